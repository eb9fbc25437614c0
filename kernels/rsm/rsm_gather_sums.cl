// SPDX-License-Identifier: MIT
// rsm_gather_sums: one level of a pyramid of sums, each of 2 x 2 of the level below.
//
// Reads:   pyramid  from params.from on: [rows, columns] of the level below; beyond them is 0
// Writes:  pyramid  from params.to on: [rows, columns] of this level
// Params:  columns and rows of the level below
// Launch:  one sum per work-item

#include "common/lanes.clh"

__kernel void rsm_gather_sums(__global float *pyramid, const int2 size, const RsmSumsParams params)
{
    const int x = (int)get_global_id(0);
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    __global const float *below = pyramid + params.from;
    const int left = 2 * x;
    const int top = 2 * y * params.columns;
    const bool has_right = left + 1 < params.columns;
    const bool has_bottom = 2 * y + 1 < params.rows;
    const float a = below[top + left];
    const float b = has_right ? below[top + left + 1] : 0.0f;
    const float c = has_bottom ? below[top + left + params.columns] : 0.0f;
    const float d = has_right && has_bottom ? below[top + left + params.columns + 1] : 0.0f;
    pyramid[params.to + y * size.x + x] = (a + b) + (c + d);
}
