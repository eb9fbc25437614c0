// SPDX-License-Identifier: MIT
// hbao: ambient occlusion from the horizons of directions, all of the hemisphere weighing the same.
//
// Method:  Bavoil and Sainz 2008, "Image-Space Horizon-Based Ambient Occlusion". From the tangent
//          plane's elevation t plus a bias, each tap outwards that raises the horizon h to s adds
//          W (sin s - sin h), W = 1 - attenuation r^2, r the distance in radii.
// Departs: elevations are above the plane across the line of sight, not the image plane, so that
//          A is right off the axis too; directions weigh by the azimuth that they stand for; the
//          sum is over what they could hide, which makes good the bias.
// Reads:   near    SLICES_LAYERS x [rows, columns] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][SLICES_COUNT][3 + SLICES_TAPS][16 columns], see common/slices.clh
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT (pairs of directions), SLICES_TAPS, SLICES_LAYERS (>= 1),
//          HBAO_ATTENUATION (0, 1)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#include "common/slices.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(HBAO_ATTENUATION)
#error "SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS and HBAO_ATTENUATION must be defined by the host"
#endif

struct SsgiGathered {
    vfloat horizon[2]; // sine of the elevation
    vfloat hidden;     // by this slice
    vfloat could_hide;
    vfloat occluded, whole;
};

static inline void ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                    const SliceParams params, SsgiGathered *gathered)
{
    const vfloat one = v_splat(1.0f);
    const vfloat cosine = v_rsqrt_quick(v_fma(slice->edge, slice->edge, one));
    const vfloat sine = slice->edge * cosine;
    gathered->hidden = gathered->could_hide = v_splat(0.0f);
    for (int side = 0; side < 2; ++side) {
        const vfloat tangent = side == 0 ? sine : -sine;
        const vfloat raised = v_fma(tangent, v_splat(params.bias_cos), cosine * params.bias_sin);
        gathered->horizon[side] =
            v_select(raised, one, v_gt(tangent, v_splat(params.bias_cos)));
        gathered->could_hide = gathered->could_hide + (one - gathered->horizon[side]);
    }
}

static inline void ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice,
                            const SsgiTap *tap, const int side, const SliceParams params,
                            SsgiGathered *gathered)
{
    const vfloat cot = ssgi_cotangent(receiver, slice, tap, tap->height, side);
    const vfloat sine = cot * v_rsqrt_quick(v_fma(cot, cot, v_splat(1.0f)));
    const vfloat before = gathered->horizon[side];
    const vmask raises = tap->counts & v_gt(tap->height, v_splat(0.0f)) & v_gt(sine, before);
    vfloat gain = sine - before;
#if HBAO_ATTENUATION
    gain = gain *
           v_fma(ssgi_squared_radii(receiver, tap), v_splat(-params.attenuation), v_splat(1.0f));
#endif
    gathered->hidden = gathered->hidden + v_select(v_splat(0.0f), gain, raises);
    gathered->horizon[side] = v_select(before, sine, raises);
}

static inline void ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                  const SliceParams params, SsgiGathered *gathered)
{
    gathered->occluded = v_fma(slice->weight, gathered->hidden, gathered->occluded);
    gathered->whole = v_fma(slice->weight, gathered->could_hide, gathered->whole);
}

__kernel void hbao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                   __global float *restrict openness, const int2 size, const SsgiCamera camera,
                   const SliceParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = ssgi_whole(size, params);
    const SsgiReceiver receiver = ssgi_receiver(near, normal, whole, x + params.margin_left,
                                                y + params.margin_top, camera, params);
    SsgiGathered gathered;
    gathered.occluded = v_splat(0.0f);
    gathered.whole = v_splat(SLICES_TINY);
    if (v_any(receiver.active)) {
        ssgi_scan(near, table + ssgi_slice_table(x, y), whole, &receiver, params, &gathered);
    }
    ssgi_store_openness(gathered.occluded / gathered.whole, &receiver, params, openness, size, x,
                        y);
}
