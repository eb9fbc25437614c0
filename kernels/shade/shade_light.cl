// SPDX-License-Identifier: MIT
// shade_light: add the direct irradiance of one light, shadowed by its map.
//
// E = I cos / d^2 (spot and point light) or E = E0 cos (directional light), times the shadow map's
// share. See kernels/shade/shadow.clh.
// Reads:   depth   image light.layer, with margin; normal  images 3 light.layer + c, view space
//          map     depth that the light sees: 1 image, or 6 of a point light, in the order
//                  +x -x +y -y +z -z (SHADE_SHADOW 1)
//          blocks  of the map, see shade/blocks.clh; without any (light.blocks 0) the map stands in
//                  for them and is not read as such (SHADE_SHADOW 1)
// Writes:  irradiance  3 x [rows, columns] W/m^2, added to (SHADE_ADD 1) or set
// Macros:  SHADE_KIND (0 spot, 1 point, 2 directional), SHADE_SHADOW, SHADE_ADD (0, 1)
// Params:  position and direction in the camera's view space; `turn` and `shift` take view space to
//          that of the light's camera (point light: to world axes round the light)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    16 scattered reads per lit pixel with a shadow map; with blocks 4 where they tell what
//          those would find, 20 elsewhere

#include "shade/light.clh"
#include "shade/shadow.clh"

#if !defined(SHADE_KIND) || !defined(SHADE_SHADOW) || !defined(SHADE_ADD)
#error "SHADE_KIND, SHADE_SHADOW and SHADE_ADD must be defined by the host"
#endif

__kernel void shade_light(ssgi_plane depth, ssgi_plane normal,
#if SHADE_SHADOW
                          ssgi_plane map, ssgi_plane blocks,
#endif
                          __global float *restrict irradiance, const int2 size,
                          const SsgiCamera camera, const SsgiCamera light_camera,
                          const LightParams light)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * light.margin_columns, size.y + 2 * light.margin_rows);
    const int at_x = x + light.margin_columns;
    const int at_y = y + light.margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat seen = ssgi_load(depth, whole, light.layer, at_x, at_y);
    if (!v_any(v_lt(seen, v_splat(INFINITY)))) {
#if !SHADE_ADD
        light_store(zero, light, irradiance, size, x, y);
#endif
        return;
    }
    const LightReceiver receiver = light_receiver(depth, normal, whole, at_x, at_y, camera, light);
    const vfloat unhidden = light_at(light, &receiver).strength;
    const vmask lit = receiver.there & v_gt(unhidden, zero);
    vfloat strength = light_bounded(unhidden, lit);
#if SHADE_SHADOW
    if (v_any(lit)) {
        const vfloat px = receiver.x, py = receiver.y, z = -receiver.z;
        const vfloat nx = receiver.nx, ny = receiver.ny, nz = receiver.nz;
        const vfloat qx = v_fma(v_splat(light.xx), px, v_fma(v_splat(light.xy), py,
                                                            light.shift_x - light.xz * z));
        const vfloat qy = v_fma(v_splat(light.yx), px, v_fma(v_splat(light.yy), py,
                                                            light.shift_y - light.yz * z));
        const vfloat qz = v_fma(v_splat(light.zx), px, v_fma(v_splat(light.zy), py,
                                                            light.shift_z - light.zz * z));
        const vfloat mx = light.xx * nx + light.xy * ny + light.xz * nz;
        const vfloat my = light.yx * nx + light.yy * ny + light.yz * nz;
        const vfloat mz = light.zx * nx + light.zy * ny + light.zz * nz;
#if SHADE_KIND == 1
        // The face of the largest component i; its camera looks along +-i with i + 1 up, so its
        // view space is (+-(i + 2), i + 1, -|i|).
        const vfloat hx = v_abs(qx), hy = v_abs(qy), hz = v_abs(qz);
        const vmask is_x = v_ge(hx, hy) & v_ge(hx, hz);
        const vmask is_y = ~is_x & v_ge(hy, hz);
        const vfloat main = v_select(v_select(qz, qy, is_y), qx, is_x);
        const vfloat side = v_select(v_select(qy, qx, is_y), qz, is_x);
        const vfloat up = v_select(v_select(qx, qz, is_y), qy, is_x);
        const vfloat main_n = v_select(v_select(mz, my, is_y), mx, is_x);
        const vfloat side_n = v_select(v_select(my, mx, is_y), mz, is_x);
        const vfloat up_n = v_select(v_select(mx, mz, is_y), my, is_x);
        const vmask minus = v_lt(main, zero);
        const vint axis = v_iselect(v_iselect(v_splat_int(4), v_splat_int(2), is_y),
                                    v_splat_int(0), is_x);
        const vint face = axis - minus; // a true mask is -1
        const vfloat share =
            ssgi_shadow(map, blocks, light.blocks != 0, (int2)(light.map_size, light.map_size),
                        light_camera, lit, face, v_select(side, -side, minus), up, v_abs(main),
                        v_select(side_n, -side_n, minus), up_n, v_select(-main_n, main_n, minus));
#else
        const vfloat share =
            ssgi_shadow(map, blocks, light.blocks != 0, (int2)(light.map_size, light.map_size),
                        light_camera, lit, v_splat_int(0), qx, qy, -qz, mx, my, mz);
#endif
        strength = strength * share;
    }
#endif
    light_store(strength, light, irradiance, size, x, y);
}
