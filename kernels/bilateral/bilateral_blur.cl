// SPDX-License-Identifier: MIT
// bilateral_blur: Gaussian blur in space, depth and normal that does not cross an edge.
//
// Method:  Tomasi and Manduchi 1998, with depth and normal in place of the value (cross-bilateral).
//          Samples beyond a threshold are tossed and the rest is renormalised.
// Departs: depth is compared with the tangent plane of the pixel, so that a tilted plane is blurred
//          like one that faces the viewer.
// Reads:   value   BLUR_COUNT x [rows, columns]
//          linear  [rows, columns] with margin, see common/surface.clh; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space, unit length
//          weights (BLUR_RADIUS + 1) weights by distance in pixels
// Writes:  blurred BLUR_COUNT x [rows, columns]; the value itself where nothing is
// Macros:  BLUR_RADIUS (1..16), BLUR_COUNT (1..4),
//          BLUR_SHAPE (0 along rows, 1 along columns, 2 the full square)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    2 BLUR_RADIUS + 1 samples per pixel, squared for the full square

#include "common/gbuffer.clh"
#include "common/surface.clh"

#if !defined(BLUR_RADIUS) || !defined(BLUR_COUNT) || !defined(BLUR_SHAPE)
#error "BLUR_RADIUS, BLUR_COUNT and BLUR_SHAPE must be defined by the host"
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
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole =
        (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vfloat own = ssgi_load(linear, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const vfloat u = v_select(v_splat(1.0f), own, there);
    // ssgi_linear is its own inverse, so it takes u back to the depth.
    const SsgiPlane plane = ssgi_tangent_plane(
        camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_y + 0.5f),
        ssgi_linear(camera, u), nx, ny, nz);

    vfloat sum[BLUR_COUNT];
    for (int c = 0; c < BLUR_COUNT; ++c) {
        sum[c] = ssgi_load(value, size, c, x, y);
    }
    vfloat total = v_splat(1.0f);
#if BLUR_SHAPE == 0
    const int first_row = 0, last_row = 0, reach = BLUR_RADIUS;
#elif BLUR_SHAPE == 1
    const int first_row = -min(BLUR_RADIUS, y), last_row = min(BLUR_RADIUS, size.y - 1 - y),
              reach = 0;
#else
    const int first_row = -min(BLUR_RADIUS, y), last_row = min(BLUR_RADIUS, size.y - 1 - y),
              reach = BLUR_RADIUS;
#endif
    for (int dy = first_row; dy <= last_row; ++dy) {
        for (int dx = -reach; dx <= reach; ++dx) {
            if (dx == 0 && dy == 0) {
                continue;
            }
            const vfloat tap = ssgi_load(linear, whole, 0, at_x + dx, at_y + dy);
            const vfloat off = ssgi_off_plane(plane, v_splat((float)dx), v_splat((float)dy), tap);
            const vfloat mx = ssgi_load(normal, whole, 0, at_x + dx, at_y + dy);
            const vfloat my = ssgi_load(normal, whole, 1, at_x + dx, at_y + dy);
            const vfloat mz = ssgi_load(normal, whole, 2, at_x + dx, at_y + dy);
            const vfloat cosine = v_fma(nx, mx, v_fma(ny, my, nz * mz));
            const vint column = v_iota() + (x + dx);
            const vmask keep = v_le(off, v_splat(params.depth_threshold)) &
                               v_ge(cosine, v_splat(params.least_cosine)) &
                               v_ige(column, v_splat_int(0)) &
                               v_ilt(column, v_splat_int(size.x));
            const vfloat far = off * params.depth_scale;
            const vfloat exponent = v_fma(far, -far, (cosine - 1.0f) * params.normal_scale);
            const float spatial = weights[abs(dx)] * weights[abs(dy)];
            const vfloat weight =
                v_select(v_splat(0.0f), v_exp2_weight(exponent) * spatial, keep);
            for (int c = 0; c < BLUR_COUNT; ++c) {
                sum[c] = v_fma(weight, ssgi_load(value, size, c, x + dx, y + dy), sum[c]);
            }
            total = total + weight;
        }
    }
    for (int c = 0; c < BLUR_COUNT; ++c) {
        const vfloat own_value = ssgi_load(value, size, c, x, y);
        ssgi_store(v_select(own_value, sum[c] / total, there), blurred, size, c, x, y, 0.0f);
    }
}
