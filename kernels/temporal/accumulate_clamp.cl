// SPDX-License-Identifier: MIT
// accumulate_clamp: a long mean, moved where the pixels around show that it is no longer right; and
// a mean of few frames, with those around.
//
// Method:  the mean difference between source and mean, over the pixels around that show the same
//          surface, is a change if it exceeds some of its standard errors; then it is added, up to
//          the least and greatest source there. Means of less than params.young frames become those
//          of the pixels there, weighted by their frames
// Reads:   blended  ACCUMULATE_COUNT x [rows, columns]: the mean; frames, why: as `accumulate`
// wrote
//          source   likewise: the frame's own value, or the mean of few frames
//          depth, normal  of the G-buffer, margin and all; view space
// Writes:  mean, count, reasons: as of `accumulate`. Where the mean is changed the count is
//          params.fast, and reasons has ACCUMULATE_CHANGED
// Macros:  ACCUMULATE_COUNT, ACCUMULATE_REACH: pixels on either side; ACCUMULATE_YOUNG: whether
// means of few frames become those of the pixels there Launch:  SSGI_LANES pixels of a row per
// work-item

#include "common/gbuffer.clh"
#include "temporal/tests.clh"

#if !defined(ACCUMULATE_COUNT) || !defined(ACCUMULATE_REACH) || !defined(ACCUMULATE_YOUNG)
#error "ACCUMULATE_COUNT, _REACH and _YOUNG must be defined by the host"
#endif
#if !defined(ACCUMULATE_CHANGED)
#error "ssgi_cl/device/constants.py defines the reasons ACCUMULATE_..."
#endif

#define ACCUMULATE_ROUNDING 1e-5f // of a mean, as a share of it: less is no change

__kernel void accumulate_clamp(ssgi_plane blended, ssgi_plane frames, ssgi_plane why,
                               ssgi_plane source, ssgi_plane depth, ssgi_plane normal,
                               __global float *restrict mean, __global float *restrict count,
                               __global float *restrict reasons, const int2 size, const int2 whole,
                               const SsgiCamera camera, const AccumulateParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const int at_x = x + params.margin_columns, at_y = y + params.margin_rows;
    const vfloat z = ssgi_load(depth, whole, 0, at_x, at_y);
    const vmask there = v_lt(z, v_splat(INFINITY));
    const vfloat before = ssgi_load(frames, size, 0, x, y);
    // Shorter means are those of few frames themselves.
    const vmask longer = there & v_lt(v_splat(params.fast), before);
#if ACCUMULATE_YOUNG
    const vmask young = there & v_lt(before, v_splat(params.young - 0.5f)); // rounded
#else
    const vmask young = v_splat_int(0);
#endif
    vmask changed = v_splat_int(0);
    if (v_any(longer | young)) {
        const TemporalPoint point =
            temporal_point(camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_y + 0.5f),
                           v_select(one, z, there), ssgi_load(normal, whole, 0, at_x, at_y),
                           ssgi_load(normal, whole, 1, at_x, at_y),
                           ssgi_load(normal, whole, 2, at_x, at_y), params.plane_distance);
        vint fitting = v_splat_int(0);
        vfloat sum[ACCUMULATE_COUNT], squares[ACCUMULATE_COUNT];
        vfloat least[ACCUMULATE_COUNT], most[ACCUMULATE_COUNT];
#if ACCUMULATE_YOUNG
        vfloat weights = zero, around[ACCUMULATE_COUNT];
#endif
        for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
            sum[c] = squares[c] = zero;
#if ACCUMULATE_YOUNG
            around[c] = zero;
#endif
            least[c] = most[c] = ssgi_load(source, size, c, x, y);
        }
        const int first = max(-ACCUMULATE_REACH, -y);
        const int last = min(ACCUMULATE_REACH, size.y - 1 - y);
        for (int dy = first; dy <= last; ++dy) {
#pragma unroll 1
            for (int dx = -ACCUMULATE_REACH; dx <= ACCUMULATE_REACH; ++dx) {
                // Where nothing is, the distance is no number or infinite, and fits nothing.
                const vfloat off =
                    temporal_off(point, camera, v_to_float(v_iota() + (at_x + dx)) + 0.5f,
                                 v_splat((float)(at_y + dy) + 0.5f),
                                 ssgi_load(depth, whole, 0, at_x + dx, at_y + dy));
                const vmask turned = temporal_turned(
                    point, ssgi_load(normal, whole, 0, at_x + dx, at_y + dy),
                    ssgi_load(normal, whole, 1, at_x + dx, at_y + dy),
                    ssgi_load(normal, whole, 2, at_x + dx, at_y + dy), params.least_cosine);
                const vmask fits =
                    v_within(v_iota() + (x + dx), size.x) & v_le(off, point.most) & ~turned;
                fitting = fitting - fits; // a mask is -1
#if ACCUMULATE_YOUNG
                const vfloat weight =
                    v_select(zero, ssgi_load(frames, size, 0, x + dx, y + dy), fits);
                weights = weights + weight;
#endif
                for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
                    const vfloat theirs = ssgi_load(blended, size, c, x + dx, y + dy);
#if ACCUMULATE_YOUNG
                    around[c] = v_fma(weight, v_select(zero, theirs, fits), around[c]);
#endif
                    // Each from its own mean, so that what differs from pixel to pixel is no
                    // change.
                    const vfloat now = ssgi_load(source, size, c, x + dx, y + dy);
                    const vfloat step = v_select(zero, now - theirs, fits);
                    const vfloat bound = v_select(least[c], now, fits);
                    least[c] = v_min(least[c], bound);
                    most[c] = v_max(most[c], bound);
                    sum[c] = sum[c] + step;
                    squares[c] = v_fma(step, step, squares[c]);
                }
            }
        }
        const vfloat pixels = v_to_float(fitting), inverse = 1.0f / v_max(pixels, one);
        for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
            const vfloat was = ssgi_load(blended, size, c, x, y);
            // Of steps that are 0 on average, the root of the sum of squares is that of the sum.
            const vfloat error = v_max(v_sqrt(squares[c]) * params.clamp_sigma,
                                       v_abs(was) * pixels * ACCUMULATE_ROUNDING);
            const vmask beyond = longer & v_lt(error, v_abs(sum[c]));
            const vfloat moved = v_min(v_max(v_fma(sum[c], inverse, was), least[c]), most[c]);
            changed |= beyond;
            vfloat result = v_select(was, moved, beyond);
#if ACCUMULATE_YOUNG
            const vmask joins = young & v_lt(zero, weights);
            result = v_select(result, around[c] / v_select(one, weights, joins), joins);
#endif
            ssgi_store(result, mean, size, c, x, y, 0.0f);
        }
    } else {
        for (int c = 0; c < ACCUMULATE_COUNT; ++c) {
            ssgi_store(ssgi_load(blended, size, c, x, y), mean, size, c, x, y, 0.0f);
        }
    }
    ssgi_store(v_select(before, v_splat(params.fast), changed), count, size, 0, x, y, 0.0f);
    const vfloat told = ssgi_load(why, size, 0, x, y);
    ssgi_store(v_select(told, told + (float)ACCUMULATE_CHANGED, changed), reasons, size, 0, x, y,
               0.0f);
}
