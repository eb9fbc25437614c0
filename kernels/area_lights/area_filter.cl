// SPDX-License-Identifier: MIT
// area_filter: irradiance by emissive polygons, times the share of it that arrives.
//
// Method:  the share is what arrives along rays over what would (Heitz, Hill and McGuire 2018,
//          "Combining Analytic Direct Illumination and Stochastic Shadows"), both summed up along
//          columns of the means of area_rows.cl. Where all near rays agree the share is 0 or 1.
// Reads:   depth, normal  with margin; normal in view space
//          sampled  what area_rows.cl writes; without a blur (AREA_REACH 0) what area_lights.cl
//          does cells    see area_lights.cl light    3 x [rows, columns] W/m^2, with nothing in the
//          way direct   3 x [rows, columns] W/m^2 (AREA_ADDS 1)
// Writes:  irradiance  3 x [rows, columns] W/m^2, that of `direct` included
// Macros:  AREA_CHANNELS (1 or 3), AREA_ADDS (0 or 1), AREA_REACH (0..16) pixels
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    in penumbrae 2 AREA_REACH + 1 samples of 30 operations at most

#include "area_lights/area_blur.clh"

#ifndef AREA_ADDS
#error "AREA_ADDS must be defined by the host"
#endif

__kernel void area_filter(ssgi_plane depth, ssgi_plane normal, ssgi_plane sampled, ssgi_plane light,
#if AREA_ADDS
                          ssgi_plane direct,
#endif
                          __global const int *restrict cells, __global float *restrict irradiance,
                          const int2 size, const SsgiCamera camera, const AreaParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const int bits = area_around(cells, size, x, y, 0);
    vfloat sum[2 * AREA_CHANNELS]; // what arrives, and what would
#pragma unroll
    for (int j = 0; j < 2 * AREA_CHANNELS; ++j) {
        const float agreed = j < AREA_CHANNELS && bits == 1 ? 0.0f : 1.0f;
        sum[j] = bits == 3 ? ssgi_load(sampled, size, j, x, y) : v_splat(agreed);
    }
#if AREA_REACH > 0
    if (bits == 3) {
        const AreaPixels p = area_pixels(depth, normal, size, camera, params, x, y);
        const vfloat radius = ssgi_load(sampled, size, 2 * AREA_CHANNELS, x, y);
        (void)area_sum(depth, normal, sampled, camera, p, radius, 1, sum);
    }
#endif
    vfloat share = zero;
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        if (j < AREA_CHANNELS) {
            const vfloat meant = sum[AREA_CHANNELS + j];
            const vmask known = v_gt(meant, zero);
            share = v_select(one, v_min(sum[j] / v_select(one, meant, known), one), known);
        }
        vfloat light_there = ssgi_load(light, size, j, x, y) * share;
#if AREA_ADDS
        light_there = light_there + ssgi_load(direct, size, j, x, y);
#endif
        ssgi_store(light_there, irradiance, size, j, x, y, 0.0f);
    }
}
