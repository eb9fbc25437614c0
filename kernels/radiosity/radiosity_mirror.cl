// SPDX-License-Identifier: MIT
// radiosity_mirror: visibility of earlier surfels from each surfel, which is that from them.
//
// Reads:   visible    see radiosity_visibility: the words from each receiver's own on
// Writes:  visible    the words before it
// Launch:  SSGI_LANES surfels per work-item, a row for each 32 surfels that they may see
// Cost:    4 operations per pair

#include "common/gbuffer.clh"

__kernel void radiosity_mirror(__global int *restrict visible, const int2 size)
{
    const int first = ssgi_first_column();
    const int word = (int)get_global_id(1);
    const int stride = size.x;
    if (first >= stride || word >= first / 32) {
        return;
    }
    // All lanes are bits of one word, as SSGI_LANES divides 32.
    __global const int *restrict theirs = visible + (first / 32) * stride + word * 32;
    const vint own = (v_iota() + first) & 31;
    vint bits = v_splat_int(0);
    for (int n = 0; n < 32; ++n) {
        const vint seen = v_shift_right(v_splat_int(theirs[n]), own) & 1;
        bits = bits | (seen * (int)(1u << n));
    }
    v_istore(bits, visible + word * stride + first);
}
