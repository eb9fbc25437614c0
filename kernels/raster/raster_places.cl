// SPDX-License-Identifier: MIT
// raster_places: like raster_tiles, at several places of each pixel.
//
// Method:  the places of a pixel have a lane each, so that triangles of a pixel or two fill lanes.
// Reads:   records, starts, list  see records.clh, raster_scan, raster_fill
//          places    [RASTER_STRIDE] steps right of and below a pixel's centre
//          corners, positions_view, uvs, cutouts, textures, texels, decode: see raster_tiles
// Writes:  depths, triangles  [tile count][32][32][RASTER_STRIDE] D, and the number or -1
// Macros:  RASTER_CUTOUT (0, 1), RASTER_WIDE, RASTER_HIGH: see raster_tiles; RASTER_SPREAD, see
//          bounds.clh; RASTER_STRIDE: number of places, a multiple of the lanes
// Params:  size = image
// Launch:  a work-item for each rectangle of each tile of the image

#include "common/camera.clh"
#include "raster/edges.clh"
#include "raster/holes.clh"
#include "raster/records.clh"
#include "raster/rectangle.clh"

#if !defined(RASTER_CUTOUT) || !defined(RASTER_WIDE) || !defined(RASTER_HIGH) ||                   \
    !defined(RASTER_STRIDE)
#error "RASTER_CUTOUT, RASTER_WIDE, RASTER_HIGH and RASTER_STRIDE must be defined by the host"
#endif

// As many places of a pixel as there are lanes.
typedef struct {
    int first;          // number of the first of them
    vint x, y;          // steps right of and below the centre
    vfloat right, down; // pixels right of and below the corner
} RasterPlaces;

// The edge function of a -> b in a pixel.
static inline vint raster_side(const int2 a, const int2 b, const int2 pixel, const bool narrow,
                               const RasterPlaces *at)
{
    if (narrow) {
        return raster_edges(v_splat_int(a.x), v_splat_int(a.y), v_splat_int(b.x), v_splat_int(b.y),
                            raster_centre(v_splat_int(pixel.x)) + at->x,
                            raster_centre(v_splat_int(pixel.y)) + at->y) >>
               8;
    }
    vint edge = v_splat_int(0);
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        const int2 place = (int2)(((const int *)&at->x)[lane], ((const int *)&at->y)[lane]);
        ((int *)&edge)[lane] = raster_edge(a - place, b - place, pixel.x, pixel.y);
    }
    return edge;
}

// Draw a record in pixels from `first` to `last`, at some places of each.
static inline void raster_draw(const RasterRecord record, const int2 first, const int2 last,
                               const bool narrow, const RasterPlaces *at, const RasterHoles *holes,
                               const RasterTextures of, const RasterRectangle *in,
                               __global float *restrict depths, __global int *restrict triangles,
                               const SsgiCamera camera, const RasterView view)
{
    const int2 a = record.v[0], b = record.v[1], c = record.v[2];
    const int2 ab = b - a, bc = c - b, ca = a - c;
    vint row_ab = raster_side(a, b, first, narrow, at);
    vint row_bc = raster_side(b, c, first, narrow, at);
    vint row_ca = raster_side(c, a, first, narrow, at);
    const float d_x = record.d.x * camera.to_x;
    const float d_0 = fma(record.d.x, camera.at_x, record.d.z);
    const vint number = v_splat_int(record.triangle);
    for (int y = first.y; y <= last.y; ++y) {
        const vfloat slope = v_fma(at->down + (float)(y - view.margin_y), v_splat(camera.to_y),
                                   v_splat(camera.at_y));
        const vfloat d_row = v_fma(v_splat(record.d.y), slope, v_splat(d_0));
        vint edge_ab = row_ab, edge_bc = row_bc, edge_ca = row_ca;
        // Without a branch for lanes that hit nothing: it would be guessed wrongly too often.
        for (int x = first.x; x <= last.x; ++x) {
            vmask hit = ~((edge_ab | edge_bc | edge_ca) >> 31);
            const int pixel = in->corner + (y - in->top) * RASTER_TILE + x - in->left;
            const int to = pixel * RASTER_STRIDE + at->first;
            const vfloat column = at->right + (float)(x - view.margin_x);
            const vfloat d =
                v_clamp(v_fma(column, v_splat(d_x), d_row), record.range.x, record.range.y);
            const vfloat nearest = v_load(depths + to);
            const vint winner = v_iload(triangles + to);
            hit = hit & (v_gt(d, nearest) | (v_eq(d, nearest) & v_igt(winner, number)));
            hit = hit & v_ge(d, v_splat(view.furthest_d));
            if (holes->cutout >= 0 && v_any(hit)) {
                hit = hit & raster_solid(holes, of, camera, column, slope, d);
            }
            v_store(v_select(nearest, d, hit), depths + to);
            v_istore(v_iselect(winner, number, hit), triangles + to);
            edge_ab = edge_ab - ab.y;
            edge_bc = edge_bc - bc.y;
            edge_ca = edge_ca - ca.y;
        }
        row_ab = row_ab + ab.x;
        row_bc = row_bc + bc.x;
        row_ca = row_ca + ca.x;
    }
}

// Nothing is seen so far.
static inline void raster_clear(const int corner, __global float *restrict depths,
                                __global int *restrict triangles)
{
    for (int y = 0; y < RASTER_HIGH; ++y) {
        const int first = (corner + y * RASTER_TILE) * RASTER_STRIDE;
        for (int x = 0; x < RASTER_WIDE * RASTER_STRIDE; x += SSGI_LANES) {
            v_store(v_splat(-INFINITY), depths + first + x);
            v_istore(v_splat_int(-1), triangles + first + x);
        }
    }
}

__kernel void
raster_places(__global const int *restrict records, __global const int *restrict starts,
              __global const int *restrict list, __global const int *restrict places,
              __global const int *restrict corners, __global const float *restrict positions_view,
              __global const float *restrict uvs, __global const int *restrict cutouts,
              __global const float *restrict materials, __global const int *restrict textures,
              __global const int *restrict texels, __global const float *restrict decode,
              __global float *restrict depths, __global int *restrict triangles, const int2 size,
              const SsgiCamera camera, const RasterView view)
{
    const RasterRectangle in = raster_rectangle(size, view);
    if (in.left >= view.tiles_x * RASTER_TILE || in.top >= view.tiles_y * RASTER_TILE) {
        return;
    }
    raster_clear(in.corner, depths, triangles);
    const RasterTextures of = {textures, texels, decode};
    const int2 begin = (int2)(in.left, in.top), end = (int2)(in.right, in.bottom);
    const int count = min(starts[in.tile + 1], view.pair_capacity);
    for (int i = starts[in.tile]; i < count; ++i) {
        const RasterRecord record = raster_load(records, list[i]);
        const int2 least = min(min(record.v[0], record.v[1]), record.v[2]);
        const int2 most = max(max(record.v[0], record.v[1]), record.v[2]);
        const int2 first = max((int2)(raster_first(least.x), raster_first(least.y)), begin);
        const int2 last = min((int2)(raster_last(most.x), raster_last(most.y)), end);
        if (first.x > last.x || first.y > last.y) {
            continue;
        }
        const bool narrow = max(most.x - least.x, most.y - least.y) < RASTER_NARROW;
        const RasterHoles holes =
            raster_holes(record.triangle, corners, positions_view, uvs, cutouts, materials, view);
        for (int p = 0; p < RASTER_STRIDE; p += SSGI_LANES) {
            RasterPlaces at;
            at.first = p;
            at.x = v_iload(places + p);
            at.y = v_iload(places + RASTER_STRIDE + p);
            at.right = v_to_float(at.x) * (1.0f / RASTER_SUBPIXELS) + 0.5f;
            at.down = v_to_float(at.y) * (1.0f / RASTER_SUBPIXELS) + 0.5f;
            raster_draw(record, first, last, narrow, &at, &holes, of, &in, depths, triangles,
                        camera, view);
        }
    }
}
