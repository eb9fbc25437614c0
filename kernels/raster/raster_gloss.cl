// SPDX-License-Identifier: MIT
// raster_gloss: what the triangle that each pixel sees mirrors, and how sharply.
//
// Reads:   triangles  [tile count][32][32] number of the triangle seen, or -1
//          faces [triangles][RASTER_FACE]; lobes [materials][4]: reflectance (3), Phong exponent
// Writes:  specular  3 x [rows, columns] in [0, 1]; 0 where nothing is
//          gloss     [rows, columns] exponent; 0 where nothing is
// Macros:  RASTER_STEP: pixels of the buffer from one of the result to the next
// Params:  size = result; tiles = columns and rows of tiles
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "raster/seen.clh"

#ifndef RASTER_STEP
#error "RASTER_STEP must be defined by the host"
#endif

__kernel void raster_gloss(__global const int *restrict triangles,
                           __global const int *restrict faces, __global const float *restrict lobes,
                           __global float *restrict specular, __global float *restrict gloss,
                           const int2 size, const int2 tiles)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint seen = raster_seen(triangles, tiles, x, y);
    const vmask there = v_ige(seen, v_splat_int(0));
    const vfloat zero = v_splat(0.0f);
    const vint id = v_igather(faces + 3, v_imax(seen, v_splat_int(0)) * RASTER_FACE) * 4;
    for (int c = 0; c < 3; ++c) {
        const vfloat own = v_select(zero, v_gather(lobes, id + c), there);
        ssgi_store(own, specular, size, c, x, y, 0.0f);
    }
    ssgi_store(v_select(zero, v_gather(lobes, id + 3), there), gloss, size, 0, x, y, 0.0f);
}
