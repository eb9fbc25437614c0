// SPDX-License-Identifier: MIT
// ssdo_points: directional occlusion and one bounce of light from taps in a half ball round each
// pixel.
//
// Method:  Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image
//          Space": a tap that lies behind what the camera sees there, and not behind its back,
//          hides the light of its direction; what is seen there sends light in its place.
// Departs: directions are fixed in the world and turned to the receiver's side, so that the light
//          from a direction is one of two numbers; each stands for its own solid angle. Only what
//          rises above the receiver's tangent plane hides and sends. POINTS_PAPER 0: a sender has
//          the area that the density of taps gives it, see ssdo_points/sender.clh.
// Reads:   depth    POINTS_LAYERS x [rows, columns] with margin, scene units; INFINITY for nothing
//          normal   3 POINTS_SENDERS (at least 3) x likewise, view space, unit length
//          thickness of the front layer, likewise, scene units; with POINTS_THICKNESS 0 not read
//          radiance 3 POINTS_SENDERS x likewise, W m^-2 sr^-1, of the sides that the camera sees
//          taps     [4 rows][POINTS_COUNT][5, with POINTS_SKY 11][16 columns]: a point of the unit
//                   ball, view space; the solid angle of its direction over its length, and
//                   alone; the light from there and from the opposite side, RGB W/m^2 over length
// Writes:  gathered [rows, columns] without margin: A in [0, 1]; with POINTS_SKY 3 images of the
//          sky's irradiance; with POINTS_SENDERS > 0 3 images of the bounce's, W/m^2. Where
//          nothing is: 1, and 0
// Macros:  POINTS_COUNT (1..256), POINTS_LAYERS (>= 1), POINTS_SENDERS (0..POINTS_LAYERS layers
//          that send light), POINTS_STEP (1, 2, 4 pixels from one receiver to the next),
//          POINTS_SKY, POINTS_PAPER, POINTS_THICKNESS (0, 1)
// Launch:  SSGI_LANES receivers of a row per work-item
// Cost:    POINTS_COUNT * POINTS_LAYERS depth reads per receiver, 6 more for a sender

#if !defined(POINTS_COUNT) || !defined(POINTS_LAYERS) || !defined(POINTS_SENDERS) ||               \
    !defined(POINTS_STEP) || !defined(POINTS_SKY) || !defined(POINTS_PAPER) ||                     \
    !defined(POINTS_THICKNESS)
#error "the macros POINTS_* of the header must be defined by the host"
#endif

#define POINTS_FIELDS (POINTS_SKY ? 11 : 5)

#include "ssdo_points/queue.clh"

#define POINTS_ONSET 50.0f // per radius
#define POINTS_BOUNCE (POINTS_SKY ? 4 : 1) // the first image of the bounce

// A receiver's pixel of a full-size plane.
static inline vfloat points_own(ssgi_plane plane, const int2 whole, const int image, const int x,
                                const int y, const PointsParams params)
{
#if POINTS_STEP == 1
    return ssgi_load(plane, whole, image, x + params.margin_columns, y + params.margin_rows);
#else
    const vint column = (v_iota() + x) * POINTS_STEP + params.margin_columns;
    return ssgi_gather(plane, whole, image, v_imin(column, v_splat_int(whole.x - 1)),
                       v_splat_int(y * POINTS_STEP + params.margin_rows));
#endif
}

__kernel void ssdo_points(ssgi_plane depth, ssgi_plane normal, ssgi_plane thickness,
                          ssgi_plane radiance, __global const float *restrict taps,
                          __global float *restrict gathered,
                          const int2 size, // of the result
                          const SsgiCamera camera, const PointsParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(params.columns, params.rows);
    const vfloat zero = v_splat(0.0f);
    const vfloat own = points_own(depth, whole, 0, x, y, params);
    const vmask there = v_lt(own, v_splat(INFINITY));
    if (!v_any(there)) {
        ssgi_store(v_splat(1.0f), gathered, size, 0, x, y, 0.0f);
        for (int c = 1; c < POINTS_BOUNCE + (POINTS_SENDERS > 0 ? 3 : 0); ++c) {
            ssgi_store(zero, gathered, size, c, x, y, 0.0f);
        }
        return;
    }
    PointsReceiver at;
    const vfloat z = v_select(v_splat(1.0f), own, there);
    const vfloat k = ssgi_k(camera, z);
    const float column_0 = (float)(x * POINTS_STEP + params.margin_columns) + 0.5f;
    const float row_0 = (float)(y * POINTS_STEP + params.margin_rows) + 0.5f;
    at.z = z;
    at.x = ssgi_slope_x(camera, v_to_float(v_iota() * POINTS_STEP) + column_0) * k;
    at.y = ssgi_slope_y(camera, v_splat(row_0)) * k;
    at.nx = points_own(normal, whole, 0, x, y, params);
    at.ny = points_own(normal, whole, 1, x, y, params);
    at.nz = points_own(normal, whole, 2, x, y, params);
    // Height of a point (a, b, -c) above the tangent plane: n . (a, b, -c) - own height.
    const vfloat own_height = v_fma(at.nx, at.x, v_fma(at.ny, at.y, -(at.nz * z)));
    // Near the camera the ball covers many pixels: it may be limited.
    const vfloat wanted_px = params.radius * max(fabs(camera.from_x), fabs(camera.from_y)) / k;
    const vfloat shrink = v_min(params.most_px / wanted_px, v_splat(1.0f));
    at.radius = params.radius * shrink;
    const vmask active = there & v_ge(wanted_px * shrink, v_splat((float)POINTS_STEP));
    const vfloat onset = POINTS_ONSET / at.radius;
    const vfloat floor_height =
        own_height + v_fma(z, v_splat(params.depth_bias), at.radius * params.bias);
    const vfloat thick = at.radius * params.thickness;

    __global const float *restrict tile = taps + (y & 3) * (POINTS_COUNT * POINTS_FIELDS * 16) +
                                          (x & 3);
    vfloat hidden = zero;
    vfloat known = zero;
#if POINTS_SKY
    vfloat sky[3] = {zero, zero, zero};
    vfloat sky_unknown[3] = {zero, zero, zero};
#endif
#if POINTS_SENDERS > 0
    PointsQueue queue;
    points_begin(&queue, &at);
#endif
    for (int i = 0; i < POINTS_COUNT; ++i) {
        __global const float *restrict tap = tile + i * (POINTS_FIELDS * 16);
        const vfloat tx = v_load(tap);
        const vfloat ty = v_load(tap + 16);
        const vfloat tz = v_load(tap + 32);
        const vfloat side = v_fma(tx, at.nx, v_fma(ty, at.ny, tz * at.nz));
        const vfloat reach = v_copysign(at.radius, side);
        const vfloat weight = v_abs(side) * v_load(tap + 48); // solid angle times cosine
        const vfloat qz = v_fma(-reach, tz, z); // depth of the tap
        // A tap at or behind the eye is projected from just before it, and not counted.
        const vmask visible = v_gt(qz, z * 0.001f);
        const vfloat inverse_k = 1.0f / ssgi_k(camera, v_max(qz, z * 0.001f));
        const vfloat column = ssgi_column(camera, v_fma(reach, tx, at.x) * inverse_k);
        const vfloat row = ssgi_row(camera, v_fma(reach, ty, at.y) * inverse_k);
        const vmask counts = active & visible & v_ge(column, zero) &
                             v_lt(column, v_splat((float)whole.x)) & v_ge(row, zero) &
                             v_lt(row, v_splat((float)whole.y));
        const vint column_at = v_to_int(v_clamp(column, 0.0f, (float)(whole.x - 1)));
        const vint row_at = v_to_int(v_clamp(row, 0.0f, (float)(whole.y - 1)));
        const vfloat slope_x = ssgi_slope_x(camera, v_to_float(column_at) + 0.5f);
        const vfloat slope_y = ssgi_slope_y(camera, v_to_float(row_at) + 0.5f);
        vfloat seen = ssgi_gather(depth, whole, 0, column_at, row_at);
        vfloat hides = zero;
        for (int layer = 0; layer < POINTS_LAYERS; ++layer) {
            vfloat next = v_splat(INFINITY);
            if (layer + 1 < POINTS_LAYERS) {
                next = ssgi_gather(depth, whole, layer + 1, column_at, row_at);
            }
#if POINTS_THICKNESS
            const vfloat own_thick =
                layer == 0 ? ssgi_gather(thickness, whole, 0, column_at, row_at) : thick;
#else
            const vfloat own_thick = thick;
#endif
            const vfloat back = v_min(seen + own_thick, next);
            const vmask within = counts & v_gt(qz, seen) & v_lt(qz, back);
            const vfloat front = v_select(z, seen, within);
            const vfloat front_k = ssgi_k(camera, front);
            const vfloat ax = slope_x * front_k;
            const vfloat ay = slope_y * front_k;
            const vfloat height = v_fma(at.nx, ax, v_fma(at.ny, ay, -(at.nz * front)));
            const vmask hit = within & v_gt(height, floor_height);
            // Both tests set in over a fiftieth of a radius: a rounding changes next to nothing.
            const vfloat least = v_min(qz - front, height - floor_height);
            const vfloat share = v_min(least * onset, v_splat(1.0f));
            hides = v_max(hides, v_select(zero, share, hit));
#if POINTS_SENDERS > 0
            if (layer < POINTS_SENDERS && v_any(hit)) {
                points_add(&queue, hit, column_at, row_at, layer, i);
                if (queue.count >= SSGI_LANES) {
                    points_weigh(&queue, depth, normal, thickness, radiance, tile, whole, camera,
                                 params);
                }
            }
#endif
            seen = next;
        }
        hidden = v_fma(weight, hides, hidden);
        known = known + v_select(zero, weight, counts);
#if POINTS_SKY
        const vmask turned = v_lt(side, zero);
        for (int c = 0; c < 3; ++c) {
            const vfloat light =
                v_select(v_load(tap + 80 + 16 * c), v_load(tap + 128 + 16 * c), turned) *
                v_abs(side);
            sky[c] = v_fma(light, v_select(zero, 1.0f - hides, counts), sky[c]);
            sky_unknown[c] = sky_unknown[c] + v_select(light, zero, counts);
        }
#endif
    }
    const vfloat open = v_select(
        v_splat(1.0f), v_clamp(1.0f - hidden / v_max(known, v_splat(1e-30f)), 0.0f, 1.0f), there);
    ssgi_store(open, gathered, size, 0, x, y, 0.0f);
#if POINTS_SKY
    for (int c = 0; c < 3; ++c) {
        // What is not known is as open as the rest.
        const vfloat light = v_fma(sky_unknown[c], open, sky[c]);
        ssgi_store(v_select(zero, light, there), gathered, size, 1 + c, x, y, 0.0f);
    }
#endif
#if POINTS_SENDERS > 0
    if (queue.count > 0) {
        points_weigh(&queue, depth, normal, thickness, radiance, tile, whole, camera, params);
    }
    for (int c = 0; c < 3; ++c) {
        const vfloat bounce = points_kept(queue.light[c]);
        ssgi_store(v_select(zero, bounce, there), gathered, size, POINTS_BOUNCE + c, x, y, 0.0f);
    }
#endif
}
