// SPDX-License-Identifier: MIT
// reflect_add: mean of the light within the lobes of 5 x 5 pixels, REFLECT_STRIDE apart; with
// REFLECT_LAST the part that the lobe reflects is added to radiance.
//
// Pixels at the sides count half and those at the corners a quarter, so that each of the 16 x 16
// sets of rays counts alike; those of other surfaces do not count. A second pass takes means of
// means further apart (Dammertz et al. 2010, "Edge-avoiding a-trous wavelet transform"), but of
// sharp lobes.
//
// Reads:   linear, normal, albedo, specular, gloss  with margin
//          reflected 3 x [rows, columns] W m^-2 sr^-1, see reflect_trace
// Writes:  radiance  3 x [rows, columns] W m^-2 sr^-1: added to (REFLECT_LAST 1), or the mean
// Macros:  REFLECT_STRIDE (pixels from one to the next), REFLECT_LAST (0, 1)
// Params:  margin
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/surface.clh"
#include "reflections/pattern.clh"

// The struct ReflectParams is generated from ssgi_cl.techniques.reflections.reflections.

#if !defined(REFLECT_STRIDE) || !defined(REFLECT_LAST)
#error "REFLECT_STRIDE and REFLECT_LAST must be defined by the host"
#endif

#define REFLECT_WIDE 2
#define REFLECT_OFF_PLANE 50.0f // depth over the least distance from the tangent plane left out
#define REFLECT_TURNED 20.0f    // likewise 1 / (1 - cosine of normals)
#define REFLECT_GLOSS 0.02f     // difference of gloss up to which surfaces are the same

__kernel void reflect_add(ssgi_plane linear, ssgi_plane normal, ssgi_plane albedo,
                          ssgi_plane specular, ssgi_plane gloss, ssgi_plane reflected,
                          __global float *restrict radiance, const int2 size,
                          const SsgiCamera camera, const ReflectParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat u = ssgi_load(linear, whole, 0, at_x, at_y);
    const SsgiLobe lobe = ssgi_lobe(albedo, specular, gloss, whole, at_x, at_y);
    const vmask there = lobe.there & v_lt(u, v_splat(INFINITY));
    if (!v_any(there)) {
#if !REFLECT_LAST
        for (int c = 0; c < 3; ++c) {
            ssgi_store(zero, radiance, size, c, x, y, 0.0f);
        }
#endif
        return;
    }
    const vfloat known = v_select(v_splat(1.0f), u, there);
    const SsgiFit fit = ssgi_fit_of(
        camera, v_to_float(v_iota() + at_x) + 0.5f, v_splat((float)at_y + 0.5f), known,
        ssgi_load(normal, whole, 0, at_x, at_y), ssgi_load(normal, whole, 1, at_x, at_y),
        ssgi_load(normal, whole, 2, at_x, at_y), REFLECT_OFF_PLANE, REFLECT_TURNED);
    vfloat sum[3] = {zero, zero, zero}, weights = zero;
    const vmask broad =
        v_lt(lobe.gloss, v_splat(REFLECT_STRIDE == 1 ? params.perfect : REFLECT_SHARP));
    for (int dy = -REFLECT_WIDE; dy <= REFLECT_WIDE; ++dy) {
        const int row = at_y + dy * REFLECT_STRIDE;
        if (row < params.margin_rows || row >= params.margin_rows + size.y) {
            continue;
        }
        for (int dx = -REFLECT_WIDE; dx <= REFLECT_WIDE; ++dx) {
            const int to_x = at_x + dx * REFLECT_STRIDE;
            const vint column = v_iota() + to_x;
            const vmask inside = v_within(column - params.margin_columns, size.x);
            const vfloat other = ssgi_load(linear, whole, 0, to_x, row);
            const vfloat off =
                v_fma(fit.off_x, v_splat((float)(dx * REFLECT_STRIDE)),
                      v_fma(fit.off_y, v_splat((float)(dy * REFLECT_STRIDE)), fit.off));
            const vfloat close = ssgi_fit(fit, off, other, ssgi_load(normal, whole, 0, to_x, row),
                                          ssgi_load(normal, whole, 1, to_x, row),
                                          ssgi_load(normal, whole, 2, to_x, row));
            const vfloat sharp = ssgi_load(gloss, whole, 0, to_x, row);
            const vmask alike =
                inside & broad & v_lt(v_abs(sharp - lobe.gloss), lobe.gloss * REFLECT_GLOSS);
            const float share =
                (abs(dx) == REFLECT_WIDE ? 0.5f : 1.0f) * (abs(dy) == REFLECT_WIDE ? 0.5f : 1.0f);
            // Itself counts whatever rounding makes of it.
            const vfloat weight = dx == 0 && dy == 0
                                      ? v_splat(1.0f)
                                      : v_select(zero, v_max(close, zero) * share, alike);
            for (int c = 0; c < 3; ++c) {
                const vfloat found = ssgi_load(reflected, size, c, to_x - params.margin_columns,
                                               row - params.margin_rows);
                sum[c] = sum[c] + v_select(zero, found * weight, v_gt(weight, zero));
            }
            weights = weights + weight;
        }
    }
    const vfloat scale = 1.0f / v_max(weights, v_splat(1e-6f));
    for (int c = 0; c < 3; ++c) {
#if REFLECT_LAST
        const vfloat before = v_load(radiance + ssgi_index(size, c, x, y));
        const vfloat added = v_select(zero, sum[c] * scale * lobe.specular[c], there);
        ssgi_store(before + added, radiance, size, c, x, y, 0.0f);
#else
        ssgi_store(v_select(zero, sum[c] * scale, there), radiance, size, c, x, y, 0.0f);
#endif
    }
}
