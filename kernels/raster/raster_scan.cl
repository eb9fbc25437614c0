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
// Launch:  one work-group of SSGI_GROUP work-items, each for as many tiles, one after the other

#include "raster/records.clh"

#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

__kernel void raster_scan(__global const int *restrict tiles, __global int *restrict starts,
                          __global int *restrict cursors, __global int *restrict counters,
                          const int2 size)
{
    __local int sums[SSGI_GROUP]; // of the work-items' tiles
    const int item = (int)get_local_id(0);
    const int share = (size.x + SSGI_GROUP - 1) / SSGI_GROUP;
    const int first = min(item * share, size.x);
    const int end = min(first + share, size.x);
    int sum = 0;
    for (int i = first; i < end; ++i) {
        sum += tiles[i] + tiles[size.x + i];
    }
    sums[item] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    sum = 0;
    for (int i = 0; i < item; ++i) {
        sum += sums[i];
    }
    for (int i = first; i < end; ++i) {
        starts[i] = sum;
        cursors[i] = sum;
        sum += tiles[i];
        cursors[size.x + i] = sum;
        sum += tiles[size.x + i];
    }
    if (item == SSGI_GROUP - 1) {
        starts[size.x] = sum;
        counters[RASTER_PAIRS] = sum;
    }
}
