// SPDX-License-Identifier: MIT
// vpl_interleaved: irradiance by virtual point lights, of which each pixel of a 4 x 4 tile takes one
// in 16, with an estimate of what stands between.
//
// Method:  Keller and Heidrich 2001, "Interleaved Sampling"; Segovia et al. 2006, "Non-interleaved
//          Deferred Shading of Interleaved Sample Patterns". A pixel's lights that are neighbours on
//          the reflective shadow map share a line of sight to one of them, which is followed
//          through the grid of vpl_occupy.
// Reads:   depth   [rows, columns] with margin, scene units; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space, unit length
//          lights  [segments][params.span][VPL_LIGHT]
//          lists   [tiles][16][params.room] and counts [tiles][16], see vpl_lists
//          grid, grid_box  see vpl_occupy
// Writes:  irradiance  3 x [rows, columns], W/m^2; 0 where nothing is
// Macros:  VPL_NEAR, VPL_CUT and VPL_ADD as in vpl_splat; VPL_SIGHT (0: light passes through walls,
//          1), VPL_GRID (32..256 cells along a side), VPL_SHARE (lights that share a line),
//          VPL_STEPS (along a line)
// Launch:  a work-item for each tile of 16 x 16, pixel of 4 x 4, and SSGI_LANES of the 16 such pixels
// Cost:    1 / 16 of vpl_splat, and VPL_STEPS reads for each pixel and line

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/grid.clh"
#include "vpl/light.clh"
#include "vpl/receiver.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(VPL_ADD) || !defined(VPL_SIGHT) ||        \
    !defined(VPL_SHARE) || !defined(VPL_GRID) || !defined(VPL_STEPS)
#error "VPL_NEAR, _CUT, _ADD, _SIGHT, _SHARE, _GRID and _STEPS must be defined"
#endif

#define VPL_PIECES (16 / SSGI_LANES)

__kernel void vpl_interleaved(ssgi_plane depth, ssgi_plane normal,
                              __global const float *restrict lights,
                              __global const int *restrict lists,
                              __global const int *restrict counts,
                              __global const int *restrict grid,
                              __global const float *restrict grid_box,
                              __global float *restrict irradiance, const int2 size,
                              const SsgiCamera camera, const VplParams params)
{
    const int tile_x = (int)get_global_id(0) / (16 * VPL_PIECES);
    const int subset = (int)get_global_id(0) / VPL_PIECES % 16;
    const int piece = (int)get_global_id(0) % VPL_PIECES;
    const int tile_y = (int)get_global_id(1);
    const int2 tiles = vpl_tiles(size);
    if (tile_x >= tiles.x || tile_y >= tiles.y) {
        return;
    }
    const vint number = v_iota() + piece * SSGI_LANES;
    const vint x = (number & 3) * 4 + (tile_x * VPL_TILE + (subset & 3));
    const vint y = (number >> 2) * 4 + (tile_y * VPL_TILE + (subset >> 2));
    const vmask inside = v_ilt(x, v_splat_int(size.x)) & v_ilt(y, v_splat_int(size.y));
    const VplReceiver at =
        vpl_receiver_at(depth, normal, size, camera, params, v_imin(x, v_splat_int(size.x - 1)),
                        v_imin(y, v_splat_int(size.y - 1)));
    const vmask shone = at.there & inside;
    const int own = (tile_y * tiles.x + tile_x) * 16 + subset;
    __global const int *restrict list = lists + own * params.room;
    const int count = v_any(shone) ? counts[own] : 0;
    lights += (params.segment + subset) * params.span * VPL_LIGHT;
    const vfloat zero = v_splat(0.0f);
#if VPL_SIGHT
    const VplCell start = vpl_cell(at.x, at.y, at.z, at.nx, at.ny, at.nz, grid_box, params);
#endif
    vfloat sum[3] = {zero, zero, zero};
    for (int first = 0; first < count; first += VPL_SHARE) {
        const int end = min(first + VPL_SHARE, count);
        vfloat part[3] = {zero, zero, zero};
        vfloat all = zero;
        for (int i = first; i < end; ++i) {
            __global const float *restrict light = lights + list[i] * VPL_LIGHT;
            const vfloat w = vpl_weight(light, at, params);
            all = all + w;
            for (int j = 0; j < 3; ++j) {
                part[j] = v_fma(w, v_splat(light[8 + j]), part[j]);
            }
        }
#if VPL_SIGHT
        const vmask wanted = v_gt(all, zero) & shone;
        if (!v_any(wanted)) {
            continue;
        }
        // Another light of each piece for each pixel of 4 x 4, and another phase of the steps.
        __global const float *restrict one =
            lights + list[first + (subset * 7 + 3) % 16 * (end - first) / 16] * VPL_LIGHT;
        const VplCell finish = vpl_cell(v_splat(one[0]), v_splat(one[1]), v_splat(one[2]),
                                        v_splat(-one[4]), v_splat(-one[5]), v_splat(-one[6]),
                                        grid_box, params);
        const int phase = (subset * 5 + first / VPL_SHARE * 3) & 15;
        const vmask open = ~vpl_blocked(grid, start, finish, ((float)phase + 0.5f) / 16.0f);
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + v_select(zero, part[j], open);
        }
#else
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + part[j];
        }
#endif
    }
    // Lanes outside the image write 0 to the guard, which is 0.
    const vint place =
        v_iselect(v_splat_int(ssgi_pitch(size) - 1), y * ssgi_pitch(size) + x, inside);
    for (int j = 0; j < 3; ++j) {
        vfloat value = v_min(v_select(zero, sum[j], shone) * (params.gain * 16.0f),
                             v_splat(VPL_BRIGHTEST));
        __global float *restrict image = irradiance + ssgi_index(size, j, 0, 0);
#if VPL_ADD
        value = v_min(value + v_gather(image, place), v_splat(VPL_BRIGHTEST));
#endif
        v_scatter(value, image, place);
    }
}
