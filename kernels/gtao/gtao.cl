// SPDX-License-Identifier: MIT
// gtao: cosine-weighted ambient occlusion from the highest horizon on both sides of slices.
//
// Method:  Jimenez et al. 2016, "Practical Realtime Strategies for Accurate Indirect Occlusion":
//          a slice sees |n_p| (a(h0) + a(h1)) with a(h) = (cos g + 2 h sin g - cos(2 h - g)) / 4.
// Departs: a horizon is measured from the tangent plane, so that planes are open at any tilt; the
//          sum is over what the same slices would see if nothing occluded, so that A is 1 there;
//          slices are weighted by the azimuth they stand for. With GTAO_FALLOFF a horizon moves
//          towards the tangent plane with distance, as in XeGTAO (Intel 2021). With GTAO_DECAY it
//          sinks towards each farther tap that is lower, the published thickness heuristic. Where
//          the surface is flat and its normal another, horizons begin at its own plane, see
//          common/facets.clh.
// Bent:    the mean unoccluded direction, weighted by cosine: the mean of all directions, 2/3 of
//          the normal n, less what horizons hide. A side's directions up to the angle h sum up,
//          towards the eye and across, to
//              (cos g (1 - cos^3 h) + sin g sin^3 h) / 3,
//              (cos g sin^3 h + sin g (2 - 3 cos h + cos^3 h)) / 3.
//          Stored is the bend, what to add to n: blurred, it leaves the detail of normals alone.
// Reads:   inv_depth    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_inv_depth
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
// Writes:  visibility [rows, columns] without margin, A in [0, 1]; 1 where nothing is; with
//          GTAO_BENT 3 more images, the bend in view space, about n's length at most; 0 where
//          nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), GTAO_FALLOFF, GTAO_DECAY, GTAO_BENT
//          (0, 1)
//          SLICES_CHECKERBOARD (0, 1): pixels of even row + column alone
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#define SLICES_FACETS SLICES_COSINE
#include "common/pairs.clh"
#include "common/scan.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(GTAO_FALLOFF) || !defined(GTAO_DECAY) || !defined(GTAO_BENT)
#error "SLICES_COUNT, _TAPS, _LAYERS, GTAO_FALLOFF, _DECAY and _BENT must be defined by the host"
#endif

#define GTAO_IMAGES (1 + 3 * GTAO_BENT)
#if GTAO_FALLOFF || GTAO_DECAY
#define GTAO_COSINES 1 // horizons are cosines
#else
#define GTAO_COSINES 0
#endif

// What a slice sees, and the directions that it hides.
typedef struct {
    vfloat seen;
    vfloat open;      // what it would see of the normal's hemisphere above another plane
    vmask rises;      // does a horizon?
    vfloat up, along; // sum of the hidden directions, times 3
} GtaoSlice;

// Cosine of an angle from the view ray.
SSGI_INLINE vfloat gtao_cosine(const vfloat cot)
{
    return cot * v_rsqrt_quick(v_fma(cot, cot, v_splat(1.0f)));
}

// How far above the tangent plane of a side a tap is: SsgiPairTap.rise, or with falloff or decay
// the cosine, which with falloff moves towards the plane's with distance.
SSGI_INLINE vfloat gtao_rise(const SsgiReceiver *receiver, const SsgiSlice *slice,
                             const SsgiPairTap *tap, const int side, const SliceParams params)
{
    if (!GTAO_COSINES) {
        return tap->rise;
    }
    const vfloat edge = side == 0 ? slice->edge : -slice->edge;
    const vfloat low = gtao_cosine(edge);
    const vfloat rise = v_max(tap->rise, v_splat(0.0f)) * slice->steepness;
    const vfloat above = gtao_cosine(edge + v_min(rise, v_splat(SLICES_STEEPEST))) - low;
    if (!GTAO_FALLOFF) {
        return above;
    }
    const vfloat scale = ssgi_scale(receiver, tap->f);
    const vfloat depth = tap->f / (receiver->radius * scale);
    const vfloat distance = v_sqrt(v_fma(depth * depth, v_splat(params.thin),
                                         ssgi_squared_radii(receiver, tap->f, tap->outside)));
    const vfloat weight = v_clamp((1.0f - distance) * params.falloff_scale, 0.0f, 1.0f);
    return above * weight;
}

// a of the angle that has this cosine and sine, g being towards the side.
SSGI_INLINE vfloat gtao_integral(const vfloat cosine, const vfloat sine, const vfloat cos_normal,
                                 const vfloat sin_normal)
{
    const vfloat turned = v_fma(-cosine, sine, v_acos(cosine));
    return 0.5f * v_fma(sine * sine, cos_normal, turned * sin_normal);
}

// Count the directions between the horizon, with this cosine and sine, and the tangent plane.
SSGI_INLINE void gtao_hide(const SsgiSlice *slice, const int side, const vfloat cosine,
                           const vfloat sine, const vfloat sin_normal, const vmask rises,
                           GtaoSlice *found)
{
    // The tangent plane is at a right angle to the projected normal.
    const vfloat low = -sin_normal;
    const vfloat high = slice->cos_normal;
    const vfloat cubes = v_fma(cosine * cosine, cosine, -(low * low * low));
    const vfloat across = v_fma(high * high, high, -(sine * sine * sine));
    const vfloat up = v_fma(slice->cos_normal, cubes, sin_normal * across);
    const vfloat along =
        v_fma(slice->cos_normal, across, sin_normal * v_fma(cosine - low, v_splat(3.0f), -cubes));
    const vfloat zero = v_splat(0.0f);
    found->up = found->up + v_select(zero, up, rises);
    found->along = found->along + v_select(zero, side == 0 ? along : -along, rises);
}

// Bend away from what a slice of this weight hides.
SSGI_INLINE void gtao_bend(const SsgiReceiver *receiver, const SsgiSlice *slice,
                           const GtaoSlice *found, const vfloat weight, vfloat *bend)
{
    const float x = slice->cosine * receiver->to_x;
    const float y = slice->sine * receiver->to_y;
    // Across the view ray r is the offset less q / r.r of r; over its length it is a unit.
    const vfloat q = v_fma(receiver->x, v_splat(x), v_splat(receiver->y * y));
    const vfloat unit = v_sqrt(slice->weight) * receiver->length * (1.0f / fabs(receiver->to_x));
    const vfloat half_weight = weight * 0.5f; // of 3/2 and a third
    const vfloat offset = found->along * unit * half_weight;
    const vfloat view_ray =
        v_fma(offset, q / receiver->ray_squared, found->up / receiver->length * half_weight);
    bend[0] = bend[0] + v_fma(view_ray, receiver->x, -(offset * x));
    bend[1] = bend[1] + v_fma(view_ray, v_splat(receiver->y), -(offset * y));
    bend[2] = bend[2] - view_ray;
}
// Count what a side sees whose horizon is so far above the tangent plane, see gtao_rise.
SSGI_INLINE void gtao_end_side(const SsgiReceiver *receiver, const SsgiSlice *slice,
                               const vfloat rise, const int side, GtaoSlice *found)
{
    const vfloat one = v_splat(1.0f);
    const vfloat edge = side == 0 ? slice->edge : -slice->edge;
    const vfloat sin_normal = side == 0 ? slice->sin_normal : -slice->sin_normal;
    vfloat cosine, sine;
    if (GTAO_COSINES) {
        cosine = gtao_cosine(edge) + rise;
        sine = v_sqrt(v_max(v_fma(-cosine, cosine, one), v_splat(0.0f)));
    } else {
        const vfloat cot = edge + v_min(rise * slice->steepness, v_splat(SLICES_STEEPEST));
        sine = v_rsqrt_quick(v_fma(cot, cot, one));
        cosine = cot * sine;
    }
    vmask rises = v_gt(rise, v_splat(0.0f));
    if (receiver->tilts) {
        // The lower of both planes ends what the normal's hemisphere sees.
        const vmask below = receiver->tilted & v_lt(cosine, -sin_normal);
        cosine = v_select(cosine, -sin_normal, below);
        sine = v_select(sine, slice->cos_normal, below);
        const vfloat plane = v_max(gtao_cosine(edge), -sin_normal);
        const vfloat across = v_sqrt(v_max(v_fma(-plane, plane, one), v_splat(0.0f)));
        found->open = found->open + gtao_integral(plane, across, slice->cos_normal, sin_normal);
    }
    found->seen = found->seen + gtao_integral(cosine, sine, slice->cos_normal, sin_normal);
    found->rises = found->rises | rises;
    if (GTAO_BENT) {
        gtao_hide(slice, side, cosine, sine, sin_normal, rises | receiver->tilted, found);
    }
}

// Find the fraction that slices of this radius (a length) find occluded, and with GTAO_BENT the
// bend.
SSGI_INLINE void gtao_scan(ssgi_plane inv_depth, const SsgiReceiver *receiver,
                           const SsgiPattern *pattern, const float radius, const SliceParams params,
                           vfloat images[GTAO_IMAGES])
{
    vfloat whole[2] = {v_splat(SLICES_TINY), v_splat(SLICES_TINY)}; // above the plane; in all
#pragma unroll
    for (int i = 0; i < GTAO_IMAGES; ++i) {
        images[i] = v_splat(0.0f);
    }
// Unrolled loops are longer than the instruction cache likes, and no faster.
#pragma unroll 1
    for (int s = 0; s < SLICES_COUNT; ++s) {
        const SsgiSlice slice =
            ssgi_slice(receiver, pattern->table + s * SLICES_SIZE, radius, pattern->centre);
        SsgiTaps taps;
        ssgi_taps(receiver, &slice, pattern->centre, params, &taps);
        ssgi_ask_taps(inv_depth, receiver, &taps, 1, SLICES_TAPS);
        vfloat highest[2] = {v_splat(0.0f), v_splat(0.0f)};
#pragma unroll 1
        for (int t = 0; t < SLICES_TAPS; ++t) {
            const SsgiPair pair = ssgi_pair(receiver, &slice, &taps, t);
            const vfloat before[2] = {highest[0], highest[1]};
            if (GTAO_DECAY) {
                highest[0] = highest[1] = v_splat(0.0f); // of this tap
            }
#pragma unroll 1
            for (int layer = 0; layer < SLICES_LAYERS; ++layer) {
                const SsgiPairTap both[2] = {
                    ssgi_pair_tap(&pair, inv_depth, receiver, &slice, &taps, 0, t, layer),
                    ssgi_pair_tap(&pair, inv_depth, receiver, &slice, &taps, 1, t, layer),
                };
#pragma unroll
                for (int side = 0; side < 2; ++side) {
                    const vfloat rise = gtao_rise(receiver, &slice, &both[side], side, params);
                    highest[side] =
                        v_max(highest[side], v_select(v_splat(0.0f), rise, both[side].counts));
                }
            }
            if (GTAO_DECAY) {
#pragma unroll
                for (int side = 0; side < 2; ++side) {
                    const vfloat lower = v_min(highest[side] - before[side], v_splat(0.0f));
                    highest[side] =
                        v_max(highest[side], v_fma(lower, v_splat(params.decay), before[side]));
                }
            }
        }
        GtaoSlice found = {v_splat(0.0f), v_splat(0.0f), v_splat_int(0), v_splat(0.0f),
                           v_splat(0.0f)};
        gtao_end_side(receiver, &slice, highest[0], 0, &found);
        gtao_end_side(receiver, &slice, highest[1], 1, &found);
        // a of both edges together is cos g + g sin g.
        const vfloat g = 1.57079633f - v_acos(slice.sin_normal);
        const vfloat entire = v_fma(g, slice.sin_normal, slice.cos_normal);
        const vfloat all = v_select(entire, found.open, receiver->tilted);
        const vfloat weight = slice.weight * slice.projected;
        const vfloat hidden = v_select(v_splat(0.0f), all - found.seen, found.rises);
        images[0] = v_fma(weight, v_max(hidden, v_splat(0.0f)), images[0]);
        whole[0] = v_fma(weight, all, whole[0]);
        whole[1] = v_fma(weight, entire, whole[1]);
        if (GTAO_BENT) {
            gtao_bend(receiver, &slice, &found, weight, images + 1);
        }
    }
#pragma unroll
    for (int i = 0; i < GTAO_IMAGES; ++i) {
        images[i] = images[i] / whole[i == 0 ? 0 : 1];
    }
}

__kernel void gtao(ssgi_plane inv_depth, ssgi_plane normal, __global const float *restrict table,
                   __global float *restrict visibility, const int2 size, const SsgiCamera camera,
                   const SliceParams params)
{
    const SsgiItem item = ssgi_item(size);
    if (!item.inside) {
        return;
    }
    const SsgiReceiver receiver =
        ssgi_receiver(inv_depth, normal, size, item.first, item.phase, item.row, camera, params);
    const SsgiPattern pattern = ssgi_pattern(table, &item, camera, params);
    vfloat images[GTAO_IMAGES];
#pragma unroll
    for (int i = 0; i < GTAO_IMAGES; ++i) {
        images[i] = v_splat(0.0f);
    }
    SsgiGroup group = ssgi_groups(receiver.active);
    while (ssgi_next_group(inv_depth, &receiver, params, &group)) {
        vfloat found[GTAO_IMAGES];
        gtao_scan(inv_depth, &receiver, &pattern, group.radius, params, found);
#pragma unroll
        for (int i = 0; i < GTAO_IMAGES; ++i) {
            images[i] = v_select(images[i], found[i], group.alike);
        }
        if (SSGI_LANES == 1) {
            break; // a receiver is in one group
        }
    }
    ssgi_store_ao(images[0], &receiver, params, visibility, size, &item);
    for (int i = 1; i < GTAO_IMAGES; ++i) {
        ssgi_store_behind(images[i], v_splat(1.0f), visibility, i, size, &item);
    }
}
