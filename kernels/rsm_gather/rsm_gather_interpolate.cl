// SPDX-License-Identifier: MIT
// rsm_gather_interpolate: irradiance at full size from that of every step-th pixel, where possible.
//
// Method:  Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", section 4.2: the mean of
//          those of the four nearest coarse pixels that lie on the same surface, with bilinear
//          weights; a pixel that has fewer than three of them is left to be computed.
// Departs: the same surface is the pixel's tangent plane, and pixels whose neighbours differ much
//          in irradiance are left too, since between them it need not be linear. A pixel that
//          is a coarse pixel itself is done.
// Reads:   coarse         3 x [rows, columns] of the coarse result, W/m^2
//          coarse_linear  [rows, columns] with coarse margin, see common/surface.clh
//          coarse_normal  3 x [rows, columns] with coarse margin, view space
//          linear, normal likewise at full size with margin
// Writes:  fine   3 x [rows, columns] without margin, W/m^2; 0 where nothing is
//          left   [rows, columns rounded up to 16] 1 where a pixel is left to be computed
// Macros:  RSM_GATHER_STEP (2, 4, 8)
// Params:  off: largest distance from the tangent plane, relative to depth; cosine: least of the
//          angle between normals; spread: largest difference of irradiances, relative to their sum
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "common/surface.clh"

#ifndef RSM_GATHER_STEP
#error "RSM_GATHER_STEP must be defined by the host"
#endif

#define RSM_ENOUGH 2.5f // coarse pixels on the surface: three of four

// The coarse pixel for each lane: every RSM_GATHER_STEP lanes have the same, from `first` on.
static inline vfloat rsm_coarse(ssgi_plane plane, const int2 size, const int image, const int first,
                                const int row, const int last)
{
#if SSGI_LANES == 1
    return ssgi_gather(plane, size, image, min(first, last), row);
#else
    __global const float *pixels = plane + ssgi_index(size, image, 0, row);
    vfloat value = v_splat(pixels[min(first, last)]);
#pragma unroll
    for (int cell = 1; cell < SSGI_LANES / RSM_GATHER_STEP; ++cell) {
        const vmask beyond = v_ige(v_iota(), v_splat_int(cell * RSM_GATHER_STEP));
        value = v_select(value, v_splat(pixels[min(first + cell, last)]), beyond);
    }
    return value;
#endif
}

__kernel void rsm_gather_interpolate(ssgi_plane coarse, ssgi_plane coarse_linear,
                                     ssgi_plane coarse_normal, ssgi_plane linear,
                                     ssgi_plane normal, __global float *restrict fine,
                                     __global int *restrict left,
                                     const int2 size, // of the fine result
                                     const SsgiCamera camera, const RsmCoarseParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int step = RSM_GATHER_STEP;
    const int2 whole =
        (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int2 small = (int2)((size.x + step - 1) / step, (size.y + step - 1) / step);
    const int2 small_whole = (int2)(params.coarse_columns, params.coarse_rows);
    const int small_left = params.margin_columns / step;
    const int small_top = params.margin_rows / step;
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat one = v_splat(1.0f);
    const vfloat own = ssgi_load(linear, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const SsgiPlane plane = ssgi_tangent_plane(
        camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_y + 0.5f),
        ssgi_linear(camera, v_select(one, own, there)), nx, ny, nz);

    const vint lane = v_iota() + x;
    const int first = x / step;
    const int top = min(y / step, small.y - 1);
    const float inverse_step = 1.0f / (float)step;
    vfloat red = zero, green = zero, blue = zero;
    vfloat total = zero, count = zero, largest = zero;
    vfloat least = v_splat(INFINITY);
#pragma unroll
    for (int corner = 0; corner < 4; ++corner) {
        const int next = corner & 1;
        const int row = min(top + (corner >> 1), small.y - 1);
        const int last = small.x - 1;
        const vfloat dx = v_to_float(v_imin(lane / step + next, v_splat_int(last)) * step - lane);
        const vfloat dy = v_splat((float)(row * step - y));
        const vfloat weight = (1.0f - v_abs(dx) * inverse_step) * (1.0f - v_abs(dy) * inverse_step);
        // In the arrays with a margin.
        const int at = first + next + small_left;
        const int edge = last + small_left;
        const int line = row + small_top;
        const vfloat mx = rsm_coarse(coarse_normal, small_whole, 0, at, line, edge);
        const vfloat my = rsm_coarse(coarse_normal, small_whole, 1, at, line, edge);
        const vfloat mz = rsm_coarse(coarse_normal, small_whole, 2, at, line, edge);
        const vfloat cosine = v_fma(nx, mx, v_fma(ny, my, nz * mz));
        const vfloat tap = rsm_coarse(coarse_linear, small_whole, 0, at, line, edge);
        const vfloat off = ssgi_off_plane(plane, dx, dy, tap);
        const vmask fits = v_le(off, v_splat(params.off)) & v_ge(cosine, v_splat(params.cosine));
        const vfloat share = v_select(zero, weight, fits);
        const vfloat r = rsm_coarse(coarse, small, 0, first + next, row, last);
        const vfloat g = rsm_coarse(coarse, small, 1, first + next, row, last);
        const vfloat b = rsm_coarse(coarse, small, 2, first + next, row, last);
        red = v_fma(share, r, red);
        green = v_fma(share, g, green);
        blue = v_fma(share, b, blue);
        total = total + share;
        count = count + v_select(zero, one, fits);
        const vfloat sum = r + g + b;
        largest = v_max(largest, v_select(zero, sum, fits));
        least = v_min(least, v_select(v_splat(INFINITY), sum, fits));
    }
    const vmask even = v_le(largest - least, (largest + least) * params.spread);
    // Of three pixels that fit, one has some weight.
    const vmask itself = v_ieq((lane | y) & (step - 1), v_splat_int(0));
    const vmask done = itself | (v_gt(count, v_splat(RSM_ENOUGH)) & even);
    const vfloat scale = v_select(zero, 1.0f / v_max(total, v_splat(1e-9f)), there & done);
    ssgi_store(red * scale, fine, size, 0, x, y, 0.0f);
    ssgi_store(green * scale, fine, size, 1, x, y, 0.0f);
    ssgi_store(blue * scale, fine, size, 2, x, y, 0.0f);
    const vmask remains = there & ~done & v_ilt(lane, v_splat_int(size.x));
    v_istore(-remains, left + y * ((size.x + 15) & ~15) + x); // a true mask is -1
}
