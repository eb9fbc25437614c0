// SPDX-License-Identifier: MIT
// vpl_grid: an empty grid round all tiles of the image and all lights.
//
// Reads:   boxes   [tiles][VPL_BOX]; see vpl_boxes
//          bounds  [segments][VPL_BOUNDS][params.stride] of all lights; see vpl_lists
// Writes:  occupancy  VPL_GRID^3 bits, 0
//          grid_box  4 floats; see vpl/grid.clh
// Macros:  VPL_GRID
// Params:  params.count segments
// Launch:  VPL_GRID rows of VPL_GRID work-items, each for one row of cells

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/grid.clh"
#include "vpl/receiver.clh"

#ifndef VPL_GRID
#error "VPL_GRID must be defined"
#endif

#if !defined(VPL_BOUNDS) || !defined(VPL_MARGIN_CELLS)
#error "ssgi_cl/device/constants.py defines VPL_BOUNDS, VPL_MARGIN_CELLS"
#endif

__kernel void vpl_grid(__global const float *restrict boxes, __global const float *restrict bounds,
                       __global int *restrict occupancy, __global float *restrict grid_box,
                       const int2 size, const VplParams params)
{
    const int y = (int)get_global_id(0);
    const int z = (int)get_global_id(1);
    if (y >= VPL_GRID || z >= VPL_GRID) {
        return;
    }
    for (int i = 0; i < VPL_GRID / 32; ++i) {
        occupancy[(z * VPL_GRID + y) * (VPL_GRID / 32) + i] = 0;
    }
    if (y == 0 && z == 0) {
        float low[3], high[3];
        for (int j = 0; j < 3; ++j) {
            vfloat least = v_splat(INFINITY);
            vfloat most = -least;
            for (int segment = 0; segment < params.count; ++segment) {
                __global const float *row = bounds + (segment * VPL_BOUNDS + j) * params.stride;
                for (int i = 0; i < params.stride; i += SSGI_LANES) {
                    least = v_min(least, v_load(row + i));
                    most = v_max(most, v_load(row + i));
                }
            }
            low[j] = -v_largest(-least);
            high[j] = v_largest(most);
        }
        const int2 tiles = vpl_tiles(size);
        for (int i = 0; i < tiles.x * tiles.y; ++i) {
            for (int j = 0; j < 3; ++j) { // an empty tile has +INFINITY and -INFINITY
                low[j] = min(low[j], boxes[i * VPL_BOX + j]);
                high[j] = max(high[j], boxes[i * VPL_BOX + 3 + j]);
            }
        }
        const float side =
            max(max(high[0] - low[0], high[1] - low[1]), max(high[2] - low[2], 1e-6f));
        const float cell = side / (float)(VPL_GRID - VPL_MARGIN_CELLS); // for lifted points
        for (int j = 0; j < 3; ++j) {
            grid_box[j] = low[j] - 0.5f * VPL_MARGIN_CELLS * cell;
        }
        grid_box[3] = 1.0f / cell;
    }
}
