// SPDX-License-Identifier: MIT
// radiosity_met: the triangles that rays over the hemispheres of points meet first, and where.
//
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, see radiosity_rays
//          nodes, triangles  see rays/bvh.clh
// Writes:  met        [rays][size.x] numbers of triangles of the scene, -1 where none is met
//          where      [rays][size.x] the part of the way there
// Params:  rays; lift: height above their surfaces at which rays begin; reach: their length
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a walk through the hierarchy for each ray

#include "radiosity/points.clh"
#include "rays/hemisphere.clh"

__kernel void radiosity_met(__global const float *restrict points,
                            __global const float *restrict ways,
                            __global const float *restrict nodes,
                            __global const float *restrict triangles, __global int *restrict met,
                            __global float *restrict where, const int2 size, const int rays,
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
    for (int i = 0; i < rays; ++i) {
        vfloat way[3];
        hemisphere_way(frame, ways, i, tile, way);
        const RaysRay line = {at.x, at.y, at.z, way[0] * reach, way[1] * reach, way[2] * reach};
        const RaysHit hit = rays_closest(nodes, triangles, line, v_splat_int(-1));
        const vmask there = v_ige(hit.triangle, v_splat_int(0));
        const vint t = v_iselect(v_splat_int(0), hit.triangle, there) * RAYS_TRIANGLE;
        const vint own = v_bits(v_gather(triangles + 10, t));
        v_istore(v_iselect(v_splat_int(-1), own, there), met + i * stride + first);
        v_store(hit.where, where + i * stride + first);
    }
}
