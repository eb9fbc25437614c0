// SPDX-License-Identifier: MIT
// hbao: ambient occlusion from the horizons of directions, all of the hemisphere weighing the same.
//
// Method:  Bavoil and Sainz 2008, "Image-Space Horizon-Based Ambient Occlusion". From the tangent
//          plane's elevation t plus a bias, each tap outwards that raises the horizon h to s adds
//          W (sin s - sin h), W = 1 - attenuation r^2, r the distance in radii.
// Departs: elevations are above the plane across the line of sight, not the image plane, so that
//          A is right off the axis too; directions weigh by the azimuth that they stand for; the
//          sum is over what they could hide, which makes good the bias.
// Reads:   near    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
//          tiles   bits of tiles/open.clh, tile_columns a row; none if that is 0
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT (pairs of directions), SLICES_TAPS, SLICES_LAYERS (>= 1),
//          HBAO_ATTENUATION, HBAO_BIAS (0, 1)
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel. With 3 slices of 6 taps,
//          an eighth is the receiver's, a quarter the slices', the rest the taps' arithmetic
// Tried:   no branch: 1.2 times as long. A branch for each side, or one for two steps; taps
//          unrolled, loaded a step ahead, or first kept and then looked at; offsets of all slices,
//          or of the next one, before the first tap: no gain

#define SSGI_SCAN_TILES 1
#define SSGI_SCAN_PAIRS
#include "common/slices.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(HBAO_ATTENUATION) || !defined(HBAO_BIAS)
#error "SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS, HBAO_ATTENUATION and HBAO_BIAS must be defined"
#endif

typedef struct {
    vfloat rise[2];    // by side, of the horizon above the tangent plane, see SsgiTap
    vfloat horizon[2]; // sine of its elevation
    vfloat hidden;     // by this slice
    vfloat could_hide;
    vfloat fade;               // change of W per SsgiTap.outside over scale^2
    vfloat occluded, whole;
} SsgiGathered;

SSGI_INLINE void
ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
                 SsgiGathered *gathered)
{
    gathered->hidden = gathered->could_hide = v_splat(0.0f);
    gathered->fade = v_splat(-params.attenuation) / (receiver->radius * receiver->radius);
}

SSGI_INLINE void
ssgi_begin_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
                const int layer, const SliceParams params, SsgiGathered *gathered)
{
    const vfloat one = v_splat(1.0f);
    // The tangent plane is at a right angle to the projected normal.
    const vfloat tangent = side == 0 ? -slice->sin_normal : slice->sin_normal;
#if HBAO_BIAS
    const vfloat cosine = slice->cos_normal;
    const vfloat raised = v_fma(tangent, v_splat(params.bias_cos), cosine * params.bias_sin);
    const vfloat raised_cosine = v_fma(cosine, v_splat(params.bias_cos),
                                       tangent * -params.bias_sin);
    const vmask upright = v_gt(tangent, v_splat(params.bias_cos));
    gathered->horizon[side] = v_select(raised, one, upright);
    // sin bias / (cos tangent cos raised) is how much the cotangent grows by the bias.
    const vfloat grown = params.bias_sin / (cosine * v_max(raised_cosine, v_splat(1e-6f)));
    gathered->rise[side] = v_select(grown / slice->steepness, v_splat(INFINITY), upright);
#else
    gathered->horizon[side] = tangent;
    gathered->rise[side] = v_splat(0.0f);
#endif
    gathered->could_hide = gathered->could_hide + (one - gathered->horizon[side]);
}

SSGI_INLINE void
ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice, const SsgiTap taps[2],
         const SliceParams params, SsgiGathered *gathered)
{
    vmask raises[2];
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        raises[side] = taps[side].counts & v_gt(taps[side].rise, gathered->rise[side]);
    }
    // Most taps raise no horizon: without the branch all takes a quarter longer.
    if (!v_any(raises[0] | raises[1])) {
        return;
    }
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        const SsgiTap *tap = &taps[side];
        const vfloat edge = side == 0 ? slice->edge : -slice->edge;
        const vfloat cot =
            v_min(v_fma(tap->rise, slice->steepness, edge), v_splat(SLICES_STEEPEST));
        const vfloat square = v_fma(cot, cot, v_splat(1.0f));
#if HBAO_ATTENUATION
        // W and the sine from one root; a division for W alone takes as long as all of this.
        const vfloat scale = ssgi_scale(receiver, tap->f);
        const vfloat root = v_rsqrt_quick(square * (scale * scale));
        const vfloat sine = root * (cot * scale);
        const vfloat per_scale = (root * root) * square; // 1 / scale^2
        const vfloat weight = v_fma(tap->outside * gathered->fade, per_scale,
                                    v_splat(1.0f - params.attenuation));
        const vfloat hides = v_fma(weight, sine - gathered->horizon[side], gathered->hidden);
#else
        const vfloat sine = cot * v_rsqrt_quick(square);
        const vfloat hides = gathered->hidden + (sine - gathered->horizon[side]);
#endif
        gathered->hidden = v_select(gathered->hidden, hides, raises[side]);
        gathered->horizon[side] = v_select(gathered->horizon[side], sine, raises[side]);
        gathered->rise[side] = v_select(gathered->rise[side], tap->rise, raises[side]);
    }
}

SSGI_INLINE void
ssgi_end_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
              const SliceParams params, SsgiGathered *gathered)
{
}

SSGI_INLINE void
ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
               SsgiGathered *gathered)
{
    gathered->occluded = v_fma(slice->weight, gathered->hidden, gathered->occluded);
    gathered->whole = v_fma(slice->weight, gathered->could_hide, gathered->whole);
}

#include "common/scan.clh"

__kernel void hbao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                   ssgi_optional __global const int *restrict tiles,
                   __global float *restrict openness,
                   const int2 size, const SsgiCamera camera, const SliceParams params)
{
    ssgi_occlude(near, normal, table, tiles, openness, size, camera, params);
}
