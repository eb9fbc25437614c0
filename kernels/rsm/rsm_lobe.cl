// SPDX-License-Identifier: MIT
// rsm_lobe: what a drawn face of a reflective shadow map mirrors, brought to where all faces are.
//
// Reads:   depth   [rows, columns] from the light, scene units; INFINITY where nothing is
//          normal  3 x [rows, columns] world space, unit length, to either side
//          flux    3 x [rows, columns] W that the lobe takes away
//          gloss   [rows, columns] Phong exponent
// Writes:  all with params.rows rows, of which those from params.first_row on, 0 where nothing is:
//          axis    3 x [rows, columns] world space: where the light's ray is mirrored to
//          power   3 x [rows, columns] W, at most params.brightest
//          sharp   [rows, columns] exponent
//          lit     [faces] params.stamp where a face has any power
// Params:  as of rsm_face
// Launch:  SSGI_LANES texels of a row per work-item

#include "rsm/face.clh"

__kernel void rsm_lobe(ssgi_plane depth, ssgi_plane normal, ssgi_plane flux, ssgi_plane gloss,
                       __global float *restrict axis, __global float *restrict power,
                       __global float *restrict sharp, __global int *restrict lit,
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
    const vmask there = v_lt(ssgi_load(depth, size, 0, x, y), v_splat(INFINITY));

    const RsmToLight way =
        rsm_to_light(ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f),
                     ssgi_slope_y(camera, v_splat((float)y + 0.5f)), camera, params);
    const vfloat to_light[3] = {way.x * way.inverse, way.y * way.inverse, way.z * way.inverse};
    vfloat n[3];
    vfloat cosine = zero;
    for (int c = 0; c < 3; ++c) {
        n[c] = ssgi_load(normal, size, c, x, y);
        cosine = v_fma(n[c], to_light[c], cosine);
    }
    for (int c = 0; c < 3; ++c) {
        const vfloat mirrored = v_fma(n[c], cosine * 2.0f, -to_light[c]);
        ssgi_store(v_select(zero, mirrored, there), axis, whole, c, x, row, 0.0f);
    }
    ssgi_store(v_select(zero, ssgi_load(gloss, size, 0, x, y), there), sharp, whole, 0, x, row,
               0.0f);
    rsm_store_power(flux, power, lit, size, x, y, there, params);
}
