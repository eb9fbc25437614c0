// SPDX-License-Identifier: MIT
// radiosity_seen: whether any of the rays over the hemispheres of points meets a surface.
//
// What none meets from there does not see the point either, as on the outside of a building.
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, see radiosity_rays
//          nodes, triangles  see rays/bvh.clh
// Writes:  seen       [size.x] 1 where one does, else 0
// Params:  rays; lift: height above their surfaces at which rays begin; reach: their length
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a walk through the hierarchy, and more where rays escape

#include "radiosity/points.clh"
#include "rays/hemisphere.clh"

__kernel void radiosity_seen(__global const float *restrict points,
                             __global const float *restrict ways,
                             __global const float *restrict nodes,
                             __global const float *restrict triangles,
                             __global float *restrict seen, const int2 size, const int rays,
                             const float lift, const float reach)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
    const vint tile = v_floor_to_int(v_load(points + POINT_TILE * stride + first));
    vmask alone = v_splat_int(-1);
    for (int i = 0; i < rays && v_any(alone); ++i) {
        vfloat way[3];
        hemisphere_way(frame, ways, i, tile, way);
        const RaysRay line = {at.x, at.y, at.z, way[0] * reach, way[1] * reach, way[2] * reach};
        alone = alone & ~rays_blocked(nodes, triangles, line, alone);
    }
    v_store(v_select(v_splat(1.0f), v_splat(0.0f), alone), seen + first);
}
