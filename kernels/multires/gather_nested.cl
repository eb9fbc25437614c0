// SPDX-License-Identifier: MIT
// gather_nested: what rays found at a coarser level's samples, each of which a level has too.
//
// Reads:   coarser  GATHER_FOUND x [coarse rows, columns], see gather_smooth
// Writes:  found    GATHER_FOUND x [rows, columns] likewise; 0 at other samples
// Macros:  GATHER_FOUND: images
// Params:  coarse = (columns, rows) of the coarser level
// Launch:  SSGI_LANES samples of a row per work-item
// Cost:    a read and a write for each sample and image

#include "common/gbuffer.clh"

#ifndef GATHER_FOUND
#error "GATHER_FOUND must be defined by the host"
#endif

__kernel void gather_nested(ssgi_plane coarser, __global float *restrict found, const int2 size,
                            const int2 coarse)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint column = v_imin(v_iota() + x, v_splat_int(size.x - 1));
    const vmask both = v_ieq((column | y) & 1, v_splat_int(0));
    for (int i = 0; i < GATHER_FOUND; ++i) {
        const vfloat value = ssgi_gather(coarser, coarse, i, column >> 1, v_splat_int(y >> 1));
        ssgi_store(v_select(v_splat(0.0f), value, both), found, size, i, x, y, 0.0f);
    }
}
