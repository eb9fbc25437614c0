// SPDX-License-Identifier: MIT
// sky_openness: which rays from points within a scene's box leave it.
//
// Reads:   rays       [size.x][6]: where a ray starts, relative to the scene's origin, and its way
//          nodes, triangles  see rays/bvh.clh; holes block
// Writes:  open       [size.x] 1 where a ray does, else 0
// Launch:  SSGI_LANES rays per work-item, one row of a multiple of 16
// Cost:    a ray

#include "common/gbuffer.clh"
#include "rays/bvh.clh"

__kernel void sky_openness(__global const float *restrict rays,
                           __global const float *restrict nodes,
                           __global const float *restrict triangles, __global float *restrict open,
                           const int2 size)
{
    const int x = ssgi_first_column();
    if (x >= size.x || (int)get_global_id(1) >= size.y) {
        return;
    }
    const vint at = (v_iota() + x) * 6;
    const RaysRay ray = {v_gather(rays, at),     v_gather(rays + 1, at), v_gather(rays + 2, at),
                         v_gather(rays + 3, at), v_gather(rays + 4, at), v_gather(rays + 5, at)};
    vfloat part;
    const vmask blocked = rays_blocked_at(nodes, triangles, 0, ray, v_splat_int(-1), &part);
    v_store(v_select(v_splat(1.0f), v_splat(0.0f), blocked), open + x);
}
