// SPDX-License-Identifier: MIT
// occupancy_reach: distance from each block to the nearest one that holds a surface, by one axis
// more.
//
// Method:  the least, along the axis, of the greater of the way there and the distance found in the
//          pass before; after three passes it is the distance in the greatest direction.
// Reads and writes:
//          occupancy  see occupancy/grid.clh
// Macros:  OCCUPANCY_CELLS
// Launch:  SSGI_LANES blocks per work-item
// Cost:    2 OCCUPANCY_REACH reads per block

#include "common/gbuffer.clh"
#include "occupancy/grid.clh"

__kernel void occupancy_reach(__global int *occupancy,
                              const int2 size) // (blocks from one to the next along the axis, pass)
{
    const int first = ssgi_first_column();
    if (first >= OCCUPANCY_ALL_BLOCKS) {
        return;
    }
    const vint number = v_iota() + first;
    const vint at = number / size.x % OCCUPANCY_BLOCKS;
    vint least = v_splat_int(OCCUPANCY_REACH);
    for (int k = 1 - OCCUPANCY_REACH; k < OCCUPANCY_REACH; ++k) {
        const vmask inside = v_within(at + k, OCCUPANCY_BLOCKS);
        const vint other = v_iselect(number, number + k * size.x, inside);
        vint far;
        if (size.y == 0) {
            const vint bits = v_igather(occupancy, 2 * other) | v_igather(occupancy, 2 * other + 1);
            far = v_iselect(v_splat_int(OCCUPANCY_REACH), v_splat_int(0),
                            v_ine(bits, v_splat_int(0)));
        } else {
            far = v_igather(occupancy + (size.y == 1 ? 3 : 2) * OCCUPANCY_ALL_BLOCKS, other);
        }
        far = v_iselect(v_splat_int(OCCUPANCY_REACH), far, inside);
        least = v_imin(least, v_imax(far, v_splat_int(max(k, -k))));
    }
    v_istore(least, occupancy + (size.y == 1 ? 2 : 3) * OCCUPANCY_ALL_BLOCKS + first);
}
