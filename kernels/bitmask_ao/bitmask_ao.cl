// SPDX-License-Identifier: MIT
// bitmask_ao: ambient occlusion from 32 sectors of each slice, which surfaces of some thickness
// cover, so that light passes behind them.
//
// Method:  Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask": a tap
//          covers the sectors from its own angle to that of a point `thickness` behind it.
// Departs: sectors are equal parts of the cosine-weighted measure of the slice, so that the share
//          of covered sectors tends to GTAO's integral (BITMASK_ANGLE 1: equal angles, slices of
//          equal weight, as published); ends are rounded with a dither, right on average.
// Reads:   near    SLICES_LAYERS x [rows, columns] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][SLICES_COUNT][3 + SLICES_TAPS][16 columns], see common/slices.clh
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), BITMASK_ANGLE (0, 1)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#include "common/slices.clh"

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(BITMASK_ANGLE)
#error "SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS and BITMASK_ANGLE must be defined by the host"
#endif

struct SsgiGathered {
    // The sector, not rounded, of an angle with cosine c and sine s from the line of sight, on the
    // side of sign d: first + d * by_sine s^2 - by_turn (c s + arcsin c); with equal angles
    // first + d * by_turn * angle.
    vfloat first, by_sine, by_turn;
    vfloat share; // of the slice in the sum
    vint covered; // a bit for each sector
    vfloat occluded, whole;
};

#if !BITMASK_ANGLE
// c s + arcsin c for c = cos, s = sin of an angle in [0, pi], absolute error < 1.1e-3, which is
// 1/50 of a sector. Odd in c.
static inline vfloat bitmask_turn(const vfloat c)
{
    const vfloat c2 = c * c;
    vfloat p = v_splat(-0.18065745f); // minimax on [0, 1]
    p = v_fma(p, c2, v_splat(0.16016449f));
    p = v_fma(p, c2, v_splat(-0.41591462f));
    return c * v_fma(p, c2, v_splat(2.00826063f));
}
#endif

static inline void ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                    const SliceParams params, SsgiGathered *gathered)
{
    gathered->covered = v_splat_int(0);
#if BITMASK_ANGLE
    const float per_radian = 10.1859164f; // 32 / pi
    const vfloat g = 1.57079633f - v_acos(slice->sin_normal);
    gathered->first = v_fma(g, v_splat(-per_radian), slice->dither + 16.0f);
    gathered->by_sine = v_splat(0.0f);
    gathered->by_turn = v_splat(per_radian);
    gathered->share = slice->weight;
#else
    // From the line of sight to the tangent plane of either side there are
    // (s^2 cos g +- (pi / 2 -+ turn) sin g) / 2, with the turn of the first side's edge.
    const vfloat sine = v_rsqrt_quick(v_fma(slice->edge, slice->edge, v_splat(1.0f)));
    const vfloat turn = bitmask_turn(slice->edge * sine);
    const vfloat both = sine * sine * slice->cos_normal;
    const vfloat whole = v_fma(-turn, slice->sin_normal, both);
    const vfloat second = 0.5f * v_fma(-(1.57079633f + turn), slice->sin_normal, both);
    const vfloat scale = 16.0f / whole;
    gathered->by_sine = slice->cos_normal * scale;
    gathered->by_turn = slice->sin_normal * scale;
    gathered->first = slice->dither +
                      v_fma(second, 2.0f * scale, gathered->by_turn * 1.57079633f);
    gathered->share = slice->weight * slice->projected * whole;
#endif
}

// The first sector beyond a cotangent on a side, 0 to 32.
static inline vint bitmask_sector(const SsgiGathered *gathered, const vfloat cot, const int side)
{
    const vfloat sine = v_rsqrt_quick(v_fma(cot, cot, v_splat(1.0f)));
    const float sign = side == 0 ? 1.0f : -1.0f;
#if BITMASK_ANGLE
    const vfloat at = v_fma(v_acos(cot * sine), sign * gathered->by_turn, gathered->first);
#else
    const vfloat flat = v_fma(sine * sine, sign * gathered->by_sine, gathered->first);
    const vfloat at = v_fma(bitmask_turn(cot * sine), -gathered->by_turn, flat);
#endif
    return v_to_int(v_clamp(at, 0.0f, 32.0f));
}

static inline void ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice,
                            const SsgiTap *tap, const int side, const SliceParams params,
                            SsgiGathered *gathered)
{
    // f of the point behind the tap on its line of sight.
    const vfloat scale = ssgi_scale(receiver, tap->f);
    const vfloat f = receiver->perspective != 0.0f
                         ? 1.0f - scale / v_fma(scale, receiver->thick, v_splat(1.0f))
                         : tap->f + receiver->thick;
    const vfloat height = v_fma(f, receiver->facing, tap->along);
    const vint front =
        bitmask_sector(gathered, ssgi_cotangent(receiver, slice, tap, tap->height, side), side);
    const vint back =
        bitmask_sector(gathered, ssgi_cotangent(receiver, slice, tap, height, side), side);
    const vint from = side == 0 ? front : back;
    const vint to = side == 0 ? back : front;
    // Sectors from, ..., to - 1; shifts by 32 are of no account, as then none counts or all do.
    const vint all = v_splat_int(-1);
    const vint mask = (all << from) & v_shift_right(all, 32 - to);
    const vmask counts = tap->counts & v_gt(tap->height, v_splat(0.0f)) & v_ilt(from, to);
    gathered->covered = gathered->covered | (mask & counts);
}

static inline void ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                  const SliceParams params, SsgiGathered *gathered)
{
    const vfloat hidden = v_to_float(v_count_bits(gathered->covered)) * (1.0f / 32.0f);
    gathered->occluded = v_fma(gathered->share, hidden, gathered->occluded);
    gathered->whole = gathered->whole + gathered->share;
}

__kernel void bitmask_ao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                         __global float *restrict openness, const int2 size,
                         const SsgiCamera camera, const SliceParams params)
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
