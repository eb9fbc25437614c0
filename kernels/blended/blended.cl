// SPDX-License-Identifier: MIT
// blended: layers that are seen through, nearest first, over what is behind them all.
//
// The share `opacity` of a layer sends its radiance to the eye, dimmed by all layers before it;
// each dims what is behind by what it lets through (Porter and Duff 1984, "over", by colours).
//
// Reads:   radiance     3 x [rows, columns] of the layer, or of what is behind all (BLENDED_STEP 2)
//          opacity      [rows, columns] of the layer, in [0, 1] (BLENDED_STEP 0, 1)
//          transmitted  3 x [rows, columns] of the layer, in [0, 1] (BLENDED_STEP 0, 1)
// Writes:  over     3 x [rows, columns] radiance of the layers so far; with BLENDED_STEP 2 of all
//          through  3 x [rows, columns] what they let through (BLENDED_STEP 0, 1)
// Macros:  BLENDED_STEP: 0 the nearest layer, 1 one behind others, 2 what is behind all
// Params:  size = images
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"

#ifndef BLENDED_STEP
#error "BLENDED_STEP must be defined by the host"
#endif

__kernel void blended(ssgi_plane radiance,
#if BLENDED_STEP < 2
                      ssgi_plane opacity, ssgi_plane transmitted,
#endif
                      __global float *restrict over, __global float *restrict through,
                      const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int c = 0; c < 3; ++c) {
        const vfloat own = ssgi_load(radiance, size, c, x, y);
#if BLENDED_STEP == 0
        const vfloat sum = own * ssgi_load(opacity, size, 0, x, y);
        ssgi_store(ssgi_load(transmitted, size, c, x, y), through, size, c, x, y, 1.0f);
#else
        const vfloat before = v_load(over + ssgi_index(size, c, x, y));
        const vfloat left = v_load(through + ssgi_index(size, c, x, y));
#if BLENDED_STEP == 1
        const vfloat sum = v_fma(own * ssgi_load(opacity, size, 0, x, y), left, before);
        ssgi_store(left * ssgi_load(transmitted, size, c, x, y), through, size, c, x, y, 1.0f);
#else
        const vfloat sum = v_fma(own, left, before);
#endif
#endif
        ssgi_store(sum, over, size, c, x, y, 0.0f);
    }
}
