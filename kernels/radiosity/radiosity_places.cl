// SPDX-License-Identifier: MIT
// radiosity_places: where in the light volume the rays of radiosity_rays end.
//
// Reads:   points     see radiosity/points.clh
//          ways       [rays][3][GATHER_TILE^2] directions, as of radiosity_rays
//          met, where see radiosity_rays
//          triangles  see rays/bvh.clh
//          cells, volume  see radiosity/volume.clh; areas alone
// Writes:  places     [rays][3][size.x] where the sides begin in the records of the volume, x -1
//                     where nothing is met
//          shares     [rays][2][size.x] what the sides of x and y count; that of z is the rest of 1
// Params:  rays, lift, reach: as of radiosity_rays; per_cell, cell_x, cell_y, cell_z: cells of the
//          volume per scene unit, and where the scene's origin is in cells
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    100 operations and 13 reads by number for each ray

#include "radiosity/points.clh"
#include "rays/hemisphere.clh"
#include "radiosity/volume.clh"

__kernel void
radiosity_places(__global const float *restrict points, __global const float *restrict ways,
                 __global const int *restrict met, __global const float *restrict where,
                 __global const float *restrict triangles, __global const int *restrict cells,
                 __global const float *restrict volume, __global int *restrict places,
                 __global float *restrict shares, const int2 size, const int rays, const float lift,
                 const float reach, const float per_cell, const float cell_x, const float cell_y,
                 const float cell_z)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
    const vint tile = v_floor_to_int(v_load(points + POINT_TILE * stride + first));
    const vfloat per = v_splat(per_cell);
    for (int i = 0; i < rays; ++i) {
        vfloat way[3], away[3];
        hemisphere_way(frame, ways, i, tile, way);
        const vint triangle = v_iload(met + i * stride + first);
        const vfloat end = v_load(where + i * stride + first);
        const vmask there = v_ige(triangle, v_splat_int(0));
        const vint t = v_iselect(v_splat_int(0), triangle, there) * RAYS_TRIANGLE;
        rays_away(triangles, t, way[0], way[1], way[2], away);
        const VolumePlace place = volume_surface(
            cells, volume, v_fma(v_fma(way[0] * reach, end, at.x), per, v_splat(cell_x)),
            v_fma(v_fma(way[1] * reach, end, at.y), per, v_splat(cell_y)),
            v_fma(v_fma(way[2] * reach, end, at.z), per, v_splat(cell_z)), away[0], away[1],
            away[2]);
        __global int *restrict to = places + i * 3 * stride + first;
        v_istore(v_iselect(v_splat_int(-1), place.x, there), to);
        v_istore(place.y, to + stride);
        v_istore(place.z, to + 2 * stride);
        v_store(place.of_x, shares + i * 2 * stride + first);
        v_store(place.of_y, shares + (i * 2 + 1) * stride + first);
    }
}
