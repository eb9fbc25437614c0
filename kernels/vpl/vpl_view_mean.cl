// SPDX-License-Identifier: MIT
// vpl_view_mean: sums of the importance of all runs, and of how many lit texels they have.
//
// Reads and writes:
//          importance  [2][runs], then [VPL_MEANS] the sums; see vpl/curve.clh
// Launch:  SSGI_LANES of the two sums per work-item

#define VPL_WEIGHTED 1
#include "common/gbuffer.clh"
#include "vpl/curve.clh"

__kernel void vpl_view_mean(__global float *restrict importance,
                            const int2 size) // (sums, runs)
{
    const int first = ssgi_first_column();
    if (first >= size.x) {
        return;
    }
    const vint sum = v_imin(v_iota() + first, v_splat_int(size.x - 1));
    vfloat all = v_splat(0.0f);
    // In blocks, which float32 rounds less than one long sum.
    for (int block = 0; block < size.y; block += VPL_BLOCK_RUNS) {
        vfloat part = v_splat(0.0f);
        for (int run = block; run < min(block + VPL_BLOCK_RUNS, size.y); ++run) {
            part = part + v_gather(importance, sum * size.y + run);
        }
        all = all + part;
    }
    v_scatter(all, importance, sum + 2 * size.y);
}
