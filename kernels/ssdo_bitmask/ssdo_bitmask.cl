// SPDX-License-Identifier: MIT
// ssdo_bitmask: ambient occlusion, the sky's light through what is open, and one diffuse bounce of
// light from what is not, in one scan of slices with 32 sectors each.
//
// Method:  Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
// Departs: sectors are equal parts of the cosine-weighted measure (see bitmask_ao), so that a
//          sender is weighted by what it covers: irradiance is pi times the mean over the measure
//          of the radiance that arrives. There is no area of a sender, no distance and no clamp to
//          choose, and within a furnace of radiance L it is pi L (1 - A). A tap is a piece of the
//          plane that it lies in (see pieces.clh), so that surfaces have no thickness unless it is
//          asked for; the first on the way outward to cover a sector lights it, whatever its layer.
//          Taps are spread over what of a side lies in the arrays. A surface that turns its back
//          on the camera is seen by the receiver from behind: it sends `back` of its front's
//          radiance, or with BITMASK_BACKS what `sent` has for backs.
// Sky:     The open part of each of BITMASK_CONES equal steps of the sine from the normal is lit by
//          the direction in its middle, from a map that is filtered to the width of a step.
// Bent:    Hidden directions are looked up in BITMASK_BENT cones likewise, see bend.clh.
// Reads:   near    SLICES_LAYERS x [rows, 4 stride] with margin, from slices_near
//          normal  3 x [rows, columns] with margin, view space, unit length
//          table   [4 rows][4 columns][SLICES_COUNT][3 + SLICES_TAPS], see common/slices.clh
//          slopes  2 SLICES_LAYERS x likewise, from slices_slopes
//          sky     [SKY_SIZE][SKY_SIZE][3] radiance by octahedral direction, see sky.clh
//          sent    3 SLICES_LAYERS x [rows, 4 stride] from slices_sorted: senders' radiance,
//                  W m^-2 sr^-1; with BITMASK_BACKS as many more for their backs
//          sides   SLICES_LAYERS x likewise, see ssdo/ssdo_sides.cl (BITMASK_SIDES 1)
//          tiles   bits of tiles/open.clh, tile_columns a row; none if that is 0
// Writes:  light   images [rows, columns] without margin: A in [0, 1], 1 where nothing is; with
//                  BITMASK_BENT 3 of what bends the normal, view space; with BITMASK_CONES 3 of
//                  irradiance by the sky, W/m^2, and with BITMASK_BOUNCE 3 of irradiance by the
//                  bounce; 0 where nothing is
//          kept    2 SLICES_COUNT x [rows, columns] without margin, with BITMASK_KEPT: a bit for
//                  each sector that is covered, and behind them one for each of those through which
//                  the receiver sees the unknown side of a surface; 0 where nothing is
// Macros:  SLICES_COUNT, SLICES_TAPS, SLICES_LAYERS (>= 1), SLICES_THICKNESS, SLICES_NEXT,
//          BITMASK_THICK, BITMASK_BOUNCE, BITMASK_BACKS, BITMASK_KEPT, BITMASK_SIDES (0, 1),
//          BITMASK_CONES, BITMASK_BENT (0 to 16), SKY_SIZE (>= 1)
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

// What receivers know beside the scan; the struct SsdoBitmaskParams is generated from
// ssgi_cl.techniques.indirect.ssdo_bitmask.
typedef struct {
    __global const float *slopes;
    __global const float *sent;
    __global const float *sides;
    __global const float *sky;
    __global int *kept;
    SsdoBitmaskParams params;
} SsdoGiven;

#define BITMASK_ANGLE 0
#define BITMASK_FIRST_SKY (3 * (BITMASK_BENT > 0)) // image behind A
#define BITMASK_MORE (BITMASK_FIRST_SKY + 3 * (BITMASK_CONES > 0) + 3 * BITMASK_BOUNCE)
#define SSGI_SCAN_MORE BITMASK_MORE
#define SSGI_SCAN_KEPT BITMASK_KEPT
#define SSGI_SCAN_FAR (BITMASK_CONES > 0)
#define SSGI_SCAN_WITHIN 1
#define SSGI_SCAN_TILES 1
#define SSGI_SCAN_PIECES
#define SSGI_SCAN_GIVEN SsdoGiven
#include "common/slices.clh"

#include "ssdo_bitmask/cones.clh"
#include "ssdo_bitmask/pieces.clh"
#if BITMASK_CONES
#include "ssdo_bitmask/sky.clh"
#endif
#if BITMASK_BENT
#include "ssdo_bitmask/bend.clh"
#endif

SSGI_INLINE void
ssgi_end_slice(const SsgiReceiver *receiver, const SsgiSlice *slice, const SliceParams params,
               SsgiGathered *gathered)
{
    const vfloat share = gathered->measure.share;
    const vfloat hidden = v_to_float(v_count_bits(gathered->covered)) * (1.0f / 32.0f);
    gathered->occluded = v_fma(share, hidden, gathered->occluded);
    gathered->whole = gathered->whole + share;
#if BITMASK_CONES || BITMASK_BOUNCE
    const vfloat irradiance = share * (3.14159265f / 32.0f);
#endif
#if BITMASK_CONES
    ssdo_sky(receiver, slice, &gathered->measure, ~(gathered->covered & receiver->active),
             irradiance, gathered->more + BITMASK_FIRST_SKY);
#endif
#if BITMASK_BOUNCE
    vfloat *bounce = gathered->more + (BITMASK_MORE - 3);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        bounce[c] = v_fma(irradiance, gathered->light[c], bounce[c]);
    }
#endif
#if BITMASK_BENT
    ssdo_bend(receiver, slice, &gathered->measure, gathered->covered & receiver->active,
              share * (1.5f / 32.0f), gathered->more);
#endif
}

#include "common/scan.clh"

__kernel void ssdo_bitmask(ssgi_plane near, ssgi_plane normal, __global const float *restrict table,
                           __global const float *restrict slopes,
                           ssgi_optional __global const float *restrict sky,
                           ssgi_optional __global const float *restrict sent,
                           ssgi_optional __global const float *restrict sides,
                           ssgi_optional __global const int *restrict tiles,
                           __global float *restrict light,
                           ssgi_optional __global int *restrict kept,
                           const int2 size, const SsgiCamera camera, const SliceParams params,
                           const SsdoBitmaskParams own)
{
    SsdoGiven given;
    given.slopes = slopes;
    given.sent = sent;
    given.sides = sides;
    given.sky = sky;
    given.kept = kept;
    given.params = own;
    ssgi_occlude(near, normal, table, tiles, light, size, given, camera, params);
}
