// SPDX-License-Identifier: MIT
// radiosity_rays: what rays over the hemispheres of points meet, how far that is, and emission.
//
// Method:  `rays` of each point in proportion to the cosine, one in each of as many strata; the
//          points of a surfel, which have consecutive numbers, have others. Of emissive surfaces
//          that are met the part that radiosity_emission leaves counts (balance heuristic).
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, z along the normal
//          nodes, blocks, triangles  see rays/first.clh
//          emission   [triangles of the scene][4] radiance, and the density q of radiosity_emission
// Writes:  met        [rays][size.x] places in `triangles`, -1 where nothing is met
//          where      [rays][size.x] the part of the ray up to there
//          far        [size.x] the share of rays that go farther than `length`
//          irradiance 3 x [size.x] by emission
// Macros:  RADIOSITY_EMITS (0, 1: any triangle does), RAYS_ONE (0, 1)
// Params:  rays; count: of places that radiosity_emission draws; lift: height above their surfaces
//          at which rays begin; reach: their length; length: see `far`
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a walk through the hierarchy for each ray

#include "radiosity/points.clh"
#include "rays/first.clh"
#include "rays/hemisphere.clh"

#ifndef RADIOSITY_EMITS
#error "RADIOSITY_EMITS must be defined by the host"
#endif

__kernel void
radiosity_rays(__global const float *restrict points, __global const float *restrict ways,
               __global const float *restrict nodes, __global const float *restrict blocks,
               __global const float *restrict triangles, __global const float *restrict emission,
               __global int *restrict met, __global float *restrict where,
               __global float *restrict far, __global float *restrict irradiance, const int2 size,
               const int rays, const float count, const float lift, const float reach,
               const float length)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
    const vint tile = v_floor_to_int(v_load(points + POINT_TILE * stride + first));
    vfloat sum[3] = {zero, zero, zero}, open = zero;
    for (int i = 0; i < rays; ++i) {
        vfloat way[3];
        const vfloat cosine = hemisphere_way(frame, ways, i, tile, way);
        const vfloat wx = way[0], wy = way[1], wz = way[2];
        const RaysRay line = {at.x, at.y, at.z, wx * reach, wy * reach, wz * reach};
        const RaysHit hit = rays_first(nodes, blocks, triangles, line, v_splat_int(-1));
        const vmask there = v_ige(hit.triangle, v_splat_int(0));
        v_istore(v_iselect(v_splat_int(-1), hit.triangle, there), met + i * stride + first);
        v_store(hit.where, where + i * stride + first);
        const vmask near = there & v_lt(hit.where * reach, v_splat(length));
        open = open + v_select(one, zero, near);
#if RADIOSITY_EMITS
        const vint t = v_iselect(v_splat_int(0), hit.triangle, there) * RAYS_TRIANGLE;
        const vint own = v_bits(v_gather(triangles + 10, t)) * 4;
        const vfloat density = v_gather(emission + 3, own) * count;
        const vmask shines = there & v_gt(density, zero);
        if (!v_any(shines)) {
            continue;
        }
        vfloat away[3];
        rays_away(triangles, t, wx, wy, wz, away);
        const vfloat emitted = v_fma(away[0], wx, v_fma(away[1], wy, away[2] * wz));
        const vfloat long_ = v_max(hit.where * reach, v_splat(1e-15f));
        const vfloat factor = cosine * emitted * 0.318309886f / (long_ * long_);
        const vfloat share =
            v_select(zero,
                     factor * 3.14159265f /
                         v_max(v_fma(factor, v_splat((float)rays), density), v_splat(1e-37f)),
                     shines);
        for (int c = 0; c < 3; ++c) {
            sum[c] = v_fma(share, v_gather(emission + c, own), sum[c]);
        }
#endif
    }
    v_store(open * (1.0f / (float)rays), far + first);
    for (int c = 0; c < 3; ++c) {
        v_store(sum[c], irradiance + c * stride + first);
    }
}
