// SPDX-License-Identifier: MIT
// cut_limits: errors that are allowed, from the mean irradiance.
//
// Reads:   found   [1, with others 2][count], see cut_mean
// Writes:  limits  [3] of interpolation and of clusters of lights, W/m^2; mean irradiance by
//                   all light over that by the lights, 1 or more
// Params:  count; shares of the mean: interpolation, runs; others: 1 where light by other sources
//          is found too
// Launch:  one work-group of SSGI_GROUP work-items, each for every so-many-th of what is found

#include "common/lanes.clh"

#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

__kernel void cut_limits(__global const float *restrict found, __global float *restrict limits,
                         const int2 size, const int count, const float interpolation,
                         const float runs, const int others)
{
    __local float sums[2 * SSGI_GROUP]; // of the work-items: by the lights, by all sources
    const int item = (int)get_local_id(0);
    float own = 0.0f, all = 0.0f;
    for (int i = item; i < count; i += SSGI_GROUP) {
        own += found[i] * (1.0f / (float)count);
        all += found[i + others * count] * (1.0f / (float)count);
    }
    sums[item] = own;
    sums[SSGI_GROUP + item] = all;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item > 0) {
        return;
    }
    own = all = 0.0f;
    for (int i = 0; i < SSGI_GROUP; ++i) {
        own += sums[i];
        all += sums[SSGI_GROUP + i];
    }
    limits[2] = own > 0.0f ? max(all / own, 1.0f) : 1.0f;
    // Where no light is found none is looked for, but with an error of 0.
    limits[0] = interpolation > 0.0f ? max(all * interpolation, 1e-37f) : 0.0f;
    limits[1] = all * runs;
}
