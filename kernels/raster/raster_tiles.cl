// SPDX-License-Identifier: MIT
// raster_tiles: the visibility buffer: in each pixel the nearest triangle's number and D.
//
// Ties of D go to the triangle of lesser number, so the order of the lists doesn't show. With
// RASTER_PEEL only what lies behind the layer before, by more than `view.peel` and
// `view.peel_more`, is seen; with RASTER_BACKS only the inner sides of closed surfaces are.
//
// Method:  records are read a lane each, which finds what the loops over their pixels need; these
//          then have a pixel a lane.
// Reads:   records, starts, list  see records.clh, raster_scan, raster_fill
//          previous  D of the layer before (RASTER_PEEL 1)
//          corners, positions_view, uvs, cutouts, textures, texels, decode: for cut-out materials
//          (RASTER_CUTOUT 1); cutouts [triangles] material of a triangle with holes, or -1
//          closed: as of raster_attributes (RASTER_BACKS 1)
// Writes:  depths, triangles  [tile count][32][32] D, and the number or -1
// Macros:  RASTER_PEEL, RASTER_BACKS, RASTER_CUTOUT (0, 1), RASTER_WIDE, RASTER_HIGH: pixels of a
//          work-item's rectangle, of which a tile holds a whole number, RASTER_WIDE a multiple of
//          the lanes; RASTER_SPREAD: 0
// Params:  size = image
// Launch:  a work-item for each rectangle of each tile of the image

#include "common/camera.clh"
#include "raster/edges.clh"
#include "raster/holes.clh"
#include "raster/quads.clh"
#include "raster/records.clh"
#include "raster/rectangle.clh"

#if !defined(RASTER_PEEL) || !defined(RASTER_BACKS) || !defined(RASTER_CUTOUT) ||                  \
    !defined(RASTER_WIDE) || !defined(RASTER_HIGH)
#error "RASTER_PEEL, _BACKS, _CUTOUT, _WIDE and _HIGH must be defined by the host"
#endif

// What depends on a pixel's own column or row alone, not on where lanes begin.
typedef struct {
    vfloat columns[RASTER_WIDE / SSGI_LANES]; // middle, px from the image without margin
    float slopes[RASTER_HIGH];                // along columns, of the view ray
} RasterPixels;

// The edges a -> b of as many records as there are lanes.
typedef struct {
    int at[SSGI_LANES]; // edge function at its first pixel, as raster_edge
    int dx[SSGI_LANES], dy[SSGI_LANES];
} RasterSides;

// As many records as there are lanes.
typedef struct {
    RasterSides ab, bc, ca;
    int narrow[SSGI_LANES];                   // does `at` of its edges not overflow?
    int from[SSGI_LANES], to[SSGI_LANES];     // columns in the rectangle, a multiple of the
                                              // lanes and the last
    int above[SSGI_LANES], below[SSGI_LANES]; // first and last row in the rectangle
    int numbers[SSGI_LANES];                  // of the triangle
    float d_x[SSGI_LANES], d_y[SSGI_LANES], d_0[SSGI_LANES]; // D = d_x column + d_y slope + d_0
    float low[SSGI_LANES], high[SSGI_LANES];                 // of D
    int kept[SSGI_LANES], count;                             // lanes whose record may cover a pixel
} RasterBatch;

// Nothing is seen so far.
static inline void raster_clear(const int corner, __global float *restrict depths,
                                __global int *restrict triangles)
{
    for (int y = 0; y < RASTER_HIGH; ++y) {
        for (int x = 0; x < RASTER_WIDE; x += SSGI_LANES) {
            const int at = corner + y * RASTER_TILE + x;
            v_store(v_splat(-INFINITY), depths + at);
            v_istore(v_splat_int(-1), triangles + at);
        }
    }
}

static inline void raster_find_pixels(const RasterRectangle *in, const SsgiCamera camera,
                                      const RasterView view, RasterPixels *pixels)
{
    for (int i = 0; i < RASTER_WIDE / SSGI_LANES; ++i) {
        const int x = in->left + i * SSGI_LANES;
        pixels->columns[i] = v_to_float(v_iota()) + ((float)(x - view.margin_x) + 0.5f);
    }
    for (int i = 0; i < RASTER_HIGH; ++i) {
        const float row = (float)(in->top + i - view.margin_y) + 0.5f;
        pixels->slopes[i] = fma(row, camera.to_y, camera.at_y);
    }
}

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

// Read the records from number `i` of the list on, a lane each, up to `end`.
static inline void raster_read(__global const int *restrict records,
                               __global const int *restrict list, const int i, const int end,
                               const RasterRectangle *in, const SsgiCamera camera,
                               RasterBatch *batch)
{
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
    const vint first_x = v_imax(raster_firsts(least_x), v_splat_int(in->left));
    const vint first_y = v_imax(raster_firsts(least_y), v_splat_int(in->top));
    const vint last_x = v_imin(raster_lasts(most_x), v_splat_int(in->right));
    const vint last_y = v_imin(raster_lasts(most_y), v_splat_int(in->bottom));
    int use[SSGI_LANES];
    v_ikeep(v_ilt(listed, v_splat_int(end)) & v_ile(first_x, last_x) & v_ile(first_y, last_y), use);
    int count = 0;
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        batch->kept[v_lane(count)] = lane;
        count -= use[lane];
    }
    batch->count = count;
    const vint from_x = first_x & ~(SSGI_LANES - 1);
    raster_keep_side(&batch->ab, ax, ay, bx, by, from_x, first_y);
    raster_keep_side(&batch->bc, bx, by, cx, cy, from_x, first_y);
    raster_keep_side(&batch->ca, cx, cy, ax, ay, from_x, first_y);
    v_ikeep(v_ilt(v_imax(most_x - least_x, most_y - least_y), v_splat_int(RASTER_NARROW)),
            batch->narrow);
    v_ikeep(from_x - in->left, batch->from);
    v_ikeep(last_x - in->left, batch->to);
    v_ikeep(first_y - in->top, batch->above);
    v_ikeep(last_y - in->top, batch->below);
    v_ikeep(third.w, batch->numbers);
    const vfloat slope = v_from_bits(second.z);
    v_keep(slope * camera.to_x, batch->d_x);
    v_keep(v_from_bits(second.w), batch->d_y);
    v_keep(v_fma(slope, v_splat(camera.at_x), v_from_bits(third.x)), batch->d_0);
    v_keep(v_from_bits(third.y), batch->low);
    v_keep(v_from_bits(third.z), batch->high);
}

// The edge functions of record number `n`, which is not narrow, in 64 bits; `entry` is its own in
// the list.
static inline void raster_widen(__global const int *restrict records, const int entry, const int n,
                                const RasterRectangle *in, RasterBatch *batch)
{
    const RasterRecord record = raster_load(records, entry);
    const int x = in->left + batch->from[n], y = in->top + batch->above[n];
    batch->ab.at[n] = raster_edge(record.v[0], record.v[1], x, y);
    batch->bc.at[n] = raster_edge(record.v[1], record.v[2], x, y);
    batch->ca.at[n] = raster_edge(record.v[2], record.v[0], x, y);
}

// Draw record number `n` of a batch, pixels a lane each.
static inline void raster_draw(const RasterBatch *batch, const int n, const RasterHoles *holes,
                               const RasterTextures of, const RasterPixels *pixels,
                               const int corner, __global const float *restrict previous,
                               __global float *restrict depths, __global int *restrict triangles,
                               const SsgiCamera camera, const RasterView view)
{
    const int number = batch->numbers[n];
    vint row_ab = raster_side(&batch->ab, n), row_bc = raster_side(&batch->bc, n);
    vint row_ca = raster_side(&batch->ca, n);
    for (int y = batch->above[n]; y <= batch->below[n]; ++y) {
        const float slope = pixels->slopes[RASTER_HIGH > 1 ? y : 0];
        const vfloat d_row = v_splat(fma(batch->d_y[n], slope, batch->d_0[n]));
        vint edge_ab = row_ab, edge_bc = row_bc, edge_ca = row_ca;
        // Without a branch for lanes that hit nothing: it would be guessed wrongly too often.
        for (int x = batch->from[n]; x <= batch->to[n]; x += SSGI_LANES) {
            vmask hit = ~((edge_ab | edge_bc | edge_ca) >> 31);
            const int pixel = corner + y * RASTER_TILE + x;
            const vfloat column = pixels->columns[RASTER_WIDE > SSGI_LANES ? x / SSGI_LANES : 0];
            const vfloat d = v_clamp(v_fma(column, v_splat(batch->d_x[n]), d_row), batch->low[n],
                                     batch->high[n]);
            const vfloat nearest = v_load(depths + pixel);
            const vint winner = v_iload(triangles + pixel);
            hit =
                hit & (v_gt(d, nearest) | (v_eq(d, nearest) & v_igt(winner, v_splat_int(number))));
            hit = hit & v_ge(d, v_splat(view.furthest_d));
            if (RASTER_PEEL) {
                hit = hit & v_lt(d, v_fma(v_load(previous + pixel), v_splat(view.peel),
                                          v_splat(-view.peel_more)));
            }
            if (holes->cutout >= 0 && v_any(hit)) {
                hit = hit & raster_solid(holes, of, camera, column, v_splat(slope), d);
            }
            v_store(v_select(nearest, d, hit), depths + pixel);
            v_istore(v_iselect(winner, v_splat_int(number), hit), triangles + pixel);
            edge_ab = edge_ab - batch->ab.dy[n] * SSGI_LANES;
            edge_bc = edge_bc - batch->bc.dy[n] * SSGI_LANES;
            edge_ca = edge_ca - batch->ca.dy[n] * SSGI_LANES;
        }
        row_ab = row_ab + batch->ab.dx[n];
        row_bc = row_bc + batch->bc.dx[n];
        row_ca = row_ca + batch->ca.dx[n];
    }
}

#if RASTER_BACKS
// Does a triangle show the inner side of a closed surface?
static inline bool raster_is_inner(const int number, __global const int *restrict closed,
                                   __global const int *restrict corners,
                                   __global const float *restrict positions_view,
                                   const SsgiCamera camera, const RasterView view)
{
    const int outward = closed[number];
    if (outward == 0) {
        return false;
    }
    float3 at[3];
    for (int i = 0; i < 3; ++i) {
        const int corner = corners[i * view.triangle_stride + number];
        at[i] = (float3)(positions_view[corner], positions_view[view.vertex_stride + corner],
                         positions_view[2 * view.vertex_stride + corner]);
    }
    const float3 across = cross(at[1] - at[0], at[2] - at[0]);
    const float away = camera.perspective != 0.0f ? dot(across, at[0]) : -across.z;
    return (float)outward * away > 0.0f;
}
#endif

__kernel void
raster_tiles(__global const int *restrict records, __global const int *restrict starts,
             __global const int *restrict list, __global const float *restrict previous,
             __global const int *restrict corners, __global const float *restrict positions_view,
             __global const float *restrict uvs, __global const int *restrict cutouts,
             __global const float *restrict materials, __global const int *restrict textures,
             __global const int *restrict texels, __global const float *restrict decode,
#if RASTER_BACKS
             __global const int *restrict closed,
#endif
             __global float *restrict depths, __global int *restrict triangles, const int2 size,
             const SsgiCamera camera, const RasterView view)
{
    const RasterRectangle in = raster_rectangle(size, view);
    if (in.left >= view.tiles_x * RASTER_TILE || in.top >= view.tiles_y * RASTER_TILE) {
        return;
    }
    raster_clear(in.corner, depths, triangles);
    RasterPixels pixels;
    raster_find_pixels(&in, camera, view, &pixels);
    const RasterTextures of = {textures, texels, decode};
    const int end = min(starts[in.tile + 1], view.pair_capacity);
    for (int i = starts[in.tile]; i < end; i += SSGI_LANES) {
        RasterBatch batch;
        raster_read(records, list, i, end, &in, camera, &batch);
        for (int j = 0; j < batch.count; ++j) {
            const int n = v_lane(batch.kept[v_lane(j)]);
#if RASTER_BACKS
            if (!raster_is_inner(batch.numbers[n], closed, corners, positions_view, camera, view)) {
                continue;
            }
#endif
            if (!batch.narrow[n]) {
                raster_widen(records, list[i + n], n, &in, &batch);
            }
            const RasterHoles holes = raster_holes(batch.numbers[n], corners, positions_view, uvs,
                                                   cutouts, materials, view);
            raster_draw(&batch, n, &holes, of, &pixels, in.corner, previous, depths, triangles,
                        camera, view);
        }
    }
}
