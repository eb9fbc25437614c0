// SPDX-License-Identifier: MIT
// subsplat_shade: irradiance at the subsplats of a level, each by all lights at its middle pixel.
//
// Method:  Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination", with the
//          form factor of a point and a disc: E = sum of flux cos cos / (pi d^2 + A).
// Departs: a light's A is the area that it stands for, not estimated from its distance to the light
//          and the number of lights, so d^2 needs no lower limit. E is irradiance: albedo is not in
//          it.
// Reads:   depth, normal  the front layer, with margin; scene units, view space
//          list    how many subsplats there are, and so many times row << 16 | column
//          lights  of one segment, see vpl/light.clh
// Writes:  values  3 x [rows, columns] of the level, W/m^2: light is added, at subsplats alone
// Macros:  VPL_NEAR, VPL_CUT (0), SUBSPLAT_ROWS (times SSGI_LANES subsplats of a work-item, so that
//          each light is read once for all of them; 1 to 4)
// Params:  image = (columns, rows) of the result; step = pixels along a texel's side
// Launch:  any number of work-items, each of which takes every so-many-th piece of the list
// Cost:    24 operations and a division per subsplat and light

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/light.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(SUBSPLAT_ROWS)
#error "VPL_NEAR, VPL_CUT and SUBSPLAT_ROWS must be defined"
#endif

#define SUBSPLAT_BLOCK 64 // lights summed before they are added to the sum: float32 rounds less so

__kernel void subsplat_shade(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                             __global const float *restrict lights, __global float *restrict values,
                             const int2 size, const SsgiCamera camera, const VplParams params,
                             const int2 image, const int step)
{
    const int listed = list[0];
    const vfloat zero = v_splat(0.0f);
    __global const float *restrict own = lights + params.segment * params.span * VPL_LIGHT;
    const int piece = SSGI_LANES * SUBSPLAT_ROWS;
    const int stride = (int)get_global_size(0) * piece;
    for (int start = (int)get_global_id(0) * piece; start < listed; start += stride) {
        VplReceiver at[SUBSPLAT_ROWS];
        vint to[SUBSPLAT_ROWS];
        vfloat sum[SUBSPLAT_ROWS][3];
#pragma unroll
        for (int r = 0; r < SUBSPLAT_ROWS; ++r) {
            // Past the list's end the last subsplat comes again, with the same value.
            const vint number =
                v_imin(v_iota() + (start + r * SSGI_LANES), v_splat_int(listed - 1));
            const vint texel = v_igather(list + 1, number);
            const vint column = texel & 0xffff, row = texel >> 16;
            to[r] = row * ssgi_pitch(size) + column;
            const vint x = v_imin(column * step + step / 2, v_splat_int(image.x - 1));
            const vint y = v_imin(row * step + step / 2, v_splat_int(image.y - 1));
            at[r] = vpl_receiver_at(depth, normal, image, camera, params, x, y);
            sum[r][0] = sum[r][1] = sum[r][2] = zero;
        }
        for (int block = 0; block < params.count; block += SUBSPLAT_BLOCK) {
            const int end = min(block + SUBSPLAT_BLOCK, params.count);
            vfloat part[SUBSPLAT_ROWS][3];
#pragma unroll
            for (int r = 0; r < SUBSPLAT_ROWS; ++r) {
                part[r][0] = part[r][1] = part[r][2] = zero;
            }
            for (int i = block; i < end; ++i) {
                __global const float *restrict light = own + i * VPL_LIGHT;
#pragma unroll
                for (int r = 0; r < SUBSPLAT_ROWS; ++r) {
                    const vfloat w = vpl_weight(light, at[r], params);
#pragma unroll
                    for (int j = 0; j < 3; ++j) {
                        part[r][j] = v_fma(w, v_splat(light[8 + j]), part[r][j]);
                    }
                }
            }
#pragma unroll
            for (int r = 0; r < SUBSPLAT_ROWS; ++r) {
#pragma unroll
                for (int j = 0; j < 3; ++j) {
                    sum[r][j] = sum[r][j] + part[r][j];
                }
            }
        }
#pragma unroll
        for (int r = 0; r < SUBSPLAT_ROWS; ++r) {
#pragma unroll
            for (int j = 0; j < 3 && start + r * SSGI_LANES < listed; ++j) {
                __global float *restrict channel = values + ssgi_index(size, j, 0, 0);
                const vfloat value = v_min(sum[r][j] * params.gain, v_splat(VPL_BRIGHTEST));
                v_scatter(value + v_gather(channel, to[r]), channel, to[r]);
            }
        }
    }
}
