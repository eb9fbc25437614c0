// SPDX-License-Identifier: MIT
// raster_hidden: triangles of the visibility buffer that lie behind a drawn surface are none.
//
// Surfaces that are seen through are drawn by themselves, in front of what is not. One that lies on
// the other, up to `view.peel`, is in front.
//
// Reads:   depths  [tile count][32][32] D of what is seen, see raster_tiles
//          front   depth of the other surface, scene units: an image that exceeds the buffer's
//                  as much on all sides; INFINITY where nothing is
// Writes:  triangles  likewise tiled: -1 where it is hidden
//          found      [1] 1 if anything is left anywhere; set to 0 before
// Params:  size = image; whole = columns and rows of `front`; camera, view: of the buffer
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "raster/records.clh"

__kernel void raster_hidden(__global const float *restrict depths, ssgi_plane front,
                            __global int *restrict triangles, __global int *restrict found,
                            const int2 size, const int2 whole, const SsgiCamera camera,
                            const RasterView view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int at = raster_place(view.tiles_x, x, y);
    const vint seen = v_iload(triangles + at);
    const int2 margin = (whole - size) / 2;
    const vfloat other = ssgi_load(front, whole, 0, x + margin.x, y + margin.y);
    const vfloat limit = camera.perspective > 0.0f
                             ? v_splat(view.peel) / other
                             : v_fma(other, v_splat(-view.peel), v_splat(-view.peel_more));
    const vmask left = v_ige(seen, v_splat_int(0)) & v_ge(v_load(depths + at), limit);
    v_istore(v_iselect(v_splat_int(-1), seen, left), triangles + at);
    if (v_any(left)) {
        atomic_or(found, 1);
    }
}
