// SPDX-License-Identifier: MIT
// raster_fill: the lists of records that may cover each tile.
//
// The order within a list depends on scheduling; the picture doesn't, since raster_tiles decides
// every tie by the triangle's number.
//
// Reads:   records, places  see records.clh, raster_setup
// Writes:  cursors   [2][tile count] the first moved on; see raster_scan
//          list      record numbers; at most params.pair_capacity
//          counters  read only
// Macros:  RASTER_SPREAD, see bounds.clh
// Params:  size = (work-items, 1)
// Launch:  any number of work-items; each takes a run of records, which lie close together

#include "raster/bounds.clh"
#include "raster/covered.clh"
#include "raster/records.clh"

__kernel void raster_fill(__global const int *restrict records,
                          __global const int2 *restrict places, __global int *restrict cursors,
                          __global int *restrict list, __global int *restrict counters,
                          const int2 size, const RasterView view)
{
    const int first = (int)get_global_id(0);
    if (first >= size.x) {
        return;
    }
    const int count = min(counters[RASTER_RECORDS], view.capacity);
    const int share = (count + size.x - 1) / size.x;
    const int end = min(first * share + share, count);
    for (int i = first * share; i < end; ++i) {
        const int2 place = places[i];
        if (place.x >= 0) {
            const int at = cursors[view.tiles_x * view.tiles_y + place.x] + place.y;
            if (at < view.pair_capacity) {
                list[at] = i;
            }
            continue;
        }
        const RasterRecord record = raster_load(records, i);
        const int4 bounds = raster_bounds(record, (int2)((int)view.columns, (int)view.rows));
        if (bounds.x > bounds.z || bounds.y > bounds.w) {
            continue;
        }
        const int4 range = bounds / RASTER_TILE;
        const bool block = raster_is_block(range);
        RasterCorners corners = raster_corners(record, range.xy);
        for (int y = range.y; y <= range.w; ++y) {
            long3 here = corners.at;
            for (int x = range.x; x <= range.z; ++x) {
                if (!(block && raster_misses(here))) {
                    const int at = atomic_inc(cursors + y * view.tiles_x + x);
                    if (at < view.pair_capacity) {
                        list[at] = i;
                    }
                }
                here += corners.right;
            }
            corners.at += corners.below;
        }
    }
}
