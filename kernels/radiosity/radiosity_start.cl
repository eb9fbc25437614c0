// SPDX-License-Identifier: MIT
// radiosity_start: starts of the visibility rays of surfels, above a part with nothing in front.
//
// Rays begin some cells above their surface. Where another surface is closer than that, or in the
// cell that they begin in, they would begin behind it, or leave through it. So a part is taken that
// has no triangle in front (exactly: each batch whose box is near is tried) and whose lifted point
// is in an empty cell, the nearest to the surfel's middle of the first few.
//
// Reads:   parts      6 x [16 size.x] positions and normals, nearest to the surfel's middle first
//          corners    3 x [size.y triangles, rounded up to 16] vertices
//          positions  3 x [vertex_stride] scene units, relative to the scene's origin
//          boxes      [batches of START_BATCH triangles][6] middle and half size, likewise
//          few        [START_FEW triangles][6] likewise
//          cutouts    [size.y] >= 0 where a triangle has holes: those block nothing here
//          occupancy, grid_box  see occupancy/grid.clh
// Writes:  surfels    SURFEL_START
//          part       [size.x] number of the part, or -1 where there is none
// Macros:  OCCUPANCY_CELLS
// Params:  shift: of the scene's origin; per_unit: of the surfels
// Launch:  SSGI_LANES surfels per work-item, one row
// Cost:    20 operations per surfel and batch, and box of a batch nearby; 50 per surfel and
//          triangle of a box nearby

#include "common/gbuffer.clh"
#include "radiosity/surfel.clh"

#if !defined(START_BATCH) || !defined(START_FEW)
#error "ssgi_cl/device/constants.py defines START_BATCH, START_FEW"
#endif

#define START_TRIES 6    // parts
#define START_NEAR 0.02f // of the ray, within which a triangle is the surfel's own

typedef struct {
    float x, y, z;
} StartCorner;

static inline StartCorner start_corner(__global const float *restrict positions, const int stride,
                                       const int vertex, const StartParams params)
{
    StartCorner corner;
    corner.x = (positions[vertex] + params.shift_x) * params.per_unit;
    corner.y = (positions[stride + vertex] + params.shift_y) * params.per_unit;
    corner.z = (positions[2 * stride + vertex] + params.shift_z) * params.per_unit;
    return corner;
}

// Whether the segment from p along d meets a triangle (Moeller and Trumbore 1997).
static inline vmask start_meets(const vfloat p[3], const vfloat d[3], const StartCorner a,
                                const StartCorner b, const StartCorner c)
{
    const float e1x = b.x - a.x, e1y = b.y - a.y, e1z = b.z - a.z;
    const float e2x = c.x - a.x, e2y = c.y - a.y, e2z = c.z - a.z;
    const vfloat hx = d[1] * e2z - d[2] * e2y;
    const vfloat hy = d[2] * e2x - d[0] * e2z;
    const vfloat hz = d[0] * e2y - d[1] * e2x;
    const vfloat det = hx * e1x + hy * e1y + hz * e1z;
    const vmask slanted = v_gt(v_abs(det), v_splat(1e-20f));
    const vfloat per = 1.0f / v_select(v_splat(1.0f), det, slanted);
    const vfloat sx = p[0] - a.x, sy = p[1] - a.y, sz = p[2] - a.z;
    const vfloat u = (sx * hx + sy * hy + sz * hz) * per;
    const vfloat qx = sy * e1z - sz * e1y;
    const vfloat qy = sz * e1x - sx * e1z;
    const vfloat qz = sx * e1y - sy * e1x;
    const vfloat v = (d[0] * qx + d[1] * qy + d[2] * qz) * per;
    const vfloat t = (qx * e2x + qy * e2y + qz * e2z) * per;
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    return slanted & v_ge(u, zero) & v_ge(v, zero) & v_le(u + v, one) &
           v_gt(t, v_splat(START_NEAR)) & v_le(t, one);
}

// Lanes whose segment from p along d comes near a box.
static inline vmask start_near(const vfloat p[3], const vfloat d[3],
                               __global const float *restrict box, const StartParams params,
                               const vmask wanted)
{
    vmask near = wanted;
    const float shift[3] = {params.shift_x, params.shift_y, params.shift_z};
    for (int j = 0; j < 3; ++j) {
        const float middle = (box[j] + shift[j]) * params.per_unit;
        const vfloat away = v_abs(p[j] + d[j] * 0.5f - middle);
        near = near & v_le(away, v_fma(v_abs(d[j]), v_splat(0.5f),
                                       v_splat(box[3 + j] * params.per_unit + 1e-6f)));
    }
    return near;
}

__kernel void
radiosity_start(__global const float *restrict parts, __global const int *restrict corners,
                __global const float *restrict positions, __global const float *restrict boxes,
                __global const float *restrict few, __global const int *restrict cutouts,
                __global const int *restrict occupancy, __global const float *restrict grid_box,
                __global float *restrict surfels, __global int *restrict part,
                const int2 size, // (surfels, triangles)
                const StartParams params)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const float most = (float)OCCUPANCY_CELLS - 0.01f;
    const float length = grid_box[4] / grid_box[3];
    const int triangle_stride = (size.y + 15) & ~15;
    const int batches = (size.y + START_BATCH - 1) / START_BATCH;
    vfloat at[3];
    vint chosen = v_splat_int(-1);
    vmask searching = v_gt(v_load(surfels + SURFEL_AREA * stride + first), v_splat(0.0f));
    for (int number = 0; number < START_TRIES; ++number) {
        const vint own = (v_iota() + first) * 16 + number;
        vfloat p[3], d[3], lifted[3];
        for (int j = 0; j < 3; ++j) {
            p[j] = v_gather(parts + j * 16 * stride, own);
            d[j] = v_gather(parts + (3 + j) * 16 * stride, own) * length;
            lifted[j] = v_clamp((p[j] + d[j] - grid_box[j]) * grid_box[3], 0.0f, most);
            at[j] = number == 0 ? lifted[j] : at[j];
        }
        if (!v_any(searching)) {
            break;
        }
        const OccupancyCell start = {lifted[0], lifted[1], lifted[2], d[0], d[1], d[2]};
        vmask clear = searching & ~occupancy_held(occupancy, start);
        for (int batch = 0; batch < batches && v_any(clear); ++batch) {
            if (!v_any(start_near(p, d, boxes + batch * 6, params, clear))) {
                continue;
            }
            const int end = min((batch + 1) * START_BATCH, size.y);
            for (int i = batch * START_BATCH; i < end; ++i) {
                if (i % START_FEW == 0 &&
                    !v_any(start_near(p, d, few + i / START_FEW * 6, params, clear))) {
                    i += START_FEW - 1;
                    continue;
                }
                if (cutouts[i] >= 0) {
                    continue;
                }
                const StartCorner a =
                    start_corner(positions, params.vertex_stride, corners[i], params);
                const StartCorner b = start_corner(positions, params.vertex_stride,
                                                   corners[triangle_stride + i], params);
                const StartCorner c = start_corner(positions, params.vertex_stride,
                                                   corners[2 * triangle_stride + i], params);
                clear = clear & ~start_meets(p, d, a, b, c);
            }
        }
        for (int j = 0; j < 3; ++j) {
            at[j] = v_select(at[j], lifted[j], clear);
        }
        chosen = v_iselect(chosen, v_splat_int(number), clear);
        searching = searching & ~clear;
    }
    for (int j = 0; j < 3; ++j) {
        v_store(at[j], surfels + (SURFEL_START + j) * stride + first);
    }
    v_istore(chosen, part + first);
}
