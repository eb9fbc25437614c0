// SPDX-License-Identifier: MIT
// probe_gather: a small occlusion-like scan, by which the host times the builds that a device
// takes.
//
// Reads:   depth  a plane of positive depths, scene units
// Writes:  result [rows, columns] a sum without meaning
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    16 scattered depth reads per pixel, about 30 operations each, as in an occlusion kernel

#include "common/gbuffer.clh"

__kernel void probe_gather(ssgi_plane depth, __global float *restrict result, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat own = ssgi_load(depth, size, 0, x, y);
    const vfloat column = v_to_float(v_iota() + x);
    vfloat sum = v_splat(0.0f);
    for (int i = 1; i <= 16; ++i) {
        const vfloat reach = (float)i * (1.0f + own);
        const vint tap_x = v_imin(v_to_int(column + reach), v_splat_int(size.x - 1));
        const vint tap_y = v_imax(v_to_int((float)y - reach), v_splat_int(0));
        const vfloat tap = ssgi_gather(depth, size, 0, tap_x, tap_y);
        const vfloat rise = (own - tap) * v_rsqrt(v_fma(reach, reach, v_splat(1.0f)));
        const vfloat weight = v_exp2_weight(-reach) * v_fma(rise, rise, v_splat(1.0f));
        sum = sum + v_select(v_splat(0.0f), weight, v_gt(rise, v_splat(0.0f)));
    }
    ssgi_store(sum, result, size, 0, x, y, 0.0f);
}
