// SPDX-License-Identifier: MIT
// multires_list: the points that are to be computed, neighbours near each other.
//
// A tile's place in the list follows from the counts of the tiles before it, so no atomics are
// needed and the list is the same in every run. Within a tile the order is a Z-curve's over blocks
// of 4 x 4 points, and that of rows within a block.
// Reads:   masks   of tiles, see multires/list.clh
//          counts  [tiles, rounded up to 16]; 0 beyond the last tile; with MULTIRES_COUNTED alone
//          tiles   [tiles] row << 16 | column
// Writes:  list    [1 + points] their number, then row << 16 | column of each
// Macros:  MULTIRES_COUNTED: 1; 0, with one lane alone: work-groups count what is before their own
// Params:  tile_count; own_tiles: of a work-item, with more than one lane a multiple of 16; of a
//          work-group with one
// Launch:  a work-item for so many tiles; with one lane a work-group of SSGI_GROUP
// Cost:    a read per tile before those of the work-item, not counted 16, which a work-group
// shares;
//          a write per point

#include "common/gbuffer.clh"
#include "multires/list.clh"

#ifndef MULTIRES_COUNTED
#error "MULTIRES_COUNTED must be defined by the host"
#endif
#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

// Masks of the tile at a place of `tiles`, and its corner's row << 16 | column.
static inline __global const int *multires_rows(__global const int *restrict masks, const int2 size,
                                                const int corner)
{
    return masks + multires_mask(size, corner & 0xffff, corner >> 16);
}

// Points of a block of 4 x 4 of a tile, 4 bits a row, and where the block begins in the tile. All
// rows of a block at once: an end of a loop that is guessed wrong costs as much as several points.
static inline int2 multires_corner(const int block)
{
    return (int2)((block & 1) * 4 + (block >> 2 & 1) * 8,
                  (block >> 1 & 1) * 4 + (block >> 3 & 1) * 8);
}
static inline int multires_block(__global const int *restrict rows, const int2 first)
{
    int bits = 0;
    for (int r = 0; r < 4; ++r) {
        bits |= (rows[first.y + r] >> first.x & 15) << 4 * r;
    }
    return bits;
}

// Lists the points of a block from place `at` on; returns the place after them.
static inline int multires_listed(__global int *restrict list, int at, int bits, const int2 first,
                                  const int corner)
{
    for (; bits != 0; bits &= bits - 1) {
        const int lowest = v_lowest_bit((uint)bits);
        list[at] = corner + ((first.y + (lowest >> 2)) << 16 | (first.x + (lowest & 3)));
        at += 1;
    }
    return at;
}

__kernel void multires_list(__global const int *restrict masks,
#if MULTIRES_COUNTED
                            __global const int *restrict counts,
#endif
                            __global const int *restrict tiles, __global int *restrict list,
                            const int2 size, const int tile_count, const int own_tiles)
{
#if SSGI_LANES == 1
    __local int found[SSGI_GROUP]; // by each work-item
    const int item = (int)get_local_id(0);
    const int begin = (int)get_group_id(0) * own_tiles;
    const int end = min(begin + own_tiles, tile_count);
    if (begin >= end) {
        return;
    }
    int own = 0;
#if MULTIRES_COUNTED
    for (int i = item; i < begin; i += SSGI_GROUP) {
        own += counts[i];
    }
#else
    for (int i = item; i < begin * (MULTIRES_TILE / 4); i += SSGI_GROUP) {
        const int corner = tiles[i / (MULTIRES_TILE / 4)] * MULTIRES_TILE; // row and column at once
        const int4 rows = vload4(i % (MULTIRES_TILE / 4), multires_rows(masks, size, corner));
        own += (int)(popcount((uint)rows.x) + popcount((uint)rows.y) + popcount((uint)rows.z) +
                     popcount((uint)rows.w));
    }
#endif
    found[item] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
    int at = 1;
#pragma unroll 4 // all of them would take as many registers
    for (int i = 0; i < SSGI_GROUP; ++i) {
        at += found[i];
    }
    for (int tile = begin; tile < end; tile += SSGI_GROUP / 16) {
        const int own_tile = tile + item / 16; // a block for each work-item
        const int2 first = multires_corner(item % 16);
        int corner = 0, bits = 0;
        if (own_tile < end) {
            corner = tiles[own_tile] * MULTIRES_TILE;
            bits = multires_block(multires_rows(masks, size, corner), first);
        }
        barrier(CLK_LOCAL_MEM_FENCE); // what is found was read
        found[item] = (int)popcount((uint)bits);
        barrier(CLK_LOCAL_MEM_FENCE);
        int before = at;
#pragma unroll 4
        for (int i = 0; i < SSGI_GROUP; ++i) {
            before += i < item ? found[i] : 0;
            at += found[i];
        }
        multires_listed(list, before, bits, first, corner);
    }
    if (end == tile_count && item == 0) {
        list[0] = at - 1;
    }
#else
    const int begin = (int)get_global_id(0) * own_tiles;
    const int end = min(begin + own_tiles, tile_count);
    if (begin >= end) {
        return;
    }
    vint sums = v_splat_int(0);
    for (int i = 0; i < begin; i += SSGI_LANES) {
        sums = sums + v_iload(counts + i);
    }
    int lanes[SSGI_LANES];
    v_ikeep(sums, lanes);
    int at = 1;
    for (int i = 0; i < SSGI_LANES; ++i) {
        at += lanes[i];
    }
    for (int tile = begin; tile < end; ++tile) {
        if (counts[tile] == 0) {
            continue;
        }
        const int corner = tiles[tile] * MULTIRES_TILE; // of row and column at once
        __global const int *restrict rows = multires_rows(masks, size, corner);
        for (int block = 0; block < 16; ++block) {
            const int2 first = multires_corner(block);
            at = multires_listed(list, at, multires_block(rows, first), first, corner);
        }
    }
    if (end == tile_count) {
        list[0] = at - 1;
    }
#endif
}
