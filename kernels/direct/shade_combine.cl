// SPDX-License-Identifier: MIT
// shade_combine: radiance of each pixel from direct, ambient and indirect irradiance.
//
// L = albedo / pi (E_direct + A E_ambient + E_indirect) + emission. Ambient occlusion A dims
// ambient light, and indirect light where asked to; with SHADE_BOUNCES it is brightened, colour by
// colour, by the albedo (Jimenez et al. 2016, "Practical Realtime Strategies for Accurate Indirect
// Occlusion"). Indirect light of visibility rays that miss occluders close by is dimmed by
// min(2 A, 1): where two surfaces meet at a right angle, A is 1/2 and each sees the other's light;
// only gaps have less.
// Reads:   linear, normal, albedo, emission  with margin; emission if SHADE_EMISSION 1
//          direct    3 x [rows, columns] W/m^2 (SHADE_DIRECT 1)
//          visibility  [rows, columns] A (SHADE_AO 1)
//          indirect  3 x [rows, columns] W/m^2 (SHADE_INDIRECT 1; 2: times A, which it reads
//                    too; 3: times min(2 A, 1))
//          sky_light 3 x [rows, columns] W/m^2 (SHADE_SKY_LIGHT 1; 2: times A, which it reads too)
//          ambient   W/m^2 (SHADE_AMBIENT 1), see direct/ambient.clh
//          sky       [sky rows][sky columns][3] latitude-longitude radiance (SHADE_SKY 1), or [3]
// Writes:  radiance  3 x [rows, columns] W m^-2 sr^-1; the sky's where nothing is
//          light_over_pi  3 x [rows, columns] irradiance of all light over pi (SHADE_LIGHT 1)
// Macros:  SHADE_DIRECT, SHADE_AO, SHADE_BOUNCES, SHADE_INDIRECT, SHADE_EMISSION, SHADE_AMBIENT
//          (any ambient light), SHADE_SKY, SHADE_LIGHT: 0 or 1; SHADE_INDIRECT 2 and 3,
//          SHADE_SKY_LIGHT 2 too; AMBIENT_SIZE, see `ambient`
// Params:  view to world rotation, margin
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "direct/ambient.clh"

#if !defined(SHADE_DIRECT) || !defined(SHADE_AO) || !defined(SHADE_BOUNCES) ||                     \
    !defined(SHADE_INDIRECT) || !defined(SHADE_EMISSION) || !defined(SHADE_AMBIENT) ||             \
    !defined(SHADE_SKY) || !defined(SHADE_SKY_LIGHT) || !defined(SHADE_LIGHT) ||                   \
    !defined(AMBIENT_SIZE)
#error "SHADE_DIRECT, _AO, _BOUNCES, _INDIRECT, _EMISSION, _AMBIENT, _SKY, AMBIENT_SIZE: undefined"
#endif

#if !defined(SHADE_CUBE_SLOPE) || !defined(SHADE_CUBE_CONSTANT) || !defined(SHADE_SQUARE_SLOPE) || \
    !defined(SHADE_SQUARE_CONSTANT) || !defined(SHADE_LINE_SLOPE) || !defined(SHADE_LINE_CONSTANT)
#error "ssgi_cl/device/constants.py defines SHADE_CUBE_SLOPE to SHADE_LINE_CONSTANT"
#endif

#if SHADE_BOUNCES
// A of several bounces between surfaces of this albedo.
static inline vfloat shade_brightened(const vfloat a, const vfloat albedo)
{
    const vfloat cube = v_fma(albedo, v_splat(SHADE_CUBE_SLOPE), v_splat(SHADE_CUBE_CONSTANT));
    const vfloat square =
        v_fma(albedo, v_splat(SHADE_SQUARE_SLOPE), v_splat(SHADE_SQUARE_CONSTANT));
    const vfloat line = v_fma(albedo, v_splat(SHADE_LINE_SLOPE), v_splat(SHADE_LINE_CONSTANT));
    const vfloat fitted = v_fma(v_fma(cube, a, square), a, line) * a;
    return v_min(v_max(fitted, a), v_splat(1.0f)); // at A = 1 the fit is up to 1.0001
}
#endif

__kernel void shade_combine(ssgi_plane linear, ssgi_plane normal, ssgi_plane albedo,
#if SHADE_EMISSION
                            ssgi_plane emission,
#endif
#if SHADE_DIRECT
                            ssgi_plane direct,
#endif
#if SHADE_AO
                            ssgi_plane visibility,
#endif
#if SHADE_INDIRECT
                            ssgi_plane indirect,
#endif
#if SHADE_SKY_LIGHT
                            ssgi_plane sky_light,
#endif
#if SHADE_AMBIENT
                            __global const float *restrict ambient,
#endif
                            __global const float *restrict sky, __global float *restrict radiance,
#if SHADE_LIGHT
                            __global float *restrict light_over_pi,
#endif
                            const int2 size, const SsgiCamera camera, const CombineParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vmask there = v_lt(ssgi_load(linear, whole, 0, at_x, at_y), v_splat(INFINITY));
#if !SHADE_SKY
    if (!v_any(there)) {
        for (int c = 0; c < 3; ++c) {
            ssgi_store(v_splat(sky[c]), radiance, size, c, x, y, 0.0f);
#if SHADE_LIGHT
            ssgi_store(v_splat(0.0f), light_over_pi, size, c, x, y, 0.0f);
#endif
        }
        return;
    }
#endif
    vfloat light[3];
    for (int c = 0; c < 3; ++c) {
        light[c] = v_splat(0.0f);
    }
#if SHADE_AMBIENT
    const vfloat vx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat vy = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat vz = ssgi_load(normal, whole, 2, at_x, at_y);
    const vfloat nx = params.xx * vx + params.xy * vy + params.xz * vz;
    const vfloat ny = params.yx * vx + params.yy * vy + params.yz * vz;
    const vfloat nz = params.zx * vx + params.zy * vy + params.zz * vz;
    ssgi_ambient(ambient, nx, ny, nz, light);
#if SHADE_AO
    const vfloat a = ssgi_load(visibility, size, 0, x, y);
    for (int c = 0; c < 3; ++c) {
#if SHADE_BOUNCES
        light[c] = light[c] * shade_brightened(a, ssgi_load(albedo, whole, c, at_x, at_y));
#else
        light[c] = light[c] * a;
#endif
    }
#endif
#endif
    vfloat sky_at[3];
    for (int c = 0; c < 3; ++c) {
        sky_at[c] = v_splat(sky[c]);
    }
#if SHADE_SKY
    if (!v_all(there)) {
        const float forward = camera.perspective;
        const vfloat sx = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * forward;
        const vfloat sy = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * forward;
        const vfloat wx = params.xx * sx + params.xy * sy - params.xz;
        const vfloat wy = params.yx * sx + params.yy * sy - params.yz;
        const vfloat wz = params.zx * sx + params.zy * sy - params.zz;
        const vfloat length = v_sqrt(wx * wx + wy * wy + wz * wz);
        const vfloat across = v_fma(atan2pi(wx, -wz), v_splat(0.5f), v_splat(0.5f));
        const vfloat down = acospi(v_clamp(wy / length, -1.0f, 1.0f));
        const vint column =
            v_iclamp(v_to_int(across * (float)params.sky_columns), 0, params.sky_columns - 1);
        const vint row = v_iclamp(v_to_int(down * (float)params.sky_rows), 0, params.sky_rows - 1);
        for (int c = 0; c < 3; ++c) {
            sky_at[c] = v_gather(sky, (row * params.sky_columns + column) * 3 + c);
        }
    }
#endif
    for (int c = 0; c < 3; ++c) {
#if SHADE_DIRECT
        light[c] = light[c] + ssgi_load(direct, size, c, x, y);
#endif
#if SHADE_INDIRECT
        const vfloat bounced = ssgi_load(indirect, size, c, x, y);
#if SHADE_INDIRECT == 2
        light[c] = v_fma(bounced, ssgi_load(visibility, size, 0, x, y), light[c]);
#elif SHADE_INDIRECT == 3
        const vfloat gap = ssgi_load(visibility, size, 0, x, y) * 2.0f;
        light[c] = v_fma(bounced, v_min(gap, v_splat(1.0f)), light[c]);
#else
        light[c] = light[c] + bounced;
#endif
#endif
#if SHADE_SKY_LIGHT
        const vfloat shone = ssgi_load(sky_light, size, c, x, y);
#if SHADE_SKY_LIGHT == 2
        light[c] = v_fma(shone, ssgi_load(visibility, size, 0, x, y), light[c]);
#else
        light[c] = light[c] + shone;
#endif
#endif
        vfloat sum = ssgi_load(albedo, whole, c, at_x, at_y) * light[c] * M_1_PI_F;
#if SHADE_LIGHT
        ssgi_store(v_select(v_splat(0.0f), light[c] * M_1_PI_F, there), light_over_pi, size, c, x,
                   y, 0.0f);
#endif
#if SHADE_EMISSION
        sum = sum + ssgi_load(emission, whole, c, at_x, at_y);
#endif
        ssgi_store(v_select(sky_at[c], sum, there), radiance, size, c, x, y, 0.0f);
    }
}
