// SPDX-License-Identifier: MIT
// tiles_interior: open tiles all of whose neighbours are open, which a blur does not change.
//
// Reads:   open  [rows of tiles, columns of tiles] bits, from tiles_open
// Writes:  interior  the same, with TILES_IS_INTERIOR where it holds; no tiles lie outside the
// image Launch:  a tile per work-item

#include "common/gbuffer.clh"
#include "tiles/open.clh"

__kernel void tiles_interior(__global const int *restrict open, __global int *restrict interior,
                             const int2 size)
{
    const int x = (int)get_global_id(0);
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    int all = TILES_IS_OPEN;
    for (int j = max(y - 1, 0); j <= min(y + 1, size.y - 1); ++j) {
        for (int i = max(x - 1, 0); i <= min(x + 1, size.x - 1); ++i) {
            all &= open[j * size.x + i];
        }
    }
    interior[y * size.x + x] = open[y * size.x + x] | (all != 0 ? TILES_IS_INTERIOR : 0);
}
