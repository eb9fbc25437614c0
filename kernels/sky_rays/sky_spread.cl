// SPDX-License-Identifier: MIT
// sky_spread: parts of the sphere that rays of each cell's pixels go to: those that sent light to a
// cell near by, and their neighbours.
//
// Reads:   cells      see sky_probe.cl
//          next       [8 SKY_WORDS][SKY_WORDS / 4] bits of the strata next to each, itself one
// Writes:  sought     [cells][SKY_WORDS + SKY_WORDS / 4]: bits of quarters of strata of which light
//                     arrives at the cell or at one of those round it; bits of strata to sample
// Macros:  SKY_WORDS (4..32)
// Params:  size: columns and rows of cells
// Launch:  a work-item for each cell
// Cost:    9 SKY_WORDS reads and SKY_WORDS / 4 for each stratum that sent light

#if !defined(SKY_WORDS)
#error "SKY_WORDS must be defined by the host: strata / 8"
#endif

__kernel void sky_spread(__global const int *restrict cells, __global const int *restrict next,
                         __global int *restrict sought, const int2 size)
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= size.x || row >= size.y) {
        return;
    }
    // Three by three of them, at the image's border towards its inside.
    const int first_row = max(min(row - 1, size.y - 3), 0);
    const int first_column = max(min(column - 1, size.x - 3), 0);
    uint near[SKY_WORDS / 4];
    for (int w = 0; w < SKY_WORDS / 4; ++w) {
        near[w] = 0;
    }
    __global int *restrict own = sought + (row * size.x + column) * (SKY_WORDS + SKY_WORDS / 4);
    for (int w = 0; w < SKY_WORDS; ++w) {
        uint bits = 0;
        for (int r = first_row; r < min(first_row + 3, size.y); ++r) {
            for (int c = first_column; c < min(first_column + 3, size.x); ++c) {
                bits |= (uint)cells[(r * size.x + c) * SKY_WORDS + w];
            }
        }
        own[w] = (int)bits;
        for (int k = 0; k < 8; ++k) {
            if (bits >> 4 * k & 15) {
                for (int n = 0; n < SKY_WORDS / 4; ++n) {
                    near[n] |= (uint)next[(w * 8 + k) * (SKY_WORDS / 4) + n];
                }
            }
        }
    }
    for (int w = 0; w < SKY_WORDS / 4; ++w) {
        own[SKY_WORDS + w] = (int)near[w];
    }
}
