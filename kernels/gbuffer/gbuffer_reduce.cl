// SPDX-License-Identifier: MIT
// gbuffer_reduce: every n-th pixel of a plane in both directions, for work at half or quarter size.
//
// Pixels are picked, not averaged: an averaged depth at an edge would lie on no surface.
//
// Reads:   fine    COUNT x [rows, columns]
// Writes:  coarse  COUNT x [rows, columns], pixel (x, y) is fine pixel (x * n + first_x, ...),
//                  which lies inside
// Macros:  REDUCE_COUNT images of the plane, UPSAMPLE_STEP n; 1, 2 and 4 are read as vectors, in
//          half the time of the gather that serves others
// Launch:  SSGI_LANES pixels of a coarse row per work-item

#include "common/gbuffer.clh"

#if UPSAMPLE_STEP == 1 || UPSAMPLE_STEP == 2 || UPSAMPLE_STEP == 4
#include "filters/phases.clh"
#endif

#if !defined(REDUCE_COUNT) || !defined(UPSAMPLE_STEP)
#error "REDUCE_COUNT and UPSAMPLE_STEP must be defined by the host"
#endif

__kernel void gbuffer_reduce(ssgi_plane fine, __global float *restrict coarse, const int2 size,
                             const int2 fine_size, const int first_x, const int first_y,
                             const float outside)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int i = 0; i < REDUCE_COUNT; ++i) {
        const int from_x = x * UPSAMPLE_STEP + first_x;
        const int from_y = y * UPSAMPLE_STEP + first_y;
#ifdef SSGI_UPSAMPLE_PHASES_CLH
        vfloat phases[UPSAMPLE_STEP];
        ssgi_load_phases(fine, fine_size, i, from_x, from_y, phases);
        const vfloat picked = phases[0];
#else
        const vint column = v_imin(v_iota() * UPSAMPLE_STEP + from_x, v_splat_int(fine_size.x - 1));
        const vfloat picked = ssgi_gather(fine, fine_size, i, column, v_splat_int(from_y));
#endif
        ssgi_store(picked, coarse, size, i, x, y, outside);
    }
}
