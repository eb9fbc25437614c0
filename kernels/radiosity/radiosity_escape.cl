// SPDX-License-Identifier: MIT
// radiosity_escape: irradiance of points by the sky, along kept rays that meet nothing.
//
// Method:  E = pi / rays sum L, with L the mean of the environments over a ray's share of the
//          hemisphere, which in proportion to the cosine is pi / rays
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, as of radiosity_rays
//          places     see radiosity_rays; of x alone
//          sky, images  see common/sky.clh
// Writes:  irradiance 3 x [size.x]
// Params:  rays: of a point; texels_per_angle, levels: see common/sky.clh
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    4 reads for each ray, and 13 and 60 operations for each that escapes

#include "common/sky.clh"
#include "radiosity/points.clh"
#include "rays/hemisphere.clh"

__kernel void
radiosity_escape(__global const float *restrict points, __global const float *restrict ways,
                 __global const int *restrict places, __global const float *restrict sky,
                 __global const int *restrict images, __global float *restrict irradiance,
                 const int2 size, const int rays, const float texels_per_angle, const int levels)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat zero = v_splat(0.0f), angle = v_splat(3.14159265f / (float)rays);
    const SurfacePoint at = surface_point(points, stride, first, 0.0f);
    const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
    const vint tile = v_floor_to_int(v_load(points + POINT_TILE * stride + first));
    vfloat sum[3] = {zero, zero, zero};
    for (int i = 0; i < rays; ++i) {
        const vmask open = v_ilt(v_iload(places + i * 3 * stride + first), v_splat_int(0));
        if (!v_any(open)) {
            continue;
        }
        vfloat way[3], found[3];
        hemisphere_way(frame, ways, i, tile, way);
        sky_radiance(sky, images, way[0], way[1], way[2], angle, texels_per_angle, levels, found);
        for (int c = 0; c < 3; ++c) {
            sum[c] = sum[c] + v_select(zero, found[c], open);
        }
    }
    for (int c = 0; c < 3; ++c) {
        v_store(sum[c] * (3.14159265f / (float)rays), irradiance + c * stride + first);
    }
}
