// SPDX-License-Identifier: MIT
// raster_motion: where what each pixel sees was in the previous image.
//
// Reads:   triangles  [tile count][32][32] number of the triangle seen, or -1
//          faces [triangles][RASTER_FACE]; vertices, vertices_before [count][RASTER_VERTEX] quads:
//          of the scene, and as it was
// Writes:  motion  3 x [rows, columns]: columns and rows from a pixel to its place in the previous
//          image, pixels, within +-RASTER_LONGEST; previous depth minus depth, scene units. 0 where
//          nothing is; RASTER_LONGEST columns and rows where it was behind the previous camera
// Params:  camera, view: of the buffer; camera_before, view_before: of the previous image; scale_x,
//          scale_y: pixels of the image to one of the previous; size = result
// Macros:  RASTER_STEP 1; RASTER_LONGEST: pixels of the longest motion
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "raster/seen.clh"
#include "raster/triangle.clh"

#if !defined(RASTER_STEP) || !defined(RASTER_LONGEST)
#error "RASTER_STEP and RASTER_LONGEST must be defined by the host"
#endif

typedef struct {
    vfloat column, row, depth;
} RasterSpot;

// Where a camera sees the point of a triangle that a hit has the weights of.
RASTER_INLINE RasterSpot raster_spot(const SsgiCamera camera, const RasterView view,
                                     const RasterTriangle *t, const RasterHit hit)
{
    const vfloat px = v_fma(t->vx, hit.c, v_fma(t->ux, hit.b, t->ax));
    const vfloat py = v_fma(t->vy, hit.c, v_fma(t->uy, hit.b, t->ay));
    const vfloat pz = v_fma(t->vz, hit.c, v_fma(t->uz, hit.b, t->az));
    RasterSpot spot;
    spot.depth = -(px * view.zx + py * view.zy + pz * view.zz);
    const vfloat ahead = v_max(spot.depth, v_splat(view.near_depth));
    const vfloat k = ssgi_k(camera, ahead);
    spot.column = ssgi_column(camera, (px * view.xx + py * view.xy + pz * view.xz) / k);
    spot.row = ssgi_row(camera, (px * view.yx + py * view.yy + pz * view.yz) / k);
    return spot;
}

__kernel void raster_motion(__global const int *restrict triangles,
                            __global const int *restrict faces,
                            __global const float *restrict vertices,
                            __global const float *restrict vertices_before,
                            __global float *restrict motion, const int2 size,
                            const SsgiCamera camera, const RasterView view,
                            const SsgiCamera camera_before, const RasterView view_before,
                            const float scale_x, const float scale_y)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint seen = raster_seen(triangles, (int2)(view.tiles_x, view.tiles_y), x, y);
    const vmask there = v_ige(seen, v_splat_int(0));
    const vfloat zero = v_splat(0.0f);
    if (!v_any(there)) {
        for (int c = 0; c < 3; ++c) {
            ssgi_store(zero, motion, size, c, x, y, 0.0f);
        }
        return;
    }
    const vint triangle = v_imax(seen, v_splat_int(0));
    const RasterTriangle now = raster_triangle(view, faces, vertices, triangle, false);
    const RasterTriangle was =
        raster_triangle(view_before, faces, vertices_before, triangle, false);
    const vfloat slope_x =
        ssgi_slope_x(camera, v_to_float(raster_columns(x) - view.margin_x) + 0.5f);
    const vfloat slope_y =
        ssgi_slope_y(camera, v_splat((float)(raster_row(y) - view.margin_y) + 0.5f));
    const RasterHit hit = raster_hit(camera, view, &now, slope_x, slope_y);
    // Both by the same steps, so that the roundings of the weights cancel: what stands still has 0.
    const RasterSpot from = raster_spot(camera, view, &now, hit);
    const RasterSpot to = raster_spot(camera_before, view_before, &was, hit);
    const vmask ahead = v_lt(v_splat(view_before.near_depth), to.depth) |
                        v_eq(v_splat(camera_before.perspective), zero);
    const float longest = (float)RASTER_LONGEST;
    const vfloat far = v_splat(longest);
    const vfloat across = v_clamp(to.column * scale_x - from.column, -longest, longest);
    const vfloat down = v_clamp(to.row * scale_y - from.row, -longest, longest);
    const vfloat deeper = v_select(zero, to.depth - from.depth, there & ahead);
    ssgi_store(v_select(zero, v_select(far, across, ahead), there), motion, size, 0, x, y, 0.0f);
    ssgi_store(v_select(zero, v_select(far, down, ahead), there), motion, size, 1, x, y, 0.0f);
    ssgi_store(deeper, motion, size, 2, x, y, 0.0f);
}
