// SPDX-License-Identifier: MIT
// radiosity_sky: irradiance of surfels by the environment, and the unoccluded part of the
// hemisphere.
//
// Reads:   surfels     see surfel.clh
//          directions  [size.y][8]: unit vector, solid angle in sr, radiance over that of the
//                      brightest source (4 to 6), 0
//          occupancy   see occupancy/grid.clh; SURFEL_RAYS 0
//          nodes, triangles  see rays/bvh.clh; SURFEL_RAYS 1
// Writes:  sky         4 x [size.x]: irradiance (0 to 2), part of the hemisphere that is open,
//                      weighted by the cosine (3)
// Macros:  OCCUPANCY_CELLS, SURFEL_RAYS (0: rays through the grid; 1: against triangles)
// Launch:  SSGI_LANES surfels per work-item, one row
// Cost:    half a ray, some 20 reads, per surfel and direction

#include "common/gbuffer.clh"
#include "radiosity/ends.clh"
#include "rays/ends.clh"

#ifndef SURFEL_RAYS
#error "SURFEL_RAYS must be defined by the host"
#endif

#if SURFEL_RAYS
#define SKY_FAR 8.0f // more than from any surfel out of the scene, in the lengths of positions
#else
// Where a ray from `at` leaves the grid along one axis, in its lengths.
static inline vfloat sky_leave(const vfloat at, const float way)
{
    const float per = 1.0f / max(fabs(way), 1e-6f);
    return (way < 0.0f ? at : v_splat((float)OCCUPANCY_CELLS - 0.01f) - at) * per;
}
#endif

__kernel void radiosity_sky(__global const float *restrict surfels,
                            __global const float *restrict directions,
#if SURFEL_RAYS
                            __global const float *restrict nodes,
                            __global const float *restrict triangles, const RaysParams rays,
#else
                            __global const int *restrict occupancy,
#endif
                            __global float *restrict sky, const int2 size)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
#if SURFEL_RAYS
    const SurfelReceiver at = surfel_receivers(surfels, stride, first);
    const RaysEnd start = rays_end(at.x, at.y, at.z, at.nx, at.ny, at.nz, rays);
#else
    const OccupancyCell start = surfel_starts(surfels, stride, first);
#endif
    const vfloat zero = v_splat(0.0f);
    vfloat sum[3] = {zero, zero, zero};
    vfloat open = zero, all = zero;
    for (int n = 0; n < size.y; ++n) {
        __global const float *restrict way = directions + n * 8;
        const vfloat n_dot_l =
            v_fma(start.nx, v_splat(way[0]), v_fma(start.ny, v_splat(way[1]), start.nz * way[2]));
        const vmask wanted = v_gt(n_dot_l, zero);
        if (!v_any(wanted)) {
            continue;
        }
#if SURFEL_RAYS
        const RaysEnd end = rays_end(v_fma(v_splat(way[0]), v_splat(SKY_FAR), start.px),
                                     v_fma(v_splat(way[1]), v_splat(SKY_FAR), start.py),
                                     v_fma(v_splat(way[2]), v_splat(SKY_FAR), start.pz),
                                     v_splat(-way[0]), v_splat(-way[1]), v_splat(-way[2]), rays);
        const vmask seen = wanted & ~rays_hidden(nodes, triangles, start, end, wanted);
#else
        const vfloat length = v_min(v_min(sky_leave(start.x, way[0]), sky_leave(start.y, way[1])),
                                    sky_leave(start.z, way[2]));
        OccupancyCell end;
        end.x = v_fma(length, v_splat(way[0]), start.x);
        end.y = v_fma(length, v_splat(way[1]), start.y);
        end.z = v_fma(length, v_splat(way[2]), start.z);
        end.nx = v_splat(-way[0]);
        end.ny = v_splat(-way[1]);
        end.nz = v_splat(-way[2]);
        const vmask seen = wanted & ~occupancy_blocked(occupancy, start, end, wanted);
#endif
        const vfloat w = v_max(n_dot_l, zero) * way[3];
        const vfloat own = v_select(zero, w, seen);
        all = all + w;
        open = open + own;
        for (int j = 0; j < 3; ++j) {
            sum[j] = v_fma(own, v_splat(way[4 + j]), sum[j]);
        }
    }
    // Scaled so that the directions' weights sum to pi: an open sky of one radiance is exact.
    const vfloat per = v_splat(1.0f) / v_max(all, v_splat(1e-30f));
    for (int j = 0; j < 3; ++j) {
        v_store(sum[j] * (per * 3.14159265f), sky + j * stride + first);
    }
    v_store(open * per, sky + 3 * stride + first);
}
