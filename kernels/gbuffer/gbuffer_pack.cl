// SPDX-License-Identifier: MIT
// gbuffer_pack: images of a caller's memory to those of a plane, whatever the order of numbers.
//
// Reads:   source  float32: pixel (x, y) of image i is that of number
//                  first + i image + y row + x column
// Writes:  plane   PACK_COUNT x [rows, columns], from image `to` on; the outside value in place of
//                  NaN, and with `positive` of numbers that are not above 0
// Macros:  PACK_COUNT (images of the plane)
// Params:  steps between numbers, int
// Launch:  one pixel per work-item

#include "common/gbuffer.clh"

#ifndef PACK_COUNT
#error "PACK_COUNT must be defined by the host"
#endif

__kernel void gbuffer_pack(__global const float *restrict source, __global float *restrict plane,
                           const int2 size, const int first, const int image, const int row,
                           const int column, const float outside, const int positive, const int to)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int i = 0; i < PACK_COUNT; ++i) {
        const float number = source[first + i * image + y * row + x * column];
        const int good = positive ? number > 0.0f : number == number;
        plane[ssgi_index(size, to + i, x, y)] = good ? number : outside;
    }
}
