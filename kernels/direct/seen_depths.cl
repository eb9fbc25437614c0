// SPDX-License-Identifier: MIT
// seen_depths: the nearest and the farthest depth of each tile of 32 x 32 pixels.
//
// Shadow maps are fitted to what lies between; see ssgi_cl/techniques/direct/shadow_fit.py.
// Reads:   depth  [rows, columns] with margin, scene units; INFINITY where nothing is
// Writes:  tiles  2 images [rows of tiles, columns of tiles]: nearest, farthest; INFINITY and 0
//                 where nothing is
// Params:  pixels = (columns, rows) of the camera's image, margin = (columns, rows) before it
// Launch:  a tile per work-item
// Cost:    1 float read per pixel

#include "common/gbuffer.clh"

#ifndef SEEN_SIDE
#error "ssgi_cl/device/constants.py defines SEEN_SIDE"
#endif

__kernel void seen_depths(ssgi_plane depth, __global float *restrict tiles, const int2 size,
                          const int2 pixels, const int2 margin)
{
    const int tile_x = (int)get_global_id(0);
    const int tile_y = (int)get_global_id(1);
    if (tile_x >= size.x || tile_y >= size.y) {
        return;
    }
    const int2 whole = pixels + 2 * margin;
    const int left = tile_x * SEEN_SIDE;
    const int top = tile_y * SEEN_SIDE;
    vfloat nearest = v_splat(INFINITY), farthest = v_splat(0.0f);
    for (int j = top; j < min(top + SEEN_SIDE, pixels.y); ++j) {
        for (int i = left; i < min(left + SEEN_SIDE, pixels.x); i += SSGI_LANES) {
            const vfloat z = ssgi_load(depth, whole, 0, i + margin.x, j + margin.y);
            const vmask there =
                v_lt(z, v_splat(INFINITY)) & v_ilt(v_iota() + i, v_splat_int(pixels.x));
            nearest = v_min(nearest, v_select(v_splat(INFINITY), z, there));
            farthest = v_max(farthest, v_select(v_splat(0.0f), z, there));
        }
    }
    tiles[ssgi_index(size, 0, tile_x, tile_y)] = -v_largest(-nearest);
    tiles[ssgi_index(size, 1, tile_x, tile_y)] = v_largest(farthest);
}
