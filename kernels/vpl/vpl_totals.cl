// SPDX-License-Identifier: MIT
// vpl_totals: cumulative sums of the blocks, from their sums, and the sums of all.
//
// Reads and writes:
//          blocks  see vpl/curve.clh
// Launch:  SSGI_LANES of VPL_SUMS sums per work-item

#include "common/gbuffer.clh"
#include "vpl/curve.clh"

__kernel void vpl_totals(__global float *restrict blocks,
                         const int2 size) // (sums, blocks)
{
    const int first = ssgi_first_column();
    if (first >= size.x) {
        return;
    }
    const vint sum = v_imin(v_iota() + first, v_splat_int(size.x - 1));
    const vint high = sum * (size.y + 1);
    const vint low = high + VPL_SUMS * (size.y + 1);
    const vfloat zero = v_splat(0.0f);
    VplPair before = {zero, zero};
    for (int block = 0; block < size.y; ++block) {
        const vfloat own = v_gather(blocks, high + block);
        const vfloat rest = v_gather(blocks, low + block);
        v_scatter(before.high, blocks, high + block);
        v_scatter(before.low, blocks, low + block);
        before = vpl_plus(before, own, rest);
    }
    v_scatter(before.high, blocks, high + size.y);
    v_scatter(before.low, blocks, low + size.y);
}
