// SPDX-License-Identifier: MIT
// rsm_gather_same: light gathered from samples that are the same for all pixels.
//
// Method:  Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", equation 1, each sample a
//          disc, see receiver.clh: E = sum over samples of flux cos cos / (pi d^2 + area).
// Reads:   depth, normal  the pixels, with margin; view space
//          list     with RSM_GATHER_LISTED: a count and so many pixels, see receiver.clh
//          samples  params.samples records, see records.clh
//          fractions   with RSM_GATHER_LISTED: [rows, columns] what of the light counts
// Writes:  irradiance  3 x [rows, columns] W/m^2; 0 where nothing is. With params.add the light is
//                      added to what is there; with RSM_GATHER_LISTED that share of it is added, at
//                      the listed pixels alone
// Macros:  RSM_GATHER_LISTED (0, 1)
// Launch:  SSGI_LANES pixels of a row per work-item; or any number of work-items for the list
// Cost:    21 operations and a division per pixel and sample

#include "rsm/receiver.clh"

#ifndef RSM_GATHER_LISTED
#error "RSM_GATHER_LISTED must be defined by the host"
#endif

__kernel void rsm_gather_same(ssgi_plane depth, ssgi_plane normal,
#if RSM_GATHER_LISTED
                              __global const int *restrict list,
#endif
                              __global const float *restrict samples,
#if RSM_GATHER_LISTED
                              ssgi_plane fractions,
#endif
                              __global float *restrict irradiance,
                              const int2 size, // of the result
                              const SsgiCamera camera, const RsmGatherParams params)
{
    for (int start = RSM_FIRST; start < RSM_END(size); start += RSM_STRIDE) {
        const RsmReceiver r = rsm_receiver(depth, normal, RSM_LIST start, size, camera, params);
        if (!v_any(r.there)) {
            rsm_write(rsm_nothing(), r, start, size, RSM_FRACTIONS irradiance, params);
            continue;
        }
        RsmSum sum = rsm_nothing();
        for (int first = 0; first < params.samples; first += RSM_RUN) {
            const int end = min(first + RSM_RUN, params.samples);
            RsmSum run = rsm_nothing();
            for (int i = first; i < end; ++i) {
                __global const float *s = samples + i * RSM_RECORD;
                if (s[RSM_POWER] == 0.0f) {
                    continue;
                }
                const vfloat f = rsm_form_factor(r, v_splat(s[RSM_AT]), v_splat(s[RSM_AT + 1]),
                                                 v_splat(s[RSM_AT + 2]), v_splat(s[RSM_AREA]),
                                                 v_splat(s[RSM_NORMAL]), v_splat(s[RSM_NORMAL + 1]),
                                                 v_splat(s[RSM_NORMAL + 2]));
                run.red = v_fma(f, v_splat(s[RSM_FLUX]), run.red);
                run.green = v_fma(f, v_splat(s[RSM_FLUX + 1]), run.green);
                run.blue = v_fma(f, v_splat(s[RSM_FLUX + 2]), run.blue);
            }
            rsm_add(&sum, run);
        }
        rsm_write(sum, r, start, size, RSM_FRACTIONS irradiance, params);
    }
}
