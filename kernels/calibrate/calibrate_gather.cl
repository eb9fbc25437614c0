// SPDX-License-Identifier: MIT
// calibrate_gather: reads pixels scattered round its own, which tells how fast that can be done.
//
// Reads:   source   a plane
//          steps    [CALIBRATE_GATHERS, 2, 16] int columns and rows from each of 16 neighbouring
//                   pixels to what they read, at most 2^CALIBRATE_REACH either way
// Writes:  sum      [rows, columns] of what was read
// Macros:  CALIBRATE_GATHERS  reads per pixel
//          CALIBRATE_REACH    logarithm to base 2 of the greatest step
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    CALIBRATE_GATHERS scattered reads of 4 bytes per pixel, three operations each

#include "common/gbuffer.clh"

#if !defined(CALIBRATE_GATHERS) || !defined(CALIBRATE_REACH)
#error "CALIBRATE_GATHERS and CALIBRATE_REACH must be defined by the host"
#endif

__kernel void calibrate_gather(ssgi_plane source, __global const int *restrict steps,
                               __global float *restrict sum, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int reach = 1 << CALIBRATE_REACH;
    const int column = clamp(x, reach, size.x - reach - SSGI_LANES);
    const int row = clamp(y, reach, size.y - reach - 1);
    const vint own = v_iota() + column;
    __global const int *const step = steps + (column & 15);
    vfloat total = v_splat(0.0f);
    for (int i = 0; i < CALIBRATE_GATHERS; ++i) {
        const vint tap_x = own + v_iload(step + i * 32);
        const vint tap_y = row + v_iload(step + i * 32 + 16);
        total = total + ssgi_gather(source, size, 0, tap_x, tap_y);
    }
    ssgi_store(total, sum, size, 0, x, y, 0.0f);
}
