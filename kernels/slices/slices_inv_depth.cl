// SPDX-License-Identifier: MIT
// slices_inv_depth: depth layers as the scan of slices reads them, at full size or less.
//
// Picks every n-th pixel and sorts each row by column modulo 4, so that pixels which scan alike lie
// side by side. 1 / depth is linear in the pixel position on every plane and has a finite value, 0,
// for nothing.
//
// Reads:   depth      INV_DEPTH_LAYERS x [rows, columns] with margin, scene units; INFINITY where
//                     nothing is
//          thickness  INV_DEPTH_THICKNESS x [rows, columns] with margin, scene units; -1: not known
// Writes:  inv_depth  INV_DEPTH_LAYERS x [rows, 4 stride], column c at (c + lead) % 4 * stride +
//                     (c + lead) / 4: 1 / depth, 0 where nothing is (perspective);
//                     depth in pixels' widths, INFINITY where nothing is (orthographic);
//                     INV_DEPTH_THICKNESS images behind them, thickness in scene units
// Macros:  INV_DEPTH_LAYERS (>= 1), INV_DEPTH_THICKNESS: layers that have a thickness (>= 0)
// Launch:  SSGI_LANES floats of a row of `inv_depth` per work-item
// Cost:    1 read and 1 write per pixel and layer

#include "common/camera.clh"
#include "slices/sorted.clh"

#if !defined(INV_DEPTH_LAYERS) || !defined(INV_DEPTH_THICKNESS)
#error "INV_DEPTH_LAYERS and INV_DEPTH_THICKNESS must be defined by the host"
#endif

__kernel void slices_inv_depth(ssgi_plane depth,
#if INV_DEPTH_THICKNESS
                               ssgi_plane thickness,
#endif
                               __global float *restrict inv_depth, const int2 size,
                               const int2 fine_size, const int columns, const int lead,
                               const int step, const int first_x, const int first_y,
                               const float ortho_unit, const SsgiCamera camera)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const bool perspective = camera.perspective != 0.0f;
    const SsgiSorted from =
        ssgi_sorted(size.x, x, y, fine_size, columns, lead, step, first_x, first_y);
    for (int layer = 0; layer < INV_DEPTH_LAYERS; ++layer) {
        const vfloat z = ssgi_load_sorted(depth, &from, layer);
        const vmask there = from.inside & v_lt(z, v_splat(INFINITY));
        const vfloat value = perspective ? v_select(v_splat(0.0f), 1.0f / z, there)
                                         : v_select(v_splat(INFINITY), z * ortho_unit, there);
        ssgi_store(value, inv_depth, size, layer, x, y, perspective ? 0.0f : INFINITY);
    }
#if INV_DEPTH_THICKNESS
    for (int layer = 0; layer < INV_DEPTH_THICKNESS; ++layer) {
        const vfloat thick = ssgi_load_sorted(thickness, &from, layer);
        ssgi_store(v_select(v_splat(0.0f), thick, from.inside), inv_depth, size,
                   INV_DEPTH_LAYERS + layer, x, y, 0.0f);
    }
#endif
}
