// SPDX-License-Identifier: MIT
// radiosity_met: the triangles that rays along the normals of points meet first, and where.
//
// Reads:   points     see radiosity/points.clh; a normal may be any direction
//          nodes, triangles  see rays/bvh.clh
// Writes:  met        [size.x] numbers of triangles of the scene, -1 where none is met
//          where      [size.x] the part of the way there
//          facing     3 x [size.x] their unit normals on that side
// Params:  reach: length of the rays
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a walk through the hierarchy

#include "radiosity/points.clh"

__kernel void radiosity_met(__global const float *restrict points,
                            __global const float *restrict nodes,
                            __global const float *restrict triangles, __global int *restrict met,
                            __global float *restrict where, __global float *restrict facing,
                            const int2 size, const float reach)
{
    const int first = ssgi_first_column();
    if (first >= size.x) {
        return;
    }
    const SurfacePoint at = surface_point(points, size.x, first, 0.0f);
    const RaysRay line = {at.x, at.y, at.z, at.nx * reach, at.ny * reach, at.nz * reach};
    const RaysHit hit = rays_closest(nodes, triangles, line, v_splat_int(-1));
    const vmask there = v_ige(hit.triangle, v_splat_int(0));
    const vint t = v_iselect(v_splat_int(0), hit.triangle, there) * RAYS_TRIANGLE;
    v_istore(v_iselect(v_splat_int(-1), v_bits(v_gather(triangles + 10, t)), there), met + first);
    v_store(hit.where, where + first);
    vfloat away[3];
    rays_away(triangles, t, at.nx, at.ny, at.nz, away);
    for (int axis = 0; axis < 3; ++axis) {
        v_store(-away[axis], facing + axis * size.x + first);
    }
}
