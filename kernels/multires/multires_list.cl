// SPDX-License-Identifier: MIT
// multires_list: the points that are to be computed, neighbours near each other.
//
// A tile's place in the list follows from the counts of the tiles before it, so no atomics are
// needed and the list is the same in every run. Within a tile the order is a Z-curve's over blocks
// of 4 x 4 points, and that of rows within a block.
// Reads:   masks   of tiles, see multires/list.clh
//          counts  [tiles, rounded up to 16]; 0 beyond the last tile
//          tiles   [tiles] row << 16 | column
// Writes:  list    [1 + points] their number, then row << 16 | column of each
// Params:  tile_count; blocks: of a work-item, with more than one lane a multiple of 16 * lanes
// Launch:  so many of the 16 blocks of a tile per work-item
// Cost:    a read per tile before those of the work-item, a write per point

#include "common/gbuffer.clh"
#include "multires/list.clh"

__kernel void multires_list(__global const int *restrict masks, __global const int *restrict counts,
                            __global const int *restrict tiles, __global int *restrict list,
                            const int2 size, const int tile_count, const int blocks)
{
    const int begin = (int)get_global_id(0) * blocks;
    const int end = min(begin + blocks, 16 * tile_count);
    if (begin >= end) {
        return;
    }
    const int first = begin / 16;
    vint sums = v_splat_int(0);
    for (int i = 0; i < first; i += SSGI_LANES) {
        sums = sums + v_iload(counts + i);
    }
    int lanes[SSGI_LANES];
    v_ikeep(sums, lanes);
    int at = 1;
    for (int i = 0; i < SSGI_LANES; ++i) {
        at += lanes[i];
    }
    for (int tile = first; 16 * tile < end; ++tile) {
        if (counts[tile] == 0) {
            continue;
        }
        const int corner = tiles[tile] * MULTIRES_TILE; // of row and column at once
        __global const int *restrict rows =
            masks + multires_mask(size, corner & 0xffff, corner >> 16);
        for (int block = 0; block < min(16, end - 16 * tile); ++block) {
            const int x = (block & 1) * 4 + (block >> 2 & 1) * 8;
            const int y = (block >> 1 & 1) * 4 + (block >> 3 & 1) * 8;
            // All rows of a block at once: an end of a loop that is guessed wrong costs as much as
            // several points.
            int bits = 0;
            for (int r = 0; r < 4; ++r) {
                bits |= (rows[y + r] >> x & 15) << 4 * r;
            }
            if (16 * tile + block < begin) {
                at += (int)popcount((uint)bits);
                continue;
            }
            for (; bits != 0; bits &= bits - 1) {
                const int lowest = 31 - (int)clz(bits & -bits);
                list[at] = corner + ((y + (lowest >> 2)) << 16 | (x + (lowest & 3)));
                at += 1;
            }
        }
    }
    if (end == 16 * tile_count) {
        list[0] = at - 1;
    }
}
