// SPDX-License-Identifier: MIT
// subsplat_mip: a level of the min-max mipmap from the finer one.
//
// Method:  Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination": the
//          maximum over 3 x 3 texels of the finer level, 2 x 2 of which are the texel's own; the
//          third column and row find discontinuities between texels.
// Reads:   finer  5 x [rows, columns] of the finer level, see variation.clh
// Writes:  coarser  5 x [rows, columns], half of them rounded up; texel (x, y) is the maximum over
//                   columns 2 x to 2 x + 2 and rows 2 y to 2 y + 2
// Params:  finer_size = (columns, rows)
// Launch:  SSGI_LANES texels of a row per work-item
// Cost:    45 reads per texel

#define UPSAMPLE_STEP 2
#include "multires/variation.clh"
#include "filters/phases.clh"

__kernel void subsplat_mip(ssgi_plane finer, __global float *restrict coarser, const int2 size,
                           const int2 finer_size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int i = 0; i < SUBSPLAT_IMAGES; ++i) {
        vfloat most = v_splat(SUBSPLAT_EMPTY);
        for (int down = 0; down < 3; ++down) {
            const int row = min(UPSAMPLE_STEP * y + down, finer_size.y - 1);
            // Columns past the last are those of the guard, which is empty.
            vfloat own[UPSAMPLE_STEP], next[UPSAMPLE_STEP];
            ssgi_load_phases(finer, finer_size, i, UPSAMPLE_STEP * x, row, own);
            ssgi_load_phases(finer, finer_size, i, UPSAMPLE_STEP * (x + 1), row, next);
            most = v_max(most, v_max(v_max(own[0], own[1]), next[0]));
        }
        ssgi_store(most, coarser, size, i, x, y, SUBSPLAT_EMPTY);
    }
}
