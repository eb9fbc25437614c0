// SPDX-License-Identifier: MIT
// light_shadows: add the direct irradiance of one light with shadows of the visible surfaces.
//
// Method:  taps along the image of the way to the light; a tap is in the shadow where it lies
//          behind a surface, and not behind its back, that rises above the receiver's tangent
//          plane. Ritschel, Grosch and Seidel 2009 take such taps for point lights. The way leads
//          to another point of the light's disc in each pixel of a 4 x 4 tile.
// Departs: taps are evenly spread in the image, not on the way, and the way's depth is that where
//          it passes the tap's pixel centre, so that a plane never shadows itself.
// Reads:   depth   LIGHT_LAYERS x [rows, columns] with margin, scene units; INFINITY for nothing
//          normal  images 3 light.layer + c, likewise, view space, unit length
//          thickness  of the front layer, likewise, scene units, -1: not known; not read with
//                     LIGHT_THICKNESS 0
//          tile    [4 rows][3][16 columns]: a point of the unit disc; where in its part of the
//                  way a tap lies, [0, 1)
// Writes:  irradiance  3 x [rows, columns] W/m^2 without margin, added to (SHADE_ADD 1) or set
// Macros:  SHADE_KIND (0 spot, 1 point, 2 directional), SHADE_ADD (0, 1), LIGHT_TAPS (1..256),
//          LIGHT_LAYERS (>= 1), LIGHT_THICKNESS (0, 1), SHADE_SMOOTH 0
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    LIGHT_TAPS * LIGHT_LAYERS scattered reads per lit pixel

#include "direct/light.clh"

#if !defined(SHADE_KIND) || !defined(SHADE_ADD) || !defined(LIGHT_TAPS) ||                         \
    !defined(LIGHT_LAYERS) || !defined(LIGHT_THICKNESS)
#error "SHADE_KIND, SHADE_ADD, LIGHT_TAPS, _LAYERS and _THICKNESS must be defined by the host"
#endif

#define LIGHT_ONSET 50.0f      // per radius
#define LIGHT_NEAREST_TAP 1.3f // px: at any angle it lies in another pixel than the receiver

// Part of the way's image up to the border of the arrays, from c with a change of d.
static inline vfloat light_inside(const vfloat c, const vfloat d, const int size)
{
    const vfloat border = v_select(v_splat(0.0f), v_splat((float)size), v_gt(d, v_splat(0.0f)));
    const vfloat safe = v_copysign(v_max(v_abs(d), v_splat(1e-6f)), d);
    return (border - c) / safe;
}

__kernel void light_shadows(ssgi_plane depth, ssgi_plane normal,
#if LIGHT_THICKNESS
                            ssgi_plane thickness,
#endif
                            __global const float *restrict tile,
                            __global float *restrict irradiance, const int2 size,
                            const SsgiCamera camera, const LightParams light,
                            const LightShadowParams params)
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
    const vfloat one = v_splat(1.0f);
    const vfloat own_column = v_to_float(v_iota() + at_x) + 0.5f;
    const vfloat own_row = v_splat((float)at_y + 0.5f);
    const LightReceiver receiver = light_receiver(depth, normal, whole, at_x, at_y, camera, light);
    const vfloat px = receiver.x, py = receiver.y, z = -receiver.z;
    const vfloat nx = receiver.nx, ny = receiver.ny, nz = receiver.nz;
    const LightAt punctual_light = light_at(light, &receiver, camera);
    const vmask lit = receiver.there & v_gt(punctual_light.strength, zero);
    vfloat shadow = zero;
    if (v_any(lit)) {
        // To a point of the light's disc, at right angles to the way to its middle.
        __global const float *restrict pattern = tile + (y & 3) * 48 + (x & 3);
        const vfloat u = v_load(pattern) * params.extent, v = v_load(pattern + 16) * params.extent;
        const vfloat sign = v_copysign(one, punctual_light.z);
        const vfloat a = -1.0f / (sign + punctual_light.z); // basis: Duff et al. 2017
        const vfloat b = punctual_light.x * punctual_light.y * a;
        const vfloat reach = v_min(v_splat(params.radius), punctual_light.distance);
        const vfloat far = SHADE_KIND == 2 ? reach : reach / punctual_light.distance;
        const vfloat length =
            v_max(SHADE_KIND == 2 ? one : punctual_light.distance, v_splat(1e-18f));
        const vfloat ux =
            v_fma(u, v_fma(sign * punctual_light.x, punctual_light.x * a, one), v * b);
        const vfloat uy =
            v_fma(u, sign * b, v * v_fma(punctual_light.y, punctual_light.y * a, sign));
        const vfloat uz = -v_fma(u, sign * punctual_light.x, v * punctual_light.y);
        const vfloat wx = v_fma(punctual_light.x, length, ux) * far;
        const vfloat wy = v_fma(punctual_light.y, length, uy) * far;
        const vfloat wz = v_fma(punctual_light.z, length, uz) * far;
        // A way that comes to the eye ends before it.
        const vfloat ahead = z * 0.99f;
        const vfloat kept = v_min(one, ahead / v_max(wz, ahead));
        const vfloat end_z = v_fma(-wz, kept, z);
        const vfloat end_k = 1.0f / ssgi_k(camera, end_z);
        const vfloat dx = ssgi_column(camera, v_fma(wx, kept, px) * end_k) - own_column;
        const vfloat dy = ssgi_row(camera, v_fma(wy, kept, py) * end_k) - own_row;
        const vfloat square = v_max(v_fma(dx, dx, dy * dy), v_splat(1e-12f));
        const vfloat nearest = LIGHT_NEAREST_TAP * v_rsqrt(square);
        const vfloat most = v_min(
            one, v_min(light_inside(own_column, dx, whole.x), light_inside(own_row, dy, whole.y)));
        const vfloat span = (most - nearest) * (1.0f / (float)LIGHT_TAPS);
        const vmask marched = lit & v_gt(span, zero);
        // linear runs straight along the way's image.
        const bool perspective = camera.perspective != 0.0f;
        const vfloat start = perspective ? 1.0f / z : z;
        const vfloat change = (perspective ? 1.0f / end_z : end_z) - start;
        const vfloat inverse_square = 1.0f / square;
        const vfloat height = v_fma(nx, px, v_fma(ny, py, -(nz * z)));
        const float bias = params.radius * params.bias;
        const vfloat floor_height = height + v_fma(z, v_splat(params.depth_bias), v_splat(bias));
        const float onset = LIGHT_ONSET / params.radius;
        const vfloat jitter = v_load(pattern + 32);
        for (int i = 0; i < LIGHT_TAPS; ++i) {
            const vfloat part = v_fma(jitter + (float)i, span, nearest);
            const vint column = v_iclamp(v_to_int(v_fma(part, dx, own_column)), 0, whole.x - 1);
            const vint row = v_iclamp(v_to_int(v_fma(part, dy, own_row)), 0, whole.y - 1);
            const vfloat column_at = v_to_float(column) + 0.5f;
            const vfloat row_at = v_to_float(row) + 0.5f;
            const vfloat passed =
                v_fma(column_at - own_column, dx, (row_at - own_row) * dy) * inverse_square;
            const vfloat linear = v_fma(v_clamp(passed, 0.0f, 1.0f), change, start);
            const vfloat qz = perspective ? 1.0f / linear : linear;
            const vfloat slope_x = ssgi_slope_x(camera, column_at);
            const vfloat slope_y = ssgi_slope_y(camera, row_at);
            vfloat seen = ssgi_gather(depth, whole, 0, column, row);
            for (int layer = 0; layer < LIGHT_LAYERS; ++layer) {
                vfloat next = v_splat(INFINITY);
                if (layer + 1 < LIGHT_LAYERS) {
                    next = ssgi_gather(depth, whole, layer + 1, column, row);
                }
                vfloat thick = v_splat(params.thickness);
#if LIGHT_THICKNESS
                if (layer == 0) {
                    const vfloat given = ssgi_gather(thickness, whole, 0, column, row);
                    thick = v_select(given, thick, v_lt(given, v_splat(0.0f)));
                }
#endif
                const vfloat back = v_min(seen + thick, next);
                const vmask within = v_gt(qz, seen) & v_lt(qz, back);
                const vfloat front = v_select(z, seen, within);
                const vfloat front_k = ssgi_k(camera, front);
                const vfloat above =
                    v_fma(nx * slope_x, front_k, v_fma(ny * slope_y, front_k, -(nz * front))) -
                    floor_height;
                // Both tests set in over a fiftieth of a radius: a rounding changes little.
                const vfloat share = v_min(v_min(qz - front, above) * onset, one);
                shadow = v_max(shadow, v_select(zero, share, within & marched));
                seen = next;
            }
        }
    }
    light_store(light_bounded(punctual_light.strength, lit) * (1.0f - shadow), light, irradiance,
                size, x, y);
}
