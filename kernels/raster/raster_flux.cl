// SPDX-License-Identifier: MIT
// raster_flux: the light that each texel of a reflective shadow map reflects, in watts.
//
// Method:  Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", section 3.1. A texel's flux
// is
//          intensity times its solid angle (spot and point light), or irradiance times its area
//          (directional light), times albedo; distance and the receiver's cosine don't enter.
// Reads:   depth   [rows, columns] INFINITY where nothing is
//          albedo  3 x [rows, columns]
// Writes:  flux    3 x [rows, columns] W; 0 beyond the cone and where nothing is
// Params:  intensity or irradiance, the cone's axis in view space and its least cosine
// Launch:  SSGI_LANES texels of a row per work-item

#include "common/camera.clh"
#include "common/gbuffer.clh"

__kernel void raster_flux(ssgi_plane depth, ssgi_plane albedo, __global float *restrict flux,
                          const int2 size, const SsgiCamera camera, const FluxParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat sx = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f) * camera.perspective;
    const vfloat sy = ssgi_slope_y(camera, v_splat((float)y + 0.5f)) * camera.perspective;
    // A texel at distance 1 has area a and lies at squared distance d2, tilted by its cosine:
    // solid angle a / d2^(3/2). An orthographic texel has sx = sy = 0, so this is its area.
    const vfloat inverse = v_rsqrt(v_fma(sx, sx, v_fma(sy, sy, v_splat(1.0f))));
    const float area = fabs(camera.to_x * camera.to_y);
    const vfloat angle = inverse * inverse * inverse * area;
    const vfloat cosine = v_fma(sx, v_splat(params.axis_x),
                                v_fma(sy, v_splat(params.axis_y), v_splat(-params.axis_z))) *
                          inverse;
    const vmask lit = v_lt(ssgi_load(depth, size, 0, x, y), v_splat(INFINITY)) &
                      v_ge(cosine, v_splat(params.least_cosine));
    const vfloat share = v_select(v_splat(0.0f), angle, lit);
    ssgi_store(ssgi_load(albedo, size, 0, x, y) * share * params.red, flux, size, 0, x, y, 0.0f);
    ssgi_store(ssgi_load(albedo, size, 1, x, y) * share * params.green, flux, size, 1, x, y, 0.0f);
    ssgi_store(ssgi_load(albedo, size, 2, x, y) * share * params.blue, flux, size, 2, x, y, 0.0f);
}
