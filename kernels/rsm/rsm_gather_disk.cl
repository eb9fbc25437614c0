// SPDX-License-Identifier: MIT
// rsm_gather_disk: light gathered from texels round where each pixel lies in the map.
//
// Method:  Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", section 4.1: samples in a
//          disk round the pixel's place, denser in the middle, weighted by what they lack there.
// Departs: point lights have a cap of the sphere of directions in place of a disk, so that no face
//          of the map ends it; pixels that the light does not see have a place too, see place.clh.
//          With RSM_GATHER_POINTS 0 each texel is a disc, see receiver.clh; with 1 it is a point,
//          as published (equation 1), moved along minus its normal against the singularity in
//          corners.
// Reads:   depth, normal  the pixels, with margin; view space
//          list     with RSM_GATHER_LISTED: a count and so many pixels, see receiver.clh
//          texels   records, see records.clh
//          pattern  [samples][4] place x, y in the unit disk and the area there that the sample
//                   stands for, or direction x, y, z round +z and the solid angle
//          turns    [4 rows][cosines, sines][4 columns] of the angle by which pixels of a tile turn
//                   the pattern; read with RSM_GATHER_ROTATED
//          fractions   with RSM_GATHER_LISTED: [rows, columns] what of the light counts
// Writes:  irradiance  3 x [rows, columns] W/m^2; 0 where nothing is. With params.add the light is
//                      added to what is there; with RSM_GATHER_LISTED that share of it is added, at
//                      the listed pixels alone
// Macros:  RSM_GATHER_LISTED, RSM_GATHER_ROTATED, RSM_GATHER_SPHERE, RSM_GATHER_POINTS (0, 1)
// Launch:  SSGI_LANES pixels of a row per work-item; or any number of work-items for the list
// Cost:    10 scattered reads per pixel and sample

#include "rsm/place.clh"

#if !defined(RSM_GATHER_LISTED) || !defined(RSM_GATHER_ROTATED) || !defined(RSM_GATHER_SPHERE) ||  \
    !defined(RSM_GATHER_POINTS)
#error "RSM_GATHER_LISTED, _ROTATED, _SPHERE and _POINTS must be defined by the host"
#endif

__kernel void rsm_gather_disk(ssgi_plane depth, ssgi_plane normal,
#if RSM_GATHER_LISTED
                              __global const int *restrict list,
#endif
                              __global const float *restrict texels,
                              __global const float *restrict pattern,
#if RSM_GATHER_ROTATED
                              __global const float *restrict turns,
#endif
#if RSM_GATHER_LISTED
                              ssgi_plane fractions,
#endif
                              __global float *restrict irradiance,
                              const int2 size, // of the result
                              const SsgiCamera camera, const RsmGatherParams params,
                              const SsgiCamera map, const RsmMapParams light)
{
    for (int start = RSM_FIRST; start < RSM_END(size); start += RSM_STRIDE) {
        const RsmReceiver r = rsm_receiver(depth, normal, RSM_LIST start, size, camera, params);
        if (!v_any(r.there)) {
            rsm_write(rsm_nothing(), r, start, size, RSM_FRACTIONS irradiance, params);
            continue;
        }
        const RsmPlace place = rsm_place(r, map, light);
#if RSM_GATHER_ROTATED
        const vint turn = (r.row & 3) * 8 + (r.column & 3);
        const vfloat cosine = v_gather(turns, turn);
        const vfloat sine = v_gather(turns, turn + 4);
#endif
        RsmSum sum = rsm_nothing();
        for (int first = 0; first < params.samples; first += RSM_RUN) {
            const int end = min(first + RSM_RUN, params.samples);
            RsmSum run = rsm_nothing();
            for (int i = first; i < end; ++i) {
                __global const float *at = pattern + 4 * i;
#if RSM_GATHER_ROTATED
                const vfloat ux = v_fma(cosine, v_splat(at[0]), -(sine * at[1]));
                const vfloat uy = v_fma(sine, v_splat(at[0]), cosine * at[1]);
#else
                const vfloat ux = v_splat(at[0]);
                const vfloat uy = v_splat(at[1]);
#endif
                const RsmTexel texel = rsm_texel(place, ux, uy, at[2], at[3], map, light);
                const vint t = texel.index * RSM_RECORD;
                const vfloat own = v_gather(texels + RSM_AREA, t);
                const vfloat mx = v_gather(texels + RSM_NORMAL, t);
                const vfloat my = v_gather(texels + RSM_NORMAL + 1, t);
                const vfloat mz = v_gather(texels + RSM_NORMAL + 2, t);
                vfloat vx = v_gather(texels + RSM_AT, t);
                vfloat vy = v_gather(texels + RSM_AT + 1, t);
                vfloat vz = v_gather(texels + RSM_AT + 2, t);
#if RSM_GATHER_POINTS
                const vfloat area = v_splat(0.0f);
                const vfloat back = v_sqrt(own) * -light.offset;
                vx = v_fma(mx, back, vx);
                vy = v_fma(my, back, vy);
                vz = v_fma(mz, back, vz);
#else
                // A sample that stands for less than a texel is no smaller a disc than that.
                const vfloat area = own * v_max(texel.count, v_splat(1.0f));
#endif
                const vfloat f = rsm_form_factor(r, vx, vy, vz, area, mx, my, mz);
                const vfloat share = f * texel.count;
                run.red = v_fma(share, v_gather(texels + RSM_FLUX, t), run.red);
                run.green = v_fma(share, v_gather(texels + RSM_FLUX + 1, t), run.green);
                run.blue = v_fma(share, v_gather(texels + RSM_FLUX + 2, t), run.blue);
            }
            rsm_add(&sum, run);
        }
        rsm_write(sum, r, start, size, RSM_FRACTIONS irradiance, params);
    }
}
