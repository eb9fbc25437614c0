// SPDX-License-Identifier: MIT
// reflect_trace: mean radiance that arrives within the lobes of pixels, of some of a lobe's rays
// each.
//
// Method:  a ray that meets what the image shows takes the radiance of that pixel, with what its
//          lobe reflects spread all ways; one that leaves the occupancy grid, that of environments;
//          any other, that of a volume of what surfaces send. Rays are distributed as the lobe; of
//          16 x 16 pixels each has others (Keller and Heidrich 2001, "Interleaved Sampling").
// Reads:   linear, normal, albedo, specular, gloss  with margin
//          radiance  3 x [rows, columns] W m^-2 sr^-1, without lobes
//          light     3 x [rows, columns] irradiance / pi
//          sky, places  see sky.clh; cells, volume  see radiosity/volume.clh
//          occupancy, grid_box  see occupancy/grid.clh
// Writes:  reflected 3 x [rows, columns] W m^-2 sr^-1; 0 where nothing is glossy
// Macros:  REFLECT_RAYS (of a pixel), REFLECT_STEPS (of a ray on the screen, at most),
//          OCCUPANCY_CELLS
// Params:  view to world rotation, margin, see the struct
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/sky.clh"
#include "reflections/image.clh"
#include "reflections/pattern.clh"
#include "reflections/trace.clh"
#include "radiosity/volume.clh"
#include "occupancy/grid.clh"

#if !defined(REFLECT_RAYS) || !defined(REFLECT_STEPS)
#error "REFLECT_RAYS and REFLECT_STEPS must be defined by the host"
#endif

#define REFLECT_ASIDE 1.0f // cells between two rays that both must leave the grid

// Where a ray leaves the grid, in cells of which it goes so many along each axis.
static inline vfloat reflect_leave(const vfloat from, const vfloat way)
{
    const vfloat edge =
        v_select(v_splat(0.02f), v_splat((float)OCCUPANCY_CELLS - 0.02f), v_gt(way, v_splat(0.0f)));
    const vfloat along = v_select(way, v_splat(1e-6f), v_lt(v_abs(way), v_splat(1e-6f)));
    return v_select(v_splat(1e9f), v_max((edge - from) / along, v_splat(0.0f)),
                    v_gt(v_abs(way), v_splat(1e-6f)));
}

// Whether a ray is blocked that starts so many cells above its surface, besides the lift, and ends
// after `until` cells or with the grid; `where` on its `length`, in cells.
SSGI_LARGE vmask reflect_blocked(__global const int *restrict occupancy, const OccupancyCell start,
                                 const vfloat above, const SsgiWay way, const vfloat until,
                                 const vmask wanted, vfloat *where, vfloat *length)
{
    const float most = (float)OCCUPANCY_CELLS - 0.01f;
    OccupancyCell from = start;
    from.x = v_clamp(v_fma(start.nx, above, start.x), 0.0f, most);
    from.y = v_clamp(v_fma(start.ny, above, start.y), 0.0f, most);
    from.z = v_clamp(v_fma(start.nz, above, start.z), 0.0f, most);
    *length = v_min(v_min(reflect_leave(from.x, way.x), reflect_leave(from.y, way.y)),
                    v_min(reflect_leave(from.z, way.z), until));
    const OccupancyCell to = {v_fma(way.x, *length, from.x),
                              v_fma(way.y, *length, from.y),
                              v_fma(way.z, *length, from.z),
                              -way.x,
                              -way.y,
                              -way.z};
    return occupancy_meets(occupancy, from, to, wanted, where);
}

__kernel void
reflect_trace(ssgi_plane linear, ssgi_plane normal, ssgi_plane albedo, ssgi_plane specular,
              ssgi_plane gloss, __global const float *restrict radiance,
              __global const float *restrict light, __global const float *restrict sky,
              __global const int *restrict places, __global const int *restrict cells,
              __global const float *restrict volume, __global const int *restrict occupancy,
              __global const float *restrict grid_box, __global float *restrict reflected,
              const int2 size, const SsgiCamera camera, const ReflectParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat u = ssgi_load(linear, whole, 0, at_x, at_y);
    const SsgiLobe lobe = ssgi_lobe(albedo, specular, gloss, whole, at_x, at_y);
    const vmask there = lobe.there & v_lt(u, v_splat(INFINITY));
    vfloat sum[3] = {zero, zero, zero};
    if (!v_any(there)) {
        for (int c = 0; c < 3; ++c) {
            ssgi_store(zero, reflected, size, c, x, y, 0.0f);
        }
        return;
    }
    const vfloat known = v_select(v_splat(1.0f), u, there);
    const vfloat depth = camera.perspective != 0.0f ? 1.0f / known : known;
    const vfloat k = ssgi_k(camera, depth);
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * k;
    const vfloat py = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * k;
    const SsgiWay mirrored = ssgi_mirrored(camera, px, py, -depth, nx, ny, nz);
    // A pixel's width off the surface, so that it does not meet itself.
    const vfloat lift = k * v_splat(fmax(fabs(camera.to_x), fabs(camera.to_y)));
    const vfloat sx = v_fma(nx, lift, px), sy = v_fma(ny, lift, py);
    const vfloat start = v_max(v_fma(-nz, lift, depth), depth * REFLECT_NEAREST);
    const float per = params.per_unit;
    const OccupancyCell from =
        occupancy_cell(px * per, py * per, -depth * per, nx, ny, nz, grid_box);
    const vint tile = reflect_number(v_iota() + x, y, lobe.gloss);
    for (int ray = 0; ray < REFLECT_RAYS; ++ray) {
        const vfloat number = v_to_float(tile * REFLECT_RAYS + ray) + 0.5f;
        const SsgiWay way = reflect_way(&lobe, mirrored, reflect_fraction(number * REFLECT_FIRST),
                                        reflect_fraction(number * REFLECT_SECOND));
        const vfloat rise = v_fma(way.x, nx, v_fma(way.y, ny, way.z * nz));
        const vmask above = there & v_gt(rise, zero);
        const ReflectLine line =
            reflect_line(camera, whole, sx, sy, start, way.x, way.y, way.z, params);
        ReflectHit hit = reflect_meet(linear, whole, camera, &line,
                                      reflect_fraction(number * REFLECT_THIRD), above, params);
        // Surfaces that turn away are seen from behind: their light is not known.
        const vint hx = hit.column, hy = hit.row;
        const vfloat facing = v_fma(ssgi_gather(normal, whole, 0, hx, hy), way.x,
                                    v_fma(ssgi_gather(normal, whole, 1, hx, hy), way.y,
                                          ssgi_gather(normal, whole, 2, hx, hy) * way.z));
        const vint ix = v_iclamp(hx - params.margin_columns, 0, size.x - 1);
        const vint iy = v_iclamp(hy - params.margin_rows, 0, size.y - 1);
        const ReflectPixel pixel = {hx, hy, ix, iy};
        hit.found = hit.found & v_lt(facing, zero) & v_ieq(ix + params.margin_columns, hx) &
                    v_ieq(iy + params.margin_rows, hy);
        // What the image shows between them does not tell whether the ray passes behind it.
        const vfloat met_u =
            v_select(v_splat(1.0f), ssgi_gather(linear, whole, 0, hx, hy), hit.found);
        const vfloat met_depth = camera.perspective != 0.0f ? 1.0f / met_u : met_u;
        const vmask level = v_lt(v_abs(way.z), v_splat(1e-6f));
        const vfloat away = (depth - met_depth) / v_select(way.z, v_splat(1e-6f), level);
        const vfloat until =
            v_select(v_splat(1e9f), v_max(away * (per * grid_box[3]), zero), hit.found);
        vfloat where, length;
        vmask blocked = reflect_blocked(occupancy, from, zero, way, until, above, &where, &length);
        hit.found = hit.found & ~blocked;
        vmask escapes = above & ~hit.found & ~blocked;
        if (v_any(escapes)) {
            // Cells where surfaces meet at an edge may be empty: no two rays pass the same one.
            vfloat where_too, length_too;
            const vmask too = reflect_blocked(occupancy, from, v_splat(REFLECT_ASIDE), way, until,
                                              escapes, &where_too, &length_too);
            where = v_select(where, where_too, too);
            length = v_select(length, length_too, too);
            blocked = blocked | too;
            escapes = escapes & ~too;
        }
        vfloat open[3] = {zero, zero, zero}, sent[3] = {zero, zero, zero};
        if (v_any(blocked | escapes)) {
            const vfloat wx = params.xx * way.x + params.xy * way.y + params.xz * way.z;
            const vfloat wy = params.yx * way.x + params.yy * way.y + params.yz * way.z;
            const vfloat wz = params.zx * way.x + params.zy * way.y + params.zz * way.z;
            if (v_any(blocked)) {
                // Cells that lie behind one another in the screen are told apart by the jitter.
                const vfloat on = where * length, scale = v_splat(params.per_cell / grid_box[3]);
                const vfloat ux = v_fma(way.x, on, from.x), uy = v_fma(way.y, on, from.y);
                const vfloat uz = v_fma(way.z, on, from.z);
                const vfloat gx = v_fma(ux, scale, v_splat(grid_box[0] * params.per_cell));
                const vfloat gy = v_fma(uy, scale, v_splat(grid_box[1] * params.per_cell));
                const vfloat gz = v_fma(uz, scale, v_splat(grid_box[2] * params.per_cell));
                const vfloat jx = reflect_fraction(number * 0.3819660f) - 0.5f;
                const vfloat jy = reflect_fraction(number * 0.7236068f) - 0.5f;
                const vfloat jz = reflect_fraction(number * 0.1458980f) - 0.5f;
                const VolumePlace place = volume_place(
                    cells, volume,
                    params.xx * gx + params.xy * gy + params.xz * gz + params.cell_x + jx,
                    params.yx * gx + params.yy * gy + params.yz * gz + params.cell_y + jy,
                    params.zx * gx + params.zy * gy + params.zz * gz + params.cell_z + jz, wx, wy,
                    wz);
                for (int c = 0; c < 3; ++c) {
                    sent[c] = volume_radiance(volume, place, c);
                }
            }
            if (params.levels > 0 && v_any(escapes)) {
                const vfloat density =
                    ssgi_lobe_value(&lobe, mirrored, way.x, way.y, way.z) * (16.0f * REFLECT_RAYS);
                sky_radiance(sky, places, wx, wy, wz, 1.0f / v_max(density, v_splat(1e-3f)),
                             params.texels_per_angle, params.levels, open);
            }
        }
        for (int c = 0; c < 3; ++c) {
            const vfloat met = reflect_image(pixel, c, v_splat_int(0), albedo, specular, gloss,
                                             whole, light, radiance, size);
            vfloat arriving = v_select(open[c], sent[c], blocked);
            arriving = v_select(arriving, met, hit.found);
            sum[c] = sum[c] + v_select(zero, arriving, above);
        }
    }
    for (int c = 0; c < 3; ++c) {
        ssgi_store(sum[c] * (1.0f / REFLECT_RAYS), reflected, size, c, x, y, 0.0f);
    }
}
