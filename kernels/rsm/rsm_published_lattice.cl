// SPDX-License-Identifier: MIT
// rsm_published_lattice: marks the pixels of the low-resolution pass.
//
// Method:  Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", section 4.2: indirect light
//          is computed for a low-resolution image of the camera's view first.
// Departs: that image is not drawn; it has the middle pixels of blocks of the full-size one.
// Reads:   depth   the front layer, with margin, scene units; INFINITY where nothing is
// Writes:  values  3 x [rows, columns]: 0, to which light is added
//          fractions  [rows, columns] 1 at pixels of the lattice that show a surface, else 0
//          masks   of tiles, see multires/list.clh
// Params:  whole = (columns, rows) with margin; margin = (columns, rows); step = pixels along a
//          block
// Launch:  a row of a tile per work-item

#include "common/gbuffer.clh"
#include "multires/list.clh"
#include "rsm/lattice.clh"

__kernel void rsm_published_lattice(ssgi_plane depth, __global float *restrict values,
                                    __global float *restrict fractions,
                                    __global int *restrict masks, const int2 size, const int2 whole,
                                    const int2 margin, const int step)
{
    const int left = (int)get_global_id(0) * MULTIRES_TILE;
    const int y = (int)get_global_id(1);
    if (left >= size.x || y >= size.y) {
        return;
    }
    const vint row = v_splat_int(y);
    const vmask on_row = v_ieq(rsm_middle(row / step, size.y, step), row);
    int mask = 0;
    for (int x = left; x < min(left + MULTIRES_TILE, size.x); x += SSGI_LANES) {
        const vint column = v_iota() + x;
        const vfloat seen = ssgi_load(depth, whole, 0, x + margin.x, y + margin.y);
        const vmask chosen = on_row & v_ieq(rsm_middle(column / step, size.x, step), column) &
                             v_lt(seen, v_splat(INFINITY));
        const vfloat share = v_select(v_splat(0.0f), v_splat(1.0f), chosen);
        for (int i = 0; i < 3; ++i) {
            ssgi_store(v_splat(0.0f), values, size, i, x, y, 0.0f);
        }
        ssgi_store(share, fractions, size, 0, x, y, 0.0f);
        mask |= multires_marks(share, x, size.x) << (x - left);
    }
    masks[multires_mask(size, left, y)] = mask;
}
