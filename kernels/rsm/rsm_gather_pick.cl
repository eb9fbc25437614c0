// SPDX-License-Identifier: MIT
// rsm_gather_pick: samples of a reflective shadow map, drawn in proportion to flux.
//
// Method:  hierarchical sample warping, Clarberg et al. 2005, "Wavelet Importance Sampling": a
//          point of the unit square goes down a pyramid of sums; at each level the row of 2 x 2 and
//          then the column are chosen in proportion, and the point is stretched to its part.
// Reads:   texels   records, see records.clh
//          pyramid  sums of 2 x 2, level by level; see rsm_gather_sums.cl
//          levels   [level_count][3] where a level begins, its columns, its rows; from the top down
//          points   [samples][2] of the unit square
// Writes:  samples  [samples] records of which each has the flux and area of all texels that it
//                   stands for; 0 where there is no flux at all
// Launch:  one sample per work-item

#include "common/lanes.clh"
#include "rsm/records.clh"

__kernel void rsm_gather_pick(__global const float *restrict texels,
                              __global const float *restrict pyramid,
                              __global const int *restrict levels,
                              __global const float *restrict points,
                              __global float *restrict samples,
                              const int2 size, // (samples, 1)
                              const int level_count)
{
    const int i = (int)get_global_id(0);
    if (i >= size.x) {
        return;
    }
    float u = points[2 * i];
    float v = points[2 * i + 1];
    int x = 0;
    int y = 0;
    for (int level = 1; level < level_count; ++level) {
        __global const float *sums = pyramid + levels[3 * level];
        const int columns = levels[3 * level + 1];
        const int rows = levels[3 * level + 2];
        x *= 2;
        y *= 2;
        const bool has_right = x + 1 < columns;
        const bool has_bottom = y + 1 < rows;
        const int at = y * columns + x;
        const float a = sums[at];
        const float b = has_right ? sums[at + 1] : 0.0f;
        const float c = has_bottom ? sums[at + columns] : 0.0f;
        const float d = has_right && has_bottom ? sums[at + columns + 1] : 0.0f;
        // A part without flux is never entered: its share is 0 or 1, and u, v lie in [0, 1).
        const float top = a + b;
        const float bottom = c + d;
        const float share = top / fmax(top + bottom, 1e-38f);
        const bool low = v >= share && bottom > 0.0f;
        v = low ? (v - share) / fmax(1.0f - share, 1e-38f) : v / fmax(share, 1e-38f);
        v = fmin(v, 0.99999994f);
        const float first = low ? c : a;
        const float second = low ? d : b;
        const float side = first / fmax(first + second, 1e-38f);
        const bool right = u >= side && second > 0.0f;
        u = right ? (u - side) / fmax(1.0f - side, 1e-38f) : u / fmax(side, 1e-38f);
        u = fmin(u, 0.99999994f);
        x += right ? 1 : 0;
        y += low ? 1 : 0;
    }
    const int last = 3 * (level_count - 1);
    __global const float *texel = texels + (y * levels[last + 1] + x) * RSM_RECORD;
    __global float *sample = samples + i * RSM_RECORD;
    const float power = texel[RSM_POWER];
    // How many texels such as this one the sample stands for.
    const float count = pyramid[levels[0]] / ((float)size.x * fmax(power, 1e-38f));
    for (int c = 0; c < 3; ++c) {
        sample[RSM_AT + c] = texel[RSM_AT + c];
        sample[RSM_NORMAL + c] = texel[RSM_NORMAL + c];
        sample[RSM_FLUX + c] = power > 0.0f ? texel[RSM_FLUX + c] * count : 0.0f;
    }
    // A sample that stands for less than a texel is no smaller a disc than that.
    sample[RSM_AREA] = texel[RSM_AREA] * fmax(count, 1.0f);
    sample[RSM_POWER] = power > 0.0f ? power * count : 0.0f;
}
