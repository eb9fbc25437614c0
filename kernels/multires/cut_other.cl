// SPDX-License-Identifier: MIT
// cut_other: adds light by other sources to what cut_mean found.
//
// Reads:   light    3 x [plane.y, plane.x] irradiance, W/m^2
//          list     how many samples there are, and so many times row << 16 | column
// Writes:  found    [wanted] mean of the three channels is added; see cut_mean
// Params:  how many samples are wanted, a multiple of the lanes; pixels of the light's plane along
//          the side of a sample's
// Launch:  a work-item for SSGI_LANES of the samples that cut_mean takes

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"

__kernel void cut_other(ssgi_plane light, __global const int *restrict list,
                        __global float *restrict found, const int2 size, const int2 plane,
                        const int wanted, const int side)
{
    const int start = (int)get_global_id(0) * SSGI_LANES;
    const int samples = list[0];
    if (start >= wanted || samples == 0) {
        return;
    }
    const vint pixel = cut_sample(list, samples, start, wanted);
    const vint column = v_imin((pixel & 0xffff) * side + side / 2, v_splat_int(plane.x - 1));
    const vint row = v_imin((pixel >> 16) * side + side / 2, v_splat_int(plane.y - 1));
    vfloat sum = v_load(found + start);
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        const vfloat value = ssgi_gather(light, plane, j, column, row);
        sum = v_fma(v_clamp(value, 0.0f, VPL_BRIGHTEST), v_splat(1.0f / 3.0f), sum);
    }
    v_store(v_min(sum, v_splat(VPL_BRIGHTEST)), found + start);
}
