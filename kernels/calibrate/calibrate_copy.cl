// SPDX-License-Identifier: MIT
// calibrate_copy: copies a plane, which tells how many bytes a second memory moves.
//
// Reads:   source  a plane larger than the caches
// Writes:  copy    [rows, columns] the same
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    one read and one write of 4 bytes per pixel

#include "common/gbuffer.clh"

__kernel void calibrate_copy(ssgi_plane source, __global float *restrict copy, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    ssgi_store(ssgi_load(source, size, 0, x, y), copy, size, 0, x, y, 0.0f);
}
