// SPDX-License-Identifier: MIT
// ssao: ambient occlusion from points in a ball round each pixel, compared with the depth buffer.
//
// Method:  Mittring 2007, "Finding Next Gen: CryEngine 2"; Filion and McNaughton 2008, "StarCraft
//          II Effects and Techniques". A = 1 - max over radii of mean over samples of f(d /
//          radius), where d is how far the sample lies behind the surface that the camera sees
//          there.
// Departs: with the hemisphere flip, a surface occludes only if it rises above the receiver's
//          tangent plane, so that a plane never occludes itself, at any tilt; and occlusion sets in
//          over a fiftieth of a radius, so that a rounding seldom shows. A is raised to
//          params.contrast, since points find less occlusion than rays do. Where the surface is
//          flat and its normal another, the tangent plane is its own, and what of the normal's
//          hemisphere lies below it is dark.
// Reads:   depth    [rows, columns] with margin, scene units, > 0; INFINITY where nothing is
//          normal   3 x [rows, columns] with margin, view space, unit length
//          samples  [SSAO_TILE rows][SSAO_MOST_SAMPLES][3][16 columns] points of the unit ball,
//                   already reflected about the random vector of each pixel of a tile
//          curve    SSAO_CURVE_SIZE values of f at equal steps from 0 to params.curve_end
// Writes:  visibility [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SSAO_MOST_SAMPLES (1..256), SSAO_RADII (1..4), SSAO_HEMISPHERE (0, 1),
//          SSAO_FALLOFF (0 exponential, 1 ramp and power, 2 curve), SSAO_CURVE_SIZE (>= 2),
//          SSAO_OUTSIDE (0 unknown: not counted, 1 a border of constant depth)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    1 depth read per pixel, sample and radius

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "direct/facet.clh"

#if !defined(SSAO_MOST_SAMPLES) || !defined(SSAO_RADII) || !defined(SSAO_HEMISPHERE) ||            \
    !defined(SSAO_FALLOFF) || !defined(SSAO_CURVE_SIZE) || !defined(SSAO_OUTSIDE)
#error "SSAO_MOST_SAMPLES, _RADII, _HEMISPHERE, _FALLOFF, _CURVE_SIZE, _OUTSIDE must be defined"
#endif

#ifndef SSAO_TILE
#error "ssgi_cl/device/constants.py defines SSAO_TILE, a power of two"
#endif

#define SSAO_ONSET 50.0f // per radius
#define SSAO_SAME 0.999f // cosine from which on facet and normal are taken for one
#define SSAO_TILE_ROW (SSAO_MOST_SAMPLES * 3 * 16)

// Occlusion by a surface that lies d (in radii, > 0) in front of a sample.
static inline vfloat ssao_occlusion(const vfloat d, __global const float *restrict curve,
                                    const SsaoParams params)
{
#if SSAO_FALLOFF == 0
    return v_exp(d * -params.rate);
#elif SSAO_FALLOFF == 1
    const vfloat ramp = v_clamp((params.none_at - d) * params.ramp_scale, 0.0f, 1.0f);
    return params.power == 1.0f ? ramp : v_pow(ramp, v_splat(params.power));
#else
    const vfloat step = v_min(d * params.curve_scale, v_splat((float)(SSAO_CURVE_SIZE - 1)));
    const vint below = v_imin(v_to_int(step), v_splat_int(SSAO_CURVE_SIZE - 2));
    const vfloat a = v_gather(curve, below);
    const vfloat b = v_gather(curve, below + 1);
    const vfloat value = v_fma(b - a, step - v_to_float(below), a);
    return v_select(v_splat(0.0f), value, v_le(d, v_splat(params.curve_end)));
#endif
}

#if SSAO_HEMISPHERE
// Replace normals by those of the triangles where these are known and others, see
// common/facets.clh; return the share of the normal's hemisphere, by cosine, that lies above them.
static inline vfloat ssao_facet(ssgi_plane depth, const int2 whole, const int at_x, const int at_y,
                                const SsgiCamera camera, const SsaoParams params, const vfloat z,
                                const vmask there, vfloat *nx, vfloat *ny, vfloat *nz)
{
    const SsgiFacet facet =
        ssgi_facet(depth, whole, 0, at_x, at_y, camera, z, *nx, *ny, *nz, params.exact != 0);
    const vfloat cosine = v_fma(facet.nx, *nx, v_fma(facet.ny, *ny, facet.nz * *nz));
    const vfloat sx = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * camera.perspective;
    const vfloat sy = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * camera.perspective;
    const vfloat n_dot_v = v_fma(facet.nx, sx, v_fma(facet.ny, sy, -facet.nz));
    const vmask tilted =
        there & facet.known & v_lt(cosine, v_splat(SSAO_SAME)) & v_lt(n_dot_v, v_splat(0.0f));
    *nx = v_select(*nx, facet.nx, tilted);
    *ny = v_select(*ny, facet.ny, tilted);
    *nz = v_select(*nz, facet.nz, tilted);
    return v_select(v_splat(1.0f), v_fma(cosine, v_splat(0.5f), v_splat(0.5f)), tilted);
}
#endif

__kernel void ssao(ssgi_plane depth, ssgi_plane normal, __global const float *restrict samples,
                   __global const float *restrict curve, __global float *restrict visibility,
                   const int2 size, // of the result
                   const SsgiCamera camera, const SsaoParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + params.margin_left + params.margin_right,
                              size.y + params.margin_top + params.margin_bottom);
    const int at_x = x + params.margin_left;
    const int at_y = y + params.margin_top;
    // The arrays may hold a band of the image's rows.
    const int above = (int)camera.rows_above;
    const float rows = (float)(whole.y + above + (int)camera.rows_below);
    const vfloat zero = v_splat(0.0f);
    const vfloat own = ssgi_load(depth, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    if (!v_any(there)) {
        ssgi_store(v_splat(1.0f), visibility, size, 0, x, y, 1.0f);
        return;
    }
    const vfloat z = v_select(v_splat(1.0f), own, there);
    const vfloat k = ssgi_k(camera, z);
    const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * k;
    const vfloat py = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * k;
    // Pixels per scene unit at this depth, the greater of both axes.
    const vfloat pixels = max(fabs(camera.from_x), fabs(camera.from_y)) / k;
#if SSAO_HEMISPHERE
    vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const float reach =
        max(max(params.radius_0, params.radius_1), max(params.radius_2, params.radius_3));
    const vmask active =
        there & v_ge(v_min(reach * pixels, v_splat(params.most_px)), v_splat(1.0f));
    const vfloat above_plane =
        ssao_facet(depth, whole, at_x, at_y, camera, params, z, active, &nx, &ny, &nz);
    // Height of a point (a, b, -c) above the tangent plane: n . (a, b, -c) - own height.
    const vfloat own_height = v_fma(nx, px, v_fma(ny, py, -(nz * z)));
#endif

    __global const float *restrict tile =
        samples + (y & (SSAO_TILE - 1)) * SSAO_TILE_ROW + (x & (SSAO_TILE - 1));
    vfloat greatest = zero;
    for (int j = 0; j < SSAO_RADII; ++j) {
        const float wanted = j == 0   ? params.radius_0
                             : j == 1 ? params.radius_1
                             : j == 2 ? params.radius_2
                                      : params.radius_3;
        // Near the camera the ball covers many pixels: its area is limited, or gets more samples.
        const vfloat wanted_px = wanted * pixels;
        const vfloat shrink = v_min(params.most_px / wanted_px, v_splat(1.0f));
        const vfloat radius = wanted * shrink;
        const vfloat radius_px = wanted_px * shrink;
        const vfloat share =
            v_clamp(radius_px * params.samples_per_px, params.fewest, (float)SSAO_MOST_SAMPLES);
        const vint count =
            v_iselect(v_splat_int(0), v_to_int(share), there & v_ge(radius_px, v_splat(1.0f)));
        const vfloat inverse_radius = 1.0f / radius;
#if SSAO_HEMISPHERE
        const vfloat bias = v_fma(z, v_splat(params.depth_bias), radius * params.bias);
        const vfloat floor_height = own_height + bias;
#endif

        vfloat sum = zero;
        vfloat known = zero;
        const int steps = v_ilargest(count);
        for (int i = 0; i < steps; ++i) {
            __global const float *restrict point = tile + i * 48;
            vfloat sx = v_load(point);
            vfloat sy = v_load(point + 16);
            vfloat sz = v_load(point + 32);
#if SSAO_HEMISPHERE
            const vfloat side = v_fma(sx, nx, v_fma(sy, ny, sz * nz));
            const vint flip = v_bits(side) & v_splat_int((int)0x80000000);
            sx = v_from_bits(v_bits(sx) ^ flip);
            sy = v_from_bits(v_bits(sy) ^ flip);
            sz = v_from_bits(v_bits(sz) ^ flip);
#endif
            const vfloat qz = v_fma(-radius, sz, z); // depth of the sample
            // A sample at or behind the eye is projected from just before it, and not counted.
            const vmask visible = v_gt(qz, z * 0.001f);
            const vfloat inverse_k = 1.0f / ssgi_k(camera, v_max(qz, z * 0.001f));
            const vfloat column = ssgi_column(camera, v_fma(radius, sx, px) * inverse_k);
            const vfloat row = ssgi_image_row(camera, v_fma(radius, sy, py) * inverse_k);
            const vmask inside = v_ge(column, zero) & v_lt(column, v_splat((float)whole.x)) &
                                 v_ge(row, zero) & v_lt(row, v_splat(rows));
            const vint column_at = v_to_int(v_clamp(column, 0.0f, (float)(whole.x - 1)));
            const vint row_at =
                v_iclamp(v_to_int(v_clamp(row, 0.0f, rows)) - above, 0, whole.y - 1);
            vfloat seen = ssgi_gather(depth, whole, 0, column_at, row_at);
            vmask counts = visible & v_ilt(v_splat_int(i), count);
#if SSAO_OUTSIDE == 0
            counts = counts & inside;
#else
            seen = v_select(v_splat(params.border_depth), seen, inside);
#endif
            const vfloat behind = (qz - seen) * inverse_radius;
            const vmask occludes = counts & v_gt(behind, zero);
#if SSAO_HEMISPHERE
            const vfloat seen_k = ssgi_k(camera, seen);
            const vfloat ax = ssgi_slope_x(camera, v_to_float(column_at) + 0.5f) * seen_k;
            const vfloat ay = ssgi_slope_y(camera, v_to_float(row_at) + 0.5f) * seen_k;
            const vfloat height = v_fma(nx, ax, v_fma(ny, ay, -(nz * seen)));
            // Both tests set in over a fiftieth of a radius: a rounding changes next to nothing.
            vfloat least = v_min(behind, (height - floor_height) * inverse_radius);
#if SSAO_OUTSIDE == 1
            least = v_select(behind, least, inside);
#endif
            const vfloat onset = v_clamp(least * SSAO_ONSET, 0.0f, 1.0f);
            const vfloat f = ssao_occlusion(v_max(behind, zero), curve, params) * onset;
#else
            const vfloat f = ssao_occlusion(v_max(behind, zero), curve, params);
#endif
            sum = sum + v_select(zero, f, occludes);
            known = known + v_select(zero, v_splat(1.0f), counts);
        }
        greatest = v_max(greatest, sum / v_max(known, v_splat(1.0f)));
    }
    const vfloat open = v_clamp(1.0f - greatest, 0.0f, 1.0f);
    const vfloat a = params.contrast == 1.0f
                         ? open
                         : v_min(v_pow(open, v_splat(params.contrast)), v_splat(1.0f));
#if SSAO_HEMISPHERE
    const vfloat lit = a * above_plane;
#else
    const vfloat lit = a;
#endif
    ssgi_store(v_select(v_splat(1.0f), lit, there), visibility, size, 0, x, y, 1.0f);
}
