// SPDX-License-Identifier: MIT
// cut_limits: errors that are allowed, from the mean irradiance.
//
// Reads:   found   [count], see cut_mean
// Writes:  limits  [2] of interpolation and of runs of lights, W/m^2
// Params:  count; shares of the mean: interpolation, runs
// Launch:  one work-item

#include "common/lanes.clh"

__kernel void cut_limits(__global const float *restrict found, __global float *restrict limits,
                         const int2 size, const int count, const float interpolation,
                         const float runs)
{
    if (get_global_id(0) > 0) {
        return;
    }
    float sum = 0.0f;
    for (int i = 0; i < count; ++i) {
        sum += found[i] * (1.0f / (float)count);
    }
    // Where no light is found none is looked for, but with an error of 0.
    limits[0] = interpolation > 0.0f ? max(sum * interpolation, 1e-37f) : 0.0f;
    limits[1] = sum * runs;
}
