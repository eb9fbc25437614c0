// SPDX-License-Identifier: MIT
// sky_openness: how many rays from points within a scene's box leave it.
//
// Reads:   rays       [size.x][6]: where a ray starts, relative to the scene's origin, and its way
//          nodes, triangles  see rays/bvh.clh; holes block
// Writes:  open       [1] count; starts as 0
// Launch:  SSGI_LANES rays per work-item, one row
// Cost:    a ray

#include "common/gbuffer.clh"
#include "rays/bvh.clh"

__kernel void sky_openness(__global const float *restrict rays,
                           __global const float *restrict nodes,
                           __global const float *restrict triangles, __global int *restrict open,
                           const int2 size)
{
    const int x = ssgi_first_column();
    if (x >= size.x || (int)get_global_id(1) >= size.y) {
        return;
    }
    const vint number = v_imin(v_iota() + x, v_splat_int(size.x - 1)), at = number * 6;
    const RaysRay ray = {v_gather(rays, at),     v_gather(rays + 1, at), v_gather(rays + 2, at),
                         v_gather(rays + 3, at), v_gather(rays + 4, at), v_gather(rays + 5, at)};
    const vmask wanted = v_ilt(v_iota() + x, v_splat_int(size.x));
    vfloat part;
    const vmask blocked = rays_blocked_at(nodes, triangles, 0, ray, wanted, &part);
    const vfloat found = v_select(v_splat(0.0f), v_splat(1.0f), wanted & ~blocked);
    atomic_add(open, (int)v_sum(found));
}
