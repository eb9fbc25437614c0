// SPDX-License-Identifier: MIT
// bitmask_ao: ambient occlusion from 32 sectors of each slice, which the surfaces between taps
// cover, so that light passes behind them.
//
// Method:  Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask": a tap
//          covers the sectors from its own angle to that of a point `thickness` behind it.
// Departs: sectors are equal parts of the cosine-weighted measure of the slice, so that the share
//          of covered sectors tends to GTAO's integral (BITMASK_ANGLE 1: equal angles, slices of
//          equal weight, as published); ends are rounded with a dither, right on average.
//          With BITMASK_JOINED neighbouring taps of a layer are ends of one surface where the depth
//          between them goes on as before the first or behind the second, or bends from the one to
//          the other; 1 / depth is linear along a plane's image, so that takes three slopes. The
//          surface covers what lies between its ends, cut off exactly at the radius; only a tap
//          that is joined to none before it has a thickness: the same for all, or that of its
//          pixel (SLICES_THICKNESS), no farther than the next layer (SLICES_NEXT).
// Reads:   near    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), BITMASK_ANGLE, BITMASK_JOINED,
//          SLICES_THICKNESS, SLICES_NEXT (0, 1)
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS reads per pixel

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(BITMASK_ANGLE) || !defined(BITMASK_JOINED) || !defined(SLICES_THICKNESS) ||           \
    !defined(SLICES_NEXT)
#error "SLICES_COUNT, _TAPS, _LAYERS, _THICKNESS, _NEXT, BITMASK_ANGLE, _JOINED must be defined"
#endif

#define SSGI_SCAN_BY_LAYER
#include "common/slices.clh"

// A tap, or the receiver, as the end of a surface.
typedef struct {
    vfloat f, outside; // see SsgiTap
    vint sector;       // its own
    vfloat x, y;       // offset, slope
    vmask there;
    bool high, inside; // is any lane's above the tangent plane, within the radius?
#if SLICES_THICKNESS || SLICES_NEXT
    vfloat behind;     // see SsgiTap
#endif
} BitmaskEnd;

// Change of f per px between two ends; empty (least > most) where an end is missing.
typedef struct {
    vfloat least, most;
    float per_px; // 1 / px between them
} BitmaskSlope;

typedef struct {
    // The sector, not rounded, of an angle with cosine c and sine s from the line of sight, on the
    // side of sign d: first + d * by_sine s^2 - by_turn (c s + arcsin c); with equal angles
    // first + d * by_turn * angle.
    vfloat first, by_sine, by_turn;
    vfloat share; // of the slice in the sum
    vint covered; // a bit for each sector
#if BITMASK_JOINED
    BitmaskEnd before, last;    // the two newest taps
    BitmaskSlope reached, link; // to `before`, from there to `last`
    bool tapped;                // is `last` a tap, not the receiver?
#endif
    vfloat occluded, whole;
} SsgiGathered;

#if !BITMASK_ANGLE
// c s + arcsin c for c = cos, s = sin of an angle in [0, pi], absolute error < 1.1e-3, which is
// 1/50 of a sector. Odd in c.
SSGI_INLINE vfloat bitmask_turn(const vfloat c)
{
    const vfloat c2 = c * c;
    vfloat p = v_splat(-0.18065745f); // minimax on [0, 1]
    p = v_fma(p, c2, v_splat(0.16016449f));
    p = v_fma(p, c2, v_splat(-0.41591462f));
    return c * v_fma(p, c2, v_splat(2.00826063f));
}
#endif

SSGI_INLINE void
ssgi_begin_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
                 SsgiGathered *gathered)
{
    gathered->covered = v_splat_int(0);
#if BITMASK_ANGLE
    const float per_radian = 10.1859164f; // 32 / pi
    const vfloat g = 1.57079633f - v_acos(slice->sin_normal);
    gathered->first = v_fma(g, v_splat(-per_radian), v_splat(slice->dither + 16.0f));
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
SSGI_INLINE vint bitmask_sector(const SsgiGathered *gathered, const vfloat cot, const int side)
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

// Cover the sectors between two ends, in whichever order.
SSGI_INLINE void bitmask_cover(SsgiGathered *gathered, const vint one, const vint other,
                               const vmask where)
{
    const vint from = v_imin(one, other);
    const vint to = v_imax(one, other);
    // Sectors from, ..., to - 1; shifts by 32 are of no account, as then none counts or all do.
    const vint all = v_splat_int(-1);
    const vint mask = (all << from) & v_shift_right(all, 32 - to);
    gathered->covered = gathered->covered | (mask & where & v_ilt(from, to));
}

#if BITMASK_JOINED

SSGI_INLINE BitmaskSlope bitmask_no_slope(void)
{
    BitmaskSlope slope;
    slope.least = v_splat(INFINITY);
    slope.most = v_splat(-INFINITY);
    slope.per_px = 1.0f;
    return slope;
}

SSGI_INLINE void
ssgi_begin_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
                const int layer, const SliceParams params, SsgiGathered *gathered)
{
    // The receiver, whose surface goes on as its tangent plane, begins the front layer.
    BitmaskEnd *last = &gathered->last;
    last->f = v_splat(0.0f);
    last->outside = -(receiver->radius * receiver->radius);
    last->sector = v_splat_int(side == 0 ? 32 : 0);
    last->x = last->y = v_splat(0.0f);
    last->there = layer == 0 ? receiver->active : v_splat_int(0);
    last->high = false;
    last->inside = layer == 0;
    gathered->link = bitmask_no_slope();
    if (layer == 0) {
        gathered->link.least = gathered->link.most = side == 0 ? slice->rise : -slice->rise;
    }
    gathered->before = *last;
    gathered->before.there = v_splat_int(0);
    gathered->reached = bitmask_no_slope();
    gathered->tapped = false;
}

// The first sector beyond a point at an offset.
SSGI_INLINE vint bitmask_sector_at(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                   const SsgiGathered *gathered, const vfloat f, const vfloat x,
                                   const vfloat y, const int side)
{
    const vfloat cross = v_fma(receiver->x, y, -(receiver->y * x));
    const vfloat square = v_fma(x, x, v_fma(y, y, v_splat(SLICES_TINY)));
    const vfloat inverse = v_rsqrt_quick(v_fma(cross, cross, square));
    const vfloat height = ssgi_height(receiver, f, v_fma(receiver->nx, x, receiver->ny * y));
    return bitmask_sector(gathered, ssgi_cotangent(receiver, slice, inverse, height, side), side);
}

// Cover what a surface between two ends hides, one of which lies beyond the radius.
SSGI_INLINE void bitmask_cover_cut(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                   const BitmaskEnd *one, const BitmaskEnd *other,
                                   const int side, const vmask where, SsgiGathered *gathered)
{
    const vfloat zero = v_splat(0.0f);
    // Along it `outside` is quadratic in the part t of the way: second t^2 + first t + one's.
    const vfloat dx = other->x - one->x;
    const vfloat dy = other->y - one->y;
    const vfloat df = other->f - one->f;
    const vfloat dq = v_fma(receiver->x, dx, receiver->y * dy);
    const vfloat second =
        v_fma(df, v_fma(df, receiver->bend, dq + dq), v_fma(dx, dx, dy * dy));
    const vfloat first = other->outside - one->outside - second;
    const vfloat root =
        v_sqrt(v_max(v_fma(first, first, -4.0f * second * one->outside), zero));
    const vmask leaves = v_gt(other->outside, zero);
    const vfloat below = v_select(root, -root, leaves) - first;
    const vfloat t = v_clamp(2.0f * one->outside / v_select(below, v_splat(-SLICES_TINY),
                                                            v_eq(below, zero)),
                             0.0f, 1.0f);
    const vint at = bitmask_sector_at(receiver, slice, gathered, v_fma(t, df, one->f),
                                      v_fma(t, dx, one->x), v_fma(t, dy, one->y), side);
    bitmask_cover(gathered, v_iselect(other->sector, one->sector, leaves), at, where);
}

// Cover what the two newest taps hide, now that the slope behind them is known: the surface between
// them, or if there is none the thickness of the last.
SSGI_INLINE void bitmask_decide(const SsgiReceiver *receiver, const SsgiSlice *slice,
                                const BitmaskSlope *behind, const int side,
                                const SliceParams params, SsgiGathered *gathered)
{
    const BitmaskEnd *before = &gathered->before, *last = &gathered->last;
    const BitmaskSlope *link = &gathered->link;
    if (!gathered->tapped || !(before->high || last->high) || !(before->inside || last->inside)) {
        return;
    }
    const vfloat scales = ssgi_scale(receiver, before->f) * ssgi_scale(receiver, last->f);
    const vfloat slack = receiver->radius * scales * (params.slack * link->per_px);
    const vfloat least = v_min(gathered->reached.least, behind->least) - slack;
    const vfloat most = v_max(gathered->reached.most, behind->most) + slack;
    const vmask joined = v_le(least, link->least) & v_le(link->most, most) & before->there &
                         last->there;
    const vmask near = v_le(before->outside, v_splat(0.0f));
    const vmask far = v_le(last->outside, v_splat(0.0f));
    bitmask_cover(gathered, before->sector, last->sector, joined & near & far);
    const vmask cut = joined & (near ^ far);
    if (v_any(cut)) {
        bitmask_cover_cut(receiver, slice, before, last, side, cut, gathered);
    }
    const vmask alone = last->there & far & ~joined;
    if (v_any(alone)) {
#if SLICES_THICKNESS || SLICES_NEXT
        const vfloat behind_it = last->behind;
#else
        const vfloat behind_it = ssgi_behind(receiver, last->f, receiver->thick);
#endif
        const vint back =
            bitmask_sector_at(receiver, slice, gathered, behind_it, last->x, last->y, side);
        bitmask_cover(gathered, last->sector, back, alone);
    }
}

SSGI_INLINE void
ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice, const SsgiTap *tap, const int side,
         const SliceParams params, SsgiGathered *gathered)
{
    BitmaskSlope behind = bitmask_no_slope();
    behind.per_px = tap->per_px;
    const vmask both = tap->there & gathered->last.there;
    const vfloat slope = (tap->f - gathered->last.f) * behind.per_px;
    behind.least = v_select(behind.least, slope, both);
    behind.most = v_select(behind.most, slope, both);
    bitmask_decide(receiver, slice, &behind, side, params, gathered);
    gathered->tapped = true;
    gathered->before = gathered->last;
    gathered->reached = gathered->link;
    gathered->link = behind;
    BitmaskEnd *last = &gathered->last;
    last->f = tap->f;
    last->outside = tap->outside;
#if SLICES_THICKNESS || SLICES_NEXT
    last->behind = tap->behind;
#endif
    last->x = v_splat(tap->x);
    last->y = v_splat(tap->y);
    last->there = tap->there;
    last->sector = v_splat_int(side == 0 ? 32 : 0);
    const vmask rises = tap->there & v_gt(tap->height, v_splat(0.0f));
    last->high = v_any(rises);
    last->inside = v_any(tap->there & tap->counts);
    if (last->high && last->inside) {
        const vfloat cot = ssgi_cotangent(receiver, slice, tap->inverse, tap->height, side);
        last->sector = bitmask_sector(gathered, cot, side);
    }
}

SSGI_INLINE void
ssgi_end_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
              const SliceParams params, SsgiGathered *gathered)
{
    const BitmaskSlope behind = bitmask_no_slope();
    bitmask_decide(receiver, slice, &behind, side, params, gathered);
}

#else

SSGI_INLINE void
ssgi_begin_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
                const int layer, const SliceParams params, SsgiGathered *gathered)
{
}

SSGI_INLINE void
ssgi_see(const SsgiReceiver *receiver, const SsgiSlice *slice, const SsgiTap *tap, const int side,
         const SliceParams params, SsgiGathered *gathered)
{
#if SLICES_THICKNESS || SLICES_NEXT
    const vfloat behind = tap->behind;
#else
    const vfloat behind = ssgi_behind(receiver, tap->f, receiver->thick);
#endif
    const vfloat height = v_fma(behind, receiver->facing, tap->along);
    const vfloat front = ssgi_cotangent(receiver, slice, tap->inverse, tap->height, side);
    const vfloat back = ssgi_cotangent(receiver, slice, tap->inverse, height, side);
    bitmask_cover(gathered, bitmask_sector(gathered, front, side),
                  bitmask_sector(gathered, back, side),
                  tap->counts & v_gt(tap->height, v_splat(0.0f)));
}

SSGI_INLINE void
ssgi_end_side(const SsgiReceiver *receiver, const SsgiSlice *slice, const int side,
              const SliceParams params, SsgiGathered *gathered)
{
}

#endif

SSGI_INLINE void
ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
               SsgiGathered *gathered)
{
    const vfloat hidden = v_to_float(v_count_bits(gathered->covered)) * (1.0f / 32.0f);
    gathered->occluded = v_fma(gathered->share, hidden, gathered->occluded);
    gathered->whole = gathered->whole + gathered->share;
}

#include "common/scan.clh"

__kernel void bitmask_ao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                         __global float *restrict openness, const int2 size,
                         const SsgiCamera camera, const SliceParams params)
{
    ssgi_occlude(near, normal, table, openness, size, camera, params);
}
