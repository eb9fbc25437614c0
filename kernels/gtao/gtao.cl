// SPDX-License-Identifier: MIT
// gtao: cosine-weighted ambient occlusion from the highest horizon on both sides of slices.
//
// Method:  Jimenez et al. 2016, "Practical Realtime Strategies for Accurate Indirect Occlusion":
//          a slice sees |n_p| (a(h0) + a(h1)) with a(h) = (cos g + 2 h sin g - cos(2 h - g)) / 4.
// Departs: a horizon is measured from the tangent plane, so that planes are open at any tilt; the
//          sum is over what the same slices would see if nothing occluded, so that A is 1 there;
//          slices are weighted by the azimuth they stand for. With GTAO_FALLOFF a horizon moves
//          towards the tangent plane with distance, as in XeGTAO (Intel 2021).
// Reads:   near    SLICES_LAYERS x [rows, columns] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][SLICES_COUNT][3 + SLICES_TAPS][16 columns], see common/slices.clh
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), GTAO_FALLOFF (0, 1)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#include "common/slices.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(GTAO_FALLOFF)
#error "SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS and GTAO_FALLOFF must be defined by the host"
#endif

struct SsgiGathered {
    vfloat rise[2]; // of the horizon above the tangent plane: cotangent, or with falloff cosine
    vfloat occluded, whole;
};

static inline void ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                    const SliceParams params, SsgiGathered *gathered)
{
    gathered->rise[0] = gathered->rise[1] = v_splat(0.0f);
}

#if GTAO_FALLOFF
// Cosine of an angle from the line of sight.
static inline vfloat gtao_cosine(const vfloat cot)
{
    return cot * v_rsqrt_quick(v_fma(cot, cot, v_splat(1.0f)));
}
#endif

static inline void ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice,
                            const SsgiTap *tap, const int side, const SliceParams params,
                            SsgiGathered *gathered)
{
    const vfloat zero = v_splat(0.0f);
#if GTAO_FALLOFF
    const vfloat edge = side == 0 ? slice->edge : -slice->edge;
    const vfloat low = gtao_cosine(edge);
    const vfloat scale = ssgi_scale(receiver, tap->f);
    const vfloat depth = tap->f / (receiver->radius * scale);
    const vfloat distance = v_sqrt(
        v_fma(depth * depth, v_splat(params.thin), ssgi_squared_radii(receiver, tap)));
    const vfloat weight = v_clamp((1.0f - distance) * params.falloff_scale, 0.0f, 1.0f);
    const vfloat top = gtao_cosine(ssgi_cotangent(receiver, slice, tap, tap->height, side));
    const vfloat rise = (top - low) * weight;
#else
    const vfloat rise = tap->height * tap->inverse;
#endif
    gathered->rise[side] =
        v_max(gathered->rise[side], v_select(zero, rise, tap->counts));
}

// a of the angle that has this cosine and sine, g being towards the side.
static inline vfloat gtao_integral(const vfloat cosine, const vfloat sine, const vfloat cos_normal,
                                   const vfloat sin_normal)
{
    const vfloat turned = v_fma(-cosine, sine, v_acos(cosine));
    return 0.5f * v_fma(sine * sine, cos_normal, turned * sin_normal);
}

static inline void ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                  const SliceParams params, SsgiGathered *gathered)
{
    const vfloat zero = v_splat(0.0f);
    const vfloat one = v_splat(1.0f);
    vfloat hidden = zero;
    for (int side = 0; side < 2; ++side) {
        const vfloat rise = gathered->rise[side];
        const vmask rises = v_gt(rise, zero);
        if (!v_any(rises)) {
            continue;
        }
        const vfloat edge = side == 0 ? slice->edge : -slice->edge;
        const vfloat sin_normal = side == 0 ? slice->sin_normal : -slice->sin_normal;
        const vfloat sine = v_rsqrt(v_fma(edge, edge, one));
        const vfloat open = gtao_integral(edge * sine, sine, slice->cos_normal, sin_normal);
#if GTAO_FALLOFF
        const vfloat cosine = v_fma(edge, sine, rise);
        const vfloat horizon_sine = v_sqrt(v_max(v_fma(-cosine, cosine, one), zero));
#else
        const vfloat cot = edge + v_min(rise * receiver->steepness, v_splat(SLICES_STEEPEST));
        const vfloat horizon_sine = v_rsqrt(v_fma(cot, cot, one));
        const vfloat cosine = cot * horizon_sine;
#endif
        const vfloat seen = gtao_integral(cosine, horizon_sine, slice->cos_normal, sin_normal);
        hidden = hidden + v_select(zero, open - seen, rises);
    }
    // a of both edges together is cos g + g sin g.
    const vfloat g = 1.57079633f - v_acos(slice->sin_normal);
    const vfloat whole = v_fma(g, slice->sin_normal, slice->cos_normal);
    const vfloat weight = slice->weight * slice->projected;
    gathered->occluded = v_fma(weight, hidden, gathered->occluded);
    gathered->whole = v_fma(weight, whole, gathered->whole);
}

__kernel void gtao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
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
