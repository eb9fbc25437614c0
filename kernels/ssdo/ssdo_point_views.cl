// SPDX-License-Identifier: MIT
// ssdo_point_views: surfaces of an auxiliary camera in the unoccluded directions of ssdo_points.
//
// Method:  Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image
//          Space", section 6, add cameras that see what the first one misses.
// Departs: directions are those of ssdo_points and meet a surface by the same rule. A direction
//          that meets something in one camera is done with, so none hides or sends twice.
// Reads:   depth, normal  image 0 and the first three, with margin: receivers, view space
//          directions  [16 rows][POINT_VIEWS_COUNT][5, with POINT_VIEWS_SKY 11][16 columns], the
//                   fields of ssdo_points
//          planes   POINTS_LAYERS layers of the other camera, with its margin, see
//                   ssdo/ssdo_planes.cl
//          thickness of its front layer, likewise; read with POINTS_THICKNESS 2 only
//          senders  POINT_VIEWS_SENDERS layers of its records, see direct/records.clh
// Writes:  gathered as ssdo_points wrote it: A and the sky's light shrink, the bounce's grows
//          kept     ceil(POINT_VIEWS_COUNT / 32) images of int as a plane, a bit for each direction
//                   that meets something
// Macros:  POINT_VIEWS_COUNT (1..256 directions), POINTS_TAPS (1..18 of a direction), POINTS_LAYERS
//          (>= 1), POINT_VIEWS_SENDERS (0..POINTS_LAYERS), POINT_VIEWS_STEP (1, 2, 4 pixels from
//          one receiver to the next), POINT_VIEWS_SKY, POINTS_PUBLISHED (0, 1),
//          POINTS_THICKNESS (0..2)
// Launch:  SSGI_LANES receivers of a row per work-item
// Cost:    that of ssdo_points, for directions that are still unoccluded

#if !defined(POINT_VIEWS_COUNT) || !defined(POINTS_TAPS) || !defined(POINTS_LAYERS) ||             \
    !defined(POINT_VIEWS_SENDERS) || !defined(POINT_VIEWS_STEP) || !defined(POINT_VIEWS_SKY) ||    \
    !defined(POINTS_PUBLISHED) || !defined(POINTS_THICKNESS)
#error "the macros of the header must be defined by the host"
#endif

#define POINTS_SURE 1
#include "ssdo/search.clh"

// The struct OtherViewParams is generated from ssgi_cl.techniques.ssdo.ssdo_views.

#define POINT_VIEWS_FIELDS (POINT_VIEWS_SKY ? 11 : 5)
#define POINT_VIEWS_WORDS ((POINT_VIEWS_COUNT + 31) / 32)
#define POINT_VIEWS_PI 3.14159265f
#define POINT_VIEWS_BOUNCE (POINT_VIEWS_SKY ? 4 : 1) // the first image of the bounce

// A plane's pixels of the receivers from column x on.
static inline vfloat point_views_own(ssgi_plane plane, const int2 whole, const int image,
                                     const int x, const int y, const PointsParams params)
{
#if POINT_VIEWS_STEP == 1
    return ssgi_load(plane, whole, image, x + params.margin_columns, y + params.margin_rows);
#else
    const vint column = (v_iota() + x) * POINT_VIEWS_STEP + params.margin_columns;
    return ssgi_gather(plane, whole, image, v_imin(column, v_splat_int(whole.x - 1)),
                       v_splat_int(y * POINT_VIEWS_STEP + params.margin_rows));
#endif
}

// A vector in the other camera's view space; z points to the viewer in both.
static inline void point_views_turned(const OtherViewParams view, const vfloat x, const vfloat y,
                                      const vfloat z, vfloat *to_x, vfloat *to_y, vfloat *to_z)
{
    *to_x = v_fma(x, v_splat(view.xx), v_fma(y, v_splat(view.xy), z * view.xz));
    *to_y = v_fma(x, v_splat(view.yx), v_fma(y, v_splat(view.yy), z * view.yz));
    *to_z = v_fma(x, v_splat(view.zx), v_fma(y, v_splat(view.zy), z * view.zz));
}

__kernel void ssdo_point_views(ssgi_plane depth, ssgi_plane normal,
                               __global const float *restrict directions,
                               __global const int *restrict planes,
#if POINTS_THICKNESS == 2
                               ssgi_plane thickness,
#endif
                               ssgi_optional __global const int *restrict senders,
                               __global float *restrict gathered, __global int *restrict kept,
                               const int2 size, // of the result
                               const SsgiCamera camera, const SsgiCamera other,
                               const PointsParams params, const OtherViewParams view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(params.columns, params.rows);
    const int2 others = (int2)(view.columns, view.rows);
    const vfloat zero = v_splat(0.0f);
    const vfloat own = point_views_own(depth, whole, 0, x, y, params);
    const vmask there = v_lt(own, v_splat(INFINITY)) & v_ilt(v_iota() + x, v_splat_int(size.x));
    const vfloat z = v_select(v_splat(1.0f), own, there);
    const vfloat k = ssgi_k(camera, z);
    const vfloat wanted_px = params.radius * max(fabs(camera.from_x), fabs(camera.from_y)) / k;
    const vfloat shrink = v_min(params.most_px / wanted_px, v_splat(1.0f));
    const vmask active = there & v_ge(wanted_px * shrink, v_splat((float)POINT_VIEWS_STEP));
    if (!v_any(active)) {
        return;
    }
    const vfloat column_own =
        v_to_float((v_iota() + x) * POINT_VIEWS_STEP + params.margin_columns) + 0.5f;
    const float row_own = (float)(y * POINT_VIEWS_STEP + params.margin_rows) + 0.5f;
    const vfloat nx = point_views_own(normal, whole, 0, x, y, params);
    const vfloat ny = point_views_own(normal, whole, 1, x, y, params);
    const vfloat nz = point_views_own(normal, whole, 2, x, y, params);
    // The receiver in the other camera's view space.
    PointsReceiver at;
    vfloat px, py, pz;
    point_views_turned(view, ssgi_slope_x(camera, column_own) * k,
                       ssgi_slope_y(camera, v_splat(row_own)) * k, -z, &px, &py, &pz);
    at.x = px + view.shift_x;
    at.y = py + view.shift_y;
    at.z = -(pz + view.shift_z);
    point_views_turned(view, nx, ny, nz, &at.nx, &at.ny, &at.nz);
    at.radius = params.radius * shrink;
    at.nearest = v_splat(view.nearest);
    at.floor = v_fma(z, v_splat(params.depth_bias), at.radius * params.bias);

    __global const float *restrict set =
        directions + (y & 15) * (POINT_VIEWS_COUNT * POINT_VIEWS_FIELDS * 16) + (x & 3);
    vmask changes = v_splat_int(0);
    vfloat hidden = zero, all = zero;
#if POINT_VIEWS_SENDERS > 0
    vfloat bounce[3] = {zero, zero, zero};
#endif
#if POINT_VIEWS_SKY
    vfloat sky_hidden[3] = {zero, zero, zero};
#endif
    for (int word = 0; word < POINT_VIEWS_WORDS; ++word) {
        __global int *restrict met_at = kept + ssgi_index(size, word, x, y);
        const vint before = v_iload(met_at);
        vint met = before;
        for (int i = 32 * word; i < min(32 * word + 32, POINT_VIEWS_COUNT); ++i) {
            __global const float *restrict field = set + i * (POINT_VIEWS_FIELDS * 16);
            const vint bit = v_splat_int(1 << (i & 31));
            const vfloat wx = v_load(field), wy = v_load(field + 16), wz = v_load(field + 32);
            const vfloat side = v_fma(wx, nx, v_fma(wy, ny, wz * nz));
            const vfloat turn = v_copysign(v_splat(1.0f), side);
            PointsDirection way;
            point_views_turned(view, turn * wx, turn * wy, turn * wz, &way.x, &way.y, &way.z);
            way.length = v_load(field + 48);
            way.cosine = v_abs(side);
            way.weight = way.cosine * v_load(field + 64);
            all = all + way.weight;
            const vmask open = active & v_ieq(before & bit, v_splat_int(0));
            if (!v_any(open)) {
                continue;
            }
            const PointsHit hit =
                points_search(&at, &way, open, planes, POINTS_GIVEN others, other, params);
            const vmask hides = v_gt(hit.hides, zero);
            met |= hides & bit;
            changes |= hides;
            hidden = v_fma(way.weight, hit.hides, hidden);
#if POINT_VIEWS_SENDERS > 0
            const vmask sends =
                v_gt(hit.amount, zero) & v_ilt(hit.layer, v_splat_int(POINT_VIEWS_SENDERS));
            if (v_any(sends)) {
                const vint record = v_iselect(v_splat_int(0), hit.record, sends);
                const RasterQuad sent = raster_quad(senders, record, false);
                const vfloat amount = v_select(zero, hit.amount, sends);
                const vint radiance[3] = {sent.x, sent.y, sent.z};
                for (int c = 0; c < 3; ++c) {
                    const vint bits = v_iselect(v_splat_int(0), radiance[c], sends);
                    bounce[c] = v_fma(amount, v_from_bits(bits), bounce[c]);
                }
            }
#endif
#if POINT_VIEWS_SKY
            const vmask turned = v_lt(side, zero);
            for (int c = 0; c < 3; ++c) {
                const vfloat light =
                    v_select(v_load(field + 16 * (5 + c)), v_load(field + 16 * (8 + c)), turned);
                sky_hidden[c] = v_fma(light * way.cosine, hit.hides, sky_hidden[c]);
            }
#endif
        }
        if (v_any(v_ine(met, before))) {
            v_istore(met, met_at); // the guard beyond the last column takes what it holds
        }
    }
    if (!v_any(changes)) {
        return;
    }
    const vfloat inverse = 1.0f / v_max(all, v_splat(1e-30f));
    __global float *restrict open_at = gathered + ssgi_index(size, 0, x, y);
    const vfloat before = v_load(open_at);
    const vfloat now = v_clamp(before - hidden * inverse, 0.0f, 1.0f);
    v_store(v_select(before, now, changes), open_at);
    for (int c = 0; c < 3; ++c) {
#if POINT_VIEWS_SKY
        __global float *restrict sky_at = gathered + ssgi_index(size, 1 + c, x, y);
        v_store(v_max(v_load(sky_at) - sky_hidden[c], zero), sky_at);
#endif
#if POINT_VIEWS_SENDERS > 0
        __global float *restrict bounce_at =
            gathered + ssgi_index(size, POINT_VIEWS_BOUNCE + c, x, y);
#if POINTS_PUBLISHED
        const vfloat more = bounce[c];
#else
        const vfloat more = bounce[c] * (POINT_VIEWS_PI * inverse);
#endif
        v_store(v_load(bounce_at) + more, bounce_at);
#endif
    }
}
