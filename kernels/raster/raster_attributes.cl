// SPDX-License-Identifier: MIT
// raster_attributes: depth, normal, albedo and emission of the triangle that each pixel sees.
//
// Reads:   triangles  [tile count][32][32] number of the triangle seen, or -1
//          faces [triangles][RASTER_FACE], vertices [count][RASTER_VERTEX] quads
//          materials [count][RASTER_MATERIAL], textures, texels, decode
//          closed  [triangles] 1 where it is counter-clockwise seen from outside, -1 from inside, 0
//                  if it is of no closed surface (RASTER_SIDES 1)
// Writes:  depth     image view.layer of a plane: scene units; INFINITY where nothing is
//          normal    images 3 view.layer + c: world space, unit length, as the mesh has it
//          albedo    likewise, in [0, 1]
//          emission  likewise, W m^-2 sr^-1 (RASTER_EMISSION not 0)
//          sides     image view.layer of a plane: 1 for the outer side of a closed surface, -1 for
//                    the inner one, 0 for another surface and for nothing (RASTER_SIDES 1)
// Params:  camera, view: of the buffer; size = result; view.matt 1: albedo has the reflectance of
//          lobes in it
// Macros:  RASTER_STEP: pixels of the buffer from one of the result to the next;
//          RASTER_SHADED (0: depth alone), RASTER_TEXTURED, RASTER_COLORED (0, 1), RASTER_EMISSION
//          (0, 1, or 2 with textures), RASTER_SIDES (0, 1)
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "raster/look_up.clh"
#include "raster/records.clh"
#include "raster/seen.clh"

#if !defined(RASTER_STEP) || !defined(RASTER_SHADED) || !defined(RASTER_TEXTURED) ||               \
    !defined(RASTER_COLORED) || !defined(RASTER_EMISSION) || !defined(RASTER_SIDES)
#error "RASTER_STEP, _SHADED, _TEXTURED, _COLORED, _EMISSION, _SIDES must be defined by the host"
#endif

#if RASTER_SIDES
// 1 in lanes that see the outer side of a closed surface, -1 for the inner one, 0 for another.
RASTER_INLINE vfloat raster_side_seen(const vint triangle, const vmask there,
                                      __global const int *restrict closed, const RasterTriangle *t,
                                      const SsgiCamera camera, const RasterView view)
{
    // From the eye to the triangle, or with an orthographic camera the view direction.
    const bool perspective = camera.perspective != 0.0f;
    const vfloat dx = perspective ? t->ax : v_splat(-view.zx);
    const vfloat dy = perspective ? t->ay : v_splat(-view.zy);
    const vfloat dz = perspective ? t->az : v_splat(-view.zz);
    const vfloat away = t->nx * dx + t->ny * dy + t->nz * dz;
    const vfloat outward = v_to_float(v_ifetch(closed, triangle, t->same));
    const vfloat side = v_select(outward, -outward, v_gt(away, v_splat(0.0f)));
    return v_select(v_splat(0.0f), side, there);
}
#endif

// Write what the lanes see of their triangles, one or several.
RASTER_INLINE void
raster_write(const vint triangle, const vmask there, const bool same,
             __global const int *restrict faces, __global const float *restrict vertices,
             __global const float *restrict materials, __global const int *restrict textures,
             __global const int *restrict texels, __global const float *restrict decode,
             __global float *restrict depth, __global float *restrict normal,
             __global float *restrict albedo, __global float *restrict emission,
#if RASTER_SIDES
             __global const int *restrict closed, __global float *restrict sides,
#endif
             const int2 size, const int x, const int y, const SsgiCamera camera,
             const RasterView view)
{
#if RASTER_SHADED
    const vfloat zero = v_splat(0.0f);
    const int first = 3 * view.layer;
#endif
    const RasterTriangle t = raster_triangle(view, faces, vertices, triangle, same);
    const vfloat slope_x =
        ssgi_slope_x(camera, v_to_float(raster_columns(x) - view.margin_x) + 0.5f);
    const vfloat slope_y =
        ssgi_slope_y(camera, v_splat((float)(raster_row(y) - view.margin_y) + 0.5f));
    const RasterHit hit = raster_hit(camera, view, &t, slope_x, slope_y);
    const vfloat kept = v_max(hit.depth, v_splat(view.near_depth));
    ssgi_store(v_select(v_splat(INFINITY), kept, there), depth, size, view.layer, x, y, INFINITY);
#if RASTER_SIDES
    ssgi_store(raster_side_seen(triangle, there, closed, &t, camera, view), sides, size, view.layer,
               x, y, 0.0f);
#endif

#if RASTER_SHADED
    const RasterAttributes turned = raster_attributes_of(vertices, &t, RASTER_NORMAL);
    const vfloat nx = raster_at(turned.x, hit);
    const vfloat ny = raster_at(turned.y, hit);
    const vfloat nz = raster_at(turned.z, hit);
    const vfloat squared = nx * nx + ny * ny + nz * nz;
    const vmask unit = there & v_gt(squared, v_splat(1e-12f));
    const vfloat scale = v_select(zero, v_rsqrt(v_max(squared, v_splat(1e-12f))), unit);
    ssgi_store(nx * scale, normal, size, first, x, y, 0.0f);
    ssgi_store(ny * scale, normal, size, first + 1, x, y, 0.0f);
    ssgi_store(nz * scale, normal, size, first + 2, x, y, 0.0f);

    const vint id = t.material;
    vfloat r = v_fetch(materials, id, t.same);
    vfloat g = v_fetch(materials, id + 1, t.same);
    vfloat b = v_fetch(materials, id + 2, t.same);
#if RASTER_COLORED || RASTER_TEXTURED || RASTER_EMISSION == 2
    const RasterAttributes own = raster_attributes_of(vertices, &t, RASTER_COLOR);
#endif
#if RASTER_COLORED
    r = r * raster_at(own.x, hit);
    g = g * raster_at(own.y, hit);
    b = b * raster_at(own.z, hit);
#endif
#if RASTER_TEXTURED || RASTER_EMISSION == 2
    const RasterTextures from = {textures, texels, decode};
#endif
#if RASTER_TEXTURED
    const vint texture = v_to_int(v_fetch(materials, id + 3, t.same));
    const RasterColor color = raster_factor(from, texture, there, camera, view, &t, hit, slope_x,
                                            slope_y, turned.w, own.w);
    r = r * color.r;
    g = g * color.g;
    b = b * color.b;
#endif
    const float matt = view.matt;
    r = v_fma(v_fetch(materials, id + 9, t.same), v_splat(matt), r);
    g = v_fma(v_fetch(materials, id + 10, t.same), v_splat(matt), g);
    b = v_fma(v_fetch(materials, id + 11, t.same), v_splat(matt), b);
    ssgi_store(v_select(zero, v_clamp(r, 0.0f, 1.0f), there), albedo, size, first, x, y, 0.0f);
    ssgi_store(v_select(zero, v_clamp(g, 0.0f, 1.0f), there), albedo, size, first + 1, x, y, 0.0f);
    ssgi_store(v_select(zero, v_clamp(b, 0.0f, 1.0f), there), albedo, size, first + 2, x, y, 0.0f);
#if RASTER_EMISSION
    vfloat glow[3];
    for (int c = 0; c < 3; ++c) {
        glow[c] = v_fetch(materials, id + (6 + c), t.same);
    }
#if RASTER_EMISSION == 2
    const vint glowing = v_to_int(v_fetch(materials, id + 12, t.same));
    const RasterColor shine = raster_factor(from, glowing, there, camera, view, &t, hit, slope_x,
                                            slope_y, turned.w, own.w);
    glow[0] = glow[0] * shine.r;
    glow[1] = glow[1] * shine.g;
    glow[2] = glow[2] * shine.b;
#endif
    for (int c = 0; c < 3; ++c) {
        ssgi_store(v_select(zero, glow[c], there), emission, size, first + c, x, y, 0.0f);
    }
#endif
#endif
}

__kernel void
raster_attributes(__global const int *restrict triangles, __global const int *restrict faces,
                  __global const float *restrict vertices, __global const float *restrict materials,
                  __global const int *restrict textures, __global const int *restrict texels,
                  __global const float *restrict decode, __global float *restrict depth,
                  __global float *restrict normal, __global float *restrict albedo,
                  __global float *restrict emission,
#if RASTER_SIDES
                  __global const int *restrict closed, __global float *restrict sides,
#endif
                  const int2 size, const SsgiCamera camera, const RasterView view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint seen = raster_seen(triangles, (int2)(view.tiles_x, view.tiles_y), x, y);
    const vmask there = v_ige(seen, v_splat_int(0));
#if RASTER_SHADED
    const vfloat zero = v_splat(0.0f);
    const int first = 3 * view.layer;
#endif
    if (!v_any(there)) {
        ssgi_store(v_splat(INFINITY), depth, size, view.layer, x, y, INFINITY);
#if RASTER_SIDES
        ssgi_store(v_splat(0.0f), sides, size, view.layer, x, y, 0.0f);
#endif
#if RASTER_SHADED
        for (int c = 0; c < 3; ++c) {
            ssgi_store(zero, normal, size, first + c, x, y, 0.0f);
            ssgi_store(zero, albedo, size, first + c, x, y, 0.0f);
#if RASTER_EMISSION
            ssgi_store(zero, emission, size, first + c, x, y, 0.0f);
#endif
        }
#endif
        return;
    }
    // Lanes that see nothing take a neighbour's triangle: often all lanes then have the same.
    const vint triangle = v_iselect(v_splat_int(v_ilargest(seen)), seen, there);
#if RASTER_SIDES
#define RASTER_INTO depth, normal, albedo, emission, closed, sides
#else
#define RASTER_INTO depth, normal, albedo, emission
#endif
    if (v_all(v_ieq(triangle, v_splat_int(v_first(triangle))))) {
        raster_write(triangle, there, true, faces, vertices, materials, textures, texels, decode,
                     RASTER_INTO, size, x, y, camera, view);
    } else {
        raster_write(triangle, there, false, faces, vertices, materials, textures, texels, decode,
                     RASTER_INTO, size, x, y, camera, view);
    }
}
