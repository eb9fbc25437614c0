// SPDX-License-Identifier: MIT
// gbuffer_reduce: every n-th pixel of a plane in both directions, for work at half or quarter size.
//
// Pixels are picked, not averaged: an averaged depth at an edge would lie on no surface.
//
// Reads:   fine    COUNT x [rows, columns]
// Writes:  coarse  COUNT x [rows, columns], pixel (x, y) is fine pixel (x * step + first_x, ...)
// Macros:  REDUCE_COUNT images of the plane
// Launch:  SSGI_LANES pixels of a coarse row per work-item

#include "common/gbuffer.clh"

#ifndef REDUCE_COUNT
#error "REDUCE_COUNT must be defined by the host"
#endif

__kernel void gbuffer_reduce(ssgi_plane fine, __global float *restrict coarse, const int2 size,
                             const int2 fine_size, const int step, const int first_x,
                             const int first_y, const float outside)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint from_x = v_imin((v_iota() + x) * step + first_x, v_splat_int(fine_size.x - 1));
    const vint from_y = v_splat_int(y * step + first_y);
    for (int i = 0; i < REDUCE_COUNT; ++i) {
        ssgi_store(ssgi_gather(fine, fine_size, i, from_x, from_y), coarse, size, i, x, y, outside);
    }
}
