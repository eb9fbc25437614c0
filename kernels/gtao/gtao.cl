// SPDX-License-Identifier: MIT
// gtao: cosine-weighted ambient occlusion from the highest horizon on both sides of slices.
//
// Method:  Jimenez et al. 2016, "Practical Realtime Strategies for Accurate Indirect Occlusion":
//          a slice sees |n_p| (a(h0) + a(h1)) with a(h) = (cos g + 2 h sin g - cos(2 h - g)) / 4.
// Departs: a horizon is measured from the tangent plane, so that planes are open at any tilt; the
//          sum is over what the same slices would see if nothing occluded, so that A is 1 there;
//          slices are weighted by the azimuth they stand for. With GTAO_FALLOFF a horizon moves
//          towards the tangent plane with distance, as in XeGTAO (Intel 2021).
// Bent:    the mean unoccluded direction, weighted by cosine: the mean of all directions, 2/3 of the
//          normal n, less what horizons hide. A side's directions up to the angle h sum up, towards
//          the eye and across, to
//              (cos g (1 - cos^3 h) + sin g sin^3 h) / 3,
//              (cos g sin^3 h + sin g (2 - 3 cos h + cos^3 h)) / 3.
//          Stored is the bend, what to add to n: blurred, it leaves the detail of normals alone.
// Reads:   near    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
//          tiles   bits of tiles/open.clh, tile_columns a row; none if that is 0
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is; with GTAO_BENT 3
//          more images, the bend in view space, about n's length at most; 0 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), GTAO_FALLOFF, GTAO_BENT (0, 1)
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#define SSGI_SCAN_TILES 1
#define SSGI_SCAN_PAIRS
#include "common/slices.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(GTAO_FALLOFF) || !defined(GTAO_BENT)
#error "SLICES_COUNT, _TAPS, _LAYERS, GTAO_FALLOFF and GTAO_BENT must be defined by the host"
#endif

typedef struct {
    vfloat rise[2]; // by side, of the horizon above the tangent plane: cotangent, or with falloff
                    // cosine
    vfloat seen;    // by this slice
    vmask rises;    // does a horizon of this slice?
    vfloat occluded, whole;
#if GTAO_BENT
    vfloat up, along; // sum of the directions that this slice hides, times 3
    vfloat more[3];   // times `whole`
#endif
} SsgiGathered;

SSGI_INLINE void
ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
                 SsgiGathered *gathered)
{
    gathered->seen = v_splat(0.0f);
    gathered->rises = v_splat_int(0);
#if GTAO_BENT
    gathered->up = v_splat(0.0f);
    gathered->along = v_splat(0.0f);
#endif
}

SSGI_INLINE void
ssgi_begin_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
                const int layer, const SliceParams params, SsgiGathered *gathered)
{
    gathered->rise[side] = v_splat(0.0f);
}

#if GTAO_FALLOFF
// Cosine of an angle from the line of sight.
SSGI_INLINE vfloat gtao_cosine(const vfloat cot)
{
    return cot * v_rsqrt_quick(v_fma(cot, cot, v_splat(1.0f)));
}
#endif

SSGI_INLINE void
ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice, const SsgiTap taps[2],
         const SliceParams params, SsgiGathered *gathered)
{
    const vfloat zero = v_splat(0.0f);
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        const SsgiTap *tap = &taps[side];
#if GTAO_FALLOFF
        const vfloat edge = side == 0 ? slice->edge : -slice->edge;
        const vfloat low = gtao_cosine(edge);
        const vfloat scale = ssgi_scale(receiver, tap->f);
        const vfloat depth = tap->f / (receiver->radius * scale);
        const vfloat distance = v_sqrt(
            v_fma(depth * depth, v_splat(params.thin), ssgi_squared_radii(receiver, tap)));
        const vfloat weight = v_clamp((1.0f - distance) * params.falloff_scale, 0.0f, 1.0f);
        const vfloat top =
            gtao_cosine(edge + v_min(v_max(tap->rise, zero) * slice->steepness,
                                     v_splat(SLICES_STEEPEST)));
        const vfloat rise = (top - low) * weight;
#else
        const vfloat rise = tap->rise;
#endif
        gathered->rise[side] = v_max(gathered->rise[side], v_select(zero, rise, tap->counts));
    }
}

// a of the angle that has this cosine and sine, g being towards the side.
SSGI_INLINE vfloat gtao_integral(const vfloat cosine, const vfloat sine, const vfloat cos_normal,
                                 const vfloat sin_normal)
{
    const vfloat turned = v_fma(-cosine, sine, v_acos(cosine));
    return 0.5f * v_fma(sine * sine, cos_normal, turned * sin_normal);
}

#if GTAO_BENT
// Count the directions between the horizon, with this cosine and sine, and the tangent plane.
SSGI_INLINE void
gtao_hide(const SsgiSlice *slice, const int side, const vfloat cosine, const vfloat sine,
          const vfloat sin_normal, const vmask rises, SsgiGathered *gathered)
{
    // The tangent plane is at a right angle to the projected normal.
    const vfloat low = -sin_normal;
    const vfloat high = slice->cos_normal;
    const vfloat cubes = v_fma(cosine * cosine, cosine, -(low * low * low));
    const vfloat across = v_fma(high * high, high, -(sine * sine * sine));
    const vfloat up = v_fma(slice->cos_normal, cubes, sin_normal * across);
    const vfloat along = v_fma(slice->cos_normal, across,
                               sin_normal * v_fma(cosine - low, v_splat(3.0f), -cubes));
    const vfloat zero = v_splat(0.0f);
    gathered->up = gathered->up + v_select(zero, up, rises);
    gathered->along = gathered->along + v_select(zero, side == 0 ? along : -along, rises);
}

// Bend away from what a slice of this weight hides.
SSGI_INLINE void
gtao_bend(const SsgiReceiver *receiver, const SsgiSlice *slice, const vfloat weight,
          SsgiGathered *gathered)
{
    const float x = slice->cosine * receiver->to_x;
    const float y = slice->sine * receiver->to_y;
    // Across the line of sight r is the offset less q / r.r of r; over its length it is a unit.
    const vfloat q = v_fma(receiver->x, v_splat(x), v_splat(receiver->y * y));
    const vfloat unit = v_sqrt(slice->weight) * receiver->length * (1.0f / fabs(receiver->to_x));
    const vfloat half_weight = weight * 0.5f; // of 3/2 and a third
    const vfloat offset = gathered->along * unit * half_weight;
    const vfloat sight =
        v_fma(offset, q / receiver->sight, gathered->up / receiver->length * half_weight);
    gathered->more[0] = gathered->more[0] + v_fma(sight, receiver->x, -(offset * x));
    gathered->more[1] = gathered->more[1] + v_fma(sight, v_splat(receiver->y), -(offset * y));
    gathered->more[2] = gathered->more[2] - sight;
}
#endif

SSGI_INLINE void
ssgi_end_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
              const SliceParams params, SsgiGathered *gathered)
{
    const vfloat one = v_splat(1.0f);
    const vfloat rise = gathered->rise[side];
    const vfloat edge = side == 0 ? slice->edge : -slice->edge;
    const vfloat sin_normal = side == 0 ? slice->sin_normal : -slice->sin_normal;
#if GTAO_FALLOFF
    const vfloat cosine = gtao_cosine(edge) + rise;
    const vfloat sine = v_sqrt(v_max(v_fma(-cosine, cosine, one), v_splat(0.0f)));
#else
    const vfloat cot = edge + v_min(rise * slice->steepness, v_splat(SLICES_STEEPEST));
    const vfloat sine = v_rsqrt_quick(v_fma(cot, cot, one));
    const vfloat cosine = cot * sine;
#endif
    gathered->seen =
        gathered->seen + gtao_integral(cosine, sine, slice->cos_normal, sin_normal);
    gathered->rises = gathered->rises | v_gt(rise, v_splat(0.0f));
#if GTAO_BENT
    gtao_hide(slice, side, cosine, sine, sin_normal, v_gt(rise, v_splat(0.0f)), gathered);
#endif
}

SSGI_INLINE void
ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
               SsgiGathered *gathered)
{
    // a of both edges together is cos g + g sin g.
    const vfloat g = 1.57079633f - v_acos(slice->sin_normal);
    const vfloat whole = v_fma(g, slice->sin_normal, slice->cos_normal);
    const vfloat weight = slice->weight * slice->projected;
    const vfloat hidden = v_select(v_splat(0.0f), whole - gathered->seen, gathered->rises);
    gathered->occluded = v_fma(weight, v_max(hidden, v_splat(0.0f)), gathered->occluded);
    gathered->whole = v_fma(weight, whole, gathered->whole);
#if GTAO_BENT
    gtao_bend(receiver, slice, weight, gathered);
#endif
}

#define SSGI_SCAN_MORE (3 * GTAO_BENT)
#include "common/scan.clh"

__kernel void gtao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                   ssgi_optional __global const int *restrict tiles,
                   __global float *restrict openness,
                   const int2 size, const SsgiCamera camera, const SliceParams params)
{
    ssgi_occlude(near, normal, table, tiles, openness, size, camera, params);
}
