// SPDX-License-Identifier: MIT
// tiles_summary: bounds of depth and normals of each tile of 16 x 16 pixels; see tiles/summary.clh.
//
// The plane that bounds a flat tile is the tangent plane of its middle pixel, moved nearer until no
// pixel rises above it; that of any other is its nearest depth.
// Reads:   linear  [rows, columns] with margin, see common/surface.clh; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space
//          depth   TILES_LAYERS x [rows, columns] with margin; INFINITY where nothing is
// Writes:  summary  TILES_COUNT x [rows of tiles, columns of tiles], with those of the margin
// Macros:  TILES_LAYERS (>= 1), TILES_PIECES (0, 1): whether normals are relied on as far as
//          slices/slices_slopes.cl does, beyond which its planes are not theirs
// Params:  (left, top) pixel of the first tile in the arrays, <= 0
// Launch:  a tile per work-item
// Cost:    4 + TILES_LAYERS - 1 floats read per pixel, 30 operations, twice as many in flat tiles

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "tiles/summary.clh"

#if !defined(TILES_LAYERS) || !defined(TILES_PIECES)
#error "TILES_LAYERS and TILES_PIECES must be defined by the host"
#endif

// Least cosine to the view ray of a normal that is relied on.
#define TILES_LEAST_N_DOT_V (TILES_PIECES ? 0.051f : 0.003f)
#ifndef TILES_FLAT
#error "ssgi_cl/device/constants.py defines TILES_FLAT"
#endif

static inline float tiles_first(const vfloat x) { return as_float(v_first(v_bits(x))); }

// v, where pixels are that is not INFINITY, and its changes on their tangent planes. True where
// these are known.
static inline vmask tiles_tangent(const SsgiCamera camera, const vfloat linear, const vfloat column,
                                  const float row, const vfloat nx, const vfloat ny,
                                  const vfloat nz, vfloat *v, vfloat *v_x, vfloat *v_y)
{
    const bool perspective = camera.perspective != 0.0f;
    const vmask there = v_lt(linear, v_splat(INFINITY));
    const vfloat u = v_select(v_splat(1.0f), linear, there);
    const vfloat sx = ssgi_slope_x(camera, column) * camera.perspective;
    const float sy = fma(row, camera.to_y, camera.at_y) * camera.perspective;
    const vfloat n_dot_v = v_fma(nx, sx, v_fma(ny, v_splat(sy), -nz));
    // The view ray is (sx, sy, -1), of length <= 1 + (sx^2 + sy^2) / 2.
    const vfloat least = v_fma(v_fma(sx, sx, v_splat(sy * sy)),
                               v_splat(-0.5f * TILES_LEAST_N_DOT_V), v_splat(-TILES_LEAST_N_DOT_V));
    const vmask known = there & v_lt(n_dot_v, least);
    const vfloat scale =
        (perspective ? u : v_splat(1.0f)) / v_select(v_splat(-1.0f), n_dot_v, known);
    *v = perspective ? u : -u;
    *v_x = nx * camera.to_x * scale;
    *v_y = ny * camera.to_y * scale;
    return known;
}

__kernel void tiles_summary(ssgi_plane linear, ssgi_plane normal, ssgi_plane depth,
                            __global float *restrict summary, const int2 size, // tiles
                            const int2 whole, const int2 start, const SsgiCamera camera)
{
    const int tile_x = (int)get_global_id(0);
    const int tile_y = (int)get_global_id(1);
    if (tile_x >= size.x || tile_y >= size.y) {
        return;
    }
    const int left = start.x + tile_x * TILES_SIDE;
    const int top = start.y + tile_y * TILES_SIDE;
    // The middle pixel, or what of the arrays is nearest to it.
    const int at_x = clamp(left + TILES_MIDDLE, 0, whole.x - 1);
    const int at_y = clamp(top + TILES_MIDDLE, 0, whole.y - 1);
    const vfloat column = v_splat((float)at_x + 0.5f);
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    vfloat middle, middle_slope_x, middle_slope_y;
    const vmask reliable =
        tiles_tangent(camera, ssgi_load(linear, whole, 0, at_x, at_y), column, (float)at_y + 0.5f,
                      nx, ny, nz, &middle, &middle_slope_x, &middle_slope_y);
    const float own_x = tiles_first(middle_slope_x);
    const float own_y = tiles_first(middle_slope_y);
    const float own = fma((float)(left + TILES_MIDDLE - at_x), own_x,
                          fma((float)(top + TILES_MIDDLE - at_y), own_y, tiles_first(middle)));
    const float most_off = fabs(own) * TILES_FLAT;
    bool flat = v_first(reliable) != 0;

    const bool perspective = camera.perspective != 0.0f;
    const vfloat lowest = v_splat(-INFINITY);
    vfloat above = lowest, below = lowest, below_x = lowest, below_y = lowest;
    vfloat nearest = lowest, farthest = lowest; // the latter of -v
    vfloat least[3], greatest[3];               // the former of -n
    for (int c = 0; c < 3; ++c) {
        least[c] = greatest[c] = lowest;
    }
    int deepest = 0;
    for (int j = max(0, -top); j < min(TILES_SIDE, whole.y - top); ++j) {
        for (int i = 0; i < min(TILES_SIDE, whole.x - left); i += SSGI_LANES) {
            // Left of the arrays lies the guard, as right of them.
            const int x = left + i, y = top + j;
            const vfloat seen = ssgi_load(linear, whole, 0, x, y);
            const vmask there = v_lt(seen, v_splat(INFINITY));
            for (int layer = deepest; layer < TILES_LAYERS; ++layer) {
                const vfloat z = layer == 0 ? seen : ssgi_load(depth, whole, layer, x, y);
                deepest = v_any(v_lt(z, v_splat(INFINITY))) ? layer + 1 : deepest;
            }
            if (!v_any(there)) {
                continue;
            }
            vfloat n[3];
#pragma unroll
            for (int c = 0; c < 3; ++c) {
                n[c] = ssgi_load(normal, whole, c, x, y);
                least[c] = v_max(least[c], v_select(lowest, -n[c], there));
                greatest[c] = v_max(greatest[c], v_select(lowest, n[c], there));
            }
            nearest = v_max(nearest, v_select(lowest, perspective ? seen : -seen, there));
            farthest = v_max(farthest, v_select(lowest, perspective ? -seen : seen, there));
            if (!flat) {
                continue;
            }
            vfloat v, v_x, v_y;
            const vmask known = tiles_tangent(camera, seen, v_to_float(v_iota() + x) + 0.5f,
                                              (float)y + 0.5f, n[0], n[1], n[2], &v, &v_x, &v_y);
            const vfloat dx = v_to_float(v_iota() + (i - TILES_MIDDLE));
            const float dy = (float)(j - TILES_MIDDLE);
            const vfloat plane = v_fma(dx, v_splat(own_x), v_splat(fma(dy, own_y, own)));
            const vfloat rise = v - plane;
            above = v_max(above, v_select(lowest, rise, there));
            const vfloat origin = v_fma(-dx, v_x, v_fma(v_y, v_splat(-dy), v));
            const vfloat missing = v_select(v_splat(INFINITY), own - origin, known);
            below = v_max(below, v_select(lowest, missing, there));
            below_x = v_max(below_x, v_select(lowest, v_abs(v_x - own_x), known));
            below_y = v_max(below_y, v_select(lowest, v_abs(v_y - own_y), known));
            flat = !v_any(there & ~v_le(v_max(rise, missing), v_splat(most_off)));
        }
    }
    const float most = v_largest(nearest);
    const bool empty = most == -INFINITY;
    float found[TILES_COUNT];
    found[TILES_V] = flat ? own : empty ? 0.0f : most;
    found[TILES_V_X] = flat ? own_x : 0.0f;
    found[TILES_V_Y] = flat ? own_y : 0.0f;
    found[TILES_ABOVE] = flat ? v_largest(above) : empty ? -INFINITY : 0.0f;
    found[TILES_BELOW] = flat ? v_largest(below) : INFINITY;
    found[TILES_BELOW_X] = flat ? v_largest(below_x) : 0.0f;
    found[TILES_BELOW_Y] = flat ? v_largest(below_y) : 0.0f;
    found[TILES_NEAREST] = most;
    found[TILES_FARTHEST] = empty ? 0.0f : -v_largest(farthest);
    for (int c = 0; c < 3; ++c) {
        found[TILES_LEAST + c] = empty ? 0.0f : -v_largest(least[c]);
        found[TILES_GREATEST + c] = empty ? 0.0f : v_largest(greatest[c]);
    }
    found[TILES_LAYER] = (float)deepest;
    // Of the middle pixel.
    const float z = fabs(perspective ? 1.0f / tiles_first(middle) : tiles_first(middle));
    const float k = perspective ? z : 1.0f;
    const float x = tiles_first(ssgi_slope_x(camera, column)) * k;
    const float y = fma((float)at_y + 0.5f, camera.to_y, camera.at_y) * k;
    const float plane = fma(tiles_first(nx), x, fma(tiles_first(ny), y, -tiles_first(nz) * z));
    found[TILES_OFFSET] = flat ? plane : -INFINITY;
    for (int image = 0; image < TILES_COUNT; ++image) {
        summary[ssgi_index(size, image, tile_x, tile_y)] = found[image];
    }
}
