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
//          In a row, receivers are taken by column modulo 4, so that lanes have the same taps and
//          read places next to one another.
// Reads:   depth, normal  image 0 and the first three, with margin: receivers, view space
//          thickness of the front layer, likewise, scene units; with POINTS_THICKNESS 0 not read
//          near     POINTS_LAYERS x depth, with margin, of sorted rows, see slices/slices_sorted.cl
//          senders  POINTS_SENDERS layers of records, see lit_layers/records.clh, with margin, of
//                   the sides that the camera sees
//          taps     [4 rows][4 columns][POINTS_COUNT][5, with POINTS_SKY 11]: a point of the unit
//                   ball, view space; the solid angle of its direction over its length, and
//                   alone; the light from there and from the opposite side, RGB W/m^2 over length
// Writes:  gathered [rows, columns] without margin: A in [0, 1]; with POINTS_SKY 3 images of the
//          sky's irradiance; with POINTS_SENDERS > 0 3 images of the bounce's, W/m^2. Where
//          nothing is: 1, and 0
//          kept     with POINTS_KEPT ceil(POINTS_COUNT / 32) images of int as a plane, a bit for
//                   each tap that lies in the image, and as many of those that hide
// Macros:  POINTS_COUNT (1..256), POINTS_LAYERS (>= 1), POINTS_SENDERS (0..POINTS_LAYERS layers
//          that send light), POINTS_STEP (1, 2, 4 pixels from one receiver to the next),
//          POINTS_SKY, POINTS_PAPER, POINTS_THICKNESS, POINTS_KEPT (0, 1)
// Launch:  one lane: a work-item a receiver; else 16 for pieces of 4 SSGI_LANES columns, which make
//          strips of 256 columns and one or more rows, strip by strip
// Cost:    POINTS_COUNT depth reads per receiver; one more for each deeper layer where a tap lies
//          behind what is before it, and a record for a sender. With 16 lanes a tap is some 60
//          instructions, one of which is the gather, and a division; a sender is 60 more.
// Tried:   the next tap's gather before this one's tests: a quarter longer; all taps first, then
//          those behind something: a fifth longer without a bounce, as long with one, a tenth
//          shorter with a second layer. Rows as they are, neighbours in the lanes: half as long
//          again with a bounce.

#if !defined(POINTS_COUNT) || !defined(POINTS_LAYERS) || !defined(POINTS_SENDERS) ||               \
    !defined(POINTS_STEP) || !defined(POINTS_SKY) || !defined(POINTS_PAPER) ||                     \
    !defined(POINTS_THICKNESS) || !defined(POINTS_KEPT)
#error "the macros POINTS_* of the header must be defined by the host"
#endif

#define POINTS_FIELDS (POINTS_SKY ? 11 : 5)
#define POINTS_WORDS ((POINTS_COUNT + 31) / 32)

#include "ssdo_points/queue.clh"

#define POINTS_ONSET 50.0f // per radius
#define POINTS_BOUNCE (POINTS_SKY ? 4 : 1) // the first image of the bounce

#define POINTS_STRIP 256 // columns
#define POINTS_IN_STRIP (POINTS_STRIP / POINTS_PIECE)

// A plane's pixels of every fourth receiver from column x on.
static inline vfloat points_own(ssgi_plane plane, const int2 whole, const int image, const int x,
                                const int y, const PointsParams params)
{
#if POINTS_STEP == 1
    return ssgi_load_fourths(plane, whole, image, x + params.margin_columns,
                             y + params.margin_rows);
#else
    const vint column = (v_iota() * POINTS_PHASES + x) * POINTS_STEP + params.margin_columns;
    return ssgi_gather(plane, whole, image, v_imin(column, v_splat_int(whole.x - 1)),
                       v_splat_int(y * POINTS_STEP + params.margin_rows));
#endif
}

// Write a row of results, given by phase.
static inline void points_store(const vfloat *by_phase, __global float *restrict plane,
                                const int2 size, const int image, const int x, const int y)
{
#if SSGI_LANES == 1
    ssgi_store(by_phase[0], plane, size, image, x, y, 0.0f);
#else
    int4 row[SSGI_LANES];
    raster_keep_quads((RasterQuad){v_bits(by_phase[0]), v_bits(by_phase[1]), v_bits(by_phase[2]),
                                   v_bits(by_phase[3])}, row);
    for (int i = 0; i < POINTS_PIECE && x + i < size.x; i += SSGI_LANES) {
        ssgi_store(*(const vfloat_anywhere *)((const float *)row + i), plane, size, image, x + i,
                   y, 0.0f);
    }
#endif
}

__kernel void ssdo_points(ssgi_plane depth, ssgi_plane normal, ssgi_plane thickness,
                          __global const float *restrict near,
                          __global const int *restrict senders,
                          __global const float *restrict taps, __global float *restrict gathered,
                          __global float *restrict kept, // bits of ints
                          const int2 size, // of the result
                          const SsgiCamera camera, const PointsParams params)
{
#if SSGI_LANES == 1
    const int x = (int)get_global_id(0);
    const int y = (int)get_global_id(1);
#else
    // 16 work-items cover 256 columns of one or more rows.
    const int rows = 16 / POINTS_IN_STRIP;
    const int bands = (size.y + rows - 1) / rows;
    const int strip = (int)get_global_id(1) / bands;
    const int item = (int)get_global_id(0);
    const int x = strip * POINTS_STRIP + item % POINTS_IN_STRIP * POINTS_PIECE;
    const int y = ((int)get_global_id(1) - strip * bands) * rows + item / POINTS_IN_STRIP;
#endif
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(params.columns, params.rows);
    const int2 sorted = (int2)(4 * params.stride, params.rows);
    const vfloat zero = v_splat(0.0f);
    vfloat open[POINTS_PHASES];
#if POINTS_SKY
    vfloat sky[3][POINTS_PHASES];
#endif
#if POINTS_KEPT
    vint known_taps[POINTS_WORDS][POINTS_PHASES], hiding_taps[POINTS_WORDS][POINTS_PHASES];
#endif
#if POINTS_SENDERS > 0
    PointsQueue queue;
    points_begin(&queue);
#endif
    const float row_0 = (float)(y * POINTS_STEP + params.margin_rows) + 0.5f;
    for (int phase = 0; phase < POINTS_PHASES; ++phase) {
        const vfloat own = points_own(depth, whole, 0, x + phase, y, params);
        const vint own_column = v_iota() * POINTS_PHASES + (x + phase);
        const vmask there = v_lt(own, v_splat(INFINITY)) & v_ilt(own_column, v_splat_int(size.x));
        open[phase] = v_splat(1.0f);
#if POINTS_SKY
        sky[0][phase] = sky[1][phase] = sky[2][phase] = zero;
#endif
#if POINTS_KEPT
        for (int word = 0; word < POINTS_WORDS; ++word) {
            known_taps[word][phase] = hiding_taps[word][phase] = v_splat_int(0);
        }
#endif
        if (!v_any(there)) {
            continue;
        }
        PointsReceiver at;
        const vfloat z = v_select(v_splat(1.0f), own, there);
        const vfloat k = ssgi_k(camera, z);
        const float column_0 = (float)((x + phase) * POINTS_STEP + params.margin_columns) + 0.5f;
        at.z = z;
        at.x = ssgi_slope_x(camera, v_to_float(v_iota() * (POINTS_PHASES * POINTS_STEP)) +
                                        column_0) * k;
        at.y = ssgi_slope_y(camera, v_splat(row_0)) * k;
        at.nx = points_own(normal, whole, 0, x + phase, y, params);
        at.ny = points_own(normal, whole, 1, x + phase, y, params);
        at.nz = points_own(normal, whole, 2, x + phase, y, params);
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
        __global const float *restrict tile =
            taps + ((y & 3) * 4 + ((x + phase) & 3)) * (POINTS_COUNT * POINTS_FIELDS);
        vfloat hidden = zero;
        vfloat known = zero;
#if POINTS_SKY
        vfloat sky_unknown[3] = {zero, zero, zero};
#endif
#if POINTS_SENDERS > 0
        bool received = false;
#endif
        for (int i = 0; i < POINTS_COUNT; ++i) {
            __global const float *restrict tap = tile + i * POINTS_FIELDS;
            const float tx = tap[0], ty = tap[1], tz = tap[2];
            const vfloat side = v_fma(v_splat(tx), at.nx, v_fma(v_splat(ty), at.ny, tz * at.nz));
            const vfloat reach = v_copysign(at.radius, side);
            const vfloat weight = v_abs(side) * tap[3]; // solid angle times cosine
            const vfloat qz = v_fma(-reach, v_splat(tz), z); // depth of the tap
            // A tap at or behind the eye is projected from just before it, and not counted.
            const vmask visible = v_gt(qz, z * 0.001f);
            const vfloat inverse_k = 1.0f / ssgi_k(camera, v_max(qz, z * 0.001f));
            const vfloat column = ssgi_column(camera, v_fma(reach, v_splat(tx), at.x) * inverse_k);
            const vfloat row = ssgi_row(camera, v_fma(reach, v_splat(ty), at.y) * inverse_k);
            const vmask counts = active & visible & v_ge(column, zero) &
                                 v_lt(column, v_splat((float)whole.x)) & v_ge(row, zero) &
                                 v_lt(row, v_splat((float)whole.y));
            const vint column_at = v_to_int(v_clamp(column, 0.0f, (float)(whole.x - 1)));
            const vint row_at = v_to_int(v_clamp(row, 0.0f, (float)(whole.y - 1)));
            const vint near_at = row_at * ssgi_pitch(sorted) + (column_at & 3) * params.stride +
                                 (column_at >> 2);
            vfloat seen = v_gather(near + ssgi_index(sorted, 0, 0, 0), near_at);
            vfloat hides = zero;
            vmask behind = counts & v_gt(qz, seen);
            // Most taps lie before all that is seen there, and none within two layers.
            for (int layer = 0; layer < POINTS_LAYERS && v_any(behind); ++layer) {
                vfloat next = v_splat(INFINITY);
                if (layer + 1 < POINTS_LAYERS) {
                    next = v_gather(near + ssgi_index(sorted, layer + 1, 0, 0), near_at);
                }
#if POINTS_THICKNESS
                const vfloat own_thick =
                    layer == 0 ? ssgi_gather(thickness, whole, 0, column_at, row_at) : thick;
#else
                const vfloat own_thick = thick;
#endif
                const vfloat back = v_min(seen + own_thick, next);
                const vmask within = behind & v_lt(qz, back);
                const vfloat front = v_select(z, seen, within);
                const vfloat front_k = ssgi_k(camera, front);
                const vfloat ax = ssgi_slope_x(camera, v_to_float(column_at) + 0.5f) * front_k;
                const vfloat ay = ssgi_slope_y(camera, v_to_float(row_at) + 0.5f) * front_k;
                const vfloat height = v_fma(at.nx, ax, v_fma(at.ny, ay, -(at.nz * front)));
                const vmask hit = within & v_gt(height, floor_height);
                // Both set in over a fiftieth of a radius: a rounding changes next to nothing.
                const vfloat least = v_min(qz - front, height - floor_height);
                const vfloat share = v_min(least * onset, v_splat(1.0f));
                hides = v_max(hides, v_select(zero, share, hit));
#if POINTS_SENDERS > 0
                if (layer < POINTS_SENDERS && v_any(hit)) {
                    if (!received) {
                        points_receive(&queue, &at, phase);
                        received = true;
                    }
                    points_add(&queue, hit, column_at, row_at, layer, front, back, tap[4], phase,
                               senders, whole);
                    if (queue.count >= SSGI_LANES) {
                        points_weigh(&queue, senders, whole, camera, params);
                    }
                }
#endif
                behind = behind & v_gt(qz, next);
                seen = next;
            }
            hidden = v_fma(weight, hides, hidden);
            known = known + v_select(zero, weight, counts);
#if POINTS_KEPT
            const vint bit = v_splat_int(1 << (i & 31));
            known_taps[i / 32][phase] |= counts & bit;
            hiding_taps[i / 32][phase] |= v_gt(hides, zero) & bit;
#endif
#if POINTS_SKY
            const vmask turned = v_lt(side, zero);
            for (int c = 0; c < 3; ++c) {
                const vfloat light =
                    v_select(v_splat(tap[5 + c]), v_splat(tap[8 + c]), turned) * v_abs(side);
                sky[c][phase] =
                    v_fma(light, v_select(zero, 1.0f - hides, counts), sky[c][phase]);
                sky_unknown[c] = sky_unknown[c] + v_select(light, zero, counts);
            }
#endif
        }
        const vfloat share =
            v_clamp(1.0f - hidden / v_max(known, v_splat(1e-30f)), 0.0f, 1.0f);
        open[phase] = v_select(v_splat(1.0f), share, there);
#if POINTS_SKY
        for (int c = 0; c < 3; ++c) {
            // What is not known is as open as the rest.
            sky[c][phase] = v_select(
                zero, v_fma(sky_unknown[c], open[phase], sky[c][phase]), there);
        }
#endif
    }
    points_store(open, gathered, size, 0, x, y);
#if POINTS_KEPT
    for (int word = 0; word < POINTS_WORDS; ++word) {
        vfloat known_bits[POINTS_PHASES], hiding_bits[POINTS_PHASES];
        for (int phase = 0; phase < POINTS_PHASES; ++phase) {
            known_bits[phase] = v_from_bits(known_taps[word][phase]);
            hiding_bits[phase] = v_from_bits(hiding_taps[word][phase]);
        }
        points_store(known_bits, kept, size, word, x, y);
        points_store(hiding_bits, kept, size, POINTS_WORDS + word, x, y);
    }
#endif
#if POINTS_SKY
    for (int c = 0; c < 3; ++c) {
        points_store(sky[c], gathered, size, 1 + c, x, y);
    }
#endif
#if POINTS_SENDERS > 0
    if (queue.count > 0) {
        points_weigh(&queue, senders, whole, camera, params);
    }
    for (int i = 0; i < POINTS_PIECE && x + i < size.x; i += SSGI_LANES) {
        const RasterQuad bounce = points_kept((const int4 *)queue.light, v_iota() + i);
        ssgi_store(v_from_bits(bounce.x), gathered, size, POINTS_BOUNCE, x + i, y, 0.0f);
        ssgi_store(v_from_bits(bounce.y), gathered, size, POINTS_BOUNCE + 1, x + i, y, 0.0f);
        ssgi_store(v_from_bits(bounce.z), gathered, size, POINTS_BOUNCE + 2, x + i, y, 0.0f);
    }
#endif
}
