// SPDX-License-Identifier: MIT
// occupancy_clear: an empty grid round all tiles of the image and all lights.
//
// Reads:   boxes   [params.boxes][VPL_BOX] of tiles; see vpl_boxes
//          bounds  [params.segments][VPL_BOUNDS][params.stride] of all lights; see vpl_lists
// Writes:  occupancy  OCCUPANCY_CELLS^3 bits, 0
//          grid_box  see occupancy/grid.clh
// Macros:  OCCUPANCY_CELLS
// Params:  how many boxes and bounds there are; what grid_box says of rays
// Launch:  OCCUPANCY_CELLS rows of OCCUPANCY_CELLS work-items, each for one row of cells

#include "common/gbuffer.clh"
#include "occupancy/grid.clh"

#if !defined(VPL_BOX) || !defined(VPL_BOUNDS) || !defined(OCCUPANCY_MARGIN)
#error "ssgi_cl/device/constants.py defines VPL_BOX, VPL_BOUNDS, OCCUPANCY_MARGIN"
#endif

__kernel void occupancy_clear(__global const float *restrict boxes,
                              ssgi_optional __global const float *restrict bounds,
                              __global int *restrict occupancy, __global float *restrict grid_box,
                              const int2 size, const OccupancyParams params)
{
    const int y = (int)get_global_id(0);
    const int z = (int)get_global_id(1);
    if (y >= size.x || z >= size.y) {
        return;
    }
    for (int i = 0; i < OCCUPANCY_CELLS / 32; ++i) {
        occupancy[(z * OCCUPANCY_CELLS + y) * (OCCUPANCY_CELLS / 32) + i] = 0;
    }
    if (y == 0 && z == 0) {
        float low[3], high[3];
        for (int j = 0; j < 3; ++j) {
            vfloat least = v_splat(INFINITY);
            vfloat most = -least;
            for (int segment = 0; segment < params.segments; ++segment) {
                __global const float *row = bounds + (segment * VPL_BOUNDS + j) * params.stride;
                for (int i = 0; i < params.stride; i += SSGI_LANES) {
                    least = v_min(least, v_load(row + i));
                    most = v_max(most, v_load(row + i));
                }
            }
            low[j] = -v_largest(-least);
            high[j] = v_largest(most);
        }
        for (int i = 0; i < params.boxes; ++i) {
            for (int j = 0; j < 3; ++j) { // an empty tile has +INFINITY and -INFINITY
                low[j] = min(low[j], boxes[i * VPL_BOX + j]);
                high[j] = max(high[j], boxes[i * VPL_BOX + 3 + j]);
            }
        }
        const float side =
            max(max(high[0] - low[0], high[1] - low[1]), max(high[2] - low[2], 1e-6f));
        const float cell = side / (float)(OCCUPANCY_CELLS - OCCUPANCY_MARGIN); // for lifted points
        for (int j = 0; j < 3; ++j) {
            grid_box[j] = low[j] - 0.5f * OCCUPANCY_MARGIN * cell;
        }
        grid_box[3] = 1.0f / cell;
        grid_box[4] = params.lift;
    }
}
