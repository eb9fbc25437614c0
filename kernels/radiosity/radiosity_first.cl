// SPDX-License-Identifier: MIT
// radiosity_first: irradiance of surfels by virtual point lights, a visibility ray for each pair
// that is listed.
//
// Rays that several lights share, as in shade_list, err by more than the light indoors where most
// of the lights are outside in the sun.
//
// Reads:   surfels    see surfel.clh
//          lights     [lights][SURFEL_RECORD] as in vpl/light.clh, in the space of the surfels
//          numbers    [groups of FIRST_GROUP surfels][size.y] lights, -1 past the last of a group
//          weights    [groups][size.y] what each of them counts
//          occupancy, grid_box  see occupancy/grid.clh
// Writes:  values     3 x [size.x] irradiance over that of the brightest source
// Macros:  OCCUPANCY_CELLS
// Params:  gain       such irradiance of a flux and square length of 1
// Launch:  SSGI_LANES surfels per work-item, one row
// Cost:    20 operations and a division per pair, and a ray, some 20 reads, if they face each other

#include "common/gbuffer.clh"
#include "radiosity/ends.clh"

#ifndef FIRST_GROUP
#error "ssgi_cl/device/constants.py defines FIRST_GROUP"
#endif

#define FIRST_BLOCK 64 // lights summed before they are added to the sum: float32 rounds less so

__kernel void
radiosity_first(__global const float *restrict surfels, __global const float *restrict lights,
                __global const int *restrict numbers, __global const float *restrict weights,
                __global const int *restrict occupancy, __global const float *restrict grid_box,
                __global float *restrict values, const int2 size, const float gain)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfelReceiver at = surfel_receivers(surfels, stride, first);
    const OccupancyCell start = surfel_starts(surfels, stride, first);
    const vfloat zero = v_splat(0.0f);
    vfloat sum[3] = {zero, zero, zero};
    __global const int *restrict own_numbers = numbers + first / FIRST_GROUP * size.y;
    __global const float *restrict own_weights = weights + first / FIRST_GROUP * size.y;
    for (int block = 0; block < size.y; block += FIRST_BLOCK) {
        vfloat part[3] = {zero, zero, zero};
        for (int i = block; i < min(block + FIRST_BLOCK, size.y) && own_numbers[i] >= 0; ++i) {
            __global const float *restrict light = lights + own_numbers[i] * SURFEL_RECORD;
            const vfloat w = surfel_weight(light, at) * own_weights[i];
            const vmask lit = v_gt(w, zero);
            if (!v_any(lit)) {
                continue;
            }
            const OccupancyCell end = occupancy_end(light, light + 4, grid_box);
            const vmask seen = lit & ~occupancy_blocked(occupancy, start, end, lit);
            const vfloat own = v_select(zero, w, seen);
            for (int j = 0; j < 3; ++j) {
                part[j] = v_fma(own, v_splat(light[8 + j]), part[j]);
            }
        }
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + part[j];
        }
    }
    for (int j = 0; j < 3; ++j) {
        v_store(sum[j] * gain, values + j * stride + first);
    }
}
