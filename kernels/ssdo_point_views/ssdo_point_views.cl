// SPDX-License-Identifier: MIT
// ssdo_point_views: what another camera sees round each pixel, after ssdo_points.
//
// Method:  Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image
//          Space", add cameras that see what the first one misses.
// Departs: taps are those of ssdo_points, and lie behind a surface by the same rule. Each hides
//          once: where no camera before this one found that it does. What no camera before this
//          one had in its image counts from here on. A sender has the area that the density of all
//          taps gives it, hidden or not, and is dark where a camera before this one showed it, see
//          ssdo_point_seen.cl: so each surface sends once.
// Reads:   depth, normal  image 0 and the first three, with margin: receivers, view space
//          taps     [4 rows][POINT_VIEWS_COUNT][5, with POINT_VIEWS_SKY 11][16 columns], the fields
//                   of ssdo_points
//          seen     POINT_VIEWS_LAYERS x depth of the other camera, with its margin, scene units
//          thickness of its front layer, likewise; with POINT_VIEWS_THICKNESS 0 not read
//          senders  POINT_VIEWS_SENDERS layers of its records, see lit_layers/records.clh
// Writes:  gathered as ssdo_points wrote it: A and the sky's light anew, the bounce's added to
//          kept     ceil(POINT_VIEWS_COUNT / 32) images of int as a plane, a bit for each tap that
//                   a camera had in its image, and as many of those that hide
// Macros:  POINT_VIEWS_COUNT (1..256), POINT_VIEWS_LAYERS (>= 1), POINT_VIEWS_SENDERS
//          (0..POINT_VIEWS_LAYERS), POINT_VIEWS_STEP (1, 2, 4 pixels from one receiver to the
//          next), POINT_VIEWS_SKY, POINT_VIEWS_PAPER, POINT_VIEWS_THICKNESS (0, 1)
// Launch:  SSGI_LANES receivers of a row per work-item
// Cost:    POINT_VIEWS_COUNT scattered reads per receiver; one more for each deeper layer where a
//          tap lies behind what is before it, and a record for a sender

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "lit_layers/records.clh"
#include "raster/quads.clh"
#include "ssdo_points/sender.clh"

#if !defined(POINT_VIEWS_COUNT) || !defined(POINT_VIEWS_LAYERS) ||                                 \
    !defined(POINT_VIEWS_SENDERS) || !defined(POINT_VIEWS_STEP) || !defined(POINT_VIEWS_SKY) ||    \
    !defined(POINT_VIEWS_PAPER) || !defined(POINT_VIEWS_THICKNESS)
#error "the macros POINT_VIEWS_* of the header must be defined by the host"
#endif

// The struct PointViewsParams is generated from ssgi_cl.techniques.ssdo_point_views.

#define POINT_VIEWS_FIELDS (POINT_VIEWS_SKY ? 11 : 5)
#define POINT_VIEWS_WORDS ((POINT_VIEWS_COUNT + 31) / 32)
#define POINT_VIEWS_ONSET 50.0f // per radius, as in ssdo_points
#define POINT_VIEWS_BOUNCE (POINT_VIEWS_SKY ? 4 : 1) // the first image of the bounce

// A plane's pixels of the receivers from column x on.
static inline vfloat point_views_own(ssgi_plane plane, const int2 whole, const int image,
                                     const int x, const int y, const PointsParams params)
{
#if POINT_VIEWS_STEP == 1
    return ssgi_load(plane, whole, image, x + params.margin_columns, y + params.margin_rows);
#else
    const vint column = (v_iota() + x) * POINT_VIEWS_STEP + params.margin_columns;
    return ssgi_gather(plane, whole, image, v_imin(column, v_splat_int(whole.x - 1)),
                       v_splat_int(y * POINT_VIEWS_STEP + params.margin_rows));
#endif
}

__kernel void ssdo_point_views(ssgi_plane depth, ssgi_plane normal,
                               __global const float *restrict taps, ssgi_plane seen,
                               ssgi_plane thickness, __global const int *restrict senders,
                               __global float *restrict gathered, __global int *restrict kept,
                               const int2 size, // of the result
                               const SsgiCamera camera, const SsgiCamera other,
                               const PointsParams params, const PointViewsParams view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(params.columns, params.rows);
    const int2 others = (int2)(view.columns, view.rows);
    const vfloat zero = v_splat(0.0f);
    const vfloat own = point_views_own(depth, whole, 0, x, y, params);
    const vmask there = v_lt(own, v_splat(INFINITY)) & v_ilt(v_iota() + x, v_splat_int(size.x));
    const vfloat z = v_select(v_splat(1.0f), own, there);
    const vfloat k = ssgi_k(camera, z);
    const vfloat wanted_px = params.radius * max(fabs(camera.from_x), fabs(camera.from_y)) / k;
    const vfloat shrink = v_min(params.most_px / wanted_px, v_splat(1.0f));
    const vmask active = there & v_ge(wanted_px * shrink, v_splat((float)POINT_VIEWS_STEP));
    if (!v_any(active)) {
        return;
    }
    const vfloat column_own =
        v_to_float((v_iota() + x) * POINT_VIEWS_STEP + params.margin_columns) + 0.5f;
    const float row_own = (float)(y * POINT_VIEWS_STEP + params.margin_rows) + 0.5f;
    const vfloat px = ssgi_slope_x(camera, column_own) * k;
    const vfloat py = ssgi_slope_y(camera, v_splat(row_own)) * k;
    const vfloat nx = point_views_own(normal, whole, 0, x, y, params);
    const vfloat ny = point_views_own(normal, whole, 1, x, y, params);
    const vfloat nz = point_views_own(normal, whole, 2, x, y, params);
    // The receiver as the other camera sees it.
    PointsReceiver at;
    at.radius = params.radius * shrink;
    at.x = v_fma(px, v_splat(view.xx), v_fma(py, v_splat(view.xy),
                                             v_fma(z, v_splat(-view.xz), v_splat(view.shift_x))));
    at.y = v_fma(px, v_splat(view.yx), v_fma(py, v_splat(view.yy),
                                             v_fma(z, v_splat(-view.yz), v_splat(view.shift_y))));
    at.z = -v_fma(px, v_splat(view.zx), v_fma(py, v_splat(view.zy),
                                              v_fma(z, v_splat(-view.zz), v_splat(view.shift_z))));
    at.nx = v_fma(nx, v_splat(view.xx), v_fma(ny, v_splat(view.xy), nz * view.xz));
    at.ny = v_fma(nx, v_splat(view.yx), v_fma(ny, v_splat(view.yy), nz * view.yz));
    at.nz = v_fma(nx, v_splat(view.zx), v_fma(ny, v_splat(view.zy), nz * view.zz));
    const vfloat ahead = v_max(at.z, v_splat(view.nearest));
    const vfloat onset = POINT_VIEWS_ONSET / at.radius;
    const vfloat floor_height = v_fma(at.nx, at.x, v_fma(at.ny, at.y, -(at.nz * at.z))) +
                                v_fma(z, v_splat(params.depth_bias), at.radius * params.bias);
    const vfloat thick = at.radius * params.thickness;

    __global const float *restrict tile =
        taps + (y & 3) * (POINT_VIEWS_COUNT * POINT_VIEWS_FIELDS * 16) + (x & 3);
    vmask changes = v_splat_int(0);
    vfloat hidden = zero, known_before = zero, known_more = zero;
#if POINT_VIEWS_SENDERS > 0
    vfloat light[3] = {zero, zero, zero};
#endif
#if POINT_VIEWS_SKY
    vfloat unknown_before[3] = {zero, zero, zero};
    vfloat unknown[3] = {zero, zero, zero};
    vfloat sky_more[3] = {zero, zero, zero};
#endif
    for (int word = 0; word < POINT_VIEWS_WORDS; ++word) {
        __global int *restrict known_at = kept + ssgi_index(size, word, x, y);
        __global int *restrict hides_at =
            kept + ssgi_index(size, POINT_VIEWS_WORDS + word, x, y);
        const vint known = v_iload(known_at);
        const vint covered = v_iload(hides_at);
        vint knows = known, covers = covered;
        for (int i = 32 * word; i < min(32 * word + 32, POINT_VIEWS_COUNT); ++i) {
            __global const float *restrict tap = tile + i * (POINT_VIEWS_FIELDS * 16);
            const vint bit = v_splat_int(1 << (i & 31));
            const vfloat tx = v_load(tap), ty = v_load(tap + 16), tz = v_load(tap + 32);
            const vfloat side = v_fma(tx, nx, v_fma(ty, ny, tz * nz));
            const vfloat reach = v_copysign(at.radius, side);
            const vfloat weight = v_abs(side) * v_load(tap + 48); // solid angle times cosine
            // The tap's way from the receiver, and its place.
            const vfloat dx =
                v_fma(tx, v_splat(view.xx), v_fma(ty, v_splat(view.xy), tz * view.xz));
            const vfloat dy =
                v_fma(tx, v_splat(view.yx), v_fma(ty, v_splat(view.yy), tz * view.yz));
            const vfloat dz =
                v_fma(tx, v_splat(view.zx), v_fma(ty, v_splat(view.zy), tz * view.zz));
            const vfloat qz = v_fma(-reach, dz, at.z);
            const vmask visible = v_gt(qz, v_splat(view.nearest));
            const vfloat inverse_k = 1.0f / ssgi_k(other, v_max(qz, v_splat(view.nearest)));
            const vfloat column = ssgi_column(other, v_fma(reach, dx, at.x) * inverse_k);
            const vfloat row = ssgi_row(other, v_fma(reach, dy, at.y) * inverse_k);
            const vmask counts = active & visible & v_ge(column, zero) &
                                 v_lt(column, v_splat((float)others.x)) & v_ge(row, zero) &
                                 v_lt(row, v_splat((float)others.y));
            vfloat hides = zero;
            if (v_any(counts)) {
                const vint column_at = v_to_int(v_clamp(column, 0.0f, (float)(others.x - 1)));
                const vint row_at = v_to_int(v_clamp(row, 0.0f, (float)(others.y - 1)));
                vfloat surface = ssgi_gather(seen, others, 0, column_at, row_at);
                vmask behind = counts & v_gt(qz, surface);
#if POINT_VIEWS_SENDERS > 0
                vmask sends = v_splat_int(0);
                vfloat sender_depth = ahead, sender_back = ahead;
                vint sender_layer = v_splat_int(0);
#endif
                for (int layer = 0; layer < POINT_VIEWS_LAYERS && v_any(behind); ++layer) {
                    vfloat next = v_splat(INFINITY);
                    if (layer + 1 < POINT_VIEWS_LAYERS) {
                        next = ssgi_gather(seen, others, layer + 1, column_at, row_at);
                    }
#if POINT_VIEWS_THICKNESS
                    const vfloat own_thick =
                        layer == 0 ? ssgi_gather(thickness, others, 0, column_at, row_at) : thick;
#else
                    const vfloat own_thick = thick;
#endif
                    const vfloat back = v_min(surface + own_thick, next);
                    const vmask within = behind & v_lt(qz, back);
                    const vfloat front = v_select(ahead, surface, within);
                    const vfloat front_k = ssgi_k(other, front);
                    const vfloat ax = ssgi_slope_x(other, v_to_float(column_at) + 0.5f) * front_k;
                    const vfloat ay = ssgi_slope_y(other, v_to_float(row_at) + 0.5f) * front_k;
                    const vfloat height =
                        v_fma(at.nx, ax, v_fma(at.ny, ay, -(at.nz * front)));
                    const vmask hit = within & v_gt(height, floor_height);
                    const vfloat least = v_min(qz - front, height - floor_height);
                    const vfloat share = v_min(least * onset, v_splat(1.0f));
                    hides = v_select(hides, share, hit); // a tap is within one layer at most
#if POINT_VIEWS_SENDERS > 0
                    if (layer < POINT_VIEWS_SENDERS) {
                        sends = sends | hit;
                        sender_depth = v_select(sender_depth, front, hit);
                        sender_back = v_select(sender_back, back, hit);
                        sender_layer = v_iselect(sender_layer, v_splat_int(layer), hit);
                    }
#endif
                    behind = behind & v_gt(qz, next);
                    surface = next;
                }
#if POINT_VIEWS_SENDERS > 0
                if (v_any(sends)) {
                    const RasterQuad sent = raster_quad(
                        senders, ssgi_record(others, sender_layer, column_at, row_at), false);
                    const vmask lit =
                        sends & v_ine(sent.x | sent.y | sent.z, v_splat_int(0));
                    if (v_any(lit)) { // most is dark: a camera before this one shows it
                        vfloat facing[3];
                        ssgi_unpacked_normal(sent.w, facing);
                        const PointsSender sender = points_sender(
                            &at, ssgi_slope_x(other, v_to_float(column_at) + 0.5f),
                            ssgi_slope_y(other, v_to_float(row_at) + 0.5f), sender_depth,
                            facing[0], facing[1], facing[2], other);
#if POINT_VIEWS_PAPER
                        const vfloat form = points_form_paper(&sender, &at, params);
#else
                        const vfloat form =
                            points_form(&sender, &at, sender_back, v_load(tap + 64));
#endif
                        const vmask arrives = lit & sender.faces;
                        const vint radiance[3] = {sent.x, sent.y, sent.z};
                        for (int c = 0; c < 3; ++c) {
                            light[c] = v_fma(v_select(zero, form, arrives),
                                             v_from_bits(v_iselect(v_splat_int(0), radiance[c],
                                                                   arrives)),
                                             light[c]);
                        }
                    }
                }
#endif
            }
            const vmask was_known = v_ine(known & bit, v_splat_int(0));
            const vmask was_open = v_ieq(covered & bit, v_splat_int(0));
            const vmask adds = counts & ~was_known;
            const vmask covers_it = v_gt(hides, zero) & was_open;
            const vfloat share = v_select(zero, hides, covers_it);
            knows = knows | (counts & bit);
            covers = covers | (covers_it & bit);
            changes = changes | adds | covers_it;
            hidden = v_fma(weight, share, hidden);
            known_before = known_before + v_select(zero, weight, was_known);
            known_more = known_more + v_select(zero, weight, adds);
#if POINT_VIEWS_SKY
            const vmask turned = v_lt(side, zero);
            for (int c = 0; c < 3; ++c) {
                const vfloat there_light = v_select(v_load(tap + 16 * (5 + c)),
                                                    v_load(tap + 16 * (8 + c)), turned) *
                                           v_abs(side);
                unknown_before[c] = unknown_before[c] + v_select(there_light, zero, was_known);
                unknown[c] = unknown[c] + v_select(there_light, zero, was_known | counts);
                sky_more[c] = v_fma(there_light, v_select(zero, v_splat(1.0f), adds) - share,
                                    sky_more[c]);
            }
#endif
        }
        if (v_any(v_ine(knows, known) | v_ine(covers, covered))) {
            // The guard beyond the last column takes what it holds.
            v_istore(knows, known_at);
            v_istore(covers, hides_at);
        }
    }
    if (v_any(changes)) {
        __global float *restrict open_at = gathered + ssgi_index(size, 0, x, y);
        const vfloat before = v_load(open_at);
        const vfloat all_hidden = v_fma(1.0f - before, known_before, hidden);
        const vfloat all_known = v_max(known_before + known_more, v_splat(1e-30f));
        const vfloat open = v_clamp(1.0f - all_hidden / all_known, 0.0f, 1.0f);
        v_store(v_select(before, open, changes), open_at);
#if POINT_VIEWS_SKY
        for (int c = 0; c < 3; ++c) {
            __global float *restrict sky_at = gathered + ssgi_index(size, 1 + c, x, y);
            const vfloat sky = v_load(sky_at);
            const vfloat seen_sky = v_fma(-unknown_before[c], before, sky) + sky_more[c];
            const vfloat now = v_max(v_fma(unknown[c], open, seen_sky), zero);
            v_store(v_select(sky, now, changes), sky_at);
        }
#endif
    }
#if POINT_VIEWS_SENDERS > 0
    for (int c = 0; c < 3; ++c) {
        __global float *restrict bounce_at =
            gathered + ssgi_index(size, POINT_VIEWS_BOUNCE + c, x, y);
        v_store(v_load(bounce_at) + v_select(zero, light[c], active), bounce_at);
    }
#endif
}
