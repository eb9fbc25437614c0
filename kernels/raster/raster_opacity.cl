// SPDX-License-Identifier: MIT
// raster_opacity: how much of the surface that each pixel sees is there, and what passes it.
//
// Of a surface that blends, the share alpha times its texture's alpha is there; that lets the share
// `transmission` of light through, and what is not there lets all through.
//
// Reads:   triangles  [tile count][32][32] number of the triangle seen, or -1
//          faces [triangles][RASTER_FACE], vertices [count][RASTER_VERTEX] quads
//          materials [count][RASTER_MATERIAL], textures, texels, decode
//          through   [materials][4]: transmission (3), and 1 where it blends or 0
// Writes:  opacity      [rows, columns] in [0, 1]; 0 where nothing is
//          transmitted  3 x [rows, columns] in [0, 1]; 1 where nothing is
// Params:  camera, view: of the buffer; size = result
// Launch:  SSGI_LANES pixels of a row per work-item

#define RASTER_STEP 1

#include "common/gbuffer.clh"
#include "raster/look_up.clh"
#include "raster/records.clh"
#include "raster/seen.clh"

__kernel void
raster_opacity(__global const int *restrict triangles, __global const int *restrict faces,
               __global const float *restrict vertices, __global const float *restrict materials,
               __global const int *restrict textures, __global const int *restrict texels,
               __global const float *restrict decode, __global const float *restrict through,
               __global float *restrict opacity, __global float *restrict transmitted,
               const int2 size, const SsgiCamera camera, const RasterView view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const vint seen = raster_seen(triangles, (int2)(view.tiles_x, view.tiles_y), x, y);
    const vmask there = v_ige(seen, v_splat_int(0));
    if (!v_any(there)) {
        ssgi_store(zero, opacity, size, 0, x, y, 0.0f);
        for (int c = 0; c < 3; ++c) {
            ssgi_store(one, transmitted, size, c, x, y, 0.0f);
        }
        return;
    }
    const vint triangle = v_iselect(v_splat_int(v_ilargest(seen)), seen, there);
    const RasterTriangle t = raster_triangle(view, faces, vertices, triangle, false);
    const vfloat slope_x =
        ssgi_slope_x(camera, v_to_float(raster_columns(x) - view.margin_x) + 0.5f);
    const vfloat slope_y =
        ssgi_slope_y(camera, v_splat((float)(raster_row(y) - view.margin_y) + 0.5f));
    const RasterHit hit = raster_hit(camera, view, &t, slope_x, slope_y);
    const vint own = v_igather(faces + 3, triangle * RASTER_FACE) * 4;
    const vmask blends = v_gt(v_gather(through, own + 3), zero);
    vfloat alpha = v_gather(materials, t.material + 4);
    const vint texture = v_to_int(v_gather(materials, t.material + 3));
    const vmask textured = there & blends & v_ige(texture, v_splat_int(0));
    if (v_any(textured)) {
        const RasterTextures from = {textures, texels, decode};
        const RasterColor color =
            raster_look_up(from, texture, camera, view, &t, hit, slope_x, slope_y,
                           raster_attributes_of(vertices, &t, RASTER_NORMAL).w,
                           raster_attributes_of(vertices, &t, RASTER_COLOR).w);
        alpha = v_select(alpha, alpha * color.a, textured);
    }
    const vfloat kept = v_select(one, v_clamp(alpha, 0.0f, 1.0f), blends);
    ssgi_store(v_select(zero, kept, there), opacity, size, 0, x, y, 0.0f);
    for (int c = 0; c < 3; ++c) {
        const vfloat passes = one - kept + kept * v_gather(through, own + c);
        ssgi_store(v_select(one, passes, there), transmitted, size, c, x, y, 1.0f);
    }
}
