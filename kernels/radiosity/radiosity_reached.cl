// SPDX-License-Identifier: MIT
// radiosity_reached: to which points of surfaces light comes.
//
// Method:  where lit air is in front of a point, or a path of light that begins there comes through
//          it. A path that comes into a closed space ends, as one from a point before it. After
//          each bounce a path goes on where its direction, one of those over the hemisphere, meets
//          a surface.
// Reads:   points     see radiosity/points.clh
//          numbers    [size.x] by which points have their directions
//          ways       [rays][3][GATHER_TILE^2] directions, see radiosity_rays
//          nodes, blocks, triangles  see rays/first.clh
//          spaces     [cells^3] by z, y and x the space of the air in a cell, 0 if occupied
//          states     [spaces] 1: light enters it, -1: none does, 0: that is not known
// Writes:  reached    [size.x] 1 where light comes to, else 0
// Macros:  RAYS_ONE (0, 1)
// Params:  cells: along a side of the grid; bounces; rays: of a point's directions, a power of two;
//          lift: height above their surfaces at which rays begin; room: that at which cells are
//          looked up; reach: length of rays; per_cell, cell_x, cell_y, cell_z: cells per scene
//          unit, and where the scene's origin is in cells
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    a walk through the hierarchy for each bounce of those that are in unknown air

#include "radiosity/points.clh"
#include "rays/first.clh"
#include "rays/hemisphere.clh"

#define REACHED_PLACES 8 // of a ray at which the air is looked up
#define REACHED_RAY 5    // directions from one bounce to the next, odd
#define REACHED_POINT 23 // places in the tile likewise

// State of the air at a place, in cells.
static inline vint reached_state(__global const int *restrict spaces,
                                 __global const int *restrict states, const int cells,
                                 const vfloat x, const vfloat y, const vfloat z)
{
    const float most = (float)cells - 0.5f;
    const vint column = v_to_int(v_clamp(x, 0.0f, most));
    const vint row = v_to_int(v_clamp(y, 0.0f, most));
    const vint slice = v_to_int(v_clamp(z, 0.0f, most));
    return v_igather(states, v_igather(spaces, (slice * cells + row) * cells + column));
}

__kernel void
radiosity_reached(__global const float *restrict points, __global const int *restrict numbers,
                  __global const float *restrict ways, __global const float *restrict nodes,
                  __global const float *restrict blocks, __global const float *restrict triangles,
                  __global const int *restrict spaces, __global const int *restrict states,
                  __global float *restrict reached, const int2 size, const int cells,
                  const int bounces, const int rays, const float lift, const float room,
                  const float reach, const float per_cell, const float cell_x, const float cell_y,
                  const float cell_z)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat per = v_splat(per_cell);
    const vfloat ox = v_splat(cell_x), oy = v_splat(cell_y), oz = v_splat(cell_z);
    SurfacePoint at = surface_point(points, stride, first, lift);
    const vint before =
        reached_state(spaces, states, cells, v_fma(v_fma(at.nx, v_splat(room), at.x), per, ox),
                      v_fma(v_fma(at.ny, v_splat(room), at.y), per, oy),
                      v_fma(v_fma(at.nz, v_splat(room), at.z), per, oz));
    const vmask known = v_ilt(before, v_splat_int(0)) | v_ilt(v_splat_int(0), before);
    vmask found = v_splat_int(0), active = v_splat_int(-1);
    if (v_any(known)) {
        const RaysRay line = {at.x, at.y, at.z, at.nx * room, at.ny * room, at.nz * room};
        const vmask free = known & v_ilt(rays_first(nodes, blocks, triangles, line, known).triangle,
                                         v_splat_int(0));
        found = free & v_ilt(v_splat_int(0), before);
        active = ~free;
    }
    const vint number = v_iload(numbers + first);
    for (int bounce = 0; bounce < bounces && v_any(active); ++bounce) {
        const Hemisphere frame = hemisphere_of(at.nx, at.ny, at.nz);
        const vint tile = (number + bounce * REACHED_POINT) & (HEMISPHERE_TILE - 1);
        const vint ray = (number / HEMISPHERE_TILE + bounce * REACHED_RAY) & (rays - 1);
        vfloat way[3];
        hemisphere_from(frame, ways, ray * (3 * HEMISPHERE_TILE) + tile, way);
        const RaysRay line = {at.x, at.y, at.z, way[0] * reach, way[1] * reach, way[2] * reach};
        const RaysHit hit = rays_first(nodes, blocks, triangles, line, active);
        const vmask met = v_ige(hit.triangle, v_splat_int(0));
        const vfloat end = v_select(v_splat(1.0f), hit.where, met);
        vmask lit = v_splat_int(0), closed = v_splat_int(0);
        for (int i = 0; i < REACHED_PLACES; ++i) {
            const vfloat part = end * (((float)i + 0.5f) / (float)REACHED_PLACES);
            const vint state =
                reached_state(spaces, states, cells, v_fma(v_fma(line.wx, part, line.x), per, ox),
                              v_fma(v_fma(line.wy, part, line.y), per, oy),
                              v_fma(v_fma(line.wz, part, line.z), per, oz));
            lit = lit | v_ilt(v_splat_int(0), state);
            closed = closed | v_ilt(state, v_splat_int(0));
        }
        found = found | (active & lit);
        active = active & met & ~(lit | closed);
        const vint t = v_iselect(v_splat_int(0), hit.triangle, met) * RAYS_TRIANGLE;
        vfloat away[3];
        rays_away(triangles, t, way[0], way[1], way[2], away);
        at.nx = -away[0], at.ny = -away[1], at.nz = -away[2];
        at.x = v_fma(at.nx, v_splat(lift), v_fma(line.wx, end, line.x));
        at.y = v_fma(at.ny, v_splat(lift), v_fma(line.wy, end, line.y));
        at.z = v_fma(at.nz, v_splat(lift), v_fma(line.wz, end, line.z));
    }
    v_store(v_select(v_splat(0.0f), v_splat(1.0f), found), reached + first);
}
