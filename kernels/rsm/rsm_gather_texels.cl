// SPDX-License-Identifier: MIT
// rsm_gather_texels: a reflective shadow map as a list of records, a texel each.
//
// Reads:   position  3 x [rows, columns] scene units from the map's origin, world axes
//          normal    3 x [rows, columns] world space, unit length
//          flux      3 x [rows, columns] W
//          area      [rows, columns] square scene units
// Writes:  texels    [rows * columns] records, see records.clh
//          powers    [rows * columns] the sum of the three fluxes, W
// Launch:  SSGI_LANES texels of a row per work-item

#include "common/gbuffer.clh"
#include "rsm/records.clh"

__kernel void rsm_gather_texels(ssgi_plane position, ssgi_plane normal, ssgi_plane flux,
                                ssgi_plane area, __global float *restrict texels,
                                __global float *restrict powers, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    vfloat power = v_splat(0.0f);
    // Lanes past the last column write what it has, once more.
    const vint column = v_imin(v_iota() + x, v_splat_int(size.x - 1));
    const vint row = v_splat_int(y);
    const vint index = column + y * size.x;
    const vint at = index * RSM_RECORD;
    for (int c = 0; c < 3; ++c) {
        v_scatter(ssgi_gather(position, size, c, column, row), texels + RSM_AT + c, at);
        v_scatter(ssgi_gather(normal, size, c, column, row), texels + RSM_NORMAL + c, at);
        const vfloat own = ssgi_gather(flux, size, c, column, row);
        v_scatter(own, texels + RSM_FLUX + c, at);
        power = power + own;
    }
    v_scatter(ssgi_gather(area, size, 0, column, row), texels + RSM_AREA, at);
    v_scatter(power, texels + RSM_POWER, at);
    v_scatter(power, powers, index);
}
