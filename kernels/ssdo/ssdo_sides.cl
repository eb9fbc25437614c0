// SPDX-License-Identifier: MIT
// ssdo_sides: layers that bound a closed object, and which of their sides is the outer one.
//
// Normals of a mesh point out of a closed object. From the front, each layer of a pixel that turns
// its outer side to the camera begins an object; each that turns it away ends the last object begun
// and not yet ended. The inner sides of such a pair are not visible. A sheet begins and has no end.
// No layer of a pixel is marked if one ends an object that was never begun (a sheet from behind, a
// mesh with its normals inside, a camera within an object) or has no normal.
//
// Reads:   depth   SIDES_LAYERS x [rows, columns], scene units; INFINITY where nothing is
//          normal  3 SIDES_LAYERS x likewise, view space, facing the camera
//          given   likewise, world space, as the mesh has it; 0 for none
// Writes:  sides   SIDES_LAYERS x likewise: 1 if the camera sees the outer side of a closed
//                  object, -1 if it sees the inner side, else 0
// Params:  rotation  world to view, row by row
// Macros:  SIDES_LAYERS (2 to 31)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    memory: 7 planes read and 1 written a layer

#include "common/gbuffer.clh"

#ifndef SIDES_LAYERS
#error "SIDES_LAYERS must be defined by the host"
#endif

__kernel void ssdo_sides(ssgi_plane depth, ssgi_plane normal, ssgi_plane given,
                         __global float *restrict sides, const int2 size,
                         const GbufferRotation rotation)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const vint none = v_splat_int(0);
    vint begun = none, paired = none, ends = none; // a bit for each layer
    vmask told = v_splat_int(-1);
    for (int layer = 0; layer < SIDES_LAYERS; ++layer) {
        const vmask there = v_lt(ssgi_load(depth, size, layer, x, y), v_splat(INFINITY));
        const vfloat wx = ssgi_load(given, size, 3 * layer, x, y);
        const vfloat wy = ssgi_load(given, size, 3 * layer + 1, x, y);
        const vfloat wz = ssgi_load(given, size, 3 * layer + 2, x, y);
        const vfloat vx = wx * rotation.xx + wy * rotation.xy + wz * rotation.xz;
        const vfloat vy = wx * rotation.yx + wy * rotation.yy + wz * rotation.yz;
        const vfloat vz = wx * rotation.zx + wy * rotation.zy + wz * rotation.zz;
        const vfloat turned = vx * ssgi_load(normal, size, 3 * layer, x, y) +
                              vy * ssgi_load(normal, size, 3 * layer + 1, x, y) +
                              vz * ssgi_load(normal, size, 3 * layer + 2, x, y);
        const vint bit = v_splat_int(1 << layer);
        const vmask end = there & v_lt(turned, zero);
        vmask open = end;
        for (int other = layer - 1; other >= 0; --other) {
            const vint at = v_splat_int(1 << other);
            const vmask last = open & v_ine(begun & at, none);
            begun = begun & ~(at & last);
            paired = paired | ((at | bit) & last);
            open = open & ~last;
        }
        told = told & ~open & ~(there & ~v_gt(v_abs(turned), zero));
        begun = begun | (bit & there & ~end);
        ends = ends | (bit & end);
    }
    paired = paired & told;
    for (int layer = 0; layer < SIDES_LAYERS; ++layer) {
        const vint bit = v_splat_int(1 << layer);
        const vfloat side = v_select(v_splat(1.0f), v_splat(-1.0f), v_ine(ends & bit, none));
        ssgi_store(v_select(zero, side, v_ine(paired & bit, none)), sides, size, layer, x, y, 0.0f);
    }
}
