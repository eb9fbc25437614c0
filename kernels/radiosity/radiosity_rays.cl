// SPDX-License-Identifier: MIT
// radiosity_rays: what rays over the hemispheres of points meet: places of the light volume, and
// emission.
//
// Method:  `rays` of each point in proportion to the cosine, one in each of as many strata; the
//          points of a surfel, which have consecutive numbers, have others. Of emissive surfaces
//          that are met the part that radiosity_emission leaves counts (balance heuristic).
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, z along the normal
//          nodes, blocks, triangles  see rays/first.clh
//          cells, volume  see radiosity/volume.clh; areas alone
//          emission   [triangles of the scene][4] radiance, and the density q of radiosity_emission
// Writes:  places     [rays][3][size.x] where the sides begin in the records of the volume, x -1
//                     where nothing is met
//          shares     [rays][2][size.x] what the sides of x and y count; that of z is the rest of 1
//          irradiance 3 x [size.x] by emission
// Macros:  RADIOSITY_EMITS (0, 1: any triangle does), RAYS_ONE (0, 1)
// Params:  rays; count: of places that radiosity_emission draws; lift: height above their surfaces
// at
//          which rays begin; reach: their length; per_cell, cell_x, cell_y, cell_z: cells of the
//          volume per scene unit, and where the scene's origin is in cells
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a walk through the hierarchy for each ray

#include "radiosity/points.clh"
#include "rays/first.clh"
#include "rays/hemisphere.clh"
#include "radiosity/volume.clh"

#ifndef RADIOSITY_EMITS
#error "RADIOSITY_EMITS must be defined by the host"
#endif

__kernel void
radiosity_rays(__global const float *restrict points, __global const float *restrict ways,
               __global const float *restrict nodes, __global const float *restrict blocks,
               __global const float *restrict triangles, __global const int *restrict cells,
               __global const float *restrict volume, __global const float *restrict emission,
               __global int *restrict places, __global float *restrict shares,
               __global float *restrict irradiance, const int2 size, const int rays,
               const float count, const float lift, const float reach, const float per_cell,
               const float cell_x, const float cell_y, const float cell_z)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
    const vint tile = v_floor_to_int(v_load(points + POINT_TILE * stride + first));
    vfloat sum[3] = {zero, zero, zero};
    for (int i = 0; i < rays; ++i) {
        vfloat way[3];
        const vfloat cosine = hemisphere_way(frame, ways, i, tile, way);
        const vfloat wx = way[0], wy = way[1], wz = way[2];
        const RaysRay line = {at.x, at.y, at.z, wx * reach, wy * reach, wz * reach};
        const RaysHit hit = rays_first(nodes, blocks, triangles, line, v_splat_int(-1));
        const vmask met = v_ige(hit.triangle, v_splat_int(0));
        const vint t = v_iselect(v_splat_int(0), hit.triangle, met) * RAYS_TRIANGLE;
        vfloat away[3];
        rays_away(triangles, t, wx, wy, wz, away);
        const VolumePlace place = volume_surface(
            cells, volume,
            v_fma(v_fma(line.wx, hit.where, line.x), v_splat(per_cell), v_splat(cell_x)),
            v_fma(v_fma(line.wy, hit.where, line.y), v_splat(per_cell), v_splat(cell_y)),
            v_fma(v_fma(line.wz, hit.where, line.z), v_splat(per_cell), v_splat(cell_z)), away[0],
            away[1], away[2]);
        __global int *restrict to = places + i * 3 * stride + first;
        v_istore(v_iselect(v_splat_int(-1), place.x, met), to);
        v_istore(place.y, to + stride);
        v_istore(place.z, to + 2 * stride);
        v_store(place.of_x, shares + i * 2 * stride + first);
        v_store(place.of_y, shares + (i * 2 + 1) * stride + first);
#if RADIOSITY_EMITS
        const vint own = v_bits(v_gather(triangles + 10, t)) * 4;
        const vfloat density = v_gather(emission + 3, own) * count;
        const vmask shines = met & v_gt(density, zero);
        if (!v_any(shines)) {
            continue;
        }
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
    for (int c = 0; c < 3; ++c) {
        v_store(sum[c], irradiance + c * stride + first);
    }
}
