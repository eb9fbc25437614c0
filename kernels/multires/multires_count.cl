// SPDX-License-Identifier: MIT
// multires_count: number of the points of each tile that are to be computed.
//
// Reads:   masks   of tiles, see multires/list.clh
//          tiles   [tiles] row << 16 | column of each, in the order in which they are listed
// Writes:  counts  [tiles] in that order
// Params:  tile_count
// Launch:  a tile per work-item
// Cost:    1 read per row of a tile

#include "common/gbuffer.clh"
#include "multires/list.clh"

__kernel void multires_count(__global const int *restrict masks, __global const int *restrict tiles,
                             __global int *restrict counts, const int2 size, const int tile_count)
{
    const int number = (int)get_global_id(0);
    if (number >= tile_count) {
        return;
    }
    const int tile = tiles[number];
    __global const int *restrict rows =
        masks + multires_mask(size, (tile & 0xffff) * MULTIRES_TILE, (tile >> 16) * MULTIRES_TILE);
    vint bits = v_splat_int(0);
    for (int y = 0; y < MULTIRES_TILE; y += SSGI_LANES) {
        bits = bits + v_count_bits(v_iload(rows + y));
    }
    counts[number] = (int)v_sum(v_to_float(bits));
}
