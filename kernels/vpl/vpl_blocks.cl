// SPDX-License-Identifier: MIT
// vpl_blocks: cumulative sums of the runs of each block, from their sums.
//
// Reads and writes:
//          runs    see vpl/curve.clh
// Writes:  blocks  see vpl/curve.clh; the sums of each block alone
// Launch:  SSGI_LANES blocks per work-item of a row, a row for each of VPL_SUMS sums

#include "common/gbuffer.clh"
#include "vpl/curve.clh"

__kernel void vpl_blocks(__global float *restrict runs, __global float *restrict blocks,
                         const int2 size, // (blocks, sums)
                         const VplCurveParams params)
{
    const int first = ssgi_first_column();
    const int sum = (int)get_global_id(1);
    if (first >= size.x || sum >= size.y) {
        return;
    }
    // Lanes past the last block do what that of the last does.
    const vint block = v_imin(v_iota() + first, v_splat_int(size.x - 1));
    const vfloat zero = v_splat(0.0f);
    __global float *restrict high = runs + sum * params.runs;
    __global float *restrict low = runs + (VPL_SUMS + sum) * params.runs;
    VplPair before = {zero, zero};
    for (int k = 0; k < VPL_BLOCK_RUNS; ++k) {
        const vint run = block * VPL_BLOCK_RUNS + k;
        const vfloat own = v_gather(high, run);
        v_scatter(before.high, high, run);
        v_scatter(before.low, low, run);
        before = vpl_plus(before, own, zero);
    }
    v_scatter(before.high, blocks + sum * (size.x + 1), block);
    v_scatter(before.low, blocks + (VPL_SUMS + sum) * (size.x + 1), block);
}
