// SPDX-License-Identifier: MIT
// hbao: ambient occlusion from the horizons of directions, all of the hemisphere weighing the same.
//
// Method:  Bavoil and Sainz 2008, "Image-Space Horizon-Based Ambient Occlusion". From the tangent
//          plane's elevation t plus a bias, each tap outwards that raises the horizon h to s adds
//          W (sin s - sin h), W = 1 - attenuation r^2, r the distance in radii.
// Departs: elevations are above the plane across the view ray, not the image plane, so that
//          A is right off the axis too; directions weigh by the azimuth that they stand for; the
//          sum is over what they could hide, which makes good the bias. Where the surface is flat
//          and its normal another, horizons begin at its own plane, see common/facets.clh.
// Reads:   inv_depth    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_inv_depth
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
// Writes:  visibility [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT (pairs of directions), SLICES_TAPS, SLICES_LAYERS (>= 1),
//          HBAO_ATTENUATION, HBAO_BIAS (0, 1)
//          SLICES_CHECKERBOARD (0, 1): pixels of even row + column alone
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel. With 3 slices of 6 taps,
//          an eighth is the receiver's, a quarter the slices', the rest the taps' arithmetic
// Tried:   no branch: 1.2 times as long. A branch for each side, or one for two steps; taps
//          unrolled, loaded a step ahead, or first kept and then looked at; offsets of all slices,
//          or of the next one, before the first tap: no gain

#define SLICES_FACETS SLICES_UNIFORM
#include "common/pairs.clh"
#include "common/scan.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(HBAO_ATTENUATION) || !defined(HBAO_BIAS)
#error "SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS, HBAO_ATTENUATION and HBAO_BIAS must be defined"
#endif

// The horizons of a slice.
typedef struct {
    vfloat rise[2];    // by side, of the horizon above the tangent plane, see SsgiPairTap
    vfloat horizon[2]; // sine of its elevation
    vfloat hidden;     // by this slice
    vfloat could_hide;
    vfloat fade; // change of W per SsgiPairTap.outside over scale^2
} HbaoHorizons;

// Where the receiver's plane is not that across its normal, the horizon is the higher of both.
SSGI_INLINE void hbao_begin_tilted(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                   const int side, HbaoHorizons *at)
{
    const vfloat one = v_splat(1.0f);
    const vfloat edge = side == 0 ? slice->edge : -slice->edge;
    const vfloat plane = edge * v_rsqrt_quick(v_fma(edge, edge, one));
    const vfloat lowest = at->horizon[side];
    const vfloat horizon = v_max(lowest, plane);
    const vfloat cosine = v_sqrt(v_max(v_fma(-horizon, horizon, one), v_splat(1e-12f)));
    const vfloat rise = v_max((horizon / cosine - edge) / slice->steepness, v_splat(0.0f));
    at->horizon[side] = v_select(lowest, horizon, receiver->tilted);
    at->rise[side] = v_select(at->rise[side], rise, receiver->tilted);
}

// Both at the tangent plane plus the bias.
SSGI_INLINE HbaoHorizons hbao_begin(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                    const SliceParams params)
{
    const vfloat one = v_splat(1.0f);
    HbaoHorizons at;
    at.hidden = at.could_hide = v_splat(0.0f);
    at.fade = v_splat(-params.attenuation) / (receiver->radius * receiver->radius);
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        // The tangent plane is at a right angle to the projected normal.
        const vfloat tangent = side == 0 ? -slice->sin_normal : slice->sin_normal;
        at.horizon[side] = tangent;
        at.rise[side] = v_splat(0.0f);
        if (HBAO_BIAS) {
            const vfloat cosine = slice->cos_normal;
            const vfloat raised =
                v_fma(tangent, v_splat(params.bias_cos), cosine * params.bias_sin);
            const vfloat raised_cosine =
                v_fma(cosine, v_splat(params.bias_cos), tangent * -params.bias_sin);
            const vmask upright = v_gt(tangent, v_splat(params.bias_cos));
            at.horizon[side] = v_select(raised, one, upright);
            // sin bias / (cos tangent cos raised) is how much the cotangent grows by the bias.
            const vfloat grown = params.bias_sin / (cosine * v_max(raised_cosine, v_splat(1e-6f)));
            at.rise[side] = v_select(grown / slice->steepness, v_splat(INFINITY), upright);
        }
        if (receiver->tilts) {
            hbao_begin_tilted(receiver, slice, side, &at);
        }
        at.could_hide = at.could_hide + (one - at.horizon[side]);
    }
    return at;
}

// Raise the horizons of both sides to their taps.
SSGI_INLINE void hbao_raise(const SsgiReceiver *receiver, const SsgiSlice *slice,
                            const SsgiPairTap taps[2], const SliceParams params, HbaoHorizons *at)
{
    vmask raises[2];
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        raises[side] = taps[side].counts & v_gt(taps[side].rise, at->rise[side]);
    }
    // Most taps raise no horizon: without the branch all takes a quarter longer.
    if (!v_any(raises[0] | raises[1])) {
        return;
    }
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        const SsgiPairTap *tap = &taps[side];
        const vfloat edge = side == 0 ? slice->edge : -slice->edge;
        const vfloat cot =
            v_min(v_fma(tap->rise, slice->steepness, edge), v_splat(SLICES_STEEPEST));
        const vfloat square = v_fma(cot, cot, v_splat(1.0f));
        vfloat sine, hides;
        if (HBAO_ATTENUATION) {
            // W and the sine from one root; a division for W alone takes as long as all of this.
            const vfloat scale = ssgi_scale(receiver, tap->f);
            const vfloat root = v_rsqrt_quick(square * (scale * scale));
            sine = root * (cot * scale);
            const vfloat per_scale = (root * root) * square; // 1 / scale^2
            const vfloat weight =
                v_fma(tap->outside * at->fade, per_scale, v_splat(1.0f - params.attenuation));
            hides = v_fma(weight, sine - at->horizon[side], at->hidden);
        } else {
            sine = cot * v_rsqrt_quick(square);
            hides = at->hidden + (sine - at->horizon[side]);
        }
        at->hidden = v_select(at->hidden, hides, raises[side]);
        at->horizon[side] = v_select(at->horizon[side], sine, raises[side]);
        at->rise[side] = v_select(at->rise[side], tap->rise, raises[side]);
    }
}

// The fraction that slices of this radius (a length) find occluded.
SSGI_INLINE vfloat hbao_scan(ssgi_plane inv_depth, const SsgiReceiver *receiver,
                             const SsgiPattern *pattern, const float radius,
                             const SliceParams params)
{
    vfloat hidden = v_splat(0.0f), could_hide = v_splat(SLICES_TINY);
// Unrolled loops are longer than the instruction cache likes, and no faster.
#pragma unroll 1
    for (int s = 0; s < SLICES_COUNT; ++s) {
        const SsgiSlice slice =
            ssgi_slice(receiver, pattern->table + s * SLICES_SIZE, radius, pattern->centre);
        SsgiTaps taps;
        ssgi_taps(receiver, &slice, pattern->centre, params, &taps);
        ssgi_ask_taps(inv_depth, receiver, &taps, 1, SLICES_TAPS);
        HbaoHorizons at = hbao_begin(receiver, &slice, params);
#pragma unroll 1
        for (int t = 0; t < SLICES_TAPS; ++t) {
            const SsgiPair pair = ssgi_pair(receiver, &slice, &taps, t);
#pragma unroll 1
            for (int layer = 0; layer < SLICES_LAYERS; ++layer) {
                const SsgiPairTap both[2] = {
                    ssgi_pair_tap(&pair, inv_depth, receiver, &slice, &taps, 0, t, layer),
                    ssgi_pair_tap(&pair, inv_depth, receiver, &slice, &taps, 1, t, layer),
                };
                hbao_raise(receiver, &slice, both, params, &at);
            }
        }
        hidden = v_fma(slice.weight, at.hidden, hidden);
        could_hide = v_fma(slice.weight, at.could_hide, could_hide);
    }
    return hidden / could_hide;
}

__kernel void hbao(ssgi_plane inv_depth, ssgi_plane normal, __global const float *restrict table,
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
    vfloat occluded = v_splat(0.0f);
    SsgiGroup group = ssgi_groups(receiver.active);
    while (ssgi_next_group(inv_depth, &receiver, params, &group)) {
        const vfloat found = hbao_scan(inv_depth, &receiver, &pattern, group.radius, params);
        occluded = v_select(occluded, found, group.alike);
        if (SSGI_LANES == 1) {
            break; // a receiver is in one group
        }
    }
    ssgi_store_ao(occluded, &receiver, params, visibility, size, &item);
}
