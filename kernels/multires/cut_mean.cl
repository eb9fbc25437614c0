// SPDX-License-Identifier: MIT
// cut_mean: irradiance at some samples by clusters of lights and by other sources, for the mean of
// the image.
//
// Method:  Runs of 16 from 1024 lights on, of 4 from 256 on, else each light: of 64 or more, the
//          mean is within some per cent; 16 runs of 256 lights miss a quarter.
// Reads:   depth, normal  of the samples' G-buffer, with margin; view space
//          list     how many samples there are, and so many times row << 16 | column
//          records  of all segments, see cluster.clh
//          other0 to 2  as many as CUT_OTHERS says: 3 x [rows, columns] irradiance by other
//                   sources, W/m^2
// Writes:  found    [1, with others 2][wanted] mean of the three channels, W/m^2: by the lights,
//                   and by all sources; 0 if there is no sample
// Macros:  VPL_NEAR, VPL_CUT (0, 1), CUT_OTHERS (0 to 3)
// Params:  lights of all segments: total; how many samples are wanted, a multiple of the lanes;
//          (columns, rows) of the planes of others, and their pixels along the side of a sample's
// Launch:  a work-item for SSGI_LANES of the samples, which are spread evenly over the list

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"
#include "vpl/light.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(CUT_OTHERS)
#error "VPL_NEAR, VPL_CUT and CUT_OTHERS must be defined"
#endif

#if CUT_OTHERS > 0
// Mean of the channels of a plane at samples' pixels, added to a sum.
static inline vfloat cut_other(ssgi_plane light, const int2 plane, const int side, const vint pixel,
                               vfloat sum)
{
    const vint column = v_imin((pixel & 0xffff) * side + side / 2, v_splat_int(plane.x - 1));
    const vint row = v_imin((pixel >> 16) * side + side / 2, v_splat_int(plane.y - 1));
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        const vfloat value = ssgi_gather(light, plane, j, column, row);
        sum = v_fma(v_clamp(value, 0.0f, VPL_BRIGHTEST), v_splat(1.0f / 3.0f), sum);
    }
    return v_min(sum, v_splat(VPL_BRIGHTEST));
}
#endif

__kernel void cut_mean(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                       __global const float *restrict records,
#if CUT_OTHERS > 0
                       ssgi_plane other0, const int2 plane0, const int side0,
#endif
#if CUT_OTHERS > 1
                       ssgi_plane other1, const int2 plane1, const int side1,
#endif
#if CUT_OTHERS > 2
                       ssgi_plane other2, const int2 plane2, const int side2,
#endif
                       __global float *restrict found, const int2 size, const SsgiCamera camera,
                       const VplParams params, const int total, const int wanted)
{
    const int start = (int)get_global_id(0) * SSGI_LANES;
    if (start >= wanted) {
        return;
    }
    const int samples = list[0];
    if (samples == 0) {
        v_store(v_splat(0.0f), found + start);
#if CUT_OTHERS > 0
        v_store(v_splat(0.0f), found + wanted + start);
#endif
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
    sum = v_min(sum * params.gain, v_splat(VPL_BRIGHTEST));
    v_store(sum, found + start);
#if CUT_OTHERS > 0
    sum = cut_other(other0, plane0, side0, pixel, sum);
#if CUT_OTHERS > 1
    sum = cut_other(other1, plane1, side1, pixel, sum);
#endif
#if CUT_OTHERS > 2
    sum = cut_other(other2, plane2, side2, pixel, sum);
#endif
    v_store(sum, found + wanted + start);
#endif
}
