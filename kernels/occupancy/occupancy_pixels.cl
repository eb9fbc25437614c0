// SPDX-License-Identifier: MIT
// occupancy_pixels: marks the cells of the grid in which the camera or a light sees a surface.
//
// Surfaces that are seen at a slant have less than a pixel for each cell. So cells between a pixel
// and the next of its row and column are marked too if these lie on one surface: in a line with the
// pixel before or behind, from which a silhouette departs.
//
// Reads:   points    OCCUPANCY_LAYERS x [rows, columns] depth, scene units;
//                    or 3 x [rows, columns] position
//          normal    3 x [rows, columns], 0 where no position is (not read with depths)
//          grid_box  see occupancy/grid.clh
// Writes:  occupancy  OCCUPANCY_CELLS^3 bits, to which 1s are added
// Macros:  OCCUPANCY_CELLS, OCCUPANCY_LAYERS (0: positions; 1 or more of depth)
// Params:  camera; from the space of positions to view space
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    3 reads per pixel and layer of depths, 18 per pixel of positions; 2 neighbours more in
//          each direction in which pixels lie cells apart

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "occupancy/grid.clh"

#ifndef OCCUPANCY_LAYERS
#error "OCCUPANCY_LAYERS must be defined"
#endif

#define PIXEL_MOST_APART 16.0f // cells between two pixels whose gap is filled, at most
#define PIXEL_BEND 0.5f // of the step to the next pixel: what one surface's steps differ by at most

// Where pixels are, in cells, and which of them are surfaces.
typedef struct {
    vfloat x, y, z;
    vmask there;
} PixelAt;

#if OCCUPANCY_LAYERS
#define PIXEL_SOURCE points, size, layer, grid_box, camera, per_unit
static inline PixelAt pixel_at(ssgi_plane points, const int2 size, const int layer,
                               __global const float *restrict grid_box, const SsgiCamera camera,
                               const float per_unit, const int x, const int y)
{
    const vfloat seen = ssgi_load(points, size, layer, x, y);
    const vfloat per = v_splat(grid_box[3]);
    PixelAt at;
    at.there = v_lt(seen, v_splat(INFINITY)) & v_ilt(v_iota() + x, v_splat_int(size.x));
    const vfloat z = v_select(v_splat(1.0f), seen, at.there);
    const vfloat k = ssgi_k(camera, z) * per_unit;
    const vfloat sx = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f);
    const vfloat sy = ssgi_slope_y(camera, v_splat((float)y + 0.5f));
    at.x = (sx * k - grid_box[0]) * per;
    at.y = (sy * k - grid_box[1]) * per;
    at.z = (z * -per_unit - grid_box[2]) * per;
    return at;
}
#else
#define PIXEL_SOURCE points, normal, size, grid_box, turn, per_unit
static inline PixelAt pixel_at(ssgi_plane points, ssgi_plane normal, const int2 size,
                               __global const float *restrict grid_box, const ToViewParams turn,
                               const float per_unit, const int x, const int y)
{
    const vfloat zero = v_splat(0.0f);
    const vfloat per = v_splat(grid_box[3]);
    const vfloat px = ssgi_load(points, size, 0, x, y);
    const vfloat py = ssgi_load(points, size, 1, x, y);
    const vfloat pz = ssgi_load(points, size, 2, x, y);
    PixelAt at;
    at.there =
        v_ilt(v_iota() + x, v_splat_int(size.x)) & (v_ne(ssgi_load(normal, size, 0, x, y), zero) |
                                                    v_ne(ssgi_load(normal, size, 1, x, y), zero) |
                                                    v_ne(ssgi_load(normal, size, 2, x, y), zero));
    at.x = ((px * turn.xx + py * turn.xy + pz * turn.xz + turn.x) * per_unit - grid_box[0]) * per;
    at.y = ((px * turn.yx + py * turn.yy + pz * turn.yz + turn.y) * per_unit - grid_box[1]) * per;
    at.z = ((px * turn.zx + py * turn.zy + pz * turn.zz + turn.z) * per_unit - grid_box[2]) * per;
    return at;
}
#endif

// How far three pixels are from a line with even steps, squared; infinite where one is missing.
static inline vfloat pixel_bend(const PixelAt a, const PixelAt b, const PixelAt c)
{
    const vfloat x = a.x - b.x - b.x + c.x;
    const vfloat y = a.y - b.y - b.y + c.y;
    const vfloat z = a.z - b.z - b.z + c.z;
    return v_select(v_splat(INFINITY), v_fma(x, x, v_fma(y, y, z * z)),
                    a.there & b.there & c.there);
}

// Cells from one pixel to the next, where there are more than one and few enough to be filled.
static inline vmask pixel_apart(const PixelAt b, const PixelAt c, vfloat *cells)
{
    const vfloat apart = v_max(v_abs(c.x - b.x), v_max(v_abs(c.y - b.y), v_abs(c.z - b.z)));
    *cells = v_select(v_splat(0.0f), apart, b.there & c.there);
    return v_gt(*cells, v_splat(1.0f)) & v_lt(*cells, v_splat(PIXEL_MOST_APART));
}

// Marks what lies between b and c, if it is on one surface with a, before b, or d, behind c.
static inline void pixel_fill(__global int *restrict occupancy, const PixelAt a, const PixelAt b,
                              const PixelAt c, const PixelAt d, const vmask apart,
                              const vfloat cells)
{
    const vfloat x = c.x - b.x;
    const vfloat y = c.y - b.y;
    const vfloat z = c.z - b.z;
    const vfloat squared = v_fma(x, x, v_fma(y, y, z * z));
    const vmask joined = apart & v_lt(v_min(pixel_bend(a, b, c), pixel_bend(b, c, d)),
                                      PIXEL_BEND * PIXEL_BEND * squared);
    for (float i = 1.0f; i < PIXEL_MOST_APART; i += 1.0f) {
        const vmask between = joined & v_lt(v_splat(i), cells);
        if (!v_any(between)) {
            break;
        }
        const vfloat t = i / v_max(v_to_float(v_to_int(cells)) + 1.0f, v_splat(1.0f));
        occupancy_mark(occupancy, v_fma(x, t, b.x), v_fma(y, t, b.y), v_fma(z, t, b.z), between);
    }
}

__kernel void occupancy_pixels(ssgi_plane points, ssgi_plane normal,
                               __global const float *restrict grid_box,
                               __global int *restrict occupancy, const int2 size,
                               const SsgiCamera camera, const float per_unit,
                               const ToViewParams turn)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
#if OCCUPANCY_LAYERS
    for (int layer = 0; layer < OCCUPANCY_LAYERS; ++layer)
#endif
    {
        const PixelAt here = pixel_at(PIXEL_SOURCE, x, y);
        if (v_any(here.there)) {
            occupancy_mark(occupancy, here.x, here.y, here.z, here.there);
            vfloat cells;
            const PixelAt right = pixel_at(PIXEL_SOURCE, x + 1, y);
            vmask apart = pixel_apart(here, right, &cells);
            if (v_any(apart)) {
                pixel_fill(occupancy, pixel_at(PIXEL_SOURCE, x - 1, y), here, right,
                           pixel_at(PIXEL_SOURCE, x + 2, y), apart, cells);
            }
            const PixelAt below = pixel_at(PIXEL_SOURCE, x, min(y + 1, size.y - 1));
            apart = pixel_apart(here, below, &cells);
            if (v_any(apart)) {
                // At the image's borders the row is its own neighbour, which bends.
                pixel_fill(occupancy, pixel_at(PIXEL_SOURCE, x, max(y - 1, 0)), here, below,
                           pixel_at(PIXEL_SOURCE, x, min(y + 2, size.y - 1)), apart, cells);
            }
        }
    }
}
