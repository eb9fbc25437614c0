// SPDX-License-Identifier: MIT
// vpl_place: pieces of reflective shadow maps as virtual point lights, as the camera sees them.
//
// Reads:   edges   [8][params.edge_stride] flux and area before each piece; see vpl_cut
//          places  [6][params.place_stride] positions from the maps' origin, normals; world axes
// Writes:  lights  [segments][params.span][VPL_LIGHT] in view space, lengths of params.per_unit,
//                  flux over params.brightest; places without a light have no flux
//          bounds  VPL_PART 0: [segments][VPL_BOUNDS][params.stride]; see vpl_lists
// Macros:  VPL_PART (1: the lights' parts, 16 n to 16 n + 15 behind the lights of the segment)
// Params:  from the maps' origin and axes to view space; of params.lights lights, params.split
//          pieces each, number i is light i % batch / subsets of the segment
//          i / batch * subsets + i % batch % subsets
// Launch:  SSGI_LANES lights (parts) of a segment per work-item, a row for each segment

#include "common/gbuffer.clh"
#include "vpl/curve.clh"

#ifndef VPL_PART
#error "VPL_PART must be defined"
#endif

#define VPL_LIGHT 12 // as in vpl/light.clh
#define VPL_BOUNDS 7 // as in vpl_lists
#define VPL_LEAST_AREA 1e-12f
#define VPL_MOST 1e30f // W

__kernel void vpl_place(__global const float *restrict edges, __global const float *restrict places,
                        __global float *restrict lights, __global float *restrict bounds,
                        const int2 size, // (lights or parts of a segment, segments)
                        const VplPlaceParams params)
{
    const int first = ssgi_first_column();
    const int segment = (int)get_global_id(1);
    if (first >= size.x || segment >= size.y) {
        return;
    }
    const vint own = v_iota() + first;
    const vint number = VPL_PART ? own / 16 : own;
    const vint within = number * params.subsets + segment % params.subsets;
    const vint light = within + segment / params.subsets * params.batch;
    const vmask there =
        v_ilt(within, v_splat_int(params.batch)) & v_ilt(light, v_splat_int(params.lights));
    const vint safe = v_iclamp(light, 0, params.lights - 1);
#if VPL_PART
    const vint place = safe * 16 + (own & 15);
    const vint begin = place;
    const vint end = place + 1;
#else
    const vint place = safe;
    const vint begin = safe * params.split;
    const vint end = begin + params.split;
#endif
    const vfloat zero = v_splat(0.0f);
    vfloat amounts[4]; // flux and area
    for (int c = 0; c < 4; ++c) {
        __global const float *restrict high = edges + c * params.edge_stride;
        __global const float *restrict low = edges + (4 + c) * params.edge_stride;
        const vfloat amount = (v_gather(high, end) - v_gather(high, begin)) +
                              (v_gather(low, end) - v_gather(low, begin));
        amounts[c] = v_select(zero, v_max(amount, zero), there);
    }
    vfloat p[3], m[3];
    for (int c = 0; c < 3; ++c) {
        p[c] = v_gather(places + c * params.place_stride, place);
        m[c] = v_gather(places + (3 + c) * params.place_stride, place);
    }
    const float turn[3][4] = {{params.xx, params.xy, params.xz, params.x},
                              {params.yx, params.yy, params.yz, params.y},
                              {params.zx, params.zy, params.zz, params.z}};
    const vfloat area = v_max(amounts[3] * (params.per_unit * params.per_unit),
                              v_splat(VPL_LEAST_AREA));
    const vint at = (own + (segment * params.span + VPL_PART * params.stride)) * VPL_LIGHT;
    for (int c = 0; c < 3; ++c) {
        const vfloat seen = v_fma(p[0], v_splat(turn[c][0]),
                                  v_fma(p[1], v_splat(turn[c][1]),
                                        v_fma(p[2], v_splat(turn[c][2]), v_splat(turn[c][3])))) *
                            params.per_unit;
        const vfloat facing = v_fma(m[0], v_splat(turn[c][0]),
                                    v_fma(m[1], v_splat(turn[c][1]), m[2] * turn[c][2]));
        v_scatter(seen, lights + c, at);
        v_scatter(-facing, lights + 4 + c, at);
        v_scatter(v_min(amounts[c], v_splat(VPL_MOST)) * params.per_brightest, lights + 8 + c, at);
#if !VPL_PART
        v_store(seen, bounds + (segment * VPL_BOUNDS + c) * params.stride + first);
        v_store(facing, bounds + (segment * VPL_BOUNDS + 3 + c) * params.stride + first);
#endif
    }
    v_scatter(area, lights + 3, at);
    v_scatter(zero, lights + 7, at);
    v_scatter(zero, lights + 11, at);
#if !VPL_PART
    v_store(area, bounds + (segment * VPL_BOUNDS + 6) * params.stride + first);
#endif
}
