// SPDX-License-Identifier: MIT
// accumulate: the mean of a value over the frames in which each surface was seen.
//
// Method:  reprojection with tests of each tap (Nehab et al. 2007), counts that are reprojected and
//          two means of different length (NVIDIA ReBLUR)
// Reads:   value    ACCUMULATE_COUNT x [rows, columns]
//          depth, normal  of the G-buffer, margin and all; view space
//          motion   3 images, likewise; with ACCUMULATE_MOTION 2 the third has no meaning
//          depth_before (ACCUMULATE_LAYERS images), normal_before: of the previous G-buffer
//          mean_before, fast_before, square_before, count_before: what this wrote for it
// Writes:  mean     ACCUMULATE_COUNT images: of up to params.limit frames
//          fast     likewise, of up to params.fast frames
//          square   mean of squares, as long as `mean`
//          count    frames that `mean` stands for, >= 1
//          reasons  ACCUMULATE_..., added up: why a pixel begins anew; 0 where it does not
// Params:  size, size_before: of the images; whole, whole_before: of the G-buffers; scale: pixels
// of
//          the previous image to one of this
// Macros:  ACCUMULATE_COUNT; ACCUMULATE_FIRST: 1 if there is nothing before; ACCUMULATE_MOTION: 0
//          (surfaces stand still), 2 or 3 images; ACCUMULATE_LAYERS of the previous G-buffer
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "temporal/tests.clh"

#if !defined(ACCUMULATE_COUNT) || !defined(ACCUMULATE_FIRST) || !defined(ACCUMULATE_MOTION) ||     \
    !defined(ACCUMULATE_LAYERS)
#error "ACCUMULATE_COUNT, _FIRST, _MOTION and _LAYERS must be defined by the host"
#endif
#if !defined(ACCUMULATE_BEGIN) || !defined(ACCUMULATE_NOTHING) || !defined(ACCUMULATE_BORDER) ||   \
    !defined(ACCUMULATE_EMPTY) || !defined(ACCUMULATE_PLANE) || !defined(ACCUMULATE_LAYER) ||      \
    !defined(ACCUMULATE_NORMAL)
#error "ssgi_cl/device/constants.py defines the reasons ACCUMULATE_..."
#endif

#define ACCUMULATE_LEAST                                                                           \
    0.015625f // share of the four taps that has to pass, so that rounding is no tap
#define ACCUMULATE_STILL                                                                           \
    0.001953125f            // pixels: so near to whole ones motion is these, which blurs nothing
#define ACCUMULATE_FAR 2e6f // pixels, beyond any image

#if !ACCUMULATE_FIRST
// One pixel a lane; `in_row`: they are neighbours, so that one load has them all.
static inline vfloat accumulate_tap(ssgi_plane plane, const int2 size, const int image,
                                    const vint x, const vint y, const int2 first, const bool in_row)
{
    return in_row ? ssgi_load(plane, size, image, first.x, first.y)
                  : ssgi_gather(plane, size, image, x, y);
}
#endif

__kernel void accumulate(ssgi_plane value, ssgi_plane depth,
#if !ACCUMULATE_FIRST
                         ssgi_plane normal,
#if ACCUMULATE_MOTION
                         ssgi_plane motion,
#endif
                         ssgi_plane depth_before, ssgi_plane normal_before, ssgi_plane mean_before,
                         ssgi_plane fast_before, ssgi_plane square_before, ssgi_plane count_before,
                         const int2 size_before, const int2 whole_before, const SsgiCamera camera,
                         const SsgiCamera camera_before,
#endif
                         __global float *restrict mean, __global float *restrict fast,
                         __global float *restrict square, __global float *restrict count,
                         __global float *restrict reasons, const int2 size, const int2 whole,
                         const AccumulateParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat one = v_splat(1.0f);
    const int at_x = x + params.margin_columns, at_y = y + params.margin_rows;
    const vfloat z = ssgi_load(depth, whole, 0, at_x, at_y);
    const vmask there = v_lt(z, v_splat(INFINITY));
#if ACCUMULATE_FIRST
    for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
        const vfloat own = ssgi_load(value, size, c, x, y);
        ssgi_store(own, mean, size, c, x, y, 0.0f);
        ssgi_store(own, fast, size, c, x, y, 0.0f);
        ssgi_store(own * own, square, size, c, x, y, 0.0f);
    }
    ssgi_store(one, count, size, 0, x, y, 0.0f);
    ssgi_store(
        v_select(v_splat((float)ACCUMULATE_NOTHING), v_splat((float)ACCUMULATE_BEGIN), there),
        reasons, size, 0, x, y, 0.0f);
#else
    const vfloat zero = v_splat(0.0f);
    const vfloat near = v_select(one, z, there);
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const vfloat own_column = v_to_float(v_iota() + x) + 0.5f;
    const vfloat own_row = v_splat((float)y + 0.5f);

#if ACCUMULATE_MOTION != 3
    // Where a surface that stands still was, in the previous camera's view space.
    const vfloat k = ssgi_k(camera, near);
    const vfloat px = ssgi_slope_x(camera, own_column + (float)params.margin_columns) * k;
    const vfloat py = ssgi_slope_y(camera, own_row + (float)params.margin_rows) * k;
    const vfloat deep = params.zz * near - params.zx * px - params.zy * py - params.z;
#endif
#if ACCUMULATE_MOTION
    vfloat across = ssgi_load(motion, whole, 0, at_x, at_y);
    vfloat down = ssgi_load(motion, whole, 1, at_x, at_y);
#if ACCUMULATE_MOTION == 3
    const vfloat deep = near + ssgi_load(motion, whole, 2, at_x, at_y);
#endif
#else
    const vfloat before = ssgi_k(camera_before, v_max(deep, v_splat(1e-30f)));
    const vfloat qx = params.xx * px + params.xy * py - params.xz * near + params.x;
    const vfloat qy = params.yx * px + params.yy * py - params.yz * near + params.y;
    vfloat across =
        (ssgi_column(camera_before, qx / before) - (float)params.before_columns) / params.scale_x -
        own_column;
    vfloat down =
        (ssgi_row(camera_before, qy / before) - (float)params.before_rows) / params.scale_y -
        own_row;
#endif
    across = v_clamp(across, -ACCUMULATE_FAR, ACCUMULATE_FAR);
    down = v_clamp(down, -ACCUMULATE_FAR, ACCUMULATE_FAR);
    const vfloat near_x = v_floor(across + 0.5f), near_y = v_floor(down + 0.5f);
    const vmask whole_pixels =
        v_lt(v_max(v_abs(across - near_x), v_abs(down - near_y)), v_splat(ACCUMULATE_STILL)) &
        v_eq(v_splat(params.scale_x), one) & v_eq(v_splat(params.scale_y), one);
    across = v_select(across, near_x, whole_pixels);
    down = v_select(down, near_y, whole_pixels);
    // In the previous image.
    const vfloat column = (own_column + across) * params.scale_x;
    const vfloat row = (own_row + down) * params.scale_y;
    const vmask ahead = v_lt(zero, deep) | v_eq(v_splat(camera_before.perspective), zero);
    const TemporalPoint point = temporal_point(
        camera_before, column + (float)params.before_columns, row + (float)params.before_rows,
        v_select(one, deep, ahead), params.xx * nx + params.xy * ny + params.xz * nz,
        params.yx * nx + params.yy * ny + params.yz * nz,
        params.zx * nx + params.zy * ny + params.zz * nz, params.plane_distance);

    const vint left = v_floor_to_int(column - 0.5f), top = v_floor_to_int(row - 0.5f);
    const vfloat part_x = column - 0.5f - v_to_float(left);
    const vfloat part_y = row - 0.5f - v_to_float(top);
    // Of smooth motion, most taps of a work-item's pixels are neighbours.
    const vint step_x = left - v_iota();
    const int first_x = v_ilargest(v_iselect(v_splat_int(INT_MIN), step_x, there));
    const int first_y = v_ilargest(v_iselect(v_splat_int(INT_MIN), top, there));
    const bool beside =
        SSGI_LANES > 1 &&
        v_all(~there | (v_ieq(step_x, v_splat_int(first_x)) & v_ieq(top, v_splat_int(first_y))));
    vfloat total = zero, frames = zero;
    vfloat means[ACCUMULATE_COUNT], fasts[ACCUMULATE_COUNT], squares[ACCUMULATE_COUNT];
    for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
        means[c] = fasts[c] = squares[c] = zero;
    }
    vint why = v_splat_int(0);
    for (int t = 0; t < 4; ++t) {
        const vfloat wide = t & 1 ? part_x : 1.0f - part_x;
        const vfloat high = t & 2 ? part_y : 1.0f - part_y;
        vfloat weight = wide * high;
        const vint tap_x = left + (t & 1), tap_y = top + (t >> 1);
        const vmask used = there & v_lt(zero, weight);
        const vmask inside =
            ahead & v_within(tap_x, size_before.x) & v_within(tap_y, size_before.y);
        const vint image_x = v_iselect(v_splat_int(0), tap_x, inside);
        const vint image_y = v_iselect(v_splat_int(0), tap_y, inside);
        const vint whole_x = image_x + params.before_columns;
        const vint whole_y = image_y + params.before_rows;
        const vfloat centre_x = v_to_float(whole_x) + 0.5f, centre_y = v_to_float(whole_y) + 0.5f;

        const int2 place = (int2)(first_x + (t & 1), first_y + (t >> 1));
        const int2 whole_place = place + (int2)(params.before_columns, params.before_rows);
        const bool in_row = beside && place.x >= 0 && place.x < size_before.x && place.y >= 0 &&
                            place.y < size_before.y; // what lies further right is guard

        const vfloat seen =
            accumulate_tap(depth_before, whole_before, 0, whole_x, whole_y, whole_place, in_row);
        const vmask full = v_lt(seen, v_splat(INFINITY));
        const vfloat off =
            temporal_off(point, camera_before, centre_x, centre_y, v_select(one, seen, full));
        const vmask apart = v_lt(point.most, off);
        vmask behind = v_splat_int(0);
#if ACCUMULATE_LAYERS > 1
        // The surface was behind the front one, whose value is another's, if a deeper layer fits
        // better.
        for (int layer = 1; layer < ACCUMULATE_LAYERS; ++layer) {
            const vfloat deeper = accumulate_tap(depth_before, whole_before, layer, whole_x,
                                                 whole_y, whole_place, in_row);
            const vmask some = v_lt(deeper, v_splat(INFINITY));
            behind |= some & v_lt(temporal_off(point, camera_before, centre_x, centre_y,
                                               v_select(one, deeper, some)),
                                  off);
        }
#endif
        const vmask turned = temporal_turned(
            point,
            accumulate_tap(normal_before, whole_before, 0, whole_x, whole_y, whole_place, in_row),
            accumulate_tap(normal_before, whole_before, 1, whole_x, whole_y, whole_place, in_row),
            accumulate_tap(normal_before, whole_before, 2, whole_x, whole_y, whole_place, in_row),
            params.least_cosine);
        vint failed = v_iselect(v_splat_int(0), v_splat_int(ACCUMULATE_NORMAL), turned);
        failed = v_iselect(failed, v_splat_int(ACCUMULATE_LAYER), behind);
        failed = v_iselect(failed, v_splat_int(ACCUMULATE_PLANE), apart);
        failed = v_iselect(failed, v_splat_int(ACCUMULATE_EMPTY), ~full);
        failed = v_iselect(failed, v_splat_int(ACCUMULATE_BORDER), ~inside);
        why |= v_iselect(v_splat_int(0), failed, used);
        const vmask passes = used & v_ieq(failed, v_splat_int(0));
        if (!v_any(passes)) {
            continue;
        }
        weight = v_select(zero, weight, passes);
        total = total + weight;
        frames = v_fma(
            weight, accumulate_tap(count_before, size_before, 0, image_x, image_y, place, in_row),
            frames);
        for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
            means[c] =
                v_fma(weight,
                      accumulate_tap(mean_before, size_before, c, image_x, image_y, place, in_row),
                      means[c]);
            fasts[c] =
                v_fma(weight,
                      accumulate_tap(fast_before, size_before, c, image_x, image_y, place, in_row),
                      fasts[c]);
            squares[c] = v_fma(
                weight,
                accumulate_tap(square_before, size_before, c, image_x, image_y, place, in_row),
                squares[c]);
        }
    }
    const vmask kept = v_le(v_splat(ACCUMULATE_LEAST), total);
    const vfloat inverse = 1.0f / v_select(one, total, kept);
    const vfloat now = v_select(zero, frames * inverse, kept) + 1.0f;
    const vfloat frames_now = v_min(now, v_splat(params.limit));
    const vfloat share = 1.0f / frames_now;
    const vfloat share_fast = 1.0f / v_min(now, v_splat(params.fast));
    for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
        const vfloat own = ssgi_load(value, size, c, x, y);
        const vfloat slow = means[c] * inverse, quick = fasts[c] * inverse;
        const vfloat spread = squares[c] * inverse;
        ssgi_store(v_select(own, v_fma(own - slow, share, slow), kept), mean, size, c, x, y, 0.0f);
        ssgi_store(v_select(own, v_fma(own - quick, share_fast, quick), kept), fast, size, c, x, y,
                   0.0f);
        ssgi_store(v_select(own * own, v_fma(own * own - spread, share, spread), kept), square,
                   size, c, x, y, 0.0f);
    }
    ssgi_store(frames_now, count, size, 0, x, y, 0.0f);
    why = v_iselect(why, v_splat_int(0), kept);
    why = v_iselect(v_splat_int(ACCUMULATE_NOTHING), why, there);
    ssgi_store(v_to_float(why), reasons, size, 0, x, y, 0.0f);
#endif
}
