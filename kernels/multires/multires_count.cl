// SPDX-License-Identifier: MIT
// multires_count: how many points of each tile are to be computed, and which.
//
// Reads:   values  [rows, columns] -INFINITY where a point is to be computed (the first image)
//          tiles   [tiles] row << 16 | column of each, in the order in which they are listed
// Writes:  masks   [tiles][16] bit x of number y is 1 where point (x, y) of the tile is; anything
//                 in tiles without any
//          counts  [tiles]
// Params:  tile_count
// Launch:  a tile per work-item
// Cost:    1 read per point

#include "common/gbuffer.clh"
#include "multires/list.clh"

// 2^lane of the lanes' mask, summed: exact, as it is less than 2^16.
static inline int multires_bits(const vmask mask)
{
    const vfloat bits = v_to_float(v_splat_int(1) << v_iota());
    return (int)v_sum(v_select(v_splat(0.0f), bits, mask));
}

__kernel void multires_count(ssgi_plane values, __global const int *restrict tiles,
                             __global int *restrict masks, __global int *restrict counts,
                             const int2 size, const int tile_count)
{
    const int number = (int)get_global_id(0);
    if (number >= tile_count) {
        return;
    }
    const int left = (tiles[number] & 0xffff) * MULTIRES_TILE;
    const int top = (tiles[number] >> 16) * MULTIRES_TILE;
    // Past the image's end the last row counts once more, and the guard, which is never -INFINITY.
    vfloat least = v_splat(0.0f);
    for (int y = 0; y < MULTIRES_TILE; ++y) {
        const int row = min(top + y, size.y - 1);
        for (int x = 0; x < MULTIRES_TILE; x += SSGI_LANES) {
            least = v_min(least, ssgi_load(values, size, 0, min(left + x, size.x), row));
        }
    }
    int count = 0;
    if (v_any(v_lt(least, v_splat(-FLT_MAX)))) {
        for (int y = 0; y < MULTIRES_TILE; ++y) {
            int mask = 0;
            for (int x = 0; x < MULTIRES_TILE && left + x < size.x && top + y < size.y;
                 x += SSGI_LANES) {
                const vfloat value = ssgi_load(values, size, 0, left + x, top + y);
                mask |= multires_bits(v_lt(value, v_splat(-FLT_MAX))) << x;
            }
            masks[number * MULTIRES_TILE + y] = mask;
            count += popcount(mask);
        }
    }
    counts[number] = count;
}
