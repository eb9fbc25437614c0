// SPDX-License-Identifier: MIT
// rsm_normals: where a mesh has no normals, those of the surface that the depth shows.
//
// Reads:   seen    3 x [rows, columns] view space; see gbuffer_normals
// Writes:  normal  3 x [rows, columns] world space, where it is 0
// Params:  rotation from view space to the world's axes
// Launch:  SSGI_LANES texels of a row per work-item

#include "common/gbuffer.clh"

__kernel void rsm_normals(ssgi_plane seen, __global float *restrict normal, const int2 size,
                          const GbufferRotation rotation)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    vfloat own[3];
    vmask none = v_splat_int(-1);
    for (int c = 0; c < 3; ++c) {
        own[c] = v_load(normal + ssgi_index(size, c, x, y));
        none = none & v_eq(own[c], v_splat(0.0f));
    }
    const vfloat nx = ssgi_load(seen, size, 0, x, y);
    const vfloat ny = ssgi_load(seen, size, 1, x, y);
    const vfloat nz = ssgi_load(seen, size, 2, x, y);
    const float turn[3][3] = {{rotation.xx, rotation.xy, rotation.xz},
                              {rotation.yx, rotation.yy, rotation.yz},
                              {rotation.zx, rotation.zy, rotation.zz}};
    for (int c = 0; c < 3; ++c) {
        const vfloat turned =
            v_fma(nx, v_splat(turn[c][0]), v_fma(ny, v_splat(turn[c][1]), nz * turn[c][2]));
        ssgi_store(v_select(own[c], turned, none), normal, size, c, x, y, 0.0f);
    }
}
