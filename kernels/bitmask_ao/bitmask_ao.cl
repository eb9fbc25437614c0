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
//          tiles   bits of tiles/open.clh, tile_columns a row; none if that is 0
// Writes:  openness [rows, columns] without margin, A in [0, 1]; 1 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), SLICES_DEEPER (1..SLICES_TAPS),
//          BITMASK_ANGLE, BITMASK_JOINED, SLICES_THICKNESS, SLICES_NEXT (0, 1)
// Launch:  every fourth of 4 SSGI_LANES pixels of a row per work-item, see common/scan.clh
// Cost:    2 * SLICES_COUNT * (SLICES_TAPS + SLICES_DEEPER * (SLICES_LAYERS - 1)) reads per pixel,
//          fewer where several taps lie in one pixel

#if !defined(SLICES_COUNT) || !defined(SLICES_TAPS) || !defined(SLICES_LAYERS) ||                  \
    !defined(BITMASK_ANGLE) || !defined(BITMASK_JOINED) || !defined(SLICES_THICKNESS) ||           \
    !defined(SLICES_NEXT) || !defined(SLICES_DEEPER)
#error "SLICES_COUNT, _TAPS, _LAYERS, _DEEPER, _THICKNESS, _NEXT, BITMASK_ANGLE, _JOINED needed"
#endif

#define SSGI_SCAN_BY_LAYER
#define SSGI_SCAN_TILES 1
#include "common/slices.clh"

#include "bitmask_ao/surfaces.clh"

SSGI_INLINE void
ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
               SsgiGathered *gathered)
{
    const vfloat hidden = v_to_float(v_count_bits(gathered->covered)) * (1.0f / 32.0f);
    gathered->occluded = v_fma(gathered->measure.share, hidden, gathered->occluded);
    gathered->whole = gathered->whole + gathered->measure.share;
}

#include "common/scan.clh"

__kernel void bitmask_ao(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                         ssgi_optional __global const int *restrict tiles,
                         __global float *restrict openness,
                         const int2 size, const SsgiCamera camera, const SliceParams params)
{
    ssgi_occlude(near, normal, table, tiles, openness, size, camera, params);
}
