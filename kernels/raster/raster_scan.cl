// SPDX-License-Identifier: MIT
// raster_scan: where each tile's list of records begins.
//
// A list has the records that may cover other tiles too first.
//
// Reads:   tiles     [2][tile count] such records of each tile, and those of this tile alone
// Writes:  starts    [tile count + 1] sums of the tiles before
//          cursors   [2][tile count] where either kind begins, the first for raster_fill to move on
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
        cursors[size.x + i] = sum;
        sum += tiles[size.x + i];
    }
    starts[size.x] = sum;
    counters[RASTER_PAIRS] = sum;
}
