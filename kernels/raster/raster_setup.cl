// SPDX-License-Identifier: MIT
// raster_setup: triangles to records; those that cover no pixel centre end here.
//
// Triangles that reach behind the near plane or far beyond the image are clipped. An edge is cut
// from its lexicographically lesser end, so both triangles that share it get the same new vertex.
//
// Reads:   corners   3 x [triangles] vertex indices
//          positions, view  3 x [vertices] relative to the scene's origin, and in view space
//          snapped, codes  see raster_vertices
// Writes:  records   see records.clh; at most params.room
//          tiles     [tile count] number of records that may cover the tile
//          counters  RASTER_RECORDS
// Params:  size = (triangles, 1); near plane; camera
// Launch:  SSGI_LANES triangles per work-item

#include "common/camera.clh"
#include "raster/records.clh"

#define RASTER_MOST_CORNERS 9 // a triangle cut by 5 planes has at most 8

// The plane of D through a triangle, within the range of its vertices' depths (least, most). It is
// found in the scene's own axes: turning far vertices into view space would round them first.
static inline void raster_depth_plane(const SsgiCamera camera, const RasterView view,
                                      const float3 a, const float3 b, const float3 c,
                                      const float least, const float most, RasterRecord *record)
{
    // Scaled by the largest extent, so that tiny and huge scenes neither vanish nor overflow.
    const float3 ab = b - a;
    const float3 ac = c - a;
    const float3 spread = fmax(fabs(ab), fabs(ac));
    const float extent = fmax(spread.x, fmax(spread.y, spread.z));
    const float scale = 1.0f / fmax(extent, 1e-37f);
    const float3 normal = cross(ab * scale, ac * scale);
    const float3 n = (float3)(dot((float3)(view.xx, view.xy, view.xz), normal),
                              dot((float3)(view.yx, view.yy, view.yz), normal),
                              dot((float3)(view.zx, view.zy, view.zz), normal));
    const float3 from_eye = (a - (float3)(view.eye_x, view.eye_y, view.eye_z)) -
                            (float3)(view.rest_x, view.rest_y, view.rest_z);
    const float3 far_off = fabs(from_eye);
    const float slack = RASTER_SLACK * (extent + far_off.x + far_off.y + far_off.z);
    const float nearest = fmax(least - slack, view.near_depth);
    const float furthest = fmax(most + slack, nearest);
    const float offset = dot(normal, from_eye);
    float divisor;
    if (camera.perspective != 0.0f) {
        divisor = offset;
        record->range = (float2)(1.0f / furthest, 1.0f / nearest);
        record->d = (float3)(n.x, n.y, -n.z) / divisor;
    } else {
        divisor = n.z;
        record->range = (float2)(-furthest, -nearest);
        record->d = (float3)(-n.x, -n.y, offset) / divisor;
    }
    // Seen edge-on: its few pixels get the nearest depth.
    if (!(isfinite(record->d.x) && isfinite(record->d.y) && isfinite(record->d.z))) {
        record->d = (float3)(0.0f, 0.0f, record->range.y);
    }
}

// Orient the record, store it as number `index` and count its tiles; one that covers no pixel centre
// is stored as an empty one, which has no tiles.
static inline void raster_append(RasterRecord record, const int index,
                                 __global int *restrict records, __global int *restrict tiles,
                                 const RasterView view)
{
    if (index >= view.room) {
        return;
    }
    const int2 ab = record.v[1] - record.v[0];
    const int2 ac = record.v[2] - record.v[0];
    const long area = (long)ab.x * ac.y - (long)ac.x * ab.y;
    if (area < 0) {
        const int2 swap = record.v[1];
        record.v[1] = record.v[2];
        record.v[2] = swap;
    }
    const int4 bounds = raster_bounds(record, (int2)((int)view.columns, (int)view.rows));
    if (area == 0 || bounds.x > bounds.z || bounds.y > bounds.w) {
        record.v[0] = record.v[1] = record.v[2] = (int2)(0, 0);
        raster_store(records, index, record);
        return;
    }
    raster_store(records, index, record);
    const int4 range = bounds / RASTER_TILE;
    const bool many = (range.z - range.x) * (range.w - range.y) > 0;
    for (int y = range.y; y <= range.w; ++y) {
        for (int x = range.x; x <= range.z; ++x) {
            if (!(many && raster_misses_tile(record, (int2)(x, y)))) {
                atomic_inc(tiles + y * view.tiles_x + x);
            }
        }
    }
}

// The point at which value, linear from a to b, is 0; the same bits from b to a.
static inline float3 raster_cut(const float3 a, const float value_a, const float3 b,
                                const float value_b)
{
    const bool swap = a.x > b.x || (a.x == b.x && (a.y > b.y || (a.y == b.y && a.z > b.z)));
    const float3 p = swap ? b : a;
    const float3 q = swap ? a : b;
    const float vp = swap ? value_b : value_a;
    const float vq = swap ? value_a : value_b;
    return p + (q - p) * (vp / (vp - vq));
}

// How far a point lies inside of a plane: the near plane, then left, right, top, bottom.
static inline float raster_inside(const SsgiCamera camera, const float near_depth, const float3 p,
                                  const int plane)
{
    const float k = camera.perspective != 0.0f ? -p.z : 1.0f;
    switch (plane) {
    case 0:
        return -p.z - near_depth;
    case 1:
        return p.x * camera.from_x + k * (camera.centre_x + RASTER_REACH);
    case 2:
        return k * (RASTER_REACH - camera.centre_x) - p.x * camera.from_x;
    case 3:
        return p.y * camera.from_y + k * (camera.centre_y + RASTER_REACH);
    default:
        return k * (RASTER_REACH - camera.centre_y) - p.y * camera.from_y;
    }
}

static inline int2 raster_snap(const SsgiCamera camera, const RasterView view, const float3 p)
{
    const float k = camera.perspective != 0.0f ? -p.z : 1.0f;
    const float inverse = 1.0f / k;
    const float column = fma(p.x, camera.from_x, k * camera.centre_x) * inverse;
    const float row = fma(p.y, camera.from_y, k * camera.centre_y) * inverse;
    const float steps = (float)RASTER_SUBPIXELS;
    const float limit = RASTER_REACH + 1.0f; // rounding may leave the cut a little outside
    return (int2)((int)floor(clamp(column, -limit, limit) * steps + 0.5f),
                  (int)floor(clamp(row, -limit, limit) * steps + 0.5f)) +
           (int2)(view.margin_x, view.margin_y) * RASTER_SUBPIXELS;
}

// Clip a triangle and append the fan of what is left.
static inline void raster_clip(const SsgiCamera camera, const float3 a, const float3 b,
                               const float3 c, RasterRecord record,
                               __global int *restrict records, __global int *restrict tiles,
                               __global int *restrict counters, const RasterView view)
{
    float3 from[RASTER_MOST_CORNERS];
    float3 to[RASTER_MOST_CORNERS];
    int count = 3;
    from[0] = a;
    from[1] = b;
    from[2] = c;
    for (int plane = 0; plane < 5; ++plane) {
        int kept = 0;
        for (int i = 0; i < count; ++i) {
            const float3 p = from[i];
            const float3 q = from[i + 1 == count ? 0 : i + 1];
            const float at_p = raster_inside(camera, view.near_depth, p, plane);
            const float at_q = raster_inside(camera, view.near_depth, q, plane);
            if (at_p >= 0.0f && kept < RASTER_MOST_CORNERS) {
                to[kept++] = p;
            }
            if ((at_p >= 0.0f) != (at_q >= 0.0f) && kept < RASTER_MOST_CORNERS) {
                float3 cut = raster_cut(p, at_p, q, at_q);
                if (plane == 0) {
                    cut.z = -view.near_depth;
                }
                to[kept++] = cut;
            }
        }
        count = kept;
        for (int i = 0; i < count; ++i) {
            from[i] = to[i];
        }
    }
    for (int i = 2; i < count; ++i) {
        record.v[0] = raster_snap(camera, view, from[0]);
        record.v[1] = raster_snap(camera, view, from[i - 1]);
        record.v[2] = raster_snap(camera, view, from[i]);
        raster_append(record, atomic_inc(counters + RASTER_RECORDS), records, tiles, view);
    }
}

static inline float3 raster_vertex(__global const float *restrict planar, const int stride,
                                   const int i)
{
    return (float3)(planar[i], planar[stride + i], planar[2 * stride + i]);
}

__kernel void raster_setup(__global const int *restrict corners,
                           __global const float *restrict positions,
                           __global const float *restrict view,
                           __global const int *restrict snapped, __global const int *restrict codes,
                           __global int *restrict records, __global int *restrict tiles,
                           __global int *restrict counters, const int2 size,
                           const SsgiCamera camera, const RasterView params)
{
    const int first = (int)get_global_id(0) * SSGI_LANES;
    if (first >= size.x) {
        return;
    }
    const int stride = (size.x + 15) & ~15;
    const int vertex_stride = params.vertex_stride;
    const vint a = v_iload(corners + first);
    const vint b = v_iload(corners + stride + first);
    const vint c = v_iload(corners + 2 * stride + first);
    const vint code_a = v_igather(codes, a);
    const vint code_b = v_igather(codes, b);
    const vint code_c = v_igather(codes, c);
    const vint x_a = v_igather(snapped, a);
    const vint x_b = v_igather(snapped, b);
    const vint x_c = v_igather(snapped, c);
    const vint y_a = v_igather(snapped + vertex_stride, a);
    const vint y_b = v_igather(snapped + vertex_stride, b);
    const vint y_c = v_igather(snapped + vertex_stride, c);
    const vmask outside = v_ine(code_a & code_b & code_c & 63, v_splat_int(0));
    const vmask clip = v_ine((code_a | code_b | code_c) & 64, v_splat_int(0));
    // No pixel centre between the least and the greatest coordinate: covers nothing.
    const int middle = RASTER_SUBPIXELS / 2;
    const vint first_x = (v_imin(v_imin(x_a, x_b), x_c) + (middle - 1)) >> 8;
    const vint last_x = (v_imax(v_imax(x_a, x_b), x_c) - middle) >> 8;
    const vint first_y = (v_imin(v_imin(y_a, y_b), y_c) + (middle - 1)) >> 8;
    const vint last_y = (v_imax(v_imax(y_a, y_b), y_c) - middle) >> 8;
    const vmask nothing = v_igt(first_x, last_x) | v_igt(first_y, last_y);
    const vmask exists = v_ilt(v_iota() + first, v_splat_int(size.x));
    const vmask keep = exists & ~outside & (clip | ~nothing);
    if (!v_any(keep)) {
        return;
    }
    int kept[SSGI_LANES];
    int clipped[SSGI_LANES];
#if SSGI_LANES == 1
    kept[0] = keep;
    clipped[0] = clip;
#else
    SSGI_V(vstore)(keep, 0, kept);
    SSGI_V(vstore)(clip, 0, clipped);
#endif
    // One step of the shared counter for all: taken one by one they would hold up each other's cores.
    int count = 0;
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        count += kept[lane] != 0 && clipped[lane] == 0 ? 1 : 0;
    }
    int index = count > 0 ? atomic_add(counters + RASTER_RECORDS, count) : 0;
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        if (kept[lane] == 0) {
            continue;
        }
        const int triangle = first + lane;
        const int ia = corners[triangle];
        const int ib = corners[stride + triangle];
        const int ic = corners[2 * stride + triangle];
        const float3 pa = raster_vertex(view, vertex_stride, ia);
        const float3 pb = raster_vertex(view, vertex_stride, ib);
        const float3 pc = raster_vertex(view, vertex_stride, ic);
        RasterRecord record;
        record.triangle = triangle;
        raster_depth_plane(camera, params, raster_vertex(positions, vertex_stride, ia),
                           raster_vertex(positions, vertex_stride, ib),
                           raster_vertex(positions, vertex_stride, ic),
                           -fmax(pa.z, fmax(pb.z, pc.z)), -fmin(pa.z, fmin(pb.z, pc.z)), &record);
        if (clipped[lane] != 0) {
            raster_clip(camera, pa, pb, pc, record, records, tiles, counters, params);
        } else {
            record.v[0] = (int2)(snapped[ia], snapped[vertex_stride + ia]);
            record.v[1] = (int2)(snapped[ib], snapped[vertex_stride + ib]);
            record.v[2] = (int2)(snapped[ic], snapped[vertex_stride + ic]);
            raster_append(record, index, records, tiles, params);
            ++index;
        }
    }
}
