// SPDX-License-Identifier: MIT
// multires_gradient: first and second differences of a level's values along their surface.
//
// Reads:   linear  [rows, columns], normal 3 x likewise, view space
//          values  MULTIRES_CHANNELS x likewise
//          bound   [1] see multires_interpolate
// Writes:  gradient  2 x [rows, columns], largest in any channel: the difference to a neighbour,
//                    MULTIRES_UNKNOWN if none fits in the row or none in the column; the second
//                    difference along row or column, -1 unless all four neighbours fit (at the
//                    image's border the two along it). Where no neighbour differs by more than the
//                    bound, fit or not, that difference and -1, as it is enough to know
// Macros:  MULTIRES_CHANNELS (1 to 16)
// Params:  scale: of the bound; depth_scale, normal_scale: see common/surface.clh
// Launch:  SSGI_LANES points of a row per work-item
// Cost:    5 x 7 reads and 2 writes per point of 3 channels

#include "multires/points.clh"

#ifndef MULTIRES_CHANNELS
#error "MULTIRES_CHANNELS must be defined by the host"
#endif

typedef struct {
    vfloat slope;             // MULTIRES_UNKNOWN: neither neighbour fits
    vfloat second_difference; // -1: not both fit; 0 where the line ends
} MultiresChange;

// Along the line of `before`, `p` and `after`, which ends at p where `ends` is.
MULTIRES_INLINE MultiresChange multires_change(const MultiresPoint *before, const MultiresPoint *p,
                                               const MultiresPoint *after, const vfloat weight,
                                               const vfloat weight_after, const vmask ends)
{
    const vfloat zero = v_splat(0.0f);
    const vmask fits = v_gt(weight, zero);
    const vmask fits_after = v_gt(weight_after, zero);
    vfloat second_difference = zero;
#pragma unroll
    for (int i = 0; i < MULTIRES_CHANNELS; ++i) {
        const vfloat both = before->value[i] + after->value[i];
        second_difference =
            v_max(second_difference, v_abs(v_fma(p->value[i], v_splat(-2.0f), both)));
    }
    const vfloat slope = v_max(v_select(zero, multires_apart(before, p), fits),
                               v_select(zero, multires_apart(p, after), fits_after));
    MultiresChange change;
    change.slope = v_select(v_splat(MULTIRES_UNKNOWN), slope, fits | fits_after);
    change.second_difference =
        v_select(v_select(v_splat(-1.0f), zero, ends), second_difference, fits & fits_after);
    return change;
}

__kernel void multires_gradient(ssgi_plane linear, ssgi_plane normal, ssgi_plane values,
                                __global const float *restrict bound,
                                __global float *restrict gradient, const int2 size,
                                const SsgiCamera camera, const MultiresParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int beside[5][2] = {{0, 0}, {-1, 0}, {1, 0}, {0, -1}, {0, 1}}; // columns and rows away
    MultiresPoint points[5];
#pragma unroll
    for (int i = 0; i < 5; ++i) {
        multires_values(values, size, x + beside[i][0], y + beside[i][1], &points[i]);
    }
    const MultiresPoint *p = &points[0];
    vfloat spread = v_splat(0.0f);
#pragma unroll
    for (int i = 1; i < 5; ++i) {
        spread = v_max(spread, multires_apart(p, &points[i]));
    }
    const vmask even = v_le(spread, v_splat(bound[0] * params.scale));
    if (v_all(even)) {
        ssgi_store(spread, gradient, size, 0, x, y, 0.0f);
        ssgi_store(v_splat(-1.0f), gradient, size, 1, x, y, 0.0f);
        return;
    }
#pragma unroll
    for (int i = 0; i < 5; ++i) {
        multires_surface(linear, normal, size, x + beside[i][0], y + beside[i][1], &points[i]);
    }
    const vmask there = v_lt(p->u, v_splat(INFINITY));
    const SsgiFit fit = ssgi_fit_of(camera, v_to_float(v_iota() + x) + 0.5f,
                                    v_splat((float)y + 0.5f), v_select(v_splat(1.0f), p->u, there),
                                    p->nx, p->ny, p->nz, params.depth_scale, params.normal_scale);
    vfloat weight[5];
#pragma unroll
    for (int i = 1; i < 5; ++i) {
        weight[i] = multires_weight(fit, &points[i], (float)beside[i][0], (float)beside[i][1]);
    }
    const vint column = v_iota() + x;
    const vmask ends = v_ieq(column, v_splat_int(0)) | v_ieq(column, v_splat_int(size.x - 1));
    const vmask ends_down = v_splat_int(y == 0 || y == size.y - 1 ? -1 : 0);
    const MultiresChange right =
        multires_change(&points[1], p, &points[2], weight[1], weight[2], ends);
    const MultiresChange down =
        multires_change(&points[3], p, &points[4], weight[3], weight[4], ends_down);
    ssgi_store(v_select(v_max(right.slope, down.slope), spread, even), gradient, size, 0, x, y,
               0.0f);
    const vmask known =
        v_ge(v_min(right.second_difference, down.second_difference), v_splat(0.0f)) &
        ~(ends & ends_down) & ~even;
    ssgi_store(
        v_select(v_splat(-1.0f), v_max(right.second_difference, down.second_difference), known),
        gradient, size, 1, x, y, 0.0f);
}
