// SPDX-License-Identifier: MIT
// radiosity_gather: light that surfels receive from one another, and send on.
//
// Method:  E_i = (1 - s_i) sum_j V_ij F_ij M_j / sum_j V_ij F_ij,
//          F_ij = A_j cos cos / (pi d^2 + A_j)
//          with the open part s_i of the hemisphere: form factors to all that a surfel sees sum to
//          what is not sky, however coarse the surfels are, so that no light is lost in corners.
//          M = M_e + albedo (E + E_source).
// Reads:   surfels   see surfel.clh
//          before    [size.x][SURFEL_RECORD] of which 8 to 10 are the flux A M sent so far
//          visible   see radiosity_visibility
//          sky       3 x [size.x] of which the fourth; see radiosity_sky
//          source    3 x [size.x] irradiance by anything but surfels
// Writes:  after     as `before`
//          received  3 x [size.x] E + E_source
// Macros:  OCCUPANCY_CELLS
// Params:  most      the factor by which a row of form factors is raised, at most
// Launch:  SSGI_LANES surfels per work-item, one row
// Cost:    24 operations and a division per pair that faces and sees each other

#include "common/gbuffer.clh"
#include "radiosity/surfel.clh"

__kernel void
radiosity_gather(__global const float *restrict surfels, __global const float *restrict before,
                 __global const int *restrict visible, __global const float *restrict sky,
                 __global const float *restrict source, __global float *restrict after,
                 __global float *restrict received, const int2 size, const float most)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfelReceiver at = surfel_receivers(surfels, stride, first);
    const vfloat zero = v_splat(0.0f);
    vfloat sum[4] = {zero, zero, zero, zero};
    for (int word = 0; word < size.y; ++word) {
        const vint bits = v_iload(visible + word * stride + first);
        if (!v_any(v_ine(bits, v_splat_int(0)))) {
            continue;
        }
        vfloat part[4] = {zero, zero, zero, zero};
        for (int n = 0; n < 32; ++n) {
            const vmask seen = v_ine(bits & v_splat_int((int)(1u << n)), v_splat_int(0));
            if (!v_any(seen)) {
                continue;
            }
            __global const float *restrict sender = before + (word * 32 + n) * SURFEL_RECORD;
            const vfloat w = v_select(zero, surfel_weight(sender, at), seen);
            for (int j = 0; j < 3; ++j) {
                part[j] = v_fma(w, v_splat(sender[8 + j]), part[j]);
            }
            part[3] = v_fma(w, v_splat(sender[3]), part[3]);
        }
        for (int j = 0; j < 4; ++j) {
            sum[j] = sum[j] + part[j];
        }
    }
    const vfloat covered = v_splat(1.0f) - v_load(sky + 3 * stride + first);
    const vfloat scale = v_min(covered / v_max(sum[3], v_splat(1e-20f)), v_splat(most));
    const vfloat area = v_load(surfels + SURFEL_AREA * stride + first);
    const vint at_record = (v_iota() + first) * SURFEL_RECORD;
    for (int j = 0; j < 3; ++j) {
        const vfloat e = v_fma(sum[j], scale, v_load(source + j * stride + first));
        const vfloat albedo = v_load(surfels + (SURFEL_ALBEDO + j) * stride + first);
        const vfloat own = v_load(surfels + (SURFEL_EMISSION + j) * stride + first);
        v_store(e, received + j * stride + first);
        v_scatter(area * v_fma(albedo, e, own), after + 8 + j, at_record);
    }
}
