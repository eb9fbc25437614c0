// SPDX-License-Identifier: MIT
// radiosity_blocked: whether triangles are in front of points.
//
// Reads:   points     see radiosity/points.clh
//          nodes, triangles  see rays/bvh.clh
// Writes:  blocked    [size.x] 1 where one is, else 0
// Params:  lift: height above their surfaces at which rays begin; reach: their length, along
// normals Launch:  SSGI_LANES points per work-item, one row Cost:    a walk through the hierarchy

#include "radiosity/points.clh"

__kernel void radiosity_blocked(__global const float *restrict points,
                                __global const float *restrict nodes,
                                __global const float *restrict triangles,
                                __global float *restrict blocked, const int2 size, const float lift,
                                const float reach)
{
    const int first = ssgi_first_column();
    if (first >= size.x) {
        return;
    }
    const SurfacePoint at = surface_point(points, size.x, first, lift);
    const RaysRay line = {at.x, at.y, at.z, at.nx * reach, at.ny * reach, at.nz * reach};
    const vmask found = rays_blocked(nodes, triangles, line, v_splat_int(-1));
    v_store(v_select(v_splat(0.0f), v_splat(1.0f), found), blocked + first);
}
