// SPDX-License-Identifier: MIT
// radiosity_first: irradiance of surfels by virtual point lights.
//
// Each 16 lights share a visibility ray, to the one before which a golden-ratio fraction of their
// flux lies: over all of them visibility is sampled in proportion to flux.
// Reads:   surfels    see surfel.clh
//          lights     [size.y rounded up to 16][SURFEL_RECORD] as in vpl/light.clh, in the space of
//                     the surfels; those past the last have no flux
//          occupancy, grid_box  see vpl/grid.clh
// Writes:  values     3 x [size.x], W/m^2: added to what is there
// Macros:  VPL_GRID
// Params:  lift       cells above their surface at which rays end
//          gain       W/m^2 of a flux and square length of 1
//          number     of the first 16 lights among all
// Launch:  SSGI_LANES surfels per work-item, one row
// Cost:    20 operations and a division per pair, and a ray for 16 of them

#include "common/gbuffer.clh"
#include "radiosity/surfel.clh"

#ifndef VPL_GRID
#error "VPL_GRID must be defined"
#endif

static inline float first_luminance(__global const float *restrict light)
{
    return fma(0.2126f, light[8], fma(0.7152f, light[9], fma(0.0722f, light[10], 1e-20f)));
}

__kernel void radiosity_first(__global const float *restrict surfels,
                              __global const float *restrict lights,
                              __global const int *restrict occupancy,
                              __global const float *restrict grid_box,
                              __global float *restrict values, const int2 size, const float lift,
                              const float gain, const int number)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const SurfelReceiver at = surfel_receivers(surfels, stride, first);
    const VplCell start = surfel_starts(surfels, stride, first);
    const vfloat zero = v_splat(0.0f);
    const float most = (float)VPL_GRID - 0.01f;
    vfloat sum[3] = {zero, zero, zero};
    for (int run = 0; run < (size.y + 15) / 16; ++run) {
        __global const float *restrict own = lights + run * 16 * SURFEL_RECORD;
        float flux = 0.0f;
        for (int i = 0; i < 16; ++i) {
            flux += first_luminance(own + i * SURFEL_RECORD);
        }
        vfloat part[3] = {zero, zero, zero};
        vmask lit = v_splat_int(0);
        for (int i = 0; i < 16; ++i) {
            __global const float *restrict light = own + i * SURFEL_RECORD;
            const vfloat w = surfel_weight(light, at);
            lit = lit | v_gt(w, zero);
            for (int j = 0; j < 3; ++j) {
                part[j] = v_fma(w, v_splat(light[8 + j]), part[j]);
            }
        }
        if (!v_any(lit)) {
            continue;
        }
        const float golden = ((float)(number + run) + 0.5f) * 0.618034f;
        float left = (golden - floor(golden)) * flux;
        int target = 0;
        while (target < 15 && left >= first_luminance(own + target * SURFEL_RECORD)) {
            left -= first_luminance(own + target * SURFEL_RECORD);
            ++target;
        }
        __global const float *restrict to = own + target * SURFEL_RECORD;
        VplCell end;
        end.nx = v_splat(-to[4]);
        end.ny = v_splat(-to[5]);
        end.nz = v_splat(-to[6]);
        end.x = v_splat(clamp(fma(-to[4], lift, (to[0] - grid_box[0]) * grid_box[3]), 0.0f, most));
        end.y = v_splat(clamp(fma(-to[5], lift, (to[1] - grid_box[1]) * grid_box[3]), 0.0f, most));
        end.z = v_splat(clamp(fma(-to[6], lift, (to[2] - grid_box[2]) * grid_box[3]), 0.0f, most));
        const vmask seen = lit & ~vpl_blocked(occupancy, start, end, lit);
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + v_select(zero, part[j], seen);
        }
    }
    for (int j = 0; j < 3; ++j) {
        __global float *restrict value = values + j * stride + first;
        v_store(v_fma(sum[j], v_splat(gain), v_load(value)), value);
    }
}
