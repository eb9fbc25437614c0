// SPDX-License-Identifier: MIT
// slices_sorted: images as the scan of slices reads them beside depth, at full size or less.
//
// Takes the same pixels as slices_inv_depth and puts them where that does: each row is sorted by
// column modulo 4.
//
// Reads:   images  SORTED_COUNT x [rows, columns] with margin
// Writes:  sorted  [rows, 4 stride], images first_image to first_image + SORTED_COUNT - 1, column c
//                  at (c + lead) % 4 * stride + (c + lead) / 4; 0 where no column is
// Macros:  SORTED_COUNT (>= 1)
// Launch:  SSGI_LANES floats of a row of `sorted` per work-item
// Cost:    1 read and 1 write per pixel and image

#include "slices/sorted.clh"

#ifndef SORTED_COUNT
#error "SORTED_COUNT must be defined by the host"
#endif

__kernel void slices_sorted(ssgi_plane images, __global float *restrict sorted, const int2 size,
                            const int2 fine_size, const int columns, const int lead, const int step,
                            const int first_x, const int first_y, const int first_image)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const SsgiSorted from =
        ssgi_sorted(size.x, x, y, fine_size, columns, lead, step, first_x, first_y);
    for (int image = 0; image < SORTED_COUNT; ++image) {
        const vfloat value = ssgi_load_sorted(images, &from, image);
        ssgi_store(v_select(v_splat(0.0f), value, from.inside), sorted, size, first_image + image,
                   x, y, 0.0f);
    }
}
