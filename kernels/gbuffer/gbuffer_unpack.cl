// SPDX-License-Identifier: MIT
// gbuffer_unpack: images of a plane to a caller's memory, in the order that the caller has.
//
// Reads:   plane   PACK_COUNT x [rows, columns]
// Writes:  target  float32: pixel (x, y) of image i is that of number
//                  first + i image + y row + x column
// Macros:  PACK_COUNT (images of the plane)
// Params:  steps between numbers, int
// Launch:  one pixel per work-item

#include "common/gbuffer.clh"

#ifndef PACK_COUNT
#error "PACK_COUNT must be defined by the host"
#endif

__kernel void gbuffer_unpack(__global const float *restrict plane, __global float *restrict target,
                             const int2 size, const int first, const int image, const int row,
                             const int column)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int i = 0; i < PACK_COUNT; ++i) {
        target[first + i * image + y * row + x * column] = plane[ssgi_index(size, i, x, y)];
    }
}
