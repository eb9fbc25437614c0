// SPDX-License-Identifier: MIT
// calibrate_multiply_add: fused multiply-adds and nothing else, which tells how many a device does.
//
// Reads:   source  a plane of numbers in [0, 1)
// Writes:  result  [rows, columns] a number without meaning
// Macros:  CALIBRATE_STEPS  multiply-adds of each of 8 independent chains
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    8 * CALIBRATE_STEPS multiply-adds per pixel

#include "common/gbuffer.clh"

#ifndef CALIBRATE_STEPS
#error "CALIBRATE_STEPS must be defined by the host"
#endif

__kernel void calibrate_multiply_add(ssgi_plane source, __global float *restrict result,
                                     const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat factor = ssgi_load(source, size, 0, x, y);
    const vfloat a = factor + 0.5f;
    vfloat c0 = factor;
    vfloat c1 = factor + 0.1f;
    vfloat c2 = factor + 0.2f;
    vfloat c3 = factor + 0.3f;
    vfloat c4 = factor + 0.4f;
    vfloat c5 = factor + 0.5f;
    vfloat c6 = factor + 0.6f;
    vfloat c7 = factor + 0.7f;
    for (int i = 0; i < CALIBRATE_STEPS; ++i) {
        c0 = v_fma(c0, factor, a);
        c1 = v_fma(c1, factor, a);
        c2 = v_fma(c2, factor, a);
        c3 = v_fma(c3, factor, a);
        c4 = v_fma(c4, factor, a);
        c5 = v_fma(c5, factor, a);
        c6 = v_fma(c6, factor, a);
        c7 = v_fma(c7, factor, a);
    }
    const vfloat total = ((c0 + c1) + (c2 + c3)) + ((c4 + c5) + (c6 + c7));
    ssgi_store(total, result, size, 0, x, y, 0.0f);
}
