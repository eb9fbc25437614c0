// SPDX-License-Identifier: MIT
// upsample_joint: from a result at half or quarter size to full size, along surfaces.
// (OpenCL C has a built-in function called upsample, so no kernel can be.)
//
// Method:  Kopf et al. 2007, "Joint Bilateral Upsampling", with the 2 x 2 nearest coarse pixels,
//          weighted by distance and by how well each fits the pixel's surface.
// Departs: a pixel that none of those fits takes the value of the one that fits best. Without
//          exponentials: see common/surface.clh.
// Reads:   coarse         UPSAMPLE_COUNT x [rows, columns] of the coarse result
//          coarse_linear  [rows, columns] with coarse margin, see common/surface.clh
//          coarse_normal  3 x [rows, columns] with coarse margin, view space
//          linear, normal likewise at full size with margin
// Writes:  fine   UPSAMPLE_COUNT x [rows, columns] without margin
// Macros:  UPSAMPLE_COUNT (1..4), UPSAMPLE_STEP (1, 2 or 4)
// Launch:  SSGI_LANES coarse columns, and their fine pixels of one row, per work-item

#include "common/gbuffer.clh"
#include "common/surface.clh"
#include "filters/flag.clh"
#include "filters/phases.clh"

#if !defined(UPSAMPLE_COUNT) || !defined(UPSAMPLE_STEP)
#error "UPSAMPLE_COUNT and UPSAMPLE_STEP must be defined by the host"
#endif

// Four coarse pixels: of this column and row, the next column, the next row, and both.
typedef struct {
    vfloat u[4], nx[4], ny[4], nz[4];
} UpsampleCorners;

// How well a corner fits a pixel that is `phase` columns right of and `rest` rows below the first.
static inline vfloat upsample_fit(const SsgiFit fit, const UpsampleCorners *corners,
                                  const int corner, const int phase, const int rest)
{
    const float dx = (float)((corner & 1) * UPSAMPLE_STEP - phase);
    const float dy = (float)((corner >> 1) * UPSAMPLE_STEP - rest);
    const vfloat off = v_fma(v_splat(dx), fit.off_x, v_fma(v_splat(dy), fit.off_y, fit.off));
    return ssgi_fit(fit, off, corners->u[corner], corners->nx[corner], corners->ny[corner],
                    corners->nz[corner]);
}

__kernel void upsample_joint(ssgi_plane coarse, ssgi_plane coarse_linear, ssgi_plane coarse_normal,
                             ssgi_plane linear, ssgi_plane normal, __global float *restrict fine,
                             const int2 size, // of the fine result
                             const SsgiCamera camera, const UpsampleParams params)
{
    const int step = UPSAMPLE_STEP;
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    const int2 small = (int2)((size.x + step - 1) / step, (size.y + step - 1) / step);
    if (x >= small.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int2 small_whole = (int2)(params.coarse_columns, params.coarse_rows);
    const int at_x = x * step + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const int row = y / step;
    const int rest = y - row * step;
    // What is beside the image is nothing, even where the G-buffer has a margin.
    const vmask right = v_within(v_iota() + (x + 1), small.x);
    UpsampleCorners corners;
#pragma unroll
    for (int corner = 0; corner < 4; ++corner) {
        const int from_x = x + (corner & 1) + params.margin_columns / step;
        const int from_y = min(row + (corner >> 1), small.y - 1) + params.margin_rows / step;
        const vfloat u = ssgi_load(coarse_linear, small_whole, 0, from_x, from_y);
        corners.nx[corner] = ssgi_load(coarse_normal, small_whole, 0, from_x, from_y);
        corners.ny[corner] = ssgi_load(coarse_normal, small_whole, 1, from_x, from_y);
        corners.nz[corner] = ssgi_load(coarse_normal, small_whole, 2, from_x, from_y);
        const bool below = (corner >> 1) != 0 && row + 1 == small.y;
        corners.u[corner] = below               ? v_splat(INFINITY)
                            : (corner & 1) != 0 ? v_select(v_splat(INFINITY), u, right)
                                                : u;
    }
    vfloat own[UPSAMPLE_STEP], nx[UPSAMPLE_STEP], ny[UPSAMPLE_STEP], nz[UPSAMPLE_STEP];
    ssgi_load_phases(linear, whole, 0, at_x, at_y, own);
    ssgi_load_phases(normal, whole, 0, at_x, at_y, nx);
    ssgi_load_phases(normal, whole, 1, at_x, at_y, ny);
    ssgi_load_phases(normal, whole, 2, at_x, at_y, nz);

    vfloat weight[UPSAMPLE_STEP][4], total[UPSAMPLE_STEP];
#pragma unroll
    for (int p = 0; p < UPSAMPLE_STEP; ++p) {
        const vmask there = v_lt(own[p], v_splat(INFINITY));
        const SsgiFit fit =
            ssgi_fit_of(camera, v_to_float(v_iota() * step + (at_x + p)) + 0.5f,
                        v_splat((float)at_y + 0.5f), v_select(v_splat(1.0f), own[p], there), nx[p],
                        ny[p], nz[p], params.depth_scale, params.normal_scale);
        total[p] = v_splat(0.0f);
#pragma unroll
        for (int corner = 0; corner < 4; ++corner) {
            const int near = (step - (int)abs((corner & 1) * step - p)) *
                             (step - (int)abs((corner >> 1) * step - rest));
            weight[p][corner] = v_splat(0.0f);
            if (near != 0) {
                weight[p][corner] =
                    (float)near * ssgi_fit_weight(upsample_fit(fit, &corners, corner, p, rest));
                total[p] = total[p] + weight[p][corner];
            }
        }
        const vmask lost = there & v_lt(total[p], v_splat(UPSAMPLE_LEAST_WEIGHT));
        if (v_any(lost)) {
            total[p] = v_select(total[p], v_splat(1.0f), lost);
            vmask left = lost;
            vfloat fits[4];
            for (int corner = 0; corner < 4; ++corner) {
                fits[corner] = upsample_fit(fit, &corners, corner, p, rest);
            }
            const vfloat best = v_max(v_max(fits[0], fits[1]), v_max(fits[2], fits[3]));
            for (int corner = 0; corner < 4; ++corner) {
                const vmask chosen = left & v_eq(fits[corner], best);
                weight[p][corner] = v_select(v_select(weight[p][corner], v_splat(0.0f), lost),
                                             v_splat(1.0f), chosen);
                left = left & ~chosen;
            }
        }
    }
    for (int c = 0; c < UPSAMPLE_COUNT; ++c) {
        vfloat value[4], sum[UPSAMPLE_STEP];
#pragma unroll
        for (int corner = 0; corner < 4; ++corner) {
            value[corner] = ssgi_load(coarse, small, c, x + (corner & 1),
                                      min(row + (corner >> 1), small.y - 1));
        }
#pragma unroll
        for (int p = 0; p < UPSAMPLE_STEP; ++p) {
            sum[p] = v_splat(0.0f);
#pragma unroll
            for (int corner = 0; corner < 4; ++corner) {
                sum[p] = v_fma(weight[p][corner], value[corner], sum[p]);
            }
            sum[p] = v_select(v_splat(params.background), sum[p] / total[p],
                              v_lt(own[p], v_splat(INFINITY)));
        }
        ssgi_store_phases(sum, fine, size, c, x * step, y, 0.0f);
    }
}
