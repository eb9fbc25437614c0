// SPDX-License-Identifier: MIT
// tonemap: linear radiance to sRGB-encoded values from 0 to 255.
//
// Method:  exposure, then a filmic curve (Narkowicz 2015, a fit of the ACES reference transform:
//          x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14)) or none, then IEC 61966-2-1.
// Reads:   radiance  3 x [rows, columns] linear, >= 0
// Writes:  encoded   3 x [rows, columns] in [0, 255]
// Macros:  TONEMAP_CURVE (0 clip at 1, 1 filmic)
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"

#ifndef TONEMAP_CURVE
#error "TONEMAP_CURVE must be defined by the host"
#endif

__kernel void tonemap(ssgi_plane radiance, __global float *restrict encoded, const int2 size,
                      const float exposure)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int c = 0; c < 3; ++c) {
        vfloat v = v_clamp(ssgi_load(radiance, size, c, x, y) * exposure, 0.0f, 1e6f);
#if TONEMAP_CURVE
        v = v * (2.51f * v + 0.03f) / (v * (2.43f * v + 0.59f) + 0.14f);
#endif
        v = v_min(v, v_splat(1.0f));
        const vfloat high = v_fma(v_pow(v, v_splat(1.0f / 2.4f)), v_splat(1.055f),
                                  v_splat(-0.055f));
        const vfloat s = v_select(high, v * 12.92f, v_le(v, v_splat(0.0031308f)));
        ssgi_store(s * 255.0f, encoded, size, c, x, y, 0.0f);
    }
}
