// SPDX-License-Identifier: MIT
// radiosity_visibility: visibility of pairs of surfels, a ray through the occupancy grid for each.
//
// Pairs of which one does not face the other have no ray. A pair has one ray: words of surfels
// before the receiver's own word are left to radiosity_mirror.
//
// Reads:   surfels    see surfel.clh
//          records    [size.x][SURFEL_RECORD] position, area, minus the normal, 0, flux, 0
//          occupancy  see occupancy/grid.clh
// Writes:  visible    [size.y][size.x]: bit n of word w is 1 where surfel 32 w + n is visible
// Macros:  OCCUPANCY_CELLS
// Launch:  SSGI_LANES surfels per work-item, a row for each 32 surfels that they may see
// Cost:    16 operations and a division per pair, and some 20 reads per ray

#include "common/gbuffer.clh"
#include "radiosity/ends.clh"

__kernel void radiosity_visibility(__global const float *restrict surfels,
                                   __global const float *restrict records,
                                   __global const int *restrict occupancy,
                                   __global int *restrict visible, const int2 size)
{
    const int first = ssgi_first_column();
    const int word = (int)get_global_id(1);
    const int stride = size.x;
    if (first >= stride || word >= size.y || word < first / 32) {
        return;
    }
    const SurfelReceiver at = surfel_receivers(surfels, stride, first);
    const OccupancyCell start = surfel_starts(surfels, stride, first);
    vint bits = v_splat_int(0);
    for (int n = 0; n < 32; ++n) {
        const int sender = word * 32 + n;
        const vfloat w = surfel_weight(records + sender * SURFEL_RECORD, at);
        const vmask wanted = v_gt(w, v_splat(0.0f));
        if (v_any(wanted)) {
            const OccupancyCell end = surfel_start(surfels, stride, sender);
            const vmask blocked = occupancy_blocked(occupancy, start, end, wanted);
            bits = bits | (wanted & ~blocked & v_splat_int((int)(1u << n)));
        }
    }
    v_istore(bits, visible + word * stride + first);
}
