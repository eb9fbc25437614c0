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
//          BLUR_ROWS of a work-item, which share what is read; 1 unless BLUR_SHAPE is 1;
//          BLUR_CHECKERBOARD (0, 1; BLUR_SHAPE 0 and 1): along rows, values are on the pixels of
//          even row + column alone, image 0 from 0 to 1; it is 1, and others 0, where nothing is.
//          Pixels between that nothing in the row fits are written as -1 less the mean of those
//          beside them, which along columns counts if nothing fits there either
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

#if !defined(BLUR_RADIUS) || !defined(BLUR_COUNT) || !defined(BLUR_SHAPE) ||                       \
    !defined(BLUR_ROWS) || !defined(BLUR_CHECKERBOARD)
#error "BLUR_RADIUS, _COUNT, _SHAPE, _ROWS and _CHECKERBOARD must be defined by the host"
#endif
#if BLUR_CHECKERBOARD && BLUR_SHAPE == 2
#error "a checkerboard is filled along rows, then columns"
#endif
#if BLUR_RADIUS > SSGI_GUARD
#error "BLUR_RADIUS reaches beyond the guard of a plane"
#endif

#if BLUR_CHECKERBOARD
// Has a pixel, or each lane's, a value? Along rows those of even row + column have, along columns
// all but those that nothing in the row fits.
static inline vmask blur_has_value(const vfloat first, const vint column, const int row)
{
    if (BLUR_SHAPE == 0) {
        return v_ieq((column + row) & 1, v_splat_int(0));
    }
    return v_ge(first, v_splat(0.0f));
}

// What stands for a pixel between that nothing fits: along rows the mean of those beside it, as a
// negative number in image 0; along columns what that was made of.
static inline vfloat blur_instead(ssgi_plane value, const vfloat own, const int2 size,
                                  const int image, const int x, const int y)
{
    const vfloat one = v_splat(1.0f);
    if (BLUR_SHAPE == 1) {
        return image == 0 ? -1.0f - own : own;
    }
    const vfloat zero = v_splat(0.0f);
    const vint column = v_iota() + x;
    const vmask left = v_igt(column, v_splat_int(0));
    const vmask right = v_ilt(column, v_splat_int(size.x - 1));
    const vfloat sum = v_select(zero, ssgi_load(value, size, image, x - 1, y), left) +
                       v_select(zero, ssgi_load(value, size, image, x + 1, y), right);
    const vfloat count = v_select(zero, one, left) + v_select(zero, one, right);
    const vfloat mean = v_select(image == 0 ? one : zero, sum / v_max(count, one), left | right);
    return image == 0 ? -1.0f - mean : mean;
}
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
#if BLUR_CHECKERBOARD
        const vmask has = blur_has_value(sum[r][0], v_iota() + x, row);
        total[r] = v_select(v_splat(0.0f), total[r], has);
#pragma unroll
        for (int c = 0; c < BLUR_COUNT; ++c) {
            sum[r][c] = v_select(v_splat(0.0f), sum[r][c], has);
        }
#endif
    }
    // Beside the image, linear is INFINITY unless there is a margin; value is nothing in any case.
    const bool cut = params.margin_columns > 0 && (x < reach || x + SSGI_LANES + reach > size.x);

#if SSGI_LANES == 1 && BLUR_COUNT > 4 // what a sample takes fills the registers
#pragma unroll 1
#endif
    for (int dy = first; dy <= last; ++dy) {
        vfloat off[BLUR_ROWS];
#pragma unroll
        for (int r = 0; r < BLUR_ROWS; ++r) {
            // Not added up: the first row of the window depends on the rows of a work-item.
            off[r] = v_fma(v_splat((float)(dy - r)), fit[r].off_y, off_left[r]);
        }
#if SSGI_LANES == 1 && BLUR_COUNT > 4
#pragma unroll 1
#endif
        for (int dx = -reach; dx <= reach; ++dx) {
            vfloat u = ssgi_load(linear, whole, 0, at_x + dx, at_y + dy);
            const vfloat mx = ssgi_load(normal, whole, 0, at_x + dx, at_y + dy);
            const vfloat my = ssgi_load(normal, whole, 1, at_x + dx, at_y + dy);
            const vfloat mz = ssgi_load(normal, whole, 2, at_x + dx, at_y + dy);
#if BLUR_CHECKERBOARD
            const vmask has = blur_has_value(ssgi_load(value, size, 0, x + dx, y + dy),
                                             v_iota() + (x + dx), y + dy);
            u = v_select(v_splat(INFINITY), u, has);
#endif
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
                    vfloat other = ssgi_load(value, size, c, x + dx, y + dy);
#if BLUR_CHECKERBOARD
                    other = v_select(v_splat(0.0f), other, has);
#endif
                    sum[r][c] = v_fma(weight, other, sum[r][c]);
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
            vfloat own = ssgi_load(value, size, c, x, y + r);
            vfloat mean = sum[r][c] / total[r];
#if BLUR_CHECKERBOARD
            const vmask fitted = v_gt(total[r], v_splat(0.0f));
            mean = v_select(blur_instead(value, own, size, c, x, y + r), mean, fitted);
            own = v_splat(c == 0 ? 1.0f : 0.0f);
#endif
            ssgi_store(v_select(own, mean, there), blurred, size, c, x, y + r, 0.0f);
        }
    }
}
