// SPDX-License-Identifier: MIT
// rsm_gather_bound: the error that interpolation may make, from the mean of some points.
//
// Reads:   list    how many points there are, and so many times row << 16 | column
//          values  3 x [rows, columns] W/m^2 of these points
// Writes:  bound   [1] share times the mean of their three channels, W/m^2
// Launch:  one work-item: a sum in one order on every device

#include "common/gbuffer.clh"

__kernel void rsm_gather_bound(__global const int *restrict list,
                               __global const float *restrict values,
                               __global float *restrict bound, const int2 size, const float share)
{
    if (get_global_id(0) > 0 || get_global_id(1) > 0) {
        return;
    }
    const int count = list[0];
    const float part = share / (3.0f * (float)max(count, 1));
    float sum = 0.0f;
    for (int i = 1; i <= count; ++i) {
        const int column = list[i] & 0xffff;
        const int row = list[i] >> 16;
        for (int c = 0; c < 3; ++c) {
            sum += values[ssgi_index(size, c, column, row)] * part;
        }
    }
    // Where no light is found none is looked for, but with an error of 0.
    bound[0] = share > 0.0f ? max(sum, 1e-37f) : 0.0f;
}
