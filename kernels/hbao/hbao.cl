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
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT (pairs of directions), SLICES_TAPS, SLICES_LAYERS (>= 1),
//          HBAO_ATTENUATION, HBAO_BIAS (0, 1)
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#include "common/slices.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(HBAO_ATTENUATION) || !defined(HBAO_BIAS)
#error "SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS, HBAO_ATTENUATION and HBAO_BIAS must be defined"
#endif

typedef struct {
    vfloat rise;    // of the horizon above the tangent plane: cotangent per steepness
    vfloat horizon; // sine of the elevation
    vfloat hidden;  // by this slice
    vfloat could_hide;
    vfloat occluded, whole;
} SsgiGathered;

SSGI_INLINE void
ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
                 SsgiGathered *gathered)
{
    gathered->hidden = gathered->could_hide = v_splat(0.0f);
}

SSGI_INLINE void
ssgi_begin_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
                const int layer, const SliceParams params, SsgiGathered *gathered)
{
    const vfloat one = v_splat(1.0f);
    const vfloat edge = side == 0 ? slice->edge : -slice->edge;
    const vfloat cosine = v_rsqrt_quick(v_fma(edge, edge, one));
    const vfloat tangent = edge * cosine;
#if HBAO_BIAS
    const vfloat raised = v_fma(tangent, v_splat(params.bias_cos), cosine * params.bias_sin);
    const vfloat raised_cosine = v_fma(cosine, v_splat(params.bias_cos),
                                       tangent * -params.bias_sin);
    const vmask upright = v_gt(tangent, v_splat(params.bias_cos));
    gathered->horizon = v_select(raised, one, upright);
    // sin bias / (cos tangent cos raised) is how much the cotangent grows by the bias.
    const vfloat grown = params.bias_sin / (cosine * v_max(raised_cosine, v_splat(1e-6f)));
    gathered->rise = v_select(grown / receiver->steepness, v_splat(INFINITY), upright);
#else
    gathered->horizon = tangent;
    gathered->rise = v_splat(0.0f);
#endif
    gathered->could_hide = gathered->could_hide + (one - gathered->horizon);
}

SSGI_INLINE void
ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice, const SsgiTap *tap, const int side,
         const SliceParams params, SsgiGathered *gathered)
{
    const vfloat rise = tap->height * tap->inverse;
    const vmask raises = tap->counts & v_gt(rise, gathered->rise);
    if (!v_any(raises)) {
        return;
    }
    const vfloat cot = ssgi_cotangent(receiver, slice, tap->inverse, tap->height, side);
    const vfloat sine = cot * v_rsqrt_quick(v_fma(cot, cot, v_splat(1.0f)));
    vfloat gain = v_max(sine - gathered->horizon, v_splat(0.0f));
#if HBAO_ATTENUATION
    gain = gain *
           v_fma(ssgi_squared_radii(receiver, tap), v_splat(-params.attenuation), v_splat(1.0f));
#endif
    gathered->hidden = gathered->hidden + v_select(v_splat(0.0f), gain, raises);
    gathered->horizon = v_select(gathered->horizon, v_max(sine, gathered->horizon), raises);
    gathered->rise = v_select(gathered->rise, rise, raises);
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
                   __global float *restrict openness, const int2 size, const SsgiCamera camera,
                   const SliceParams params)
{
    ssgi_occlude(near, normal, table, openness, size, camera, params);
}
