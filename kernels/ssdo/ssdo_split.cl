// SPDX-License-Identifier: MIT
// ssdo_split: direct light and the bounce of each pixel, from the gathered images and punctual
// lights.
//
// direct = punctual_lights + sky + A times the light of constant environments; the bounce is
// copied. Reads:   depth     image 0, with margin; INFINITY where nothing is
//          gathered  A; from image SPLIT_FIRST on 3 of the sky's irradiance (SPLIT_SKY 1), 3 of the
//                    bounce's (SPLIT_BOUNCE 1), W/m^2
//          punctual_lights  3 images, W/m^2, with a margin of its own (SPLIT_LIGHTS 1)
// Writes:  direct, bounce  3 x [rows, columns] W/m^2; 0 where nothing is; bounce with
//          SPLIT_BOUNCE 1
// Macros:  SPLIT_GATHERED (whether there is `gathered`: else A is 1 and the bounce 0),
//          SPLIT_SKY, SPLIT_BOUNCE, SPLIT_LIGHTS: 0 or 1; SPLIT_FIRST (>= 1)
// Params:  irradiance of constant environments where A is 1; margins
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    memory: up to 11 planes read, 6 written

#include "common/gbuffer.clh"

#if !defined(SPLIT_GATHERED) || !defined(SPLIT_SKY) || !defined(SPLIT_BOUNCE) ||                   \
    !defined(SPLIT_LIGHTS) || !defined(SPLIT_FIRST)
#error "SPLIT_GATHERED, _SKY, _BOUNCE, _LIGHTS and _FIRST must be defined by the host"
#endif

__kernel void ssdo_split(ssgi_plane depth,
#if SPLIT_GATHERED
                         ssgi_plane gathered,
#endif
#if SPLIT_LIGHTS
                         ssgi_plane punctual_lights,
#endif
                         __global float *restrict direct,
                         ssgi_optional __global float *restrict bounce, const int2 size,
                         const SplitParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const vfloat zero = v_splat(0.0f);
    const vmask there =
        v_lt(ssgi_load(depth, whole, 0, x + params.margin_columns, y + params.margin_rows),
             v_splat(INFINITY));
#if SPLIT_GATHERED
    const vfloat a = ssgi_load(gathered, size, 0, x, y);
#else
    const vfloat a = v_splat(1.0f);
#endif
#if SPLIT_LIGHTS
    const int2 lights_size =
        (int2)(size.x + 2 * params.lights_columns, size.y + 2 * params.lights_rows);
#endif
    for (int c = 0; c < 3; ++c) {
        vfloat sum = a * (c == 0 ? params.red : c == 1 ? params.green : params.blue);
#if SPLIT_SKY
        sum = sum + ssgi_load(gathered, size, SPLIT_FIRST + c, x, y);
#endif
#if SPLIT_LIGHTS
        sum = sum + ssgi_load(punctual_lights, lights_size, c, x + params.lights_columns,
                              y + params.lights_rows);
#endif
        ssgi_store(v_select(zero, sum, there), direct, size, c, x, y, 0.0f);
#if SPLIT_BOUNCE
#if SPLIT_GATHERED
        const vfloat sent = ssgi_load(gathered, size, SPLIT_FIRST + 3 * SPLIT_SKY + c, x, y);
#else
        const vfloat sent = zero;
#endif
        ssgi_store(v_select(zero, sent, there), bounce, size, c, x, y, 0.0f);
#endif
    }
}
