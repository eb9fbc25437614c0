// SPDX-License-Identifier: MIT
// multires_start: marks all points of the coarsest level as to be computed.
//
// Reads:   depth   [rows, columns] with margin, scene units; INFINITY where nothing is
// Writes:  values  MULTIRES_CHANNELS x [rows, columns]: -INFINITY, 0 where nothing is;
//                  without margin
// Macros:  MULTIRES_CHANNELS (1 to 16)
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"

#ifndef MULTIRES_CHANNELS
#error "MULTIRES_CHANNELS must be defined by the host"
#endif

__kernel void multires_start(ssgi_plane depth, __global float *restrict values, const int2 size,
                             const int2 whole, const int2 margin)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vmask there = v_lt(ssgi_load(depth, whole, 0, x + margin.x, y + margin.y), v_splat(INFINITY));
    const vfloat mark = v_select(v_splat(0.0f), v_splat(-INFINITY), there);
    for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
        ssgi_store(mark, values, size, i, x, y, 0.0f);
    }
}
