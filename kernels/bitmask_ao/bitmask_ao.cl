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
//          surface covers what lies between its ends, cut off exactly at the radius. A tap of known
//          thickness (SLICES_THICKNESS) covers what of its view ray lies in it and within the
//          radius; of the others only one that is joined to none before it has a thickness, no
//          farther than the next layer (SLICES_NEXT).
// Reads:   inv_depth    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_inv_depth
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
// Writes:  visibility [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), SLICES_DEEPER (1..SLICES_TAPS),
//          SLICES_THICKNESS: layers, from the front, whose thickness follows behind all;
//          BITMASK_ANGLE, BITMASK_JOINED, SLICES_NEXT (0, 1)
//          SLICES_CHECKERBOARD (0, 1): pixels of even row + column alone
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * (SLICES_TAPS + SLICES_DEEPER * (SLICES_LAYERS - 1)) reads per pixel,
//          fewer where several taps lie in one pixel

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(BITMASK_ANGLE) || !defined(BITMASK_JOINED) || !defined(SLICES_THICKNESS) ||           \
    !defined(SLICES_NEXT) || !defined(SLICES_DEEPER)
#error "SLICES_COUNT, _TAPS, _LAYERS, _DEEPER, _THICKNESS, _NEXT, BITMASK_ANGLE, _JOINED needed"
#endif

#define SLICES_FACETS SLICES_COSINE
#include "bitmask_ao/surfaces.clh"
#include "common/scan.clh"

// Cover the sectors of a slice that surfaces of all layers hide, layer by layer on each side, from
// near to far; layers behind the first are read at every so-many-th tap.
SSGI_INLINE void bitmask_slice(ssgi_plane inv_depth, SsgiReceiver *receiver, const SsgiSlice *slice,
                               const float centre, const SliceParams params,
                               BitmaskSurfaces *surfaces)
{
    SsgiTaps taps;
    BitmaskPath path;
    bitmask_taps(receiver, slice, centre, params, &taps, &path);
    ssgi_ask_taps(inv_depth, receiver, &taps, path.every, SLICES_DEEPER);
    surfaces->measure = bitmask_measure(slice);
    surfaces->covered = surfaces->held = surfaces->held_from = v_splat_int(0);
    surfaces->held_f = surfaces->held_x = surfaces->held_y = v_splat(0.0f);
#pragma unroll 1
    for (int side = 0; side < 2; ++side) {
#pragma unroll 1
        for (int layer = 0; layer < SLICES_LAYERS; ++layer) {
            if (BITMASK_JOINED) {
                bitmask_begin(receiver, slice, side, layer, surfaces);
            }
#pragma unroll 1
            for (BitmaskStep at = bitmask_start(&path, layer);
                 bitmask_next(slice, &path, layer, &at);) {
                const SsgiTap tap = ssgi_tap(inv_depth, receiver, slice, &taps, side, at.t, layer);
                if (BITMASK_JOINED) {
                    bitmask_join(inv_depth, receiver, slice, &tap, at.per_px, side, layer, params,
                                 surfaces);
                } else {
                    bitmask_tap(inv_depth, receiver, slice, &tap, side, layer, surfaces);
                }
            }
            if (BITMASK_JOINED) {
                bitmask_end(inv_depth, receiver, slice, side, layer, params, surfaces);
            }
        }
        bitmask_release(receiver, slice, side, surfaces);
        ssgi_mirror(receiver);
    }
}

// The fraction that slices of this radius (a length) find occluded.
SSGI_INLINE vfloat bitmask_scan(ssgi_plane inv_depth, SsgiReceiver *receiver,
                                const SsgiPattern *pattern, const float radius,
                                const SliceParams params)
{
    vfloat occluded = v_splat(0.0f), whole = v_splat(SLICES_TINY);
#pragma unroll 1
    for (int s = 0; s < SLICES_COUNT; ++s) {
        const SsgiSlice slice =
            ssgi_slice(receiver, pattern->table + s * SLICES_SIZE, radius, pattern->centre);
        BitmaskSurfaces surfaces;
        bitmask_slice(inv_depth, receiver, &slice, pattern->centre, params, &surfaces);
        if (!receiver->tilts) {
            const vfloat share = v_to_float(v_count_bits(surfaces.covered)) * (1.0f / 32.0f);
            occluded = v_fma(surfaces.measure.share, share, occluded);
            whole = whole + surfaces.measure.share;
            continue;
        }
        const vint below = bitmask_below(receiver, &slice, &surfaces.measure);
        const vfloat hidden = v_to_float(v_count_bits(surfaces.covered & ~below)) * (1.0f / 32.0f);
        const vfloat above =
            v_fma(v_to_float(v_count_bits(below)), v_splat(-1.0f / 32.0f), v_splat(1.0f));
        occluded = v_fma(surfaces.measure.share, hidden, occluded);
        whole = v_fma(surfaces.measure.share, above, whole);
    }
    return occluded / whole;
}

__kernel void bitmask_ao(ssgi_plane inv_depth, ssgi_plane normal,
                         __global const float *restrict table, __global float *restrict visibility,
                         const int2 size, const SsgiCamera camera, const SliceParams params)
{
    const SsgiItem item = ssgi_item(size);
    if (!item.inside) {
        return;
    }
    SsgiReceiver receiver =
        ssgi_receiver(inv_depth, normal, size, item.first, item.phase, item.row, camera, params);
    const SsgiPattern pattern = ssgi_pattern(table, &item, camera, params);
    vfloat occluded = v_splat(0.0f);
    SsgiGroup group = ssgi_groups(receiver.active);
    while (ssgi_next_group(inv_depth, &receiver, params, &group)) {
        const vfloat found = bitmask_scan(inv_depth, &receiver, &pattern, group.radius, params);
        occluded = v_select(occluded, found, group.alike);
        if (SSGI_LANES == 1) {
            break; // a receiver is in one group
        }
    }
    ssgi_store_ao(occluded, &receiver, params, visibility, size, &item);
}
