// SPDX-License-Identifier: MIT
// cut_limits: errors that are allowed, from the mean irradiance.
//
// Reads:   found   [count], see cut_mean
// Writes:  limits  [3] of interpolation and of clusters of lights, W/m^2; mean irradiance by
//                   all light over that by the lights, 1 or more
// Params:  count; shares of the mean: interpolation, runs; stage: CUT_OWN before other light is
//          added to what is found, CUT_ALL then, CUT_ALONE where there is none
// Launch:  one work-group of SSGI_GROUP work-items, each for every so-many-th of what is found

#include "common/lanes.clh"

#if !defined(CUT_OWN) || !defined(CUT_ALL) || !defined(CUT_ALONE)
#error "ssgi_cl/device/constants.py defines CUT_OWN, CUT_ALL, CUT_ALONE"
#endif

#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

__kernel void cut_limits(__global const float *restrict found, __global float *restrict limits,
                         const int2 size, const int count, const float interpolation,
                         const float runs, const int stage)
{
    __local float sums[SSGI_GROUP]; // of the work-items
    const int item = (int)get_local_id(0);
    float sum = 0.0f;
    for (int i = item; i < count; i += SSGI_GROUP) {
        sum += found[i] * (1.0f / (float)count);
    }
    sums[item] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item > 0) {
        return;
    }
    sum = 0.0f;
    for (int i = 0; i < SSGI_GROUP; ++i) {
        sum += sums[i];
    }
    if (stage == CUT_OWN) {
        limits[2] = sum; // until the other stage
        return;
    }
    limits[2] = stage == CUT_ALL && limits[2] > 0.0f ? max(sum / limits[2], 1.0f) : 1.0f;
    // Where no light is found none is looked for, but with an error of 0.
    limits[0] = interpolation > 0.0f ? max(sum * interpolation, 1e-37f) : 0.0f;
    limits[1] = sum * runs;
}
