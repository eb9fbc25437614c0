// SPDX-License-Identifier: MIT
// bilateral_blur: Gaussian blur in space, depth and normal that does not cross an edge.
//
// Method:  Tomasi and Manduchi 1998, with depth and normal in place of the value (cross-bilateral).
// Departs: depth is compared with the tangent plane of the pixel, so that a tilted plane is blurred
//          like one that faces the viewer. The Gaussians of depth and normal are powers that end
//          (common/surface.clh): no exponential, and what is beyond weighs exactly 0.
// Reads:   value   BLUR_COUNT x [rows, columns]
//          linear  [rows, columns] with margin, see common/surface.clh; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space, unit length
//          weights by distance in pixels: of 0 to BLUR_RADIUS, then BLUR_ROWS - 1 zeros; that of
//                  0 is 0 unless BLUR_SHAPE is 2, as a pixel counts fully whatever it fits
// Writes:  blurred BLUR_COUNT x [rows, columns]; the value itself where nothing is
// Macros:  BLUR_RADIUS (1..16), BLUR_COUNT (1..4),
//          BLUR_SHAPE (0 along rows, 1 along columns, 2 the full square),
//          BLUR_ROWS of a work-item, which share what is read; 1 unless BLUR_SHAPE is 1
// Launch:  SSGI_LANES pixels of BLUR_ROWS rows per work-item
// Cost:    2 BLUR_RADIUS + 1 samples per pixel, squared for the full square; a sample of one image
//          is 14 operations and 5 loads. On two cores with 16 lanes the rows are bound by the
//          multiply-adds, the columns of wide images by what the second-level cache delivers.
// Tried:   exponentials, thresholds and planes taken anew in each sample: 3.2 ms in place of 1.7
//          (15 x 15, 800 x 600), same error. Weights that are products over neighbouring pixels, 4
//          operations a sample, don't reach over gaps: with small things about, error up by 5 %.
//          Blocks that are one plane, for a path of their own, are a fifth of a furnished scene.
//          Work-groups that are tall and narrow: up to 1.4 times as long; 4 rows a work-item: 1.2.

#include "common/gbuffer.clh"
#include "common/surface.clh"

#if !defined(BLUR_RADIUS) || !defined(BLUR_COUNT) || !defined(BLUR_SHAPE) || !defined(BLUR_ROWS)
#error "BLUR_RADIUS, BLUR_COUNT, BLUR_SHAPE and BLUR_ROWS must be defined by the host"
#endif
#if BLUR_RADIUS > SSGI_GUARD
#error "BLUR_RADIUS reaches beyond the guard of a plane"
#endif

__kernel void bilateral_blur(ssgi_plane value, ssgi_plane linear, ssgi_plane normal,
                             __global const float *restrict weights,
                             __global float *restrict blurred, const int2 size, // of the value
                             const SsgiCamera camera, const BlurParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1) * BLUR_ROWS;
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
#if BLUR_SHAPE == 0
    const int first = 0, last = 0, reach = BLUR_RADIUS;
#elif BLUR_SHAPE == 1
    const int first = -min(BLUR_RADIUS, y), reach = 0,
              last = min(BLUR_RADIUS + BLUR_ROWS - 1, size.y - 1 - y);
#else
    const int first = -min(BLUR_RADIUS, y), last = min(BLUR_RADIUS, size.y - 1 - y),
              reach = BLUR_RADIUS;
#endif
    SsgiFit fit[BLUR_ROWS];
    vfloat off_left[BLUR_ROWS], total[BLUR_ROWS], sum[BLUR_ROWS][BLUR_COUNT];
#pragma unroll
    for (int r = 0; r < BLUR_ROWS; ++r) {
        const int row = min(y + r, size.y - 1);
        const int at_row = row + params.margin_rows;
        const vfloat own = ssgi_load(linear, whole, 0, at_x, at_row);
        fit[r] = ssgi_fit_of(
            camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_row + 0.5f),
            v_select(v_splat(1.0f), own, v_lt(own, v_splat(INFINITY))),
            ssgi_load(normal, whole, 0, at_x, at_row), ssgi_load(normal, whole, 1, at_x, at_row),
            ssgi_load(normal, whole, 2, at_x, at_row), params.depth_scale, params.normal_scale);
        off_left[r] = v_fma(v_splat((float)-reach), fit[r].off_x, fit[r].off);
        total[r] = v_splat(1.0f);
#pragma unroll
        for (int c = 0; c < BLUR_COUNT; ++c) {
            sum[r][c] = ssgi_load(value, size, c, x, row);
        }
    }
    // Beside the image, linear is INFINITY unless there is a margin; value is nothing in any case.
    const bool cut = params.margin_columns > 0 && (x < reach || x + SSGI_LANES + reach > size.x);

    for (int dy = first; dy <= last; ++dy) {
        vfloat off[BLUR_ROWS];
#pragma unroll
        for (int r = 0; r < BLUR_ROWS; ++r) {
            // Not added up: the first row of the window depends on the rows of a work-item.
            off[r] = v_fma(v_splat((float)(dy - r)), fit[r].off_y, off_left[r]);
        }
        for (int dx = -reach; dx <= reach; ++dx) {
            vfloat u = ssgi_load(linear, whole, 0, at_x + dx, at_y + dy);
            const vfloat mx = ssgi_load(normal, whole, 0, at_x + dx, at_y + dy);
            const vfloat my = ssgi_load(normal, whole, 1, at_x + dx, at_y + dy);
            const vfloat mz = ssgi_load(normal, whole, 2, at_x + dx, at_y + dy);
            if (cut) {
                u = v_select(v_splat(INFINITY), u, v_within(v_iota() + (x + dx), size.x));
            }
#pragma unroll
            for (int r = 0; r < BLUR_ROWS; ++r) {
#if BLUR_SHAPE == 2
                const float near = dx == 0 && dy == 0 ? 0.0f : weights[abs(dx)] * weights[abs(dy)];
#else
                const float near = weights[BLUR_SHAPE == 0 ? abs(dx) : abs(dy - r)];
#endif
                const vfloat weight =
                    near * ssgi_fit_weight(ssgi_fit(fit[r], off[r], u, mx, my, mz));
#pragma unroll
                for (int c = 0; c < BLUR_COUNT; ++c) {
                    sum[r][c] = v_fma(weight, ssgi_load(value, size, c, x + dx, y + dy), sum[r][c]);
                }
                total[r] = total[r] + weight;
                off[r] = off[r] + fit[r].off_x;
            }
        }
    }
#pragma unroll
    for (int r = 0; r < BLUR_ROWS; ++r) {
        if (y + r >= size.y) {
            return;
        }
        const vmask there = v_lt(ssgi_load(linear, whole, 0, at_x, at_y + r), v_splat(INFINITY));
#pragma unroll
        for (int c = 0; c < BLUR_COUNT; ++c) {
            const vfloat own = ssgi_load(value, size, c, x, y + r);
            ssgi_store(v_select(own, sum[r][c] / total[r], there), blurred, size, c, x, y + r,
                       0.0f);
        }
    }
}
