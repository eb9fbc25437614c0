// SPDX-License-Identifier: MIT
// sky_light: irradiance of pixels by environments, with visibility at any distance.
//
// Method:  E = pi sum(w L V) / sum(w), w = cos dw, over every 16th direction of a stratified set:
//          another sixteenth for each pixel of a 4 x 4 square (Wald et al. 2002, "Interactive Global
//          Illumination using Fast Ray Tracing", interleaved sampling); V by a visibility ray through
//          the occupancy grid of the scene.
// Reads:   depth   image sky.layer, with margin; normal  images 3 sky.layer + c, view space
//          directions  [8][sky.directions]: unit vector in the grid's space (0-2), solid angle in sr
//                      (3), radiance (4-6)
//          occupancy, grid_box  see vpl/grid.clh
// Writes:  irradiance  3 x [rows, columns] W/m^2
// Macros:  VPL_GRID
// Params:  SkyParams: from view space to that of the grid; turn without, move with its unit
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    a ray, some 20 reads, for each sixteenth of the directions above the horizon

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/receiver.clh"
#include "vpl/grid.clh"

#ifndef VPL_GRID
#error "VPL_GRID must be defined"
#endif

#define SKY_PATTERN 16
#define SKY_BRIGHTEST 1e30f // W/m^2, so that sums stay finite

// How far a ray from `at` may go along one axis before it leaves the grid, in cells.
static inline vfloat sky_leave(const vfloat at, const vfloat way)
{
    const vfloat per = 1.0f / v_max(v_abs(way), v_splat(1e-6f));
    const vfloat most = v_splat((float)VPL_GRID - 0.01f);
    return v_select(most - at, at, v_lt(way, v_splat(0.0f))) * per;
}

__kernel void sky_light(ssgi_plane depth, ssgi_plane normal,
                        __global const float *restrict directions,
                        __global const int *restrict occupancy,
                        __global const float *restrict grid_box,
                        __global float *restrict irradiance, const int2 size,
                        const SsgiCamera camera, const SkyParams sky)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * sky.margin_columns, size.y + 2 * sky.margin_rows);
    const int at_x = x + sky.margin_columns;
    const int at_y = y + sky.margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat own = ssgi_load(depth, whole, sky.layer, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    vfloat sum[3] = {zero, zero, zero};
    vfloat all = zero;
    if (v_any(there)) {
        const vfloat z = v_select(v_splat(1.0f), own, there);
        const vfloat k = ssgi_k(camera, z);
        const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * k;
        const vfloat py = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * k;
        const int first = 3 * sky.layer;
        const vfloat mx = ssgi_load(normal, whole, first, at_x, at_y) * sky.facing;
        const vfloat my = ssgi_load(normal, whole, first + 1, at_x, at_y) * sky.facing;
        const vfloat mz = ssgi_load(normal, whole, first + 2, at_x, at_y) * sky.facing;
        const vfloat nx = sky.xx * mx + sky.xy * my + sky.xz * mz;
        const vfloat ny = sky.yx * mx + sky.yy * my + sky.yz * mz;
        const vfloat nz = sky.zx * mx + sky.zy * my + sky.zz * mz;
        const float per = grid_box[3];
        const float unit = sky.per_unit;
        VplCell start = {zero, zero, zero, nx, ny, nz};
        const float most = (float)VPL_GRID - 0.01f;
        const vfloat gx = (sky.xx * px + sky.xy * py - sky.xz * z) * unit + sky.shift_x;
        const vfloat gy = (sky.yx * px + sky.yy * py - sky.yz * z) * unit + sky.shift_y;
        const vfloat gz = (sky.zx * px + sky.zy * py - sky.zz * z) * unit + sky.shift_z;
        start.x = v_clamp(v_fma(nx, v_splat(sky.lift), (gx - grid_box[0]) * per), 0.0f, most);
        start.y = v_clamp(v_fma(ny, v_splat(sky.lift), (gy - grid_box[1]) * per), 0.0f, most);
        start.z = v_clamp(v_fma(nz, v_splat(sky.lift), (gz - grid_box[2]) * per), 0.0f, most);
        // Bits of column and row, crossed over: neighbours are far apart in the pattern.
        const vint column = v_iota() + x;
        const vint a = (column ^ v_splat_int(y)) & 3, b = v_splat_int(y) & 3;
        const vint pattern = ((a & 1) << 3) | ((b & 1) << 2) | (a & 2) | (b >> 1);
        for (int n = 0; n < sky.directions; n += SKY_PATTERN) {
            const vint number = v_imin(pattern + n, v_splat_int(sky.directions - 1));
            const vfloat wx = v_gather(directions, number);
            const vfloat wy = v_gather(directions + sky.directions, number);
            const vfloat wz = v_gather(directions + 2 * sky.directions, number);
            const vfloat facing = v_fma(nx, wx, v_fma(ny, wy, nz * wz));
            const vmask wanted = there & v_gt(facing, zero);
            if (!v_any(wanted)) {
                continue;
            }
            const vfloat length = v_min(v_min(sky_leave(start.x, wx), sky_leave(start.y, wy)),
                                        sky_leave(start.z, wz));
            VplCell end;
            end.x = v_fma(length, wx, start.x);
            end.y = v_fma(length, wy, start.y);
            end.z = v_fma(length, wz, start.z);
            end.nx = -wx;
            end.ny = -wy;
            end.nz = -wz;
            const vmask seen = wanted & ~vpl_blocked(occupancy, start, end, wanted);
            const vfloat w =
                v_max(facing, zero) * v_gather(directions + 3 * sky.directions, number);
            const vfloat arriving = v_select(zero, w, seen);
            all = all + w;
#pragma unroll
            for (int c = 0; c < 3; ++c) {
                sum[c] = v_fma(arriving,
                               v_gather(directions + (4 + c) * sky.directions, number), sum[c]);
            }
        }
    }
    // Weights are scaled to sum to pi: an open sky of one radiance is exact.
    const vfloat scale = v_splat(3.14159265f) / v_max(all, v_splat(1e-30f));
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const vfloat value = v_min(sum[c] * scale, v_splat(SKY_BRIGHTEST));
        ssgi_store(v_select(zero, value, there), irradiance, size, c, x, y, 0.0f);
    }
}
