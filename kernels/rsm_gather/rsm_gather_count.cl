// SPDX-License-Identifier: MIT
// rsm_gather_count: how many pixels of each row are left to be computed.
//
// Reads:   left    [rows, columns rounded up to 16] 1 where a pixel is left, else 0
// Writes:  counts  [rows]
// Launch:  one row per work-item

__kernel void rsm_gather_count(__global const int *restrict left, __global int *restrict counts,
                               const int2 size)
{
    const int y = (int)get_global_id(0);
    if (y >= size.y) {
        return;
    }
    __global const int *row = left + y * ((size.x + 15) & ~15);
    int count = 0;
    for (int x = 0; x < size.x; ++x) {
        count += row[x];
    }
    counts[y] = count;
}
