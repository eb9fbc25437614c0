// SPDX-License-Identifier: MIT
// vpl_near: for each tile, the virtual point lights that give way to their parts there.
//
// Reads:   boxes   [tiles][VPL_BOX]; see vpl_boxes
//          lights  [segments][VPL_BOUNDS][params.stride]; see vpl_lists
// Writes:  near    [tiles][params.near_capacity] lights of all 16 segments of the batch that are
//                  closer than sqrt(params.refine A) to the tile, segment * params.span + number
//                  each
//          counts  [tiles]; 0 where there is no room for all of them, which then stay whole
// Launch:  a work-item for each tile; lanes are lights

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/receiver.clh"

#ifndef VPL_BOUNDS
#error "ssgi_cl/device/constants.py defines VPL_BOUNDS"
#endif

__kernel void vpl_near(__global const float *restrict boxes, __global const float *restrict lights,
                       __global int *restrict near, __global int *restrict counts, const int2 size,
                       const VplParams params)
{
    const int tile_x = (int)get_global_id(0);
    const int tile_y = (int)get_global_id(1);
    const int2 tiles = vpl_tiles(size);
    if (tile_x >= tiles.x || tile_y >= tiles.y) {
        return;
    }
    const int tile = tile_y * tiles.x + tile_x;
    __global const float *restrict box = boxes + tile * VPL_BOX;
    __global int *restrict list = near + tile * params.near_capacity;
    int count = 0;
    for (int subset = 0; subset < 16 && box[13] > 0.0f; ++subset) {
        __global const float *restrict own =
            lights + (params.segment + subset) * VPL_BOUNDS * params.stride;
        const int number_of = (params.count - subset + 15) / 16;
        for (int i = 0; i < number_of; i += SSGI_LANES) {
            vfloat squared = v_splat(0.0f); // least distance from the tile's box
            for (int j = 0; j < 3; ++j) {
                const vfloat y = v_load(own + j * params.stride + i);
                const vfloat d = v_max(v_max(box[j] - y, y - box[3 + j]), v_splat(0.0f));
                squared = v_fma(d, d, squared);
            }
            const vfloat area = v_load(own + 6 * params.stride + i);
            const vmask close =
                v_lt(squared, area * params.refine) & v_ilt(v_iota() + i, v_splat_int(number_of));
            // A place beyond the last is written to before the mask moves on, or doesn't.
            if (v_any(close) && count + SSGI_LANES <= params.near_capacity) {
                count = vpl_append(list, count, v_iota() + (i + subset * params.span), close);
            } else if (v_any(close)) {
                counts[tile] = 0;
                return;
            }
        }
    }
    counts[tile] = count;
}
