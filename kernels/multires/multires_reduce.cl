// SPDX-License-Identifier: MIT
// multires_reduce: every second pixel of a G-buffer in both directions, without its margin.
//
// Reads:   fine_depth  [rows, columns] with margin, scene units; INFINITY where nothing is
//          fine_normal 3 x [rows, columns] with margin, view space
// Writes:  depth   [rows, columns], pixel (x, y) is fine pixel (2 x, 2 y) within the margin
//          linear  [rows, columns] 1 / depth (orthographic: depth); INFINITY where nothing is
//          normal  3 x [rows, columns]
//          next_depth, next_linear, next_normal  likewise every second of these; with
//                  MULTIRES_LEVELS 2 alone
// Macros:  MULTIRES_LEVELS (1; 2 with one lane alone)
// Params:  fine_size with margin; margin = (columns, rows); next = (columns, rows)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    4 reads and 5 writes per pixel

#define UPSAMPLE_STEP 2
#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "common/surface.clh"
#include "filters/phases.clh"

#ifndef MULTIRES_LEVELS
#error "MULTIRES_LEVELS must be defined by the host"
#endif
#if MULTIRES_LEVELS > 1 && SSGI_LANES != 1
#error "two levels are made at a time with one lane alone"
#endif

__kernel void
multires_reduce(ssgi_plane fine_depth, ssgi_plane fine_normal, __global float *restrict depth,
                __global float *restrict linear, __global float *restrict normal,
#if MULTIRES_LEVELS > 1
                __global float *restrict next_depth, __global float *restrict next_linear,
                __global float *restrict next_normal, const int2 next,
#endif
                const int2 size, const int2 fine_size, const int2 margin, const SsgiCamera camera)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int from_x = UPSAMPLE_STEP * x + margin.x;
    const int from_y = UPSAMPLE_STEP * y + margin.y;
    vfloat phases[UPSAMPLE_STEP];
    ssgi_load_phases(fine_depth, fine_size, 0, from_x, from_y, phases);
    const vmask there = v_lt(phases[0], v_splat(INFINITY));
    const vfloat z = v_select(v_splat(1.0f), phases[0], there);
    const vfloat shown = v_select(v_splat(INFINITY), ssgi_linear(camera, z), there);
#if MULTIRES_LEVELS > 1
    const bool again = (x & 1) == 0 && (y & 1) == 0; // in the next level too
    if (again) {
        ssgi_store(phases[0], next_depth, next, 0, x / 2, y / 2, INFINITY);
        ssgi_store(shown, next_linear, next, 0, x / 2, y / 2, INFINITY);
    }
#endif
    ssgi_store(phases[0], depth, size, 0, x, y, INFINITY);
    ssgi_store(shown, linear, size, 0, x, y, INFINITY);
    for (int i = 0; i < 3; ++i) {
        ssgi_load_phases(fine_normal, fine_size, i, from_x, from_y, phases);
        ssgi_store(phases[0], normal, size, i, x, y, 0.0f);
#if MULTIRES_LEVELS > 1
        if (again) {
            ssgi_store(phases[0], next_normal, next, i, x / 2, y / 2, 0.0f);
        }
#endif
    }
}
