// SPDX-License-Identifier: MIT
// vpl_occupy: marks the cells of the grid in which the camera or a light sees a surface.
//
// Reads:   points    VPL_LAYERS x [rows, columns] depth, scene units; or 3 x [rows, columns] position
//          normal    3 x [rows, columns], 0 where no position is (not read with depths)
//          grid_box  see vpl/grid.clh
// Writes:  grid      VPL_GRID^3 bits, to which 1s are added
// Macros:  VPL_GRID, VPL_LAYERS (0: positions; 1 or more of depth)
// Params:  camera; from the space of positions to view space
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/grid.clh"

#if !defined(VPL_GRID) || !defined(VPL_LAYERS)
#error "VPL_GRID and VPL_LAYERS must be defined"
#endif

static inline void vpl_set(volatile __global int *restrict grid, const int word, const int bit)
{
    if (word >= 0 && (grid[word] & bit) == 0) { // most are set already
        atomic_or(grid + word, bit);
    }
}

// Marks the cells of the lanes in `there`.
static inline void vpl_mark(__global int *restrict grid, __global const float *restrict grid_box,
                            const vfloat x, const vfloat y, const vfloat z, const vmask there)
{
    const vfloat side = v_splat((float)VPL_GRID);
    const vfloat zero = v_splat(0.0f);
    const vfloat cx = (x - grid_box[0]) * grid_box[3];
    const vfloat cy = (y - grid_box[1]) * grid_box[3];
    const vfloat cz = (z - grid_box[2]) * grid_box[3];
    const vmask inside = there & v_ge(cx, zero) & v_lt(cx, side) & v_ge(cy, zero) &
                         v_lt(cy, side) & v_ge(cz, zero) & v_lt(cz, side);
    const vint column = v_to_int(v_select(zero, cx, inside));
    const vint row = v_to_int(v_select(zero, cy, inside));
    const vint slice = v_to_int(v_select(zero, cz, inside));
    const vint block = ((slice >> 2) * VPL_BLOCKS + (row >> 2)) * VPL_BLOCKS + (column >> 2);
    const vint word = v_iselect(v_splat_int(-1), block * 2 + ((slice >> 1) & 1), inside);
    const vint bit = v_splat_int(1) << (((slice & 1) << 4) | ((row & 3) << 2) | (column & 3));
#if SSGI_LANES == 1
    vpl_set(grid, word, bit);
#else
#define VPL_SET(n) vpl_set(grid, word.s##n, bit.s##n)
    (void)(SSGI_EACH(VPL_SET));
#undef VPL_SET
#endif
}

__kernel void vpl_occupy(ssgi_plane points, ssgi_plane normal,
                         __global const float *restrict grid_box, __global int *restrict grid,
                         const int2 size, const SsgiCamera camera, const VplParams params,
                         const VplTurn turn)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vmask image = v_ilt(v_iota() + x, v_splat_int(size.x));
    const float per = params.per_unit;
#if VPL_LAYERS
    const vfloat sx = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f);
    const vfloat sy = ssgi_slope_y(camera, v_splat((float)y + 0.5f));
    for (int layer = 0; layer < VPL_LAYERS; ++layer) {
        const vfloat seen = ssgi_load(points, size, layer, x, y);
        const vmask there = image & v_lt(seen, v_splat(INFINITY));
        if (v_any(there)) {
            const vfloat z = v_select(v_splat(1.0f), seen, there);
            const vfloat k = ssgi_k(camera, z) * per;
            vpl_mark(grid, grid_box, sx * k, sy * k, z * -per, there);
        }
    }
#else
    const vfloat zero = v_splat(0.0f);
    const vfloat nx = ssgi_load(normal, size, 0, x, y);
    const vfloat ny = ssgi_load(normal, size, 1, x, y);
    const vfloat nz = ssgi_load(normal, size, 2, x, y);
    const vmask there = image & (v_ne(nx, zero) | v_ne(ny, zero) | v_ne(nz, zero));
    if (v_any(there)) {
        const vfloat px = ssgi_load(points, size, 0, x, y);
        const vfloat py = ssgi_load(points, size, 1, x, y);
        const vfloat pz = ssgi_load(points, size, 2, x, y);
        vpl_mark(grid, grid_box, (px * turn.xx + py * turn.xy + pz * turn.xz + turn.x) * per,
                 (px * turn.yx + py * turn.yy + pz * turn.yz + turn.y) * per,
                 (px * turn.zx + py * turn.zy + pz * turn.zz + turn.z) * per, there);
    }
#endif
}
