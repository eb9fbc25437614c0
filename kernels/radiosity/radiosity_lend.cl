// SPDX-License-Identifier: MIT
// radiosity_lend: which records of a volume stand for those without surfaces that face a side.
//
// Method:  cells round a place are tried, the nearest first, but for those behind what the record's
//          own surfaces face away from, which may lie beyond a wall. Of a cell that a plane divides
//          the record on the place's side of the plane is taken.
// Reads:   places     3 x [size.x] in cells: of records, a cell along `ways` from their middle
//          ways       3 x [size.x] which way their surfaces face, of length 1, or 0 where that is
//                     not known
//          wanted     [size.x] sides that a record is wanted for, a bit for each
//          cells      see radiosity/volume.clh; a cell that no surface lies in has a record, too
//          known      [records] sides for which each can stand, likewise
//          steps      [count][3] to cells round one, by x, y and z
// Writes:  lender     VOLUME_SIDES x [size.x] a record, or -1
// Macros:  VOLUME_CELLS
// Params:  count: of the cells that are tried
// Launch:  SSGI_LANES places per work-item, one row
// Cost:    30 operations and two reads a cell, up to where all sides are found

#include "common/gbuffer.clh"
#include "radiosity/volume.clh"

#define LEND_BEHIND -0.5f // cells along a record's way at which others begin to be behind it

__kernel void radiosity_lend(__global const float *restrict places,
                             __global const float *restrict ways,
                             __global const int *restrict wanted,
                             __global const int *restrict cells, __global const int *restrict known,
                             __global const int *restrict steps, __global int *restrict lender,
                             const int2 size, const int count)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat px = v_load(places + first), py = v_load(places + stride + first);
    const vfloat pz = v_load(places + 2 * stride + first);
    const float most = (float)VOLUME_CELLS - 0.5f;
    const vint x = v_to_int(v_clamp(px, 0.0f, most)), y = v_to_int(v_clamp(py, 0.0f, most));
    const vint z = v_to_int(v_clamp(pz, 0.0f, most));
    const vfloat wx = v_load(ways + first), wy = v_load(ways + stride + first);
    const vfloat wz = v_load(ways + 2 * stride + first);
    // From the record's middle to that of a cell, along its way, but for what the cell adds.
    const vfloat own = v_fma(wx, px - wx, v_fma(wy, py - wy, wz * (pz - wz)));
    const vfloat least = own + LEND_BEHIND - 0.5f * (wx + wy + wz);
    const vint none = v_splat_int(0);
    vint left = v_iload(wanted + first);
    vint found[VOLUME_SIDES];
    for (int side = 0; side < VOLUME_SIDES; ++side) {
        found[side] = v_splat_int(-1);
    }
    for (int i = 0; i < count && v_any(v_ine(left, none)); ++i) {
        const vint column = v_iclamp(x + steps[3 * i], 0, VOLUME_CELLS - 1);
        const vint row = v_iclamp(y + steps[3 * i + 1], 0, VOLUME_CELLS - 1);
        const vint slice = v_iclamp(z + steps[3 * i + 2], 0, VOLUME_CELLS - 1);
        const vint cell = (slice * VOLUME_CELLS + row) * VOLUME_CELLS + column;
        const vint record = volume_side(cells, v_igather(cells, cell), px, py, pz);
        const vmask ahead =
            v_ge(v_fma(wx, v_to_float(column), v_fma(wy, v_to_float(row), wz * v_to_float(slice))),
                 least);
        const vint here = v_igather(known, record) & left & ahead;
        if (!v_any(v_ine(here, none))) {
            continue;
        }
        for (int side = 0; side < VOLUME_SIDES; ++side) {
            found[side] =
                v_iselect(found[side], record, v_ine(here & v_splat_int(1 << side), none));
        }
        left = left & ~here;
    }
    for (int side = 0; side < VOLUME_SIDES; ++side) {
        v_istore(found[side], lender + side * stride + first);
    }
}
