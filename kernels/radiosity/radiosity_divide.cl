// SPDX-License-Identifier: MIT
// radiosity_divide: the plane of what hides points from others next to them.
//
// Reads:   points     see radiosity/points.clh
//          partners   [size.x] the number of the point that each looks at
//          nodes, triangles  see rays/bvh.clh
// Writes:  planes     4 x [size.x] normal, towards the partner, and where it is along that,
// relative
//                     to the scene's origin, of the triangle that is met first; 0 where none is
// Params:  lift: height above their surfaces of both ends
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a short walk through the hierarchy

#include "radiosity/points.clh"

__kernel void radiosity_divide(__global const float *restrict points,
                               __global const int *restrict partners,
                               __global const float *restrict nodes,
                               __global const float *restrict triangles,
                               __global float *restrict planes, const int2 size, const float lift)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const vint partner = v_iload(partners + first);
    vfloat to[6];
    for (int i = 0; i < 6; ++i) {
        to[i] = v_gather(points + i * stride, partner);
    }
    const RaysRay line = {at.x,
                          at.y,
                          at.z,
                          v_fma(to[3], v_splat(lift), to[0]) - at.x,
                          v_fma(to[4], v_splat(lift), to[1]) - at.y,
                          v_fma(to[5], v_splat(lift), to[2]) - at.z};
    const RaysHit hit = rays_closest(nodes, triangles, line, v_splat_int(-1));
    const vmask met = v_ige(hit.triangle, v_splat_int(0));
    const vint t = v_iselect(v_splat_int(0), hit.triangle, met) * RAYS_TRIANGLE;
    vfloat away[3];
    rays_away(triangles, t, line.wx, line.wy, line.wz, away);
    const vfloat along =
        v_fma(v_gather(triangles, t), away[0],
              v_fma(v_gather(triangles + 1, t), away[1], v_gather(triangles + 2, t) * away[2]));
    for (int i = 0; i < 3; ++i) {
        v_store(v_select(v_splat(0.0f), away[i], met), planes + i * stride + first);
    }
    v_store(v_select(v_splat(0.0f), along, met), planes + 3 * stride + first);
}
