// SPDX-License-Identifier: MIT
// vpl_to_view: virtual point lights in world space as the camera sees them, behind chosen ones.
//
// Reads:   world   [10][params.place_stride] positions (0-2) from an origin, normals (3-5), area
// (6),
//                  flux over the brightest's (7-9), of lights or, with VPL_PART 1, their 16 parts
//                  each
// Writes:  lights  [segments][params.span][VPL_LIGHT] in view space, lengths of params.per_unit,
//                  flux over params.per_brightest; places past the last light have no flux
//          bounds  VPL_PART 0: [segments][VPL_BOUNDS][params.stride]; see vpl_lists
// Macros:  VPL_PART (1: the lights' parts, 16 n to 16 n + 15 behind the lights of the segment)
// Params:  from the origin and world axes to view space; params.lights lights of which the first is
//          number `first` among all, a multiple of 16; those before it are left as they are;
//          params.per_brightest: what flux is multiplied by
// Launch:  SSGI_LANES lights (parts) of a segment per work-item, a row for each segment

#include "common/gbuffer.clh"
#include "vpl/curve.clh"
#include "vpl/to_view.clh"

#ifndef VPL_PART
#error "VPL_PART must be defined"
#endif

#if !defined(VPL_LIGHT) || !defined(VPL_BOUNDS)
#error "ssgi_cl/device/constants.py defines VPL_LIGHT, VPL_BOUNDS"
#endif

#define VPL_LEAST_AREA 1e-12f
#define VPL_MOST 1e30f

__kernel void vpl_to_view(__global const float *restrict world, __global float *restrict lights,
                          __global float *restrict bounds,
                          const int2 size, // (lights or parts of a segment, segments)
                          const VplPlaceParams params, const int first)
{
    const int column = ssgi_first_column();
    const int segment = (int)get_global_id(1);
    if (column >= size.x || segment >= size.y) {
        return;
    }
    const int parts = VPL_PART ? 16 : 1;
    const int begin = segment * params.batch * parts + column - first * parts;
    if (begin < 0) {
        return;
    }
    const vint own = v_iota() + column;
    const vint place = v_iota() + begin;
    const vint last = v_splat_int(params.lights * parts - 1);
    // A segment may be wider than a batch.
    const vmask there = v_ile(place, last) & v_ilt(own, v_splat_int(params.batch * parts));
    const vint from = v_imin(place, last);
    const vfloat zero = v_splat(0.0f);
    vfloat p[3], m[3];
    for (int c = 0; c < 3; ++c) {
        p[c] = v_gather(world + c * params.place_stride, from);
        m[c] = v_gather(world + (3 + c) * params.place_stride, from);
    }
    const VplToView turn = vpl_to_view_of(params);
    const vfloat wide = v_gather(world + 6 * params.place_stride, from);
    const vfloat area = v_max(v_select(zero, wide, there) * (params.per_unit * params.per_unit),
                              v_splat(VPL_LEAST_AREA));
#if !VPL_PART
    __global float *restrict own_bounds = bounds + segment * VPL_BOUNDS * params.stride + column;
#endif
    const vint at = (own + (segment * params.span + VPL_PART * params.stride)) * VPL_LIGHT;
    for (int c = 0; c < 3; ++c) {
        const vfloat position = vpl_view_position(turn, c, p[0], p[1], p[2]) * params.per_unit;
        const vfloat normal = vpl_view_direction(turn, c, m[0], m[1], m[2]);
        const vfloat flux = v_gather(world + (7 + c) * params.place_stride, from);
        v_scatter(position, lights + c, at);
        v_scatter(-normal, lights + 4 + c, at);
        v_scatter(v_min(v_select(zero, flux, there) * params.per_brightest, v_splat(VPL_MOST)),
                  lights + 8 + c, at);
#if !VPL_PART
        v_store(position, own_bounds + c * params.stride);
        v_store(normal, own_bounds + (3 + c) * params.stride);
#endif
    }
    v_scatter(area, lights + 3, at);
    v_scatter(zero, lights + 7, at);
    v_scatter(zero, lights + 11, at);
#if !VPL_PART
    v_store(area, own_bounds + 6 * params.stride);
#endif
}
