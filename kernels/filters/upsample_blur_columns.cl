// SPDX-License-Identifier: MIT
// upsample_blur_columns: the second of two passes that blur a coarse result for full size.
//
// Method:  see upsample_blur_rows. Samples that nothing fitted don't count. A pixel that no sample
//          of its column fits either takes the value of the best of the four nearest coarse pixels.
// Reads:   rows    [rows of the coarse result, columns of the fine], from upsample_blur_rows
//          coarse, coarse_linear, coarse_normal, linear, normal, weights: see there
// Writes:  fine    [rows, columns] without margin; `background` where nothing is
// Macros:  UPSAMPLE_STEP (1, 2 or 4), BLUR_RADIUS (1..16)
// Launch:  SSGI_LANES fine pixels of UPSAMPLE_STEP rows per work-item
// Cost:    about (2 BLUR_RADIUS + 1) / UPSAMPLE_STEP samples per pixel; over a third of the time of
//          wide images is waiting for the second-level cache
// Tried:   strips of columns, so that what is read stays in the nearest cache: 1.1 to 1.8 times as
//          long, as memory is fetched ahead along rows; twice the rows of a work-item: 1.4; samples
//          unrolled: 1.2, all loads come first and leave the registers; bands of rows in turn with
//          those of the first pass, asking for rows ahead, leaving out where all is 1: no gain

#include "common/gbuffer.clh"
#include "common/surface.clh"
#include "filters/corners.clh"
#include "filters/flag.clh"

#if !defined(UPSAMPLE_STEP) || !defined(BLUR_RADIUS)
#error "UPSAMPLE_STEP and BLUR_RADIUS must be defined by the host"
#endif

__kernel void upsample_blur_columns(ssgi_plane rows, ssgi_plane coarse, ssgi_plane coarse_linear,
                                    ssgi_plane coarse_normal, ssgi_plane linear, ssgi_plane normal,
                                    __global const float *restrict weights,
                                    __global float *restrict fine, const int2 size, // of fine
                                    const SsgiCamera camera, const UpsampleParams params)
{
    const int step = UPSAMPLE_STEP;
    const int x = ssgi_first_column();
    const int row = (int)get_global_id(1); // of the coarse result
    const int2 small = (int2)((size.x + step - 1) / step, (size.y + step - 1) / step);
    if (x >= size.x || row >= small.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int2 wide = (int2)(size.x, small.y);
    const int at_x = x + params.margin_columns;
    const int y = row * step;

    const int first = -min(BLUR_RADIUS / UPSAMPLE_STEP, row);
    const int last = min((BLUR_RADIUS + UPSAMPLE_STEP - 1) / UPSAMPLE_STEP, small.y - 1 - row);
    SsgiFit fit[UPSAMPLE_STEP];
    vfloat off[UPSAMPLE_STEP], step_y[UPSAMPLE_STEP], sum[UPSAMPLE_STEP], total[UPSAMPLE_STEP];
#pragma unroll
    for (int r = 0; r < UPSAMPLE_STEP; ++r) {
        const int at_y = min(y + r, size.y - 1) + params.margin_rows;
        const vfloat own = ssgi_load(linear, whole, 0, at_x, at_y);
        fit[r] = ssgi_fit_of(
            camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_y + 0.5f),
            v_select(v_splat(1.0f), own, v_lt(own, v_splat(INFINITY))),
            ssgi_load(normal, whole, 0, at_x, at_y), ssgi_load(normal, whole, 1, at_x, at_y),
            ssgi_load(normal, whole, 2, at_x, at_y), params.depth_scale, params.normal_scale);
        off[r] = v_fma(v_splat((float)(first * step - r)), fit[r].off_y, fit[r].off);
        step_y[r] = fit[r].off_y * (float)step;
        sum[r] = v_splat(0.0f);
        total[r] = v_splat(0.0f);
    }
    // Indices and weights that only grow: what is left to the loop is hardly more than its samples.
    int at = ssgi_pixel(whole, at_x, y + first * step + params.margin_rows);
    int value_at = ssgi_pixel(wide, x, row + first);
    int distance = BLUR_RADIUS + UPSAMPLE_STEP + first * step;
    for (int d = first; d <= last; ++d) {
        const vfloat value = ssgi_load_at(rows, wide, 0, value_at);
        const vfloat u =
            v_select(ssgi_load_at(linear, whole, 0, at), v_splat(INFINITY), upsample_flag(value));
        const vfloat mx = ssgi_load_at(normal, whole, 0, at);
        const vfloat my = ssgi_load_at(normal, whole, 1, at);
        const vfloat mz = ssgi_load_at(normal, whole, 2, at);
#pragma unroll
        for (int r = 0; r < UPSAMPLE_STEP; ++r) {
            const vfloat weight =
                weights[distance - r] * ssgi_fit_weight(ssgi_fit(fit[r], off[r], u, mx, my, mz));
            sum[r] = v_fma(weight, value, sum[r]);
            total[r] = total[r] + weight;
            off[r] = off[r] + step_y[r];
        }
        at += step * ssgi_below(whole);
        value_at += ssgi_below(wide);
        distance += step;
    }
#pragma unroll
    for (int r = 0; r < UPSAMPLE_STEP; ++r) {
        if (y + r >= size.y) {
            return;
        }
        const vmask there =
            v_lt(ssgi_load(linear, whole, 0, at_x, y + r + params.margin_rows), v_splat(INFINITY));
        const vmask lost = v_lt(total[r], v_splat(UPSAMPLE_LEAST_WEIGHT)) & there;
        vfloat result = sum[r] / v_max(total[r], v_splat(UPSAMPLE_LEAST_WEIGHT));
        if (v_any(lost)) {
            result = v_select(result,
                              upsample_best(fit[r], coarse, coarse_linear, coarse_normal, small, x,
                                            row, r, params),
                              lost);
        }
        ssgi_store(v_select(v_splat(params.background), result, there), fine, size, 0, x, y + r,
                   0.0f);
    }
}
