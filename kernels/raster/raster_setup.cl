// SPDX-License-Identifier: MIT
// raster_setup: triangles to records; those that cover no pixel centre end here.
//
// Triangles that reach behind the near plane or far beyond the image are clipped. An edge is cut
// from its lexicographically lesser end, so both triangles that share it get the same new vertex.
//
// Reads:   corners   3 x [triangles] vertex indices
//          vertices  [count][RASTER_VERTEX] quads
//          view, screen  see raster_vertices
// Writes:  records   see records.clh; at most params.room
//          tiles     [tile count] number of records that may cover the tile
//          counters  RASTER_RECORDS
// Params:  size = (triangles, 1); near plane; camera
// Launch:  SSGI_LANES triangles per work-item

#include "common/camera.clh"
#include "raster/planes.clh"
#include "raster/quads.clh"
#include "raster/records.clh"

#define RASTER_MOST_CORNERS 9 // a triangle cut by 5 planes has at most 8

// What becomes of a triangle.
#define RASTER_READY 1 // a record
#define RASTER_WIDE 2  // a record, once it is oriented
#define RASTER_CLIP 3  // those of the pieces that are left

// Count the tiles of a record: of those in `range`, first column and row and last ones, all that it
// may cover.
static inline void raster_count(const RasterRecord record, const int4 range,
                                __global int *restrict tiles, const RasterView view)
{
    const bool many = (range.z - range.x) * (range.w - range.y) > 0;
    for (int y = range.y; y <= range.w; ++y) {
        for (int x = range.x; x <= range.z; ++x) {
            if (!(many && raster_misses_tile(record, (int2)(x, y)))) {
                atomic_inc(tiles + y * view.tiles_x + x);
            }
        }
    }
}

// Orient the record, store it as number `index` and count its tiles; one that covers no pixel
// centre is stored as an empty one, which has no tiles.
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
    raster_count(record, bounds / RASTER_TILE, tiles, view);
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
                           __global const float *restrict vertices,
                           __global const float *restrict view, __global const int *restrict screen,
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
    const RasterQuad at_a = raster_quad(screen, a, false);
    const RasterQuad at_b = raster_quad(screen, b, false);
    const RasterQuad at_c = raster_quad(screen, c, false);
    const vint x_a = at_a.x, x_b = at_b.x, x_c = at_c.x;
    const vint y_a = at_a.y, y_b = at_b.y, y_c = at_c.y;
    const vint code_a = at_a.z, code_b = at_b.z, code_c = at_c.z;
    const vmask outside = v_ine(code_a & code_b & code_c & 63, v_splat_int(0));
    const vmask exists = v_ilt(v_iota() + first, v_splat_int(size.x)) & ~outside;
    const vmask clip = exists & v_ine((code_a | code_b | code_c) & 64, v_splat_int(0));
    // Pixels whose centres lie between the least and the greatest coordinate, as raster_bounds.
    const int middle = RASTER_SUBPIXELS / 2;
    const vint left = v_imax((v_imin(v_imin(x_a, x_b), x_c) + (middle - 1)) >> 8, v_splat_int(0));
    const vint top = v_imax((v_imin(v_imin(y_a, y_b), y_c) + (middle - 1)) >> 8, v_splat_int(0));
    const vint right = v_imin((v_imax(v_imax(x_a, x_b), x_c) - middle) >> 8,
                              v_splat_int((int)params.columns - 1));
    const vint bottom = v_imin((v_imax(v_imax(y_a, y_b), y_c) - middle) >> 8,
                               v_splat_int((int)params.rows - 1));
    const vmask whole = exists & ~clip & v_ile(left, right) & v_ile(top, bottom);
    // Products of sides below 2^15 steps fit; what is larger is oriented in 64 bits.
    const vint ab_x = x_b - x_a, ab_y = y_b - y_a, ac_x = x_c - x_a, ac_y = y_c - y_a;
    const vmask narrow = v_within(ab_x + 32767, 65535) & v_within(ab_y + 32767, 65535) &
                         v_within(ac_x + 32767, 65535) & v_within(ac_y + 32767, 65535);
    const vint area = ab_x * ac_y - ac_x * ab_y;
    const vmask ready = whole & narrow & v_ine(area, v_splat_int(0));
    const vmask wide = whole & ~narrow;
    if (!v_any(ready | wide | clip)) {
        return;
    }
    const vmask swap = narrow & v_ilt(area, v_splat_int(0));
    const vfloat z_a = v_from_bits(at_a.w), z_b = v_from_bits(at_b.w), z_c = v_from_bits(at_c.w);
    const RasterPlanes planes =
        raster_planes(camera, params, vertices, a, b, c, -v_max(z_a, v_max(z_b, z_c)),
                      -v_min(z_a, v_min(z_b, z_c)));
    int parts[RASTER_RECORD][SSGI_LANES];
    v_ikeep(x_a, parts[0]);
    v_ikeep(y_a, parts[1]);
    v_ikeep(v_iselect(x_b, x_c, swap), parts[2]);
    v_ikeep(v_iselect(y_b, y_c, swap), parts[3]);
    v_ikeep(v_iselect(x_c, x_b, swap), parts[4]);
    v_ikeep(v_iselect(y_c, y_b, swap), parts[5]);
    v_ikeep(v_bits(planes.x), parts[6]);
    v_ikeep(v_bits(planes.y), parts[7]);
    v_ikeep(v_bits(planes.z), parts[8]);
    v_ikeep(v_bits(planes.least), parts[9]);
    v_ikeep(v_bits(planes.most), parts[10]);
    v_ikeep(v_iota() + first, parts[11]);
    // Numbers of the first and the last tile of the bounds.
    int from[SSGI_LANES], to[SSGI_LANES], kind[SSGI_LANES];
    v_ikeep(top / RASTER_TILE * params.tiles_x + left / RASTER_TILE, from);
    v_ikeep(bottom / RASTER_TILE * params.tiles_x + right / RASTER_TILE, to);
    v_ikeep((ready & RASTER_READY) | (wide & RASTER_WIDE) | (clip & RASTER_CLIP), kind);
    // One step of the shared counter for all: one by one they would hold up each other's cores.
    int count = 0;
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        count += kind[lane] == RASTER_READY || kind[lane] == RASTER_WIDE ? 1 : 0;
    }
    int index = count > 0 ? atomic_add(counters + RASTER_RECORDS, count) : 0;
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        if (kind[lane] == RASTER_READY && from[lane] == to[lane]) {
            // Most triangles are small.
            if (index < params.room) {
                for (int i = 0; i < RASTER_RECORD; ++i) {
                    records[index * RASTER_RECORD + i] = parts[i][lane];
                }
                atomic_inc(tiles + from[lane]);
            }
            ++index;
        } else if (kind[lane] != 0) {
            RasterRecord record;
            record.v[0] = (int2)(parts[0][lane], parts[1][lane]);
            record.v[1] = (int2)(parts[2][lane], parts[3][lane]);
            record.v[2] = (int2)(parts[4][lane], parts[5][lane]);
            record.d = (float3)(as_float(parts[6][lane]), as_float(parts[7][lane]),
                                as_float(parts[8][lane]));
            record.range = (float2)(as_float(parts[9][lane]), as_float(parts[10][lane]));
            record.triangle = first + lane;
            if (kind[lane] == RASTER_CLIP) {
                const int triangle = first + lane;
                raster_clip(camera, raster_vertex(view, vertex_stride, corners[triangle]),
                            raster_vertex(view, vertex_stride, corners[stride + triangle]),
                            raster_vertex(view, vertex_stride, corners[2 * stride + triangle]),
                            record, records, tiles, counters, params);
            } else {
                raster_append(record, index, records, tiles, params);
                ++index;
            }
        }
    }
}
