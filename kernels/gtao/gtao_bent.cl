// SPDX-License-Identifier: MIT
// gtao_bent: bent normals of unit length in world space, from normals and their bends.
//
// The mean unoccluded direction lies above the surface: where so little is unoccluded that noise
// puts it below, it is raised until its cosine to the normal is `least` times its length before.
// Reads:   scanned  4 x [rows, columns] A and the bend in view space, from gtao or ssdo_bitmask,
//                   blurred or not; further images are not read
//          normal   3 x [rows, columns] with margin, view space, unit length; 0 where nothing is
// Writes:  bent     4 x [rows, columns] A and the bent normal in world space; 0 where nothing is
// Params:  to_world  view to world, row by row; margin (columns, rows); least
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"

// The struct GbufferRotation is generated from ssgi_cl.device.gbuffer.

static inline vfloat gtao_dot(const vfloat x, const vfloat y, const vfloat z, const vfloat bx,
                              const vfloat by, const vfloat bz)
{
    return v_fma(x, bx, v_fma(y, by, z * bz));
}

__kernel void gtao_bent(ssgi_plane scanned, ssgi_plane normal, __global float *restrict bent,
                        const int2 size, const int2 margin, const float least,
                        const GbufferRotation to_world)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = size + 2 * margin;
    const vfloat nx = ssgi_load(normal, whole, 0, x + margin.x, y + margin.y);
    const vfloat ny = ssgi_load(normal, whole, 1, x + margin.x, y + margin.y);
    const vfloat nz = ssgi_load(normal, whole, 2, x + margin.x, y + margin.y);
    vfloat bx = nx + ssgi_load(scanned, size, 1, x, y);
    vfloat by = ny + ssgi_load(scanned, size, 2, x, y);
    vfloat bz = nz + ssgi_load(scanned, size, 3, x, y);
    const vfloat lack = v_max(least - gtao_dot(nx, ny, nz, bx, by, bz), v_splat(0.0f));
    bx = v_fma(nx, lack, bx);
    by = v_fma(ny, lack, by);
    bz = v_fma(nz, lack, bz);
    const vfloat squared = gtao_dot(bx, by, bz, bx, by, bz);
    // Where nothing is, the normal is 0, and anything may be in `scanned`.
    const vmask there = v_gt(gtao_dot(nx, ny, nz, nx, ny, nz), v_splat(0.0f));
    const vfloat unit = v_select(v_splat(0.0f), v_rsqrt(squared), there);
    bx = bx * unit;
    by = by * unit;
    bz = bz * unit;
    ssgi_store(ssgi_load(scanned, size, 0, x, y), bent, size, 0, x, y, 1.0f);
    const float turn[3][3] = {{to_world.xx, to_world.xy, to_world.xz},
                              {to_world.yx, to_world.yy, to_world.yz},
                              {to_world.zx, to_world.zy, to_world.zz}};
    for (int c = 0; c < 3; ++c) {
        const vfloat turned =
            gtao_dot(v_splat(turn[c][0]), v_splat(turn[c][1]), v_splat(turn[c][2]), bx, by, bz);
        ssgi_store(turned, bent, size, c + 1, x, y, 1.0f);
    }
}
