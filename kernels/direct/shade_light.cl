// SPDX-License-Identifier: MIT
// shade_light: add the direct irradiance of one light, shadowed by its map; or, with SHADE_LOBE,
// the radiance that lobes reflect of it.
//
// E = I cos / d^2 (spot and point light) or E = E0 cos (directional light), times the shadow map's
// share. See kernels/direct/shadow.clh and, for lobes, common/phong.clh.
// Reads:   depth   image light.layer, with margin; normal  images 3 light.layer + c, view space
//          map     depth that the light sees: an image for each of light.crops parts
//                  (SHADE_SHADOW 1)
//          crops   the parts of its faces, see direct/crops.clh; the faces of a point light are
//                  +x -x +y -y +z -z (SHADE_SHADOW 1)
//          blocks  of the map, see direct/blocks.clh; without any (light.blocks 0) the map stands
//                  in for them and is not read as such (SHADE_SHADOW 1)
//          With light.facets 1 depths are exact: what lies on a facet that is turned away from the
//          light is dark, and facets are what maps are compared with (SHADE_SHADOW 1).
//          albedo, specular, gloss  with margin (SHADE_LOBE 1)
// Writes:  irradiance  3 x [rows, columns] W/m^2, added to (SHADE_ADD 1) or set; with SHADE_LOBE
//          radiance, W m^-2 sr^-1, likewise
// Macros:  SHADE_KIND (0 spot, 1 point, 2 directional), SHADE_SHADOW, SHADE_SOFT (it has a
//          size, light.extent; with SHADE_SHADOW), SHADE_ADD, SHADE_LOBE (0, 1), SHADE_SMOOTH (1:
//          a pixel at the edge of a spot light's cone has a share of its light)
// Params:  position and direction in the camera's view space; `turn` and `shift` take view space to
//          that of the light's camera (point light: to world axes round the light)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    16 scattered reads per lit pixel with a shadow map; with blocks 4 where they tell what
//          those would find, 20 elsewhere

#include "common/phong.clh"
#include "direct/facet.clh"
#include "direct/light.clh"
#include "direct/soft_shadow.clh"

#if !defined(SHADE_KIND) || !defined(SHADE_SHADOW) || !defined(SHADE_ADD) ||                       \
    !defined(SHADE_LOBE) || !defined(SHADE_SOFT)
#error "SHADE_KIND, SHADE_SHADOW, SHADE_SOFT, SHADE_ADD and SHADE_LOBE must be defined by the host"
#endif

// Cosine by which a facet must be turned away from the light to be dark: more than depths round.
#define SHADE_GRAZING 1e-3f

__kernel void shade_light(ssgi_plane depth, ssgi_plane normal,
#if SHADE_SHADOW
                          ssgi_plane map, ssgi_plane blocks, __global const float *restrict crops,
#endif
#if SHADE_LOBE
                          ssgi_plane albedo, ssgi_plane specular, ssgi_plane gloss,
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
    vmask counts = v_lt(seen, v_splat(INFINITY));
#if SHADE_LOBE
    SsgiLobe lobe = ssgi_lobe(albedo, specular, gloss, whole, at_x, at_y);
    counts = counts & lobe.there;
#endif
    if (!v_any(counts)) {
#if !SHADE_ADD
        light_store(zero, light, irradiance, size, x, y);
#endif
        return;
    }
    const LightReceiver receiver = light_receiver(depth, normal, whole, at_x, at_y, camera, light);
    const LightAt at = light_at(light, &receiver, camera);
    const vfloat unhidden = at.strength;
    vmask lit = counts & v_gt(unhidden, zero);
#if SHADE_SHADOW
    SsgiFacet facet = {receiver.there & ~receiver.there, receiver.nx, receiver.ny, receiver.nz};
    if (light.facets != 0 && v_any(lit)) {
        facet = ssgi_facet(depth, whole, light.layer, at_x, at_y, camera, -receiver.z, receiver.nx,
                           receiver.ny, receiver.nz, true);
        const vfloat front = v_fma(facet.nx, at.x, v_fma(facet.ny, at.y, facet.nz * at.z));
        lit = lit & ~(facet.known & v_lt(front, v_splat(-SHADE_GRAZING)));
    }
#endif
    vfloat strength = light_bounded(unhidden, lit);
#if SHADE_SHADOW
    if (v_any(lit)) {
        const vfloat px = receiver.x, py = receiver.y, z = -receiver.z;
        const vfloat nx = facet.nx, ny = facet.ny, nz = facet.nz;
        const vfloat qx = v_fma(v_splat(light.xx), px,
                                v_fma(v_splat(light.xy), py, light.shift_x - light.xz * z));
        const vfloat qy = v_fma(v_splat(light.yx), px,
                                v_fma(v_splat(light.yy), py, light.shift_y - light.yz * z));
        const vfloat qz = v_fma(v_splat(light.zx), px,
                                v_fma(v_splat(light.zy), py, light.shift_z - light.zz * z));
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
        const vint axis =
            v_iselect(v_iselect(v_splat_int(4), v_splat_int(2), is_y), v_splat_int(0), is_x);
        const vint face = axis - minus; // a true mask is -1
        const vfloat sx = v_select(side, -side, minus), sy = up, sz = v_abs(main);
        const vfloat tx = v_select(side_n, -side_n, minus), ty = up_n;
        const vfloat tz = v_select(-main_n, main_n, minus);
#else
        const vint face = v_splat_int(0);
        const vfloat sx = qx, sy = qy, sz = -qz, tx = mx, ty = my, tz = mz;
#endif
        const int2 map_size = (int2)(light.map_size, light.map_size);
#if SHADE_SOFT
        const vfloat share =
            ssgi_soft_shadow(map, crops, light.crops, map_size, light_camera, lit, face, sx, sy, sz,
                             tx, ty, tz, facet.known, light.extent);
#else
        const vfloat share =
            ssgi_shadow(map, blocks, light.blocks != 0, crops, light.crops, map_size, light_camera,
                        lit, face, sx, sy, sz, tx, ty, tz, facet.known);
#endif
        strength = strength * share;
    }
#endif
#if SHADE_LOBE
    lobe = ssgi_widened(lobe, normal, whole, at_x, at_y);
    const vfloat mirrored =
        ssgi_lobe_value(&lobe,
                        ssgi_mirrored(camera, receiver.x, receiver.y, receiver.z, receiver.nx,
                                      receiver.ny, receiver.nz),
                        at.x, at.y, at.z);
    // Radiance per specular reflectance: without the cosine, which the lobe does not have.
    const vfloat shone = strength / v_max(at.cosine, v_splat(1e-6f)) * mirrored;
    for (int c = 0; c < 3; ++c) {
        const float power = c == 0 ? light.red : c == 1 ? light.green : light.blue;
        vfloat sum = v_min(shone * lobe.specular[c] * power, v_splat(LIGHT_BRIGHTEST));
#if SHADE_ADD
        sum = sum + v_load(irradiance + ssgi_index(size, c, x, y));
#endif
        ssgi_store(sum, irradiance, size, c, x, y, 0.0f);
    }
#else
    light_store(strength, light, irradiance, size, x, y);
#endif
}
