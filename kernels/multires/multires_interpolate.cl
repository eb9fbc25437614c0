// SPDX-License-Identifier: MIT
// multires_interpolate: values at a level's points from the next coarser level's, where possible.
//
// Method:  Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination": few
//          points where a result is smooth, many where it is not.
// Departs: points are nested and each is decided for by itself, from the error that
//          interpolation would make there, so that cells need no balance and have no seams.
//          Neighbours count as they fit the point's surface (common/surface.clh). Where the error
//          is near the bound, some of each: else a point that passes it would jump by that error.
// Reads:   coarse_linear  [coarse rows, columns], coarse_normal 3 x likewise, view space
//          coarse_values  MULTIRES_CHANNELS x likewise
//          coarse_gradient   2 x likewise, as multires_gradient writes it
//          linear         [rows, columns] with margin, normal 3 x likewise
//          bound          [1] error that values stay below, in their unit; INFINITY: geometry
//                         decides
// Writes:  values  MULTIRES_CHANNELS x [rows, columns] 1 - share of what is interpolated, 0 where
//                  nothing is
//          fractions  [rows, columns] of what is computed, 0 to 1; only next to points on the list
//          masks   of tiles, see multires/list.clh
// Macros:  MULTIRES_CHANNELS (1 to 16)
// Params:  scale: of the bound at this level; margin_columns, margin_rows of linear and normal;
//          depth_scale, normal_scale: see common/surface.clh
//          begins, ends: of the bound, errors at which a point begins to be computed, and at which
//          nothing else counts
//          no_second_difference: of the largest difference between corners, the error where no
//          second difference is known; beyond: of half the slope beyond those that fit, where
//          others don't. Measured in the hall and the Cornell box: each kind of point then errs as
//          much at an equal estimate
// Launch:  SSGI_LANES points of a coarse row, and thus two rows of points, per work-item; with one
//          lane a point per work-item, in work-groups of MULTIRES_TILE columns
// Cost:    7 reads and 3 writes per point of 3 channels

#define UPSAMPLE_STEP 2
#include "multires/list.clh"
#include "multires/points.clh"
#include "filters/phases.clh"

#ifndef MULTIRES_CHANNELS
#error "MULTIRES_CHANNELS must be defined by the host"
#endif

#define MULTIRES_NO_BOUND 1e35f // more than any error, so that none is over it

#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

// Values at the points `odd` columns and `odd_row` rows from the first of four corners, of which
// `own` is 1 / depth and normal; every second one from (column, row) on in the camera's pixels.
// The first corner is (x, y) of `gradient`, and `range` the largest difference to it. Returns which
// share of the value is to be computed, which grows from 0 at an error of `begins` on by `rate`;
// the rest is in `result`.
MULTIRES_INLINE vfloat multires_phase(const MultiresPoint corner[4], const vfloat range,
                                      ssgi_plane gradient, const int2 coarse, const int x,
                                      const int y, const int odd, const int odd_row,
                                      const vfloat own[4], const int column, const int row,
                                      const float begins, const float rate, const SsgiCamera camera,
                                      const MultiresParams params, vfloat *result)
{
    const vfloat zero = v_splat(0.0f);
    const vmask there = v_lt(own[0], v_splat(INFINITY));
    const SsgiFit fit =
        ssgi_fit_of(camera, v_to_float(v_iota() * 2 + column) + 0.5f, v_splat((float)row + 0.5f),
                    v_select(v_splat(1.0f), own[0], there), own[1], own[2], own[3],
                    params.depth_scale, params.normal_scale);
    const int lines = odd + odd_row; // on which corners lie on both sides of the point
    vfloat mean[MULTIRES_CHANNELS];
    vfloat weight[4];
    vfloat sum = zero;
    vfloat least = v_splat(INFINITY);
#pragma unroll
    for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
        mean[i] = zero;
    }
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const int c = i & 1;
        const int r = i >> 1;
        if (c > odd || r > odd_row) {
            continue;
        }
        weight[i] =
            multires_weight(fit, &corner[i], (float)(2 * c - odd), (float)(2 * r - odd_row));
        sum = sum + weight[i];
        least = v_min(least, weight[i]);
#pragma unroll
        for (int j = 0; j < MULTIRES_CHANNELS; ++j) {
            mean[j] = v_fma(corner[i].value[j], weight[i], mean[j]);
        }
    }
    const vfloat inverse = 1.0f / v_max(sum, v_splat(MULTIRES_LEAST));
    // Corners that count for less than others move the value towards those, by half of the way.
    const vfloat weight_imbalance = 1.0f - least * inverse * (float)(1 << lines);
    const vmask all = v_gt(least, zero);
    const vmask known = v_gt(sum, v_splat(MULTIRES_LEAST));
    vfloat share = zero;
    // Nothing more needs to be known where even a tilted line between the corners would do.
    const vfloat tilted = v_fma(weight_imbalance, v_splat(0.5f), v_splat(0.25f)) * range;
    if (v_any(there & ~(known & all & v_lt(tilted, v_splat(begins))))) {
        vfloat slope = zero;
        vfloat second_difference = v_splat(-1.0f);
#pragma unroll
        for (int i = 0; i < 4; ++i) {
            const int c = i & 1;
            const int r = i >> 1;
            if (c > odd || r > odd_row) {
                continue;
            }
            const int near = min(y + r, coarse.y - 1);
            const vmask fits = v_gt(weight[i], zero);
            slope = v_max(slope, v_select(zero, ssgi_load(gradient, coarse, 0, x + c, near), fits));
            second_difference =
                v_max(second_difference,
                      v_select(v_splat(-1.0f), ssgi_load(gradient, coarse, 1, x + c, near), fits));
        }
        // Of the straight line between two points, of each line: an eighth of the second difference
        // between neighbours twice as close, thus a sixteenth of theirs where both have the same.
        const vfloat curved = v_min(second_difference * (0.0625f * (float)lines), range * 0.5f);
        const vfloat straight =
            v_select(range * params.no_second_difference, curved, v_ge(second_difference, zero));
        const vfloat error =
            v_fma(weight_imbalance * 0.5f, v_select(slope * params.beyond, range, all),
                  v_select(zero, straight, all));
        const vfloat over = (v_select(error, v_min(error, tilted), all) - begins) * rate;
        share = v_select(v_splat(1.0f), v_min(v_max(over, zero), v_splat(1.0f)), known);
        share = v_select(zero, share, there);
    }
    const vfloat rest = v_select(zero, inverse * (1.0f - share), there);
#pragma unroll
    for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
        result[i] = mean[i] * rest;
    }
    return share;
}

__kernel void multires_interpolate(ssgi_plane coarse_linear, ssgi_plane coarse_normal,
                                   ssgi_plane coarse_values, ssgi_plane coarse_gradient,
                                   ssgi_plane linear, ssgi_plane normal,
                                   __global const float *restrict bound,
                                   __global float *restrict values,
                                   __global float *restrict fractions, __global int *restrict masks,
                                   const int2 size, const int2 coarse, const SsgiCamera camera,
                                   const MultiresParams params)
{
    // With a bound of 0 an error of 0 is above it too.
    const float most = min(bound[0], MULTIRES_NO_BOUND) * params.scale;
    const float begins = most > 0.0f ? most * params.begins : -1.0f;
    const float rate = 1.0f / max(most * (params.ends - params.begins), FLT_MIN);
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
#if SSGI_LANES == 1
    __local int marks[SSGI_GROUP]; // of the work-items
    const int x = (int)get_global_id(0), y = (int)get_global_id(1);
    const int item = (int)(get_local_id(1) * get_local_size(0) + get_local_id(0));
    float share = 0.0f;
    if (x < size.x && y < size.y) {
        const int odd = x & 1, odd_row = y & 1;
        MultiresPoint corner[4];
        float range = 0.0f; // of those that count
        float result[MULTIRES_CHANNELS];
        multires_values(coarse_values, coarse, x >> 1, y >> 1, &corner[0]);
#pragma unroll
        for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
            result[i] = corner[0].value[i];
        }
        if (odd + odd_row > 0) {
            multires_surface(coarse_linear, coarse_normal, coarse, x >> 1, y >> 1, &corner[0]);
#pragma unroll
            for (int i = 1; i < 4; ++i) {
                if ((i & 1) > odd || i >> 1 > odd_row) {
                    continue;
                }
                const int at_x = (x >> 1) + (i & 1), at_y = (y >> 1) + (i >> 1);
                multires_surface(coarse_linear, coarse_normal, coarse, at_x, at_y, &corner[i]);
                multires_values(coarse_values, coarse, at_x, at_y, &corner[i]);
                range = v_max(range, multires_apart(&corner[i], &corner[0]));
            }
            const int left = x + params.margin_columns, top = y + params.margin_rows;
            float own[4];
#pragma unroll
            for (int i = 0; i < 4; ++i) {
                own[i] = i == 0 ? ssgi_load(linear, whole, 0, left, top)
                                : ssgi_load(normal, whole, i - 1, left, top);
            }
            share = multires_phase(corner, range, coarse_gradient, coarse, x >> 1, y >> 1, odd,
                                   odd_row, own, left, top, begins, rate, camera, params, result);
        }
#pragma unroll
        for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
            ssgi_store(result[i], values, size, i, x, y, 0.0f);
        }
        if (share > 0.0f) {
            ssgi_store(share, fractions, size, 0, x, y, 0.0f);
        }
    }
    marks[item] = share > 0.0f ? 1 << x % MULTIRES_TILE : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (x % MULTIRES_TILE == 0 && x < size.x && y < size.y) {
        int mask = 0;
        for (int i = 0; i < MULTIRES_TILE; ++i) {
            mask |= marks[item + i];
        }
        masks[multires_mask(size, x, y)] = mask;
    }
#else
    const int coarse_x = (int)get_global_id(0) * SSGI_LANES;
    const int coarse_y = (int)get_global_id(1);
    if (coarse_x >= coarse.x || coarse_y >= coarse.y) {
        return;
    }
    masks += multires_mask(size, 2 * coarse_x, 2 * coarse_y);
    MultiresPoint corner[4];
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const int x = coarse_x + (i & 1);
        const int y = coarse_y + (i >> 1);
        multires_surface(coarse_linear, coarse_normal, coarse, x, y, &corner[i]);
        multires_values(coarse_values, coarse, x, y, &corner[i]);
    }
    const vfloat right = multires_apart(&corner[1], &corner[0]);
    const vfloat below = multires_apart(&corner[2], &corner[0]);
    const vfloat all = v_max(v_max(right, below), multires_apart(&corner[3], &corner[0]));
    const int left = 2 * coarse_x + params.margin_columns;
#pragma unroll
    for (int odd_row = 0; odd_row < 2; ++odd_row) {
        const int y = 2 * coarse_y + odd_row;
        if (y >= size.y) {
            break;
        }
        const int top = y + params.margin_rows;
        vfloat own[2][4];
        vfloat result[2][MULTIRES_CHANNELS];
        vfloat share[2];
#pragma unroll
        for (int i = 0; i < 4; ++i) {
            vfloat phases[2];
            if (i == 0) {
                ssgi_load_phases(linear, whole, 0, left, top, phases);
            } else {
                ssgi_load_phases(normal, whole, i - 1, left, top, phases);
            }
            own[0][i] = phases[0];
            own[1][i] = phases[1];
        }
        if (odd_row) {
            share[0] =
                multires_phase(corner, below, coarse_gradient, coarse, coarse_x, coarse_y, 0,
                               odd_row, own[0], left, top, begins, rate, camera, params, result[0]);
        } else {
            share[0] = v_splat(0.0f);
#pragma unroll
            for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
                result[0][i] = corner[0].value[i];
            }
        }
        share[1] = multires_phase(corner, odd_row ? all : right, coarse_gradient, coarse, coarse_x,
                                  coarse_y, 1, odd_row, own[1], left + 1, top, begins, rate, camera,
                                  params, result[1]);
#pragma unroll
        for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
            const vfloat phases[2] = {result[0][i], result[1][i]};
            ssgi_store_phases(phases, values, size, i, 2 * coarse_x, y, 0.0f);
        }
        int mark[2] = {0, 0}; // of the row's one tile, or two
        if (v_any(v_gt(v_max(share[0], share[1]), v_splat(0.0f)))) {
            ssgi_store_phases(share, fractions, size, 0, 2 * coarse_x, y, 0.0f);
            vfloat row[2];
            ssgi_weave_phases(share, row);
#pragma unroll
            for (int p = 0; p < 2; ++p) {
                mark[p] = multires_marks(row[p], 2 * coarse_x + p * SSGI_LANES, size.x);
            }
        }
#if SSGI_LANES == 16
        masks[odd_row] = mark[0];
        if (2 * coarse_x + SSGI_LANES < size.x) {
            masks[MULTIRES_TILE + odd_row] = mark[1];
        }
#else
        masks[odd_row] = mark[0] | mark[1] << SSGI_LANES;
#endif
    }
#endif
}
