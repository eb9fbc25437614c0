// SPDX-License-Identifier: MIT
// radiosity_bounce: irradiance of points by what surfaces reflect, found along kept rays.
//
// Method:  E = pi / rays sum L, with L of the places of the light volume that radiosity_rays found
// Reads:   volume     records, see radiosity/volume.clh
//          places, shares  see radiosity_rays
// Writes:  received   3 x [size.x]
// Params:  rays       of a point
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    14 reads and 12 operations for each ray

#include "common/gbuffer.clh"
#include "radiosity/volume.clh"

__kernel void radiosity_bounce(__global const float *restrict volume,
                               __global const int *restrict places,
                               __global const float *restrict shares,
                               __global float *restrict received, const int2 size, const int rays)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    vfloat sum[3] = {zero, zero, zero};
    for (int i = 0; i < rays; ++i) {
        __global const int *restrict from = places + i * 3 * stride + first;
        const vint x = v_iload(from);
        const vmask met = v_ige(x, v_splat_int(0));
        const vfloat of_x = v_load(shares + i * 2 * stride + first);
        const vfloat of_y = v_load(shares + (i * 2 + 1) * stride + first);
        const VolumePlace place = {v_imax(x, v_splat_int(0)),
                                   v_iload(from + stride),
                                   v_iload(from + 2 * stride),
                                   of_x,
                                   of_y,
                                   one - of_x - of_y};
        for (int c = 0; c < 3; ++c) {
            sum[c] = sum[c] + v_select(zero, volume_radiance(volume, place, c), met);
        }
    }
    for (int c = 0; c < 3; ++c) {
        v_store(sum[c] * (3.14159265f / (float)rays), received + c * stride + first);
    }
}
