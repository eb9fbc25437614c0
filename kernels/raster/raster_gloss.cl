// SPDX-License-Identifier: MIT
// raster_gloss: what the triangle that each pixel sees mirrors, and how sharply.
//
// Reads:   triangles  [tile count][32][32] number of the triangle seen, or -1
//          material_ids [triangles], lobes [materials][4]: reflectance (3), Phong exponent
// Writes:  specular  3 x [rows, columns] in [0, 1]; 0 where nothing is
//          gloss     [rows, columns] exponent; 0 where nothing is
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "raster/records.clh"

__kernel void raster_gloss(__global const int *restrict triangles,
                           __global const int *restrict material_ids,
                           __global const float *restrict lobes, __global float *restrict specular,
                           __global float *restrict gloss, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int tiles_x = (size.x + RASTER_TILE - 1) / RASTER_TILE;
    const int tile = y / RASTER_TILE * tiles_x + x / RASTER_TILE;
    const int at = (tile * RASTER_TILE + (y & (RASTER_TILE - 1))) * RASTER_TILE +
                   (x & (RASTER_TILE - 1));
    const vint seen = v_iload(triangles + at);
    const vmask there = v_ige(seen, v_splat_int(0));
    const vfloat zero = v_splat(0.0f);
    const vint id = v_igather(material_ids, v_imax(seen, v_splat_int(0))) * 4;
    for (int c = 0; c < 3; ++c) {
        const vfloat own = v_select(zero, v_gather(lobes, id + c), there);
        ssgi_store(own, specular, size, c, x, y, 0.0f);
    }
    ssgi_store(v_select(zero, v_gather(lobes, id + 3), there), gloss, size, 0, x, y, 0.0f);
}
