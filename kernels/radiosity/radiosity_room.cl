// SPDX-License-Identifier: MIT
// radiosity_room: the share of rays over the hemispheres of points that go farther than a length.
//
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, see radiosity_rays
//          nodes, triangles  see rays/bvh.clh
// Writes:  far        [size.x] 0 to 1
// Params:  rays; lift: height above their surfaces at which rays begin; reach: the length
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a short walk through the hierarchy for each ray

#include "radiosity/points.clh"
#include "rays/hemisphere.clh"

__kernel void radiosity_room(__global const float *restrict points,
                             __global const float *restrict ways,
                             __global const float *restrict nodes,
                             __global const float *restrict triangles, __global float *restrict far,
                             const int2 size, const int rays, const float lift, const float reach)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
    const vint tile = v_floor_to_int(v_load(points + POINT_TILE * stride + first));
    vfloat sum = v_splat(0.0f);
    for (int i = 0; i < rays; ++i) {
        vfloat way[3];
        hemisphere_way(frame, ways, i, tile, way);
        const RaysRay line = {at.x, at.y, at.z, way[0] * reach, way[1] * reach, way[2] * reach};
        const vmask blocked = rays_blocked(nodes, triangles, line, v_splat_int(-1));
        sum = sum + v_select(v_splat(1.0f), v_splat(0.0f), blocked);
    }
    v_store(sum * (1.0f / (float)rays), far + first);
}
