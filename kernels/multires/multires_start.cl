// SPDX-License-Identifier: MIT
// multires_start: marks all points of the coarsest level as to be computed.
//
// Reads:   depth   [rows, columns] with margin, scene units; INFINITY where nothing is
// Writes:  values  MULTIRES_CHANNELS x [rows, columns], without margin: 0, to which all that is
//                  computed is added
//          fractions  [rows, columns] 1, 0 where nothing is
//          masks   of tiles, see multires/list.clh
// Macros:  MULTIRES_CHANNELS (1 to 16)
// Launch:  a row of a tile per work-item

#include "common/gbuffer.clh"
#include "multires/list.clh"

#ifndef MULTIRES_CHANNELS
#error "MULTIRES_CHANNELS must be defined by the host"
#endif

__kernel void multires_start(ssgi_plane depth, __global float *restrict values,
                             __global float *restrict fractions, __global int *restrict masks,
                             const int2 size, const int2 whole, const int2 margin)
{
    const int left = (int)get_global_id(0) * MULTIRES_TILE;
    const int y = (int)get_global_id(1);
    if (left >= size.x || y >= size.y) {
        return;
    }
    int mask = 0;
    for (int x = left; x < min(left + MULTIRES_TILE, size.x); x += SSGI_LANES) {
        const vfloat seen = ssgi_load(depth, whole, 0, x + margin.x, y + margin.y);
        const vmask there = v_lt(seen, v_splat(INFINITY));
        const vfloat share = v_select(v_splat(0.0f), v_splat(1.0f), there);
        for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
            ssgi_store(v_splat(0.0f), values, size, i, x, y, 0.0f);
        }
        ssgi_store(share, fractions, size, 0, x, y, 0.0f);
        mask |= multires_marks(share, x, size.x) << (x - left);
    }
    masks[multires_mask(size, left, y)] = mask;
}
