// SPDX-License-Identifier: MIT
// cut_mean: irradiance at some samples by clusters of lights, for the mean of the image.
//
// Method:  Runs of 16 from 1024 lights on, of 4 from 256 on, else each light: of 64 or more, the
//          mean is within some per cent; 16 runs of 256 lights miss a quarter.
// Reads:   depth, normal  of the samples' G-buffer, with margin; view space
//          list     how many samples there are, and so many times row << 16 | column
//          records  of all segments, see cluster.clh
// Writes:  found    [wanted] mean of the three channels, W/m^2; 0 if there is no sample
// Macros:  VPL_NEAR, VPL_CUT (0, 1)
// Params:  lights of all segments: total; how many samples are wanted, a multiple of the lanes
// Launch:  a work-item for SSGI_LANES of the samples, which are spread evenly over the list

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"
#include "vpl/light.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT)
#error "VPL_NEAR and VPL_CUT must be defined"
#endif

__kernel void cut_mean(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                       __global const float *restrict records, __global float *restrict found,
                       const int2 size, const SsgiCamera camera, const VplParams params,
                       const int total, const int wanted)
{
    const int start = (int)get_global_id(0) * SSGI_LANES;
    if (start >= wanted) {
        return;
    }
    const int samples = list[0];
    if (samples == 0) {
        v_store(v_splat(0.0f), found + start);
        return;
    }
    const vint pixel = cut_sample(list, samples, start, wanted);
    const VplReceiver at = cut_receiver(depth, normal, pixel, size, camera, params);
    const int stride = params.stride;
    const int level = total >= 1024 ? 2 : total >= 256 ? 1 : 0;
    const int share = 1 << 2 * level; // lights of a run
    vfloat sum = v_splat(0.0f);
    for (int segment = 0; segment * stride < total; ++segment) {
        const int count = min(total - segment * stride, stride);
        __global const float *restrict runs =
            records + (segment * tree_first(stride, 4) + tree_first(stride, level)) * TREE_RECORD;
        for (int i = 0; i < (count + share - 1) / share; ++i) {
            __global const float *restrict light = runs + i * TREE_RECORD;
            const float flux = (light[8] + light[9] + light[10]) / 3.0f;
            sum = v_fma(vpl_weight(light, at, params), v_splat(flux), sum);
        }
    }
    v_store(v_min(sum * params.gain, v_splat(VPL_BRIGHTEST)), found + start);
}
