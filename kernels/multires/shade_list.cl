// SPDX-License-Identifier: MIT
// shade_list: irradiance at samples by the lights and runs of lights that their group listed.
//
// Method:  as vpl/vpl_splat.cl: E = sum over the list of flux * w, w = cos cos / (pi d^2 + A).
// Reads:   depth, normal  of the samples' G-buffer, with margin; view space
//          list     how many samples there are, and so many times row << 16 | column
//          records  of all segments, see cluster.clh
//          lists, counts  see cut_lists
// Writes:  values   3 x [rows, columns], W/m^2, at the samples alone
// Macros:  VPL_NEAR, VPL_CUT (0, 1), VPL_ADD (1: to what is there), SHADE_ROWS (times SSGI_LANES
//          samples of a work-item, so that each light is read once for all of them; 1 to 4)
// Params:  CutParams: first group, groups at most
// Launch:  any number of work-items, each of which takes every so-many-th piece of a group
// Cost:    24 operations and a division per sample and light of its list

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"
#include "vpl/light.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(VPL_ADD) || !defined(SHADE_ROWS)
#error "VPL_NEAR, VPL_CUT, VPL_ADD and SHADE_ROWS must be defined"
#endif

#define SHADE_BLOCK 64 // lights summed before they are added to the sum: float32 rounds less so
#define SHADE_PIECE (SSGI_LANES * SHADE_ROWS)
#define SHADE_PIECES (CUT_GROUP / SHADE_PIECE)

__kernel void shade_list(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                         __global const float *restrict records,
                         __global const int *restrict lists, __global const int *restrict counts,
                         __global float *restrict values, const int2 size, const SsgiCamera camera,
                         const VplParams params, const CutParams cut)
{
    const int samples = list[0];
    const vfloat zero = v_splat(0.0f);
    records += params.segment * tree_first(params.stride, 4) * TREE_RECORD;
    for (int own = (int)get_global_id(0); own < cut.groups * SHADE_PIECES;
         own += (int)get_global_size(0)) {
        const int group = own / SHADE_PIECES;
        const int start = cut.first * CUT_GROUP + own * SHADE_PIECE;
        if (start >= samples) {
            break;
        }
        VplReceiver at[SHADE_ROWS];
        vfloat sum[SHADE_ROWS][3];
#pragma unroll
        for (int r = 0; r < SHADE_ROWS; ++r) {
            at[r] = cut_receiver(depth, normal, list, v_iota() + (start + r * SSGI_LANES), size,
                                 camera, params);
            sum[r][0] = sum[r][1] = sum[r][2] = zero;
        }
        const int count = counts[group];
        __global const int *restrict lights = lists + group * params.room;
        for (int block = 0; block < count; block += SHADE_BLOCK) {
            const int end = min(block + SHADE_BLOCK, count);
            vfloat part[SHADE_ROWS][3];
#pragma unroll
            for (int r = 0; r < SHADE_ROWS; ++r) {
                part[r][0] = part[r][1] = part[r][2] = zero;
            }
            for (int i = block; i < end; ++i) {
                __global const float *restrict light = records + lights[i] * TREE_RECORD;
#pragma unroll
                for (int r = 0; r < SHADE_ROWS; ++r) {
                    const vfloat w = vpl_weight(light, at[r], params);
#pragma unroll
                    for (int j = 0; j < 3; ++j) {
                        part[r][j] = v_fma(w, v_splat(light[8 + j]), part[r][j]);
                    }
                }
            }
#pragma unroll
            for (int r = 0; r < SHADE_ROWS; ++r) {
#pragma unroll
                for (int j = 0; j < 3; ++j) {
                    sum[r][j] = sum[r][j] + part[r][j];
                }
            }
        }
#pragma unroll
        for (int r = 0; r < SHADE_ROWS; ++r) {
            // Past the list's end the last sample comes again, with the same value.
            const int last = samples - 1;
            const vint n = v_imin(v_iota() + (start + r * SSGI_LANES), v_splat_int(last));
            const vint pixel = v_igather(list + 1, n);
            const vint to = (pixel >> 16) * ssgi_pitch(size) + (pixel & 0xffff);
#pragma unroll
            for (int j = 0; j < 3; ++j) {
                __global float *restrict image = values + ssgi_index(size, j, 0, 0);
                vfloat value = v_min(sum[r][j] * params.gain, v_splat(VPL_BRIGHTEST));
#if VPL_ADD
                value = value + v_gather(image, to);
#endif
                v_scatter(value, image, to);
            }
        }
    }
}
