// SPDX-License-Identifier: MIT
// vpl_place: pieces of reflective shadow maps as virtual point lights, as the camera sees them.
//
// Reads:   edges   [8][params.edge_stride] flux and area before each piece; see vpl_cut
//          places  [6][params.place_stride] positions from the maps' origin, normals; world axes
//                  (6 to 9 of VPL_GLOSSY 1: axes and exponents of lobes)
// Writes:  lights  [segments][params.span][VPL_LIGHT] in view space, lengths of params.per_unit,
//                  flux over params.brightest; places without a light have no flux
//          bounds  VPL_PART 0: [segments][VPL_BOUNDS][params.stride]; see vpl_lists
// Macros:  VPL_PART (1: the lights' parts, 16 n to 16 n + 15 behind the lights of the segment),
//          VPL_GLOSSY (1: lights with lobes, which have no parts; see glossy.clh)
// Params:  from the maps' origin and axes to view space; of params.lights lights, params.split
//          pieces each, number i is light i % batch / subsets of the segment
//          i / batch * subsets + i % batch % subsets
// Launch:  SSGI_LANES lights (parts) of a segment per work-item, a row for each segment

#include "common/gbuffer.clh"
#include "vpl/curve.clh"
#include "vpl/to_view.clh"

#if !defined(VPL_PART) || !defined(VPL_GLOSSY)
#error "VPL_PART and VPL_GLOSSY must be defined"
#endif

#if !defined(VPL_LIGHT) || !defined(VPL_BOUNDS)
#error "ssgi_cl/device/constants.py defines VPL_LIGHT, VPL_BOUNDS"
#endif

#if VPL_GLOSSY
#include "vpl/glossy.clh"
#define VPL_OWN_LIGHT VPL_LOBE_LIGHT
#define VPL_OWN_BOUNDS VPL_LOBE_BOUNDS
#define VPL_NORMAL 12
#define VPL_BOUNDS_NORMAL 7
#else
#define VPL_OWN_LIGHT VPL_LIGHT
#define VPL_OWN_BOUNDS VPL_BOUNDS
#define VPL_NORMAL 4
#define VPL_BOUNDS_NORMAL 3
#endif
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
#if VPL_GLOSSY
    vfloat r[3];
#endif
    for (int c = 0; c < 3; ++c) {
        p[c] = v_gather(places + c * params.place_stride, place);
        m[c] = v_gather(places + (3 + c) * params.place_stride, place);
#if VPL_GLOSSY
        r[c] = v_gather(places + (6 + c) * params.place_stride, place);
#endif
    }
    const VplToView turn = vpl_to_view_of(params);
    const vfloat area =
        v_max(amounts[3] * (params.per_unit * params.per_unit), v_splat(VPL_LEAST_AREA));
#if !VPL_PART
    __global float *restrict own_bounds = bounds + segment * VPL_OWN_BOUNDS * params.stride + first;
#endif
    const vint at = (own + (segment * params.span + VPL_PART * params.stride)) * VPL_OWN_LIGHT;
    for (int c = 0; c < 3; ++c) {
        const vfloat position = vpl_view_position(turn, c, p[0], p[1], p[2]) * params.per_unit;
        const vfloat normal = vpl_view_direction(turn, c, m[0], m[1], m[2]);
        v_scatter(position, lights + c, at);
        v_scatter(-normal, lights + VPL_NORMAL + c, at);
#if VPL_GLOSSY
        const vfloat axis = vpl_view_direction(turn, c, r[0], r[1], r[2]);
        v_scatter(-axis, lights + 4 + c, at);
        v_store(axis, own_bounds + (3 + c) * params.stride);
#endif
        v_scatter(v_min(amounts[c], v_splat(VPL_MOST)) * params.per_brightest, lights + 8 + c, at);
#if !VPL_PART
        v_store(position, own_bounds + c * params.stride);
        v_store(normal, own_bounds + (VPL_BOUNDS_NORMAL + c) * params.stride);
#endif
    }
    v_scatter(area, lights + 3, at);
#if VPL_GLOSSY
    const vfloat cosine = v_fma(r[0], m[0], v_fma(r[1], m[1], r[2] * m[2]));
    const vfloat sharp =
        v_clamp(v_gather(places + 9 * params.place_stride, place), 1.0f, VPL_SHARPEST) - 1.0f;
    const vfloat whole = vpl_lobe_share(sharp, v_clamp(cosine, 0.0f, 1.0f)) * 6.28318531f;
    v_store(sharp, own_bounds + 10 * params.stride);
    v_store(whole, own_bounds + 11 * params.stride);
    v_scatter(sharp, lights + 7, at);
    v_scatter(whole, lights + 11, at);
    v_scatter(zero, lights + 15, at);
#else
    v_scatter(zero, lights + 7, at);
    v_scatter(zero, lights + 11, at);
#endif
#if !VPL_PART
    v_store(area, own_bounds + 6 * params.stride);
#endif
}
