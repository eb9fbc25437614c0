// SPDX-License-Identifier: MIT
// upsample_blur_rows: the first of two passes that blur a coarse result for full size.
//
// Method:  the edge-aware blur (filters/bilateral_blur.cl) of full-size pixels, with samples only
//          where there are coarse pixels: joint-bilateral upsampling (Kopf et al. 2007) of a wide
//          reach. This pass does so along the rows that have coarse pixels; upsample_blur_columns
//          goes on along all columns.
// Reads:   coarse         [rows, columns] of the coarse result
//          coarse_linear  [rows, columns] with coarse margin, see common/surface.clh
//          coarse_normal  3 x [rows, columns] with coarse margin, view space
//          linear, normal likewise at full size with margin
//          weights        by distance in pixels from -(BLUR_RADIUS + UPSAMPLE_STEP) to as much; 0
//                         beyond BLUR_RADIUS
// Writes:  blurred        [rows of the coarse result, columns of the fine]; its last bit is 1
//                         where no sample fits
// Macros:  UPSAMPLE_STEP (1, 2 or 4), BLUR_RADIUS (1..16)
// Launch:  SSGI_LANES coarse columns, and their fine pixels, of a coarse row per work-item
// Cost:    about (2 BLUR_RADIUS + 1) / UPSAMPLE_STEP samples per pixel. Both passes take 4.7 ms (15
//          x 15, from half size to 1600 x 1200, two cores, 16 lanes). Upsampling and then blurring
//          takes 10.4 for 1 to 2 % less error of GTAO; blurring 7 x 7 and then upsampling takes 3.8
//          for the same error, with steps along silhouettes when it comes from quarter size.

#include "common/gbuffer.clh"
#include "common/surface.clh"
#include "filters/flag.clh"
#include "filters/phases.clh"

#if !defined(UPSAMPLE_STEP) || !defined(BLUR_RADIUS)
#error "UPSAMPLE_STEP and BLUR_RADIUS must be defined by the host"
#endif

__kernel void upsample_blur_rows(ssgi_plane coarse, ssgi_plane coarse_linear,
                                 ssgi_plane coarse_normal, ssgi_plane linear, ssgi_plane normal,
                                 __global const float *restrict weights,
                                 __global float *restrict blurred, const int2 size, // of blurred
                                 const int2 small,                                  // of coarse
                                 const int2 whole,                                  // of linear
                                 const SsgiCamera camera, const UpsampleParams params)
{
    const int step = UPSAMPLE_STEP;
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= small.x || y >= small.y) {
        return;
    }
    const int2 small_whole = (int2)(params.coarse_columns, params.coarse_rows);
    const int from_x = x + params.margin_columns / step;
    const int from_y = y + params.margin_rows / step;
    const int at_x = x * step + params.margin_columns;
    const int at_y = y * step + params.margin_rows;
    vfloat own[UPSAMPLE_STEP], nx[UPSAMPLE_STEP], ny[UPSAMPLE_STEP], nz[UPSAMPLE_STEP];
    ssgi_load_phases(linear, whole, 0, at_x, at_y, own);
    ssgi_load_phases(normal, whole, 0, at_x, at_y, nx);
    ssgi_load_phases(normal, whole, 1, at_x, at_y, ny);
    ssgi_load_phases(normal, whole, 2, at_x, at_y, nz);

    // Samples from `first` to `last` coarse columns away are within reach of some phase.
    const int first = -(BLUR_RADIUS / UPSAMPLE_STEP);
    const int last = (BLUR_RADIUS + UPSAMPLE_STEP - 1) / UPSAMPLE_STEP;
    SsgiFit fit[UPSAMPLE_STEP];
    vfloat off[UPSAMPLE_STEP], sum[UPSAMPLE_STEP], total[UPSAMPLE_STEP];
#pragma unroll
    for (int p = 0; p < UPSAMPLE_STEP; ++p) {
        fit[p] = ssgi_fit_of(camera, v_to_float(v_iota() * step + (at_x + p)) + 0.5f,
                             v_splat((float)at_y + 0.5f),
                             v_select(v_splat(1.0f), own[p], v_lt(own[p], v_splat(INFINITY))),
                             nx[p], ny[p], nz[p], params.depth_scale, params.normal_scale);
        off[p] = v_fma(v_splat((float)(first * step - p)), fit[p].off_x, fit[p].off);
        fit[p].off_x = fit[p].off_x * (float)step;
        sum[p] = v_splat(0.0f);
        total[p] = v_splat(0.0f);
    }
    // Beside the image, linear is INFINITY unless there is a margin; coarse is nothing in any case.
    const bool cut = params.margin_columns > 0 && (x < -first || x + SSGI_LANES + last > small.x);
    const int at = ssgi_pixel(small_whole, from_x, from_y);
    const int value_at = ssgi_pixel(small, x, y);
    int distance = BLUR_RADIUS + UPSAMPLE_STEP + first * step;
#if SSGI_LANES == 1
#pragma unroll 1
#endif
    for (int d = first; d <= last; ++d) {
        vfloat u = ssgi_load_beside(coarse_linear, small_whole, 0, at, d);
        const vfloat mx = ssgi_load_beside(coarse_normal, small_whole, 0, at, d);
        const vfloat my = ssgi_load_beside(coarse_normal, small_whole, 1, at, d);
        const vfloat mz = ssgi_load_beside(coarse_normal, small_whole, 2, at, d);
        const vfloat value = ssgi_load_beside(coarse, small, 0, value_at, d);
        if (cut) {
            u = v_select(v_splat(INFINITY), u, v_within(v_iota() + (x + d), small.x));
        }
#pragma unroll
        for (int p = 0; p < UPSAMPLE_STEP; ++p) {
            const vfloat weight =
                weights[distance - p] * ssgi_fit_weight(ssgi_fit(fit[p], off[p], u, mx, my, mz));
            sum[p] = v_fma(weight, value, sum[p]);
            total[p] = total[p] + weight;
            off[p] = off[p] + fit[p].off_x;
        }
        distance += step;
    }
#pragma unroll
    for (int p = 0; p < UPSAMPLE_STEP; ++p) {
        const vmask fitted = v_le(v_splat(UPSAMPLE_LEAST_WEIGHT), total[p]);
        const vfloat mean = sum[p] / v_max(total[p], v_splat(UPSAMPLE_LEAST_WEIGHT));
        sum[p] = upsample_flagged(mean, ~fitted);
    }
    ssgi_store_phases(sum, blurred, size, 0, x * step, y, 0.0f);
}
