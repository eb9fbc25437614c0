// SPDX-License-Identifier: MIT
// rsm_face: one face of a drawn reflective shadow map, copied to the map of all faces.
//
// Method:  a texel's position is where its view ray ends; the surface that it stands for is
//          the section across its beam there, over the cosine at which it meets the surface.
// Reads:   depth   [rows, columns] from the light, scene units; INFINITY where nothing is
//          normal  3 x [rows, columns] world space, unit length, to either side
//          flux    3 x [rows, columns] W
// Writes:  all with params.rows rows, of which those from params.first_row on, 0 where nothing is:
//          position    3 x [rows, columns] world axes, scene units from the map's origin
//          lit_normal  3 x [rows, columns] world space, on the side that the light falls on
//          power       3 x [rows, columns] W, at most params.brightest
//          area        [rows, columns] square scene units
//          lit         [faces] params.stamp where a face has any power
// Params:  rotation from the face's view space to the world's axes, the eye relative to the origin
// Launch:  SSGI_LANES texels of a row per work-item

#include "rsm/face.clh"

#ifndef RSM_LEAST_COSINE
#error "ssgi_cl/device/constants.py defines RSM_LEAST_COSINE"
#endif

__kernel void rsm_face(ssgi_plane depth, ssgi_plane normal, ssgi_plane flux,
                       __global float *restrict position, __global float *restrict lit_normal,
                       __global float *restrict power, __global float *restrict area,
                       __global int *restrict lit,
                       const int2 size, // of the face
                       const SsgiCamera camera, const RsmFace params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const int2 whole = (int2)(size.x, params.rows);
    const int row = y + params.first_row;
    const vfloat seen = ssgi_load(depth, size, 0, x, y);
    const vmask there = v_lt(seen, v_splat(INFINITY));
    const vfloat z = v_select(zero, seen, there);
    const vfloat k = ssgi_k(camera, z);
    const vfloat sx = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f);
    const vfloat sy = ssgi_slope_y(camera, v_splat((float)y + 0.5f));
    const vfloat px = sx * k;
    const vfloat py = sy * k;
    const vfloat at_x =
        v_fma(px, v_splat(params.xx),
              v_fma(py, v_splat(params.xy), v_fma(-z, v_splat(params.xz), v_splat(params.x))));
    const vfloat at_y =
        v_fma(px, v_splat(params.yx),
              v_fma(py, v_splat(params.yy), v_fma(-z, v_splat(params.yz), v_splat(params.y))));
    const vfloat at_z =
        v_fma(px, v_splat(params.zx),
              v_fma(py, v_splat(params.zy), v_fma(-z, v_splat(params.zz), v_splat(params.z))));
    ssgi_store(v_select(zero, at_x, there), position, whole, 0, x, row, 0.0f);
    ssgi_store(v_select(zero, at_y, there), position, whole, 1, x, row, 0.0f);
    ssgi_store(v_select(zero, at_z, there), position, whole, 2, x, row, 0.0f);

    const RsmToLight way = rsm_to_light(sx, sy, camera, params);
    const vfloat nx = ssgi_load(normal, size, 0, x, y);
    const vfloat ny = ssgi_load(normal, size, 1, x, y);
    const vfloat nz = ssgi_load(normal, size, 2, x, y);
    const vfloat cosine = v_fma(nx, way.x, v_fma(ny, way.y, nz * way.z)) * way.inverse;
    const vfloat side = v_select(zero, v_copysign(v_splat(1.0f), cosine), there);
    ssgi_store(nx * side, lit_normal, whole, 0, x, row, 0.0f);
    ssgi_store(ny * side, lit_normal, whole, 1, x, row, 0.0f);
    ssgi_store(nz * side, lit_normal, whole, 2, x, row, 0.0f);

    // A beam that goes aslant by the cosine `way.inverse` is narrower by it.
    const vfloat section = fabs(camera.to_x * camera.to_y) * k * k * way.inverse;
    const vfloat own_area = section / v_max(v_abs(cosine), v_splat(RSM_LEAST_COSINE));
    ssgi_store(v_select(zero, own_area, there), area, whole, 0, x, row, 0.0f);
    rsm_store_power(flux, power, lit, size, x, y, there, params);
}
