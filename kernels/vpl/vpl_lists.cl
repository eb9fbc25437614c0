// SPDX-License-Identifier: MIT
// vpl_lists: for each tile, the virtual point lights that may give any of its pixels something.
//
// Method:  A light whose irradiance per flux w = cos cos / (pi d^2 + A) is nowhere in the tile
//          above the cutoff is left out. Three bounds: where cos / (pi d^2) is above the cutoff
//          there lies, for a diffuse light, a sphere of radius (4/27)^(1/4) R about the point
//          3^(-3/4) R along its normal, R = 1 / sqrt(pi cutoff); the tile lies behind the light, or
//          the light behind the tile; the greatest cosines over the least distance between light
//          and tile. Of a light with a lobe, in place of the sphere: the least angle between its
//          axis and the ball round the tile, and a plane between the tile's box and the cone in
//          which the lobe is above the cutoff. Both are tighter than an ellipsoid round the lobe
//          where the tile is small beside it. All of them are conservative, so that a tile's pixels
//          get bit-identical results from its list as from all lights.
// Reads:   boxes   [tiles][VPL_BOX]; see vpl_boxes
//          lights  [segments][VPL_BOUNDS][params.stride] positions (0-2), normals (3-5), area (6);
//                  VPL_GLOSSY 1: axes in place of normals, and normals (7-9), n - 1 (10), 2 pi F
//                  (11); see glossy.clh
// Writes:  lists   [tiles][VPL_SUBSETS][params.capacity] numbers of the lights; -1 - n for light n
//                  whose parts, params.stride + 16 n to + 15, precede it
//          counts  [tiles][VPL_SUBSETS]
// Macros:  VPL_CUT (0: only what gives nothing is left out, 1), VPL_SUBSETS (1, 16: light i of
//          params.count is number i / 16 of the subset i % 16, which has a segment of its own),
//          VPL_PARTS (1: lights closer than sqrt(params.refine A) to a tile have their parts
//          with them), VPL_GLOSSY (1: lights with Phong lobes)
// Launch:  a work-item for each tile and subset; lanes are lights

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/glossy.clh"
#include "vpl/receiver.clh"

#if !defined(VPL_CUT) || !defined(VPL_SUBSETS) || !defined(VPL_PARTS) || !defined(VPL_GLOSSY)
#error "VPL_CUT, VPL_SUBSETS, VPL_PARTS and VPL_GLOSSY must be defined"
#endif

#ifndef VPL_BOUNDS
#error "ssgi_cl/device/constants.py defines VPL_BOUNDS"
#endif

#if VPL_GLOSSY // floats of a light, and where its normal is
#define VPL_OWN_BOUNDS VPL_LOBE_BOUNDS
#define VPL_NORMAL 7
#else
#define VPL_OWN_BOUNDS VPL_BOUNDS
#define VPL_NORMAL 3
#endif

#if VPL_PARTS
// Appends light `number` if it is kept, marked and with its 16 parts if it is close and there is
// room for them beside all lights to come; returns the new count.
static inline int vpl_append_parts(__global int *restrict list, const int count, const int number,
                                   const int number_of, const int kept, const int close,
                                   const VplParams params)
{
    if (close && count + 17 + number_of - number <= params.capacity) {
        for (int j = 0; j < 16; ++j) {
            list[count + j] = params.stride + 16 * number + j;
        }
        list[count + 16] = -1 - number;
        return count + 16 - kept;
    }
    list[count] = number;
    return count - kept;
}
#endif

#if VPL_CUT && VPL_GLOSSY
// Whether a way from the lights into the box may have this cosine to their axis a: if one has, then
// (a - cosine u) . way >= 0, and whatever unit vector u is, that is greatest at a corner. It tells
// most with u towards what of the box is nearest to the axis at the box's distance along it.
static inline vmask vpl_reaches(__global const float *restrict box,
                                __global const float *restrict lights, const int stride,
                                const int i, const vfloat along, const vfloat cosine)
{
    vfloat low[3], high[3], axis[3], to[3];
    vfloat squared = v_splat(1e-24f);
    for (int j = 0; j < 3; ++j) {
        const vfloat y = v_load(lights + j * stride + i);
        axis[j] = v_load(lights + (3 + j) * stride + i);
        low[j] = v_splat(box[j]) - y;
        high[j] = v_splat(box[3 + j]) - y;
        to[j] = v_min(v_max(axis[j] * along, low[j]), high[j]);
        squared = v_fma(to[j], to[j], squared);
    }
    // Rounding: the cosine gets 1e-5 less, and the sum 1e-6 of its parts more.
    const vfloat least = v_max(cosine - 1e-5f, v_splat(0.0f)) * v_rsqrt(squared);
    vfloat most = v_splat(0.0f);
    for (int j = 0; j < 3; ++j) {
        const vfloat turned = v_fma(-least, to[j], axis[j]);
        most = most + v_max(turned * low[j], turned * high[j]);
        most = v_fma(v_max(v_abs(low[j]), v_abs(high[j])), v_splat(1e-6f), most);
    }
    return v_gt(most, v_splat(0.0f));
}
#endif

#define VPL_SLACK 4e-6f // rounding of a height, relative to the distances that it is made of

__kernel void vpl_lists(__global const float *restrict boxes, __global const float *restrict lights,
                        __global int *restrict lists, __global int *restrict counts,
                        const int2 size, const VplParams params)
{
    const int tile_x = (int)get_global_id(0) / VPL_SUBSETS;
    const int subset = (int)get_global_id(0) % VPL_SUBSETS;
    const int tile_y = (int)get_global_id(1);
    const int2 tiles = vpl_tiles(size);
    if (tile_x >= tiles.x || tile_y >= tiles.y) {
        return;
    }
    const int tile = tile_y * tiles.x + tile_x;
    const int own = tile * VPL_SUBSETS + subset;
    __global const float *restrict box = boxes + tile * VPL_BOX;
    if (box[13] == 0.0f) {
        counts[own] = 0;
        return;
    }
    lights += (params.segment + subset) * VPL_OWN_BOUNDS * params.stride;
    const int number_of = (params.count - subset + VPL_SUBSETS - 1) / VPL_SUBSETS;
    __global int *restrict list = lists + own * params.capacity;
    const vfloat zero = v_splat(0.0f);
    float extent = 0.0f;
#if VPL_GLOSSY
    float radius = 0.0f; // squared, of the ball round the tile
#endif
    for (int j = 0; j < 3; ++j) {
        extent += max(fabs(box[j]), fabs(box[3 + j]));
#if VPL_GLOSSY
        const float half_side = 0.5f * (box[3 + j] - box[j]);
        radius = fma(half_side, half_side, radius);
#endif
    }
    int count = 0;
    for (int i = 0; i < number_of; i += SSGI_LANES) {
        vfloat squared = zero;               // least distance from the tile's box
        vfloat emitted = zero;               // greatest height of the tile above the light
        vfloat received = v_splat(-box[12]); // and of the light above the tile
        vfloat slack = v_splat(extent);
#if VPL_GLOSSY
        vfloat along = zero; // of the way to the tile's centre
        vfloat away = zero;  // its square
#elif VPL_CUT
        vfloat from_centre = zero; // least distance of the box from the sphere's centre
#endif
        for (int j = 0; j < 3; ++j) {
            const vfloat y = v_load(lights + j * params.stride + i);
            const vfloat m = v_load(lights + (VPL_NORMAL + j) * params.stride + i);
            const vfloat low = v_splat(box[j]);
            const vfloat high = v_splat(box[3 + j]);
            const vfloat d = v_max(v_max(low - y, y - high), zero);
            squared = v_fma(d, d, squared);
            emitted = emitted + v_max(m * (low - y), m * (high - y));
            received = received + v_max(y * box[6 + j], y * box[9 + j]);
            slack = slack + v_abs(y);
#if VPL_GLOSSY
            const vfloat axis = v_load(lights + (3 + j) * params.stride + i);
            const vfloat way = 0.5f * (low + high) - y;
            along = v_fma(axis, way, along);
            away = v_fma(way, way, away);
#elif VPL_CUT
            const vfloat c = v_fma(m, v_splat(params.lobe_centre), y);
            const vfloat e = v_max(v_max(low - c, c - high), zero);
            from_centre = v_fma(e, e, from_centre);
#endif
        }
        emitted = v_fma(slack, v_splat(VPL_SLACK), emitted);
        received = v_fma(slack, v_splat(VPL_SLACK), received);
        vmask kept = v_gt(emitted, zero) & v_gt(received, zero) &
                     v_ilt(v_iota() + i, v_splat_int(number_of));
#if VPL_GLOSSY
        // Rounding grows with the exponent, which is at most 1000: cosines get 1e-6 more.
        const vfloat one = v_splat(1.0f);
        const vfloat inverse = v_rsqrt(v_max(away, v_splat(1e-24f)));
        const vfloat centred = v_clamp(along * inverse, -1.0f, 1.0f);
        const vfloat sine = v_min(inverse * (sqrt(radius) * 1.00001f), one);
        const vfloat cosine = v_sqrt(v_max(v_fma(-sine, sine, one), zero));
        const vfloat across = v_sqrt(v_max(v_fma(-centred, centred, one), zero));
        const vfloat nearest_to_axis =
            v_min(v_select(v_fma(centred, cosine, v_fma(across, sine, v_splat(1e-6f))), one,
                           v_ge(centred, cosine) | v_ge(sine, one)),
                  one);
        kept = kept & v_gt(nearest_to_axis, zero);
#endif
#if VPL_CUT && VPL_GLOSSY
        const vfloat area = v_load(lights + 6 * params.stride + i);
        const vfloat sharp = v_load(lights + 10 * params.stride + i);
        const vfloat nearest = squared * (1.0f - 1e-5f);
        const vfloat power = vpl_sharpness(sharp, area, v_max(nearest, v_splat(1e-24f))) + one;
        const vfloat lobe = v_pow(v_max(nearest_to_axis, zero), power);
        const vfloat spread =
            v_max(nearest * v_load(lights + 11 * params.stride + i) / (sharp + 2.0f), area);
        const vfloat distance = v_sqrt(v_max(nearest, v_splat(1e-24f)));
        const vfloat most = v_min(received / distance, one) * 1.001f;
        const vfloat least = spread * params.cutoff;
        kept = kept & v_gt(most * lobe, least);
        if (v_any(kept)) {
            const vfloat share = v_min(least / v_max(most, v_splat(1e-24f)), one);
            kept = kept & vpl_reaches(box, lights, params.stride, i, v_max(along, zero),
                                      v_pow(share, one / power));
        }
#elif VPL_CUT
        // cos cos <= min(1, height / distance) for both; times the squared distance.
        const vfloat area = v_load(lights + 6 * params.stride + i);
        const vfloat nearest = squared * (1.0f - 1e-5f);
        const vfloat distance = v_sqrt(nearest);
        const vfloat most = v_min(emitted, distance) * v_min(received, distance) * (1.0f + 1e-5f);
        const vfloat bound = v_max(nearest * 3.14159265f, area) * params.cutoff; // "clamped"
        const vmask inside = v_eq(nearest, zero);
        kept = kept & (v_gt(most, bound * nearest) | (inside & v_gt(v_splat(1.0f), bound))) &
               v_le(from_centre, v_splat(params.lobe_squared));
#endif
#if VPL_PARTS
        // Next to a tile a light has its parts with it, whichever way it faces: they may face the
        // tile where it does not.
        const vmask close = v_lt(squared, v_load(lights + 6 * params.stride + i) * params.refine) &
                            v_ilt(v_iota() + i, v_splat_int(number_of));
        if (v_any(close)) {
#if SSGI_LANES == 1
            count = vpl_append_parts(list, count, i, number_of, kept, close, params);
#else
            const vint whole = v_iota() + i;
#define VPL_APPEND(n)                                                                              \
    count = vpl_append_parts(list, count, whole.s##n, number_of, kept.s##n, close.s##n, params)
            (void)(SSGI_EACH(VPL_APPEND));
#undef VPL_APPEND
#endif
            continue;
        }
#endif
        if (v_any(kept)) {
            count = vpl_append(list, count, v_iota() + i, kept);
        }
    }
    counts[own] = count;
}
