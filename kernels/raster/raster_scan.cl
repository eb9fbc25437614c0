// SPDX-License-Identifier: MIT
// raster_scan: where each tile's list of records begins.
//
// Reads:   tiles     [tile count] records of each tile
// Writes:  starts    [tile count + 1] sums of the tiles before
//          cursors   [tile count] the same, for raster_fill to move on
//          counters  RASTER_PAIRS
// Params:  size = (tile count, 1)
// Launch:  one work-item

#include "raster/records.clh"

__kernel void raster_scan(__global const int *restrict tiles, __global int *restrict starts,
                          __global int *restrict cursors, __global int *restrict counters,
                          const int2 size)
{
    if (get_global_id(0) != 0) {
        return;
    }
    int sum = 0;
    for (int i = 0; i < size.x; ++i) {
        starts[i] = sum;
        cursors[i] = sum;
        sum += tiles[i];
    }
    starts[size.x] = sum;
    counters[RASTER_PAIRS] = sum;
}
