// SPDX-License-Identifier: MIT
// vpl_partial_sums: sums of flux and area of a reflective shadow map along each run of texels, of
// which vpl_blocks and vpl_totals make the cumulative flux.
//
// Reads:   flux   3 x [rows, columns] W
//          area   [rows, columns] square scene units; of texels without flux it doesn't count
//          gloss  [rows, columns] Phong exponent (VPL_GLOSSY 1)
//          order  [params.face_runs][16] row << 16 | column of a face's texels along its curve,
//                 -1 past their end
//          importance  see vpl/curve.clh (VPL_WEIGHTED 1)
// Writes:  quarters, runs  see vpl/curve.clh; of runs the sums alone. From run params.first_run on,
//                          0 past the map
// Macros:  VPL_GLOSSY (1: luminous flux counts by vpl_importance),
//          VPL_WEIGHTED (1: by vpl_weight_of)
// Launch:  SSGI_LANES runs per work-item
// Cost:    five scattered reads a texel

#include "common/gbuffer.clh"
#include "vpl/curve.clh"

#if !defined(VPL_GLOSSY) || !defined(VPL_WEIGHTED)
#error "VPL_GLOSSY and VPL_WEIGHTED must be defined"
#endif

__kernel void vpl_partial_sums(ssgi_plane flux, ssgi_plane area,
#if VPL_GLOSSY
                               ssgi_plane gloss,
#endif
                               __global const int *restrict order,
                               ssgi_optional __global const float *restrict importance,
                               __global float *restrict quarters, __global float *restrict runs,
                               const int2 size, // of the map
                               const VplCurveParams params)
{
    const int first = ssgi_first_column();
    if (first >= params.map_runs) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const vfloat one = v_splat(1.0f);
    const vint run = v_iota() + first;
    const vint face = run / params.face_runs;
    const vmask in_map = v_ilt(face, v_splat_int(params.faces));
    const vint own = v_iselect(v_splat_int(0), run - face * params.face_runs, in_map);
    const vint top = v_iselect(v_splat_int(0), face * params.face_rows, in_map);
    __global float *restrict group =
        quarters + v_first(vpl_quarter(run + params.first_run, 0, v_splat_int(0)));
#if VPL_WEIGHTED
    const vfloat weight = vpl_weight_of(importance, run + params.first_run, params.runs);
#endif
    vfloat sums[VPL_SUMS] = {zero, zero, zero, zero, zero, zero};
    for (int k = 0; k < VPL_RUN; ++k) {
        const vint packed = v_igather(order, own * VPL_RUN + k);
        const vmask there = in_map & v_ige(packed, v_splat_int(0));
        const vint at = v_iselect(v_splat_int(0), packed, there);
        const vint x = at & 0xffff;
        const vint y = (at >> 16) + top;
        const vfloat red = v_select(zero, ssgi_gather(flux, size, 0, x, y), there);
        const vfloat green = v_select(zero, ssgi_gather(flux, size, 1, x, y), there);
        const vfloat blue = v_select(zero, ssgi_gather(flux, size, 2, x, y), there);
        const vmask lit = v_gt(v_max(red, v_max(green, blue)), zero);
        vfloat measure = vpl_luminance(red, green, blue);
#if VPL_GLOSSY
        measure = measure * vpl_importance(ssgi_gather(gloss, size, 0, x, y));
#endif
#if VPL_WEIGHTED
        measure = measure * weight;
#endif
        const vfloat amounts[VPL_SUMS] = {v_select(zero, one, lit),
                                          measure,
                                          red,
                                          green,
                                          blue,
                                          v_select(zero, ssgi_gather(area, size, 0, x, y), lit)};
        for (int sum = 0; sum < VPL_SUMS; ++sum) {
            sums[sum] = sums[sum] + amounts[sum];
            if ((k & 3) == 3) {
                v_store(sums[sum], group + (sum * 4 + k / 4) * 16);
            }
        }
    }
    for (int sum = 0; sum < VPL_SUMS; ++sum) {
        v_store(sums[sum], runs + sum * params.runs + params.first_run + first);
    }
}
