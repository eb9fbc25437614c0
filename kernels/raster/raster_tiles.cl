// SPDX-License-Identifier: MIT
// raster_tiles: the visibility buffer: in each pixel the nearest triangle's number and D.
//
// Ties of D go to the triangle of lesser number, so the order of the lists doesn't show. With
// RASTER_PEEL only what lies behind the layer before, by more than `view.peel`, is seen.
//
// Reads:   records, starts, list  see records.clh, raster_scan, raster_fill
//          previous  D of the layer before (RASTER_PEEL 1)
//          corners, positions_view, uvs, cutouts, textures, texels, decode: for cut-out materials
//          (RASTER_CUTOUT 1); cutouts [triangles] material of a triangle with holes, or -1
// Writes:  depths, triangles  [tile count][32][32] D, and the number or -1
// Macros:  RASTER_PEEL (0, 1), RASTER_CUTOUT (0, 1), RASTER_WIDE, RASTER_HIGH: pixels of a
//          work-item's rectangle, of which a tile holds a whole number, RASTER_WIDE a multiple of
//          the lanes
// Params:  size = image
// Launch:  a work-item for each rectangle of each tile of the image

#include "common/camera.clh"
#include "raster/records.clh"
#include "raster/texture.clh"
#include "raster/linear.clh"

#if !defined(RASTER_PEEL) || !defined(RASTER_CUTOUT) || !defined(RASTER_WIDE) ||                   \
    !defined(RASTER_HIGH)
#error "RASTER_PEEL, RASTER_CUTOUT, RASTER_WIDE and RASTER_HIGH must be defined by the host"
#endif

__kernel void raster_tiles(__global const int *restrict records, __global const int *restrict starts,
                           __global const int *restrict list, __global const float *restrict previous,
                           __global const int *restrict corners,
                           __global const float *restrict positions_view,
                           __global const float *restrict uvs, __global const int *restrict cutouts,
                           __global const float *restrict materials,
                           __global const int *restrict textures,
                           __global const int *restrict texels,
                           __global const float *restrict decode, __global float *restrict depths,
                           __global int *restrict triangles, const int2 size,
                           const SsgiCamera camera, const RasterView view)
{
    const int left = (int)get_global_id(0) * RASTER_WIDE;
    const int top = (int)get_global_id(1) * RASTER_HIGH;
    if (left >= view.tiles_x * RASTER_TILE || top >= view.tiles_y * RASTER_TILE) {
        return;
    }
    const int tile = top / RASTER_TILE * view.tiles_x + left / RASTER_TILE;
    const int base = tile * RASTER_TILE * RASTER_TILE;
    const int right = min(left + RASTER_WIDE, size.x) - 1;
    const int bottom = min(top + RASTER_HIGH, size.y) - 1;
    for (int y = top; y < top + RASTER_HIGH; ++y) {
        for (int x = left; x < left + RASTER_WIDE; x += SSGI_LANES) {
            const int at = base + (y & (RASTER_TILE - 1)) * RASTER_TILE + (x & (RASTER_TILE - 1));
            v_store(v_splat(-INFINITY), depths + at);
            v_istore(v_splat_int(-1), triangles + at);
        }
    }
    const int end = min(starts[tile + 1], view.pair_room);
    for (int i = starts[tile]; i < end; ++i) {
        const RasterRecord record = raster_load(records, list[i]);
        const int4 bounds = raster_bounds(record, size);
        const int first_x = max(bounds.x, left);
        const int last_x = min(bounds.z, right);
        const int first_y = max(bounds.y, top);
        const int last_y = min(bounds.w, bottom);
        if (first_x > last_x || first_y > last_y) {
            continue;
        }
        const int from_x = first_x & ~(SSGI_LANES - 1);
        const int2 ab = record.v[1] - record.v[0];
        const int2 bc = record.v[2] - record.v[1];
        const int2 ca = record.v[0] - record.v[2];
        int edge_ab = raster_edge(record.v[0], record.v[1], from_x, first_y);
        int edge_bc = raster_edge(record.v[1], record.v[2], from_x, first_y);
        int edge_ca = raster_edge(record.v[2], record.v[0], from_x, first_y);
        const float d_x = record.d.x * camera.to_x;
        const float d_0 = fma(record.d.x, camera.at_x, record.d.z);
        const vint lane_ab = v_iota() * -ab.y;
        const vint lane_bc = v_iota() * -bc.y;
        const vint lane_ca = v_iota() * -ca.y;
#if RASTER_CUTOUT
        const int cutout = cutouts[record.triangle];
        __global const float *material = materials + max(cutout, 0) * RASTER_MATERIAL;
        RasterLinear u_of = {(float3)(0.0f), 0.0f}, v_of = u_of;
        if (cutout >= 0) {
            const int a = corners[record.triangle];
            const int b = corners[view.triangle_stride + record.triangle];
            const int c = corners[2 * view.triangle_stride + record.triangle];
            u_of = raster_linear(positions_view, view.vertex_stride, uvs, a, b, c);
            v_of = raster_linear(positions_view, view.vertex_stride, uvs + view.vertex_stride, a,
                                 b, c);
        }
#endif
        for (int y = first_y; y <= last_y; ++y) {
            const float slope_y = fma((float)(y - view.margin_y) + 0.5f, camera.to_y, camera.at_y);
            const float d_row = fma(record.d.y, slope_y, d_0);
            const int row = base + (y & (RASTER_TILE - 1)) * RASTER_TILE;
            int step = 0;
            // Without a branch for lanes that hit nothing: it would be guessed wrongly too often.
            for (int x = from_x; x <= last_x; x += SSGI_LANES, step += SSGI_LANES) {
                const vint outside = (lane_ab + (edge_ab - step * ab.y)) |
                                     (lane_bc + (edge_bc - step * bc.y)) |
                                     (lane_ca + (edge_ca - step * ca.y));
                vmask hit = ~(outside >> 31);
                const int at = row + (x & (RASTER_TILE - 1));
                // From the pixel's own column, so that it doesn't depend on where lanes begin.
                const vfloat column = v_to_float(v_iota()) + ((float)(x - view.margin_x) + 0.5f);
                const vfloat d = v_clamp(v_fma(column, v_splat(d_x), v_splat(d_row)),
                                         record.range.x, record.range.y);
                const vfloat nearest = v_load(depths + at);
                const vint winner = v_iload(triangles + at);
                hit = hit & (v_gt(d, nearest) |
                             (v_eq(d, nearest) & v_igt(winner, v_splat_int(record.triangle))));
                hit = hit & v_ge(d, v_splat(view.furthest_d));
#if RASTER_PEEL
                hit = hit & v_lt(d, v_load(previous + at) * view.peel);
#endif
#if RASTER_CUTOUT
                if (cutout >= 0 && v_any(hit)) {
                    const RasterTextures from = {textures, texels, decode};
                    const vfloat lane_x = ssgi_slope_x(camera, column);
                    const vfloat u = raster_linear_at(camera, u_of, lane_x, slope_y, d);
                    const vfloat v = raster_linear_at(camera, v_of, lane_x, slope_y, d);
                    const vfloat alpha =
                        raster_texture_alpha(from, (int)material[3], u, v) * material[4];
                    hit = hit & v_ge(alpha, v_splat(material[5]));
                }
#endif
                v_store(v_select(nearest, d, hit), depths + at);
                v_istore(v_iselect(winner, v_splat_int(record.triangle), hit), triangles + at);
            }
            edge_ab += ab.x;
            edge_bc += bc.x;
            edge_ca += ca.x;
        }
    }
}
