// SPDX-License-Identifier: MIT
// raster_tiles: the visibility buffer: in each pixel the nearest triangle's number and D.
//
// Ties of D go to the triangle of lesser number, so the order of the lists doesn't show. With
// RASTER_PEEL only what lies behind the layer before, by more than `view.peel`, is seen.
//
// Method:  records are read a lane each, which finds what the loops over their pixels need; these
//          then have a pixel a lane.
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
#include "raster/edges.clh"
#include "raster/quads.clh"
#include "raster/records.clh"
#include "raster/texture.clh"
#include "raster/linear.clh"

#if !defined(RASTER_PEEL) || !defined(RASTER_CUTOUT) || !defined(RASTER_WIDE) ||                   \
    !defined(RASTER_HIGH)
#error "RASTER_PEEL, RASTER_CUTOUT, RASTER_WIDE and RASTER_HIGH must be defined by the host"
#endif

// A record's edge a -> b.
typedef struct {
    int at[SSGI_LANES];              // edge function at its first pixel, as raster_edge
    int dx[SSGI_LANES], dy[SSGI_LANES];
} RasterSides;

static inline void raster_keep_side(RasterSides *side, const vint ax, const vint ay, const vint bx,
                                    const vint by, const vint column, const vint row)
{
    const vint x = raster_centre(column), y = raster_centre(row);
    v_ikeep(raster_edges(ax, ay, bx, by, x, y) >> 8, side->at);
    v_ikeep(bx - ax, side->dx);
    v_ikeep(by - ay, side->dy);
}

// The edge function of a record's side along a row.
static inline vint raster_side(const RasterSides *side, const int record)
{
    return v_splat_int(side->at[record]) - v_iota() * side->dy[record];
}

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
    // What depends on a pixel's own column or row alone, not on where lanes begin.
    vfloat columns[RASTER_WIDE / SSGI_LANES];
    for (int i = 0; i < RASTER_WIDE / SSGI_LANES; ++i) {
        const int x = left + i * SSGI_LANES;
        columns[i] = v_to_float(v_iota()) + ((float)(x - view.margin_x) + 0.5f);
    }
    float slopes[RASTER_HIGH];
    for (int i = 0; i < RASTER_HIGH; ++i) {
        slopes[i] = fma((float)(top + i - view.margin_y) + 0.5f, camera.to_y, camera.at_y);
    }
    const int corner = base + (top & (RASTER_TILE - 1)) * RASTER_TILE + (left & (RASTER_TILE - 1));
    const int end = min(starts[tile + 1], view.pair_room);
    for (int i = starts[tile]; i < end; i += SSGI_LANES) {
        const vint listed = v_iota() + i;
        const vint at = v_igather(list, v_imin(listed, v_splat_int(end - 1))) * (RASTER_RECORD / 4);
        const RasterQuad first = raster_quad(records, at, false);
        const RasterQuad second = raster_quad(records, at + 1, false);
        const RasterQuad third = raster_quad(records, at + 2, false);
        const vint ax = first.x, ay = first.y, bx = first.z, by = first.w;
        const vint cx = second.x, cy = second.y;
        const vint least_x = v_imin(v_imin(ax, bx), cx), most_x = v_imax(v_imax(ax, bx), cx);
        const vint least_y = v_imin(v_imin(ay, by), cy), most_y = v_imax(v_imax(ay, by), cy);
        // Pixels that the record may cover, as raster_bounds.
        const vint first_x = v_imax(raster_firsts(least_x), v_splat_int(left));
        const vint first_y = v_imax(raster_firsts(least_y), v_splat_int(top));
        const vint last_x = v_imin(raster_lasts(most_x), v_splat_int(right));
        const vint last_y = v_imin(raster_lasts(most_y), v_splat_int(bottom));
        int use[SSGI_LANES], kept[SSGI_LANES];
        v_ikeep(v_ilt(listed, v_splat_int(end)) & v_ile(first_x, last_x) & v_ile(first_y, last_y),
                use);
        int count = 0;
        for (int lane = 0; lane < SSGI_LANES; ++lane) {
            kept[count] = lane;
            count -= use[lane];
        }
        const vint from_x = first_x & ~(SSGI_LANES - 1);
        RasterSides ab, bc, ca;
        raster_keep_side(&ab, ax, ay, bx, by, from_x, first_y);
        raster_keep_side(&bc, bx, by, cx, cy, from_x, first_y);
        raster_keep_side(&ca, cx, cy, ax, ay, from_x, first_y);
        int narrow[SSGI_LANES], from[SSGI_LANES], to[SSGI_LANES], above[SSGI_LANES];
        int below[SSGI_LANES], numbers[SSGI_LANES];
        v_ikeep(v_ilt(v_imax(most_x - least_x, most_y - least_y), v_splat_int(RASTER_NARROW)),
                narrow);
        v_ikeep(from_x - left, from);
        v_ikeep(last_x - left, to);
        v_ikeep(first_y - top, above);
        v_ikeep(last_y - top, below);
        v_ikeep(third.w, numbers);
        float d_x[SSGI_LANES], d_y[SSGI_LANES], d_0[SSGI_LANES], low[SSGI_LANES], high[SSGI_LANES];
        const vfloat slope = v_from_bits(second.z);
        v_keep(slope * camera.to_x, d_x);
        v_keep(v_from_bits(second.w), d_y);
        v_keep(v_fma(slope, v_splat(camera.at_x), v_from_bits(third.x)), d_0);
        v_keep(v_from_bits(third.y), low);
        v_keep(v_from_bits(third.z), high);
        for (int j = 0; j < count; ++j) {
            const int n = kept[j];
            if (!narrow[n]) {
                const RasterRecord record = raster_load(records, list[i + n]);
                const int x = left + from[n], y = top + above[n];
                ab.at[n] = raster_edge(record.v[0], record.v[1], x, y);
                bc.at[n] = raster_edge(record.v[1], record.v[2], x, y);
                ca.at[n] = raster_edge(record.v[2], record.v[0], x, y);
            }
            const int number = numbers[n];
#if RASTER_CUTOUT
            const int cutout = cutouts[number];
            __global const float *material = materials + max(cutout, 0) * RASTER_MATERIAL;
            RasterLinear u_of = {(float3)(0.0f), 0.0f}, v_of = u_of;
            if (cutout >= 0) {
                const int a = corners[number];
                const int b = corners[view.triangle_stride + number];
                const int c = corners[2 * view.triangle_stride + number];
                u_of = raster_linear(positions_view, view.vertex_stride, uvs, a, b, c);
                v_of = raster_linear(positions_view, view.vertex_stride, uvs + view.vertex_stride,
                                     a, b, c);
            }
#endif
            vint row_ab = raster_side(&ab, n), row_bc = raster_side(&bc, n);
            vint row_ca = raster_side(&ca, n);
            for (int y = above[n]; y <= below[n]; ++y) {
                const vfloat d_row = v_splat(fma(d_y[n], slopes[y], d_0[n]));
                vint edge_ab = row_ab, edge_bc = row_bc, edge_ca = row_ca;
                // Without a branch for lanes that hit nothing: it would be guessed wrongly too
                // often.
                for (int x = from[n]; x <= to[n]; x += SSGI_LANES) {
                    vmask hit = ~((edge_ab | edge_bc | edge_ca) >> 31);
                    const int pixel = corner + y * RASTER_TILE + x;
                    const vfloat column = columns[x / SSGI_LANES];
                    const vfloat d =
                        v_clamp(v_fma(column, v_splat(d_x[n]), d_row), low[n], high[n]);
                    const vfloat nearest = v_load(depths + pixel);
                    const vint winner = v_iload(triangles + pixel);
                    hit = hit & (v_gt(d, nearest) |
                                 (v_eq(d, nearest) & v_igt(winner, v_splat_int(number))));
                    hit = hit & v_ge(d, v_splat(view.furthest_d));
#if RASTER_PEEL
                    hit = hit & v_lt(d, v_load(previous + pixel) * view.peel);
#endif
#if RASTER_CUTOUT
                    if (cutout >= 0 && v_any(hit)) {
                        const RasterTextures of = {textures, texels, decode};
                        const vfloat slope_x = ssgi_slope_x(camera, column);
                        const vfloat u = raster_linear_at(camera, u_of, slope_x, slopes[y], d);
                        const vfloat v = raster_linear_at(camera, v_of, slope_x, slopes[y], d);
                        const vfloat alpha =
                            raster_texture_alpha(of, (int)material[3], u, v) * material[4];
                        hit = hit & v_ge(alpha, v_splat(material[5]));
                    }
#endif
                    v_store(v_select(nearest, d, hit), depths + pixel);
                    v_istore(v_iselect(winner, v_splat_int(number), hit), triangles + pixel);
                    edge_ab = edge_ab - ab.dy[n] * SSGI_LANES;
                    edge_bc = edge_bc - bc.dy[n] * SSGI_LANES;
                    edge_ca = edge_ca - ca.dy[n] * SSGI_LANES;
                }
                row_ab = row_ab + ab.dx[n];
                row_bc = row_bc + bc.dx[n];
                row_ca = row_ca + ca.dx[n];
            }
        }
    }
}
