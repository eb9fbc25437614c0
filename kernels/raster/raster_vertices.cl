// SPDX-License-Identifier: MIT
// raster_vertices: vertices to view space, snapped screen positions and clip codes.
//
// Reads:   positions  3 x [vertices] scene units, relative to the scene's origin
// Writes:  view       3 x [vertices] view space
//          screen     [vertices, a multiple of 16][4] column and row in 1/256 pixels, wrong where
//                     the code forbids it; code; the bits of z in view space. The code's bits: left
//                     1, right 2, above 4, below 8, nearer than the near plane 16, beyond the far
//                     plane 32, must be clipped before snapping 64
//          counters   set to 0, and `tiles` [2][tile count] too
// Params:  size = (vertices, 1); view matrix, camera, near and far plane
// Launch:  SSGI_LANES vertices per work-item

#include "common/camera.clh"
#include "raster/quads.clh"
#include "raster/records.clh"

__kernel void raster_vertices(__global const float *restrict positions,
                              __global float *restrict view, __global int *restrict screen,
                              __global int *restrict counters, __global int *restrict tiles,
                              const int2 size, const SsgiCamera camera, const RasterView to_view)
{
    const int i = (int)get_global_id(0) * SSGI_LANES;
    const int stride = (size.x + 15) & ~15;
    const int own = (int)get_global_id(0), items = (int)get_global_size(0);
    for (int j = own; j < RASTER_COUNTERS; j += items) {
        counters[j] = 0;
    }
    for (int j = own; j < 2 * to_view.tiles_x * to_view.tiles_y; j += items) {
        tiles[j] = 0;
    }
    if (i >= size.x) {
        return;
    }
    const vfloat x = v_load(positions + i);
    const vfloat y = v_load(positions + stride + i);
    const vfloat z = v_load(positions + 2 * stride + i);
    const vfloat vx =
        v_fma(v_splat(to_view.xx), x,
              v_fma(v_splat(to_view.xy), y, v_fma(v_splat(to_view.xz), z, v_splat(to_view.x))));
    const vfloat vy =
        v_fma(v_splat(to_view.yx), x,
              v_fma(v_splat(to_view.yy), y, v_fma(v_splat(to_view.yz), z, v_splat(to_view.y))));
    const vfloat vz =
        v_fma(v_splat(to_view.zx), x,
              v_fma(v_splat(to_view.zy), y, v_fma(v_splat(to_view.zz), z, v_splat(to_view.z))));
    v_store(vx, view + i);
    v_store(vy, view + stride + i);
    v_store(vz, view + 2 * stride + i);

    const vfloat depth = -vz;
    const vfloat k = ssgi_k(camera, depth);
    // Columns and rows times k: the sides of the view are half-spaces in these, for any k. They
    // count from the image's corner and not from the margin's: the margin must not change a bit.
    const vfloat hx = v_fma(vx, v_splat(camera.from_x), k * camera.centre_x);
    const vfloat hy = v_fma(vy, v_splat(camera.from_y), k * camera.centre_y);
    const float margin_x = (float)to_view.margin_x;
    const float margin_y = (float)to_view.margin_y;
    const vint none = v_splat_int(0);
    vint code = v_iselect(none, v_splat_int(1), v_lt(hx, k * -margin_x));
    code = code | v_iselect(none, v_splat_int(2), v_gt(hx, k * (to_view.columns - margin_x)));
    code = code | v_iselect(none, v_splat_int(4), v_lt(hy, k * -margin_y));
    code = code | v_iselect(none, v_splat_int(8), v_gt(hy, k * (to_view.rows - margin_y)));
    const vmask too_near = v_lt(depth, v_splat(to_view.near_depth));
    code = code | v_iselect(none, v_splat_int(16), too_near);
    code = code | v_iselect(none, v_splat_int(32), v_gt(depth, v_splat(to_view.far_depth)));
    const vfloat inverse = 1.0f / v_select(k, v_splat(1.0f), too_near);
    const vfloat column = hx * inverse;
    const vfloat row = hy * inverse;
    const vmask clip = too_near | v_gt(v_abs(column), v_splat(RASTER_REACH)) |
                       v_gt(v_abs(row), v_splat(RASTER_REACH));
    code = code | v_iselect(none, v_splat_int(64), clip);
    const vfloat zero = v_splat(0.0f);
    const float steps = (float)RASTER_SUBPIXELS;
    const vint snapped_x = v_floor_to_int(v_select(column, zero, clip) * steps + 0.5f);
    const vint snapped_y = v_floor_to_int(v_select(row, zero, clip) * steps + 0.5f);
    const RasterQuad quad = {snapped_x + to_view.margin_x * RASTER_SUBPIXELS,
                             snapped_y + to_view.margin_y * RASTER_SUBPIXELS, code, v_bits(vz)};
    raster_store_quads(quad, screen + 4 * i);
}
