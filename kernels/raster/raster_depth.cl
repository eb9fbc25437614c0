// SPDX-License-Identifier: MIT
// raster_depth: depth alone, from the D that the visibility buffer has, in a tenth of the time of
// raster_attributes. It is a few roundings off, far below the slack of a shadow map's texel.
//
// Reads:   depths  [tile count][32][32] D, -INFINITY where nothing is
// Writes:  depth   image view.layer of a plane: scene units; INFINITY where nothing is
// Params:  size = image
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "raster/records.clh"

__kernel void raster_depth(__global const float *restrict depths, __global float *restrict depth,
                           const int2 size, const SsgiCamera camera, const RasterView view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat d = v_load(depths + raster_place(view.tiles_x, x, y));
    const vmask there = v_gt(d, v_splat(-INFINITY));
    const vfloat own = camera.perspective != 0.0f ? 1.0f / v_select(v_splat(1.0f), d, there) : -d;
    const vfloat kept = v_max(own, v_splat(view.near_depth));
    ssgi_store(v_select(v_splat(INFINITY), kept, there), depth, size, view.layer, x, y, INFINITY);
}
