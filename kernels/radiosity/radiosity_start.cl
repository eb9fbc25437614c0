// SPDX-License-Identifier: MIT
// radiosity_start: where the visibility rays of surfels begin: above a part in an empty cell.
//
// A point within a cell of another surface, lifted off its own, lies in an occupied cell, from which
// rays leave through that surface. So the part nearest to the surfel's middle is taken whose lifted
// point is in an empty cell; the nearest of all where there is none.
// Reads:   parts      3 x [16 size.x] positions, nearest to the surfel's first; see surfel.clh
//          occupancy, grid_box  see vpl/grid.clh
// Writes:  surfels    SURFEL_START
// Macros:  VPL_GRID
// Params:  lift       cells above the surface
// Launch:  SSGI_LANES surfels per work-item, one row
// Cost:    up to 16 reads of the grid per surfel

#include "common/gbuffer.clh"
#include "radiosity/surfel.clh"

#ifndef VPL_GRID
#error "VPL_GRID must be defined"
#endif

__kernel void radiosity_start(__global const float *restrict parts,
                              __global const int *restrict occupancy,
                              __global const float *restrict grid_box,
                              __global float *restrict surfels, const int2 size, const float lift)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const float most = (float)VPL_GRID - 0.01f;
    vfloat at[3];
    vmask found = v_splat_int(0);
    for (int part = 0; part < 16; ++part) {
        vfloat own[3];
        vint cell[3];
        for (int j = 0; j < 3; ++j) {
            const vfloat p = v_gather(parts + j * 16 * stride, (v_iota() + first) * 16 + part);
            const vfloat n = v_load(surfels + (SURFEL_NORMAL + j) * stride + first);
            own[j] = v_clamp(v_fma(n, v_splat(lift), (p - grid_box[j]) * grid_box[3]), 0.0f, most);
            cell[j] = v_to_int(own[j]);
        }
        const vint block = ((cell[2] >> 2) * VPL_BLOCKS + (cell[1] >> 2)) * VPL_BLOCKS +
                           (cell[0] >> 2);
        const vint word = v_igather(occupancy, block * 2 + ((cell[2] >> 1) & 1));
        const vint bit = ((cell[2] & 1) << 4) | ((cell[1] & 3) << 2) | (cell[0] & 3);
        const vmask empty = v_ieq(v_shift_right(word, bit) & 1, v_splat_int(0));
        const vmask take = part == 0 ? v_splat_int(-1) : empty & ~found;
        for (int j = 0; j < 3; ++j) {
            at[j] = part == 0 ? own[j] : v_select(at[j], own[j], take);
        }
        found = found | empty;
    }
    for (int j = 0; j < 3; ++j) {
        v_store(at[j], surfels + (SURFEL_START + j) * stride + first);
    }
}
