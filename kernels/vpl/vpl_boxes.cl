// SPDX-License-Identifier: MIT
// vpl_boxes: bounds of the surfaces of each tile of the image.
//
// Reads:   depth   [rows, columns] with margin, scene units; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space
// Writes:  boxes   [tiles][16]: least and greatest position (0-5) in lengths of params.per_unit,
//                  least and greatest normal (6-11), least height n . x of a pixel's tangent plane
//                  above the eye (12), 1 if anything is there, else 0 (13)
// Params:  how many lengths a scene unit is
// Launch:  a work-item for each tile of VPL_TILE x VPL_TILE pixels

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/receiver.clh"

__kernel void vpl_boxes(ssgi_plane depth, ssgi_plane normal, __global float *restrict boxes,
                        const int2 size, const SsgiCamera camera, const VplParams params)
{
    const int tile_x = (int)get_global_id(0);
    const int tile_y = (int)get_global_id(1);
    const int2 tiles = vpl_tiles(size);
    if (tile_x >= tiles.x || tile_y >= tiles.y) {
        return;
    }
    const vfloat high = v_splat(INFINITY);
    vfloat least[7] = {high, high, high, high, high, high, high};
    vfloat most[6] = {-high, -high, -high, -high, -high, -high};
    vmask any = v_splat_int(0);
    const int bottom = min(size.y, (tile_y + 1) * VPL_TILE);
    for (int y = tile_y * VPL_TILE; y < bottom; ++y) {
        for (int i = 0; i < VPL_TILE; i += SSGI_LANES) {
            const int x = tile_x * VPL_TILE + i;
            const VplReceiver at = vpl_receiver(depth, normal, size, camera, params, x, y);
            const vmask there = at.there & v_ilt(v_iota() + x, v_splat_int(size.x));
            const vfloat values[6] = {at.x, at.y, at.z, at.nx, at.ny, at.nz};
            for (int j = 0; j < 6; ++j) {
                least[j] = v_min(least[j], v_select(high, values[j], there));
                most[j] = v_max(most[j], v_select(-high, values[j], there));
            }
            const vfloat height = v_fma(at.nx, at.x, v_fma(at.ny, at.y, at.nz * at.z));
            least[6] = v_min(least[6], v_select(high, height, there));
            any = any | there;
        }
    }
    __global float *restrict box = boxes + (tile_y * tiles.x + tile_x) * VPL_BOX;
    for (int j = 0; j < 3; ++j) {
        box[j] = -v_largest(-least[j]);
        box[3 + j] = v_largest(most[j]);
        box[6 + j] = -v_largest(-least[3 + j]);
        box[9 + j] = v_largest(most[3 + j]);
    }
    box[12] = -v_largest(-least[6]);
    box[13] = v_any(any) ? 1.0f : 0.0f;
}
