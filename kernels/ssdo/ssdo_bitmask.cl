// SPDX-License-Identifier: MIT
// ssdo_bitmask: ambient occlusion, the sky's light through the unoccluded directions, and one
// diffuse bounce of light from the others, in one scan of slices with 32 sectors each.
//
// Method:  Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
// Departs: sectors are equal parts of the cosine-weighted measure (see bitmask_ao), so the weight
//          of a sender is the number of sectors that it covers: irradiance is pi times the mean
//          over the measure of the radiance that arrives. There is no area of a sender, no distance
//          and no clamp to choose, and within a furnace of radiance L it is pi L (1 - A). A tap is
//          a piece of its tangent plane (see pieces.clh), so surfaces have no thickness unless the
//          parameter says so. The first piece outward to cover a sector lights it, whatever its
//          layer. Taps are distributed over the part of a side within the arrays. A receiver that
//          sees a surface's side averted from the camera gets `back` of the radiance of the other
//          side, or with BITMASK_BACKS the radiance of that side in `sent`.
// Sky:     The unoccluded part of each of BITMASK_CONES equal steps of the sine from the normal is
//          lit by the direction in its middle, from a map that is filtered to the width of a step.
// Bent:    Occluded directions are looked up in BITMASK_BENT cones likewise, see bend.clh.
// Reads:   inv_depth    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_inv_depth
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
//          slopes  2 SLICES_LAYERS x likewise, from slices_slopes
//          sky     [SKY_SIZE][SKY_SIZE][3] radiance by octahedral direction, see sky.clh
//          sent    3 SLICES_LAYERS x [rows, 4 stride] from slices_sorted: senders' radiance,
//                  W m^-2 sr^-1; with BITMASK_BACKS as many more for their backs
//          sides   SLICES_LAYERS x likewise, see ssdo/ssdo_sides.cl (BITMASK_SIDES 1)
// Writes:  light   images [rows, columns] without margin: A in [0, 1], 1 where nothing is; with
//                  BITMASK_BENT 3 of the bend of the normal, view space; with BITMASK_CONES 3 of
//                  irradiance by the sky, W/m^2, and with BITMASK_BOUNCE 3 of irradiance by the
//                  bounce; 0 where nothing is
//          kept    2 SLICES_COUNT x [rows, columns] without margin, with BITMASK_KEPT: a bit for
//                  each sector that is covered, and behind them one for each of those through which
//                  the receiver sees the unknown side of a surface; 0 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), SLICES_THICKNESS, SLICES_NEXT,
//          BITMASK_THICK, BITMASK_BOUNCE, BITMASK_BACKS, BITMASK_KEPT, BITMASK_SIDES (0, 1),
//          BITMASK_CONES, BITMASK_BENT (0 to 16), SKY_SIZE (>= 1)
//          SLICES_CHECKERBOARD (0, 1): pixels of even row + column alone
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * SLICES_TAPS * SLICES_LAYERS times 3 reads per pixel, with
//          BITMASK_BOUNCE 3 to 6 more where a tap covers something, with BITMASK_SIDES 1 more

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(SLICES_THICKNESS) || !defined(SLICES_NEXT) || !defined(BITMASK_THICK) ||              \
    !defined(BITMASK_BOUNCE) || !defined(BITMASK_BACKS) || !defined(BITMASK_KEPT) ||               \
    !defined(BITMASK_SIDES) || !defined(BITMASK_CONES) || !defined(BITMASK_BENT) ||                \
    !defined(SKY_SIZE)
#error "the macros SLICES_*, BITMASK_* and SKY_SIZE of the header must be defined by the host"
#endif

// Arguments of the scan beside depth; the struct SsdoBitmaskParams is generated from
// ssgi_cl.techniques.ssdo.ssdo_bitmask.
typedef struct {
    __global const float *slopes;
    __global const float *sent;
    __global const float *sides;
    __global const float *sky;
    __global int *kept;
    SsdoBitmaskParams params;
} SsdoGiven;

#define BITMASK_ANGLE 0
#define SSDO_FIRST_SKY (1 + 3 * (BITMASK_BENT > 0)) // image
#define SSDO_FIRST_BOUNCE (SSDO_FIRST_SKY + 3 * (BITMASK_CONES > 0))
#define SSDO_IMAGES (SSDO_FIRST_BOUNCE + 3 * BITMASK_BOUNCE)
// Whether covered sectors are marked whose sender is seen from behind and sends only `back`.
#define SSDO_DARK (BITMASK_KEPT * BITMASK_BOUNCE * (1 - BITMASK_BACKS))

#include "common/scan.clh"
#include "ssdo/bend.clh"
#include "ssdo/pieces.clh"
#include "ssdo/sky.clh"

// Find the pieces of a slice and cover their sectors: one side after the other, each from near to
// far, of each tap the layers from front to back.
SSGI_INLINE void ssdo_slice(ssgi_plane inv_depth, const SsgiReceiver *receiver,
                            const SsdoGiven *given, const SsgiPattern *pattern, SsgiSlice *slice,
                            const SliceParams params, Pieces *pieces)
{
    pieces_begin(receiver, slice, pieces);
    SsgiReceiver sided = *receiver;
    const float span = slice->span;
    int sides = 2;
    if (BITMASK_CONES) { // none of receivers that see only the sky
        sides = v_any(receiver->active) ? 2 : 0;
    }
#pragma unroll 1
    for (int side = 0; side < sides; ++side) {
        slice->span = min(span, ssgi_within(receiver, slice, pattern->start, side));
        SsgiTaps taps;
        PieceEnds ends;
        piece_taps(receiver, slice, pattern->centre, params, &taps, &ends);
        piece_ask(inv_depth, receiver, given->slopes, &taps, side);
        pieces_begin_side(&sided, pieces);
#pragma unroll 1
        for (int t = 0; t < SLICES_TAPS; ++t) {
            piece_go_on(slice, t, &ends);
#pragma unroll 1
            for (int layer = 0; layer < SLICES_LAYERS; ++layer) {
                const SsgiTap tap = ssgi_tap(inv_depth, &sided, slice, &taps, side, t, layer);
                piece_find(inv_depth, &sided, given, &tap, &ends, side, t, layer, pieces);
                if (SSGI_LANES == 1) {
                    pieces_cover(&sided, slice, given, side, pieces);
                }
            }
        }
        if (SSGI_LANES > 1) {
            pieces_cover(&sided, slice, given, side, pieces);
        }
        ssgi_mirror(&sided);
    }
}

// Scan the slices within this radius (a length): the occluded fraction, the images behind A, and
// with BITMASK_KEPT the bits of each slice.
SSGI_INLINE void ssdo_scan(ssgi_plane inv_depth, const SsgiReceiver *receiver,
                           const SsdoGiven *given, const SsgiPattern *pattern, const float radius,
                           const SliceParams params, vfloat images[SSDO_IMAGES],
                           vint kept[2 * SLICES_COUNT])
{
    vfloat whole = v_splat(SLICES_TINY);
#pragma unroll
    for (int i = 0; i < SSDO_IMAGES; ++i) {
        images[i] = v_splat(0.0f);
    }
#pragma unroll
    for (int s = 0; s < 2 * SLICES_COUNT; ++s) {
        kept[s] = v_splat_int(0);
    }
#pragma unroll 1
    for (int s = 0; s < SLICES_COUNT; ++s) {
        SsgiSlice slice =
            ssgi_slice(receiver, pattern->table + s * SLICES_SIZE, radius, pattern->centre);
        Pieces pieces;
        ssdo_slice(inv_depth, receiver, given, pattern, &slice, params, &pieces);
        const vfloat share = pieces.measure.share;
        const vfloat hidden = v_to_float(v_count_bits(pieces.covered)) * (1.0f / 32.0f);
        images[0] = v_fma(share, hidden, images[0]);
        whole = whole + share;
        const vfloat irradiance = share * (3.14159265f / 32.0f);
        const vint covered = pieces.covered & receiver->active;
        if (BITMASK_CONES) {
            ssdo_sky(receiver, &slice, given, &pieces.measure, ~covered, irradiance,
                     images + SSDO_FIRST_SKY);
        }
        if (BITMASK_BOUNCE) {
            vfloat *bounce = images + SSDO_FIRST_BOUNCE;
#pragma unroll
            for (int c = 0; c < 3; ++c) {
                bounce[c] = v_fma(irradiance, pieces.light[c], bounce[c]);
            }
        }
        if (BITMASK_BENT) {
            ssdo_bend(receiver, &slice, &pieces.measure, covered, share * (1.5f / 32.0f),
                      images + 1);
        }
        if (BITMASK_KEPT) {
            // Arrays that a variable indexes lie in memory.
#pragma unroll
            for (int k = 0; k < SLICES_COUNT; ++k) {
                kept[k] = k == s ? pieces.covered : kept[k];
                kept[SLICES_COUNT + k] = k == s ? pieces.dark : kept[SLICES_COUNT + k];
            }
        }
    }
#pragma unroll
    for (int i = 0; i < SSDO_IMAGES; ++i) {
        images[i] = images[i] / whole;
    }
}

// Write the bits of all slices, as they are.
SSGI_INLINE void ssdo_store_kept(const vint kept[2 * SLICES_COUNT], const SsgiReceiver *receiver,
                                 __global int *images, const int2 size, const SsgiItem *item)
{
#pragma unroll
    for (int s = 0; s < 2 * SLICES_COUNT; ++s) {
        ssgi_store_item(v_from_bits(kept[s] & receiver->active), (__global float *)images, s, size,
                        item);
    }
}

__kernel void
ssdo_bitmask(ssgi_plane inv_depth, ssgi_plane normal, __global const float *restrict table,
             __global const float *restrict slopes,
             ssgi_optional __global const float *restrict sky,
             ssgi_optional __global const float *restrict sent,
             ssgi_optional __global const float *restrict sides, __global float *restrict light,
             ssgi_optional __global int *restrict kept, const int2 size, const SsgiCamera camera,
             const SliceParams params, const SsdoBitmaskParams own)
{
    SsdoGiven given;
    given.slopes = slopes;
    given.sent = sent;
    given.sides = sides;
    given.sky = sky;
    given.kept = kept;
    given.params = own;
    const SsgiItem item = ssgi_item(size);
    if (!item.inside) {
        return;
    }
    const SsgiReceiver receiver =
        ssgi_receiver(inv_depth, normal, size, item.first, item.phase, item.row, camera, params);
    const SsgiPattern pattern = ssgi_pattern(table, &item, camera, params);
    vfloat images[SSDO_IMAGES];
    vint bits[2 * SLICES_COUNT];
#pragma unroll
    for (int i = 0; i < SSDO_IMAGES; ++i) {
        images[i] = v_splat(0.0f);
    }
#pragma unroll
    for (int s = 0; s < 2 * SLICES_COUNT; ++s) {
        bits[s] = v_splat_int(0);
    }
    vmask receivers = receiver.active;
    if (BITMASK_CONES) { // the sky also lights receivers whose radius is below a pixel
        receivers = receiver.there;
    }
    SsgiGroup group = ssgi_groups(receivers);
    while (ssgi_next_group(inv_depth, &receiver, params, &group)) {
        vfloat found[SSDO_IMAGES];
        vint found_bits[2 * SLICES_COUNT];
        ssdo_scan(inv_depth, &receiver, &given, &pattern, group.radius, params, found, found_bits);
#pragma unroll
        for (int i = 0; i < SSDO_IMAGES; ++i) {
            images[i] = v_select(images[i], found[i], group.alike);
        }
        if (BITMASK_KEPT) {
#pragma unroll
            for (int s = 0; s < 2 * SLICES_COUNT; ++s) {
                bits[s] = v_iselect(bits[s], found_bits[s], group.alike);
            }
        }
        if (SSGI_LANES == 1) {
            break; // a receiver is in one group
        }
    }
    ssgi_store_ao(images[0], &receiver, params, light, size, &item);
    for (int i = 1; i < SSDO_IMAGES; ++i) {
        ssgi_store_behind(images[i], v_splat(1.0f), light, i, size, &item);
    }
    if (BITMASK_KEPT) {
        ssdo_store_kept(bits, &receiver, kept, size, &item);
    }
}
