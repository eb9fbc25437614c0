// SPDX-License-Identifier: MIT
// rsm_gather_list: the pixels that are left to be computed, in the order of rows and columns.
//
// A row's place in the list follows from the counts of the rows above it, so no atomics are needed
// and the list is the same in every run.
// Reads:   left    [rows, columns rounded up to 16] 1 where a pixel is left, else 0
//          counts  [rows] how many of each row are
// Writes:  list    [1 + rows * columns] their number, then row << 16 | column of each
// Launch:  one row per work-item

__kernel void rsm_gather_list(__global const int *restrict left,
                              __global const int *restrict counts, __global int *restrict list,
                              const int2 size)
{
    const int y = (int)get_global_id(0);
    if (y >= size.y) {
        return;
    }
    int at = 0;
    for (int row = 0; row < y; ++row) {
        at += counts[row];
    }
    const int end = at + counts[y];
    if (y == size.y - 1) {
        list[0] = end;
    }
    __global const int *mine = left + y * ((size.x + 15) & ~15);
    for (int x = 0; at < end; ++x) {
        if (mine[x] != 0) {
            at += 1;
            list[at] = (y << 16) | x;
        }
    }
}
