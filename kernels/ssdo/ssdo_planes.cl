// SPDX-License-Identifier: MIT
// ssdo_planes: the tangent plane of every pixel's surface, as four floats that lie together.
//
// Reads:   depth    PLANES_LAYERS images, with margin, scene units
//          normal   3 PLANES_NORMALS images, view space
// Writes:  planes   [PLANES_LAYERS][rows][columns padded to 16] quads: the normal m and c = m . x
//                   for the points x of the plane, view space; 0 where nothing is. A layer
//                   without normals faces the camera
// Macros:  PLANES_LAYERS (>= 1), PLANES_NORMALS (1..PLANES_LAYERS)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    depth and normal read, the quads written

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "direct/records.clh"
#include "raster/quads.clh"

#if !defined(PLANES_LAYERS) || !defined(PLANES_NORMALS)
#error "PLANES_LAYERS and PLANES_NORMALS must be defined by the host"
#endif

__kernel void ssdo_planes(ssgi_plane depth, ssgi_plane normal, __global int *restrict planes,
                          const int2 size, const SsgiCamera camera)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const vfloat slope_x = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f);
    const vfloat slope_y = ssgi_slope_y(camera, v_splat((float)y + 0.5f));
    for (int layer = 0; layer < PLANES_LAYERS; ++layer) {
        const vfloat own = ssgi_load(depth, size, layer, x, y);
        const vmask there = v_lt(own, v_splat(INFINITY));
        const vfloat z = v_select(v_splat(1.0f), own, there);
        const vfloat k = ssgi_k(camera, z);
        vfloat mx = zero, my = zero, mz = v_splat(1.0f);
        if (layer < PLANES_NORMALS) {
            mx = ssgi_load(normal, size, 3 * layer, x, y);
            my = ssgi_load(normal, size, 3 * layer + 1, x, y);
            mz = ssgi_load(normal, size, 3 * layer + 2, x, y);
        }
        const vfloat c = v_fma(mx, slope_x * k, v_fma(my, slope_y * k, -(mz * z)));
        const RasterQuad quad = {
            v_bits(v_select(zero, mx, there)), v_bits(v_select(zero, my, there)),
            v_bits(v_select(zero, mz, there)), v_bits(v_select(zero, c, there))};
        const vint place = ssgi_record(size, v_splat_int(layer), v_iota() + x, v_splat_int(y));
        raster_store_quads(quad, planes + 4 * v_first(place));
    }
}
