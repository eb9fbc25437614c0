// SPDX-License-Identifier: MIT
// upsample_joint: from a result at half or quarter size to full size, along surfaces.
// (OpenCL C has a built-in function called upsample, so no kernel can be.)
//
// Method:  Kopf et al. 2007, "Joint Bilateral Upsampling", with the 2 x 2 nearest coarse pixels,
//          weighted by distance, by how far each lies off the pixel's tangent plane and by normal.
//          No weight is cut to 0: where none fits well, the best one decides.
// Reads:   coarse         UPSAMPLE_COUNT x [rows, columns] of the coarse result
//          coarse_linear  [rows, columns] with coarse margin, see common/surface.clh
//          coarse_normal  3 x [rows, columns] with coarse margin, view space
//          linear, normal likewise at full size with margin
// Writes:  fine   UPSAMPLE_COUNT x [rows, columns] without margin
// Macros:  UPSAMPLE_COUNT (1..4)
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "common/surface.clh"

#ifndef UPSAMPLE_COUNT
#error "UPSAMPLE_COUNT must be defined by the host"
#endif

__kernel void upsample_joint(ssgi_plane coarse, ssgi_plane coarse_linear,
                             ssgi_plane coarse_normal, ssgi_plane linear, ssgi_plane normal,
                             __global float *restrict fine, const int2 size, // of the fine result
                             const SsgiCamera camera, const UpsampleParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int step = params.step;
    const int2 whole =
        (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int2 small = (int2)((size.x + step - 1) / step, (size.y + step - 1) / step);
    const int2 small_whole = (int2)(params.coarse_columns, params.coarse_rows);
    const int small_left = params.margin_columns / step;
    const int small_top = params.margin_rows / step;
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vfloat own = ssgi_load(linear, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const SsgiPlane plane = ssgi_tangent_plane(
        camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_y + 0.5f),
        ssgi_linear(camera, v_select(v_splat(1.0f), own, there)), nx, ny, nz);

    const vint lane = v_iota() + x;
    const vint left = v_imin(lane / step, v_splat_int(small.x - 1));
    const int top = min(y / step, small.y - 1);
    const float inverse_step = 1.0f / (float)step;
    const vfloat zero = v_splat(0.0f);
    vfloat sum[UPSAMPLE_COUNT];
    for (int c = 0; c < UPSAMPLE_COUNT; ++c) {
        sum[c] = zero;
    }
    vfloat total = zero;
    for (int corner = 0; corner < 4; ++corner) {
        const vint cx = v_imin(left + (corner & 1), v_splat_int(small.x - 1));
        const int row = min(top + (corner >> 1), small.y - 1);
        const vint cy = v_splat_int(row);
        const vfloat dx = v_to_float(cx * step - lane);
        const vfloat dy = v_splat((float)(row * step - y));
        const vfloat near_x = v_max(1.0f - v_abs(dx) * inverse_step, zero) + 1e-3f;
        const vfloat near_y = v_max(1.0f - v_abs(dy) * inverse_step, zero) + 1e-3f;
        const vfloat tap =
            ssgi_gather(coarse_linear, small_whole, 0, cx + small_left, cy + small_top);
        const vfloat mx =
            ssgi_gather(coarse_normal, small_whole, 0, cx + small_left, cy + small_top);
        const vfloat my =
            ssgi_gather(coarse_normal, small_whole, 1, cx + small_left, cy + small_top);
        const vfloat mz =
            ssgi_gather(coarse_normal, small_whole, 2, cx + small_left, cy + small_top);
        const vfloat cosine = v_fma(nx, mx, v_fma(ny, my, nz * mz));
        // An empty coarse pixel is as far off as can be; 40 halvings leave it the last choice.
        const vfloat far = v_min(ssgi_off_plane(plane, dx, dy, tap) * params.depth_scale,
                                 v_splat(5.0f));
        const vfloat turned = v_min((1.0f - cosine) * params.normal_scale, v_splat(15.0f));
        const vfloat weight = near_x * near_y * v_exp2_weight(-v_fma(far, far, turned));
        for (int c = 0; c < UPSAMPLE_COUNT; ++c) {
            sum[c] = v_fma(weight, ssgi_gather(coarse, small, c, cx, cy), sum[c]);
        }
        total = total + weight;
    }
    for (int c = 0; c < UPSAMPLE_COUNT; ++c) {
        ssgi_store(v_select(v_splat(params.background), sum[c] / total, there), fine, size, c, x,
                   y, 0.0f);
    }
}
