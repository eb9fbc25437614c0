// SPDX-License-Identifier: MIT
// raster_sides: which side of a closed surface each pixel sees.
//
// Reads:   triangles  [tile count][32][32] number of the triangle seen, or -1
//          faces [triangles][RASTER_FACE], vertices [count][RASTER_VERTEX] quads
//          closed  [triangles] 1 where it is counter-clockwise seen from outside, -1 from inside, 0
//                  if it is of no closed surface
// Writes:  sides  image view.layer of a plane: 1 for the outer side, -1 for the inner one, 0 for
//                 another surface and for nothing
// Params:  camera, view: of the buffer; size = image
// Launch:  SSGI_LANES pixels of a row per work-item

#define RASTER_STEP 1
#include "common/gbuffer.clh"
#include "raster/records.clh"
#include "raster/seen.clh"
#include "raster/triangle.clh"

__kernel void raster_sides(__global const int *restrict triangles,
                           __global const int *restrict faces,
                           __global const float *restrict vertices,
                           __global const int *restrict closed, __global float *restrict sides,
                           const int2 size, const SsgiCamera camera, const RasterView view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint seen = raster_seen(triangles, (int2)(view.tiles_x, view.tiles_y), x, y);
    const vmask there = v_ige(seen, v_splat_int(0));
    vfloat side = v_splat(0.0f);
    if (v_any(there)) {
        // Lanes that see nothing take a neighbour's triangle: often all lanes then have the same.
        const vint triangle = v_iselect(v_splat_int(v_ilargest(seen)), seen, there);
        const bool same = v_all(v_ieq(triangle, v_splat_int(v_first(triangle))));
        const RasterTriangle t = raster_triangle(view, faces, vertices, triangle, same);
        // From the eye to the triangle, or with an orthographic camera the view direction.
        const bool perspective = camera.perspective != 0.0f;
        const vfloat dx = perspective ? t.ax : v_splat(-view.zx);
        const vfloat dy = perspective ? t.ay : v_splat(-view.zy);
        const vfloat dz = perspective ? t.az : v_splat(-view.zz);
        const vfloat away = t.nx * dx + t.ny * dy + t.nz * dz;
        const vfloat outward = v_to_float(v_ifetch(closed, triangle, same));
        side = v_select(outward, -outward, v_gt(away, v_splat(0.0f)));
        side = v_select(v_splat(0.0f), side, there);
    }
    ssgi_store(side, sides, size, view.layer, x, y, 0.0f);
}
