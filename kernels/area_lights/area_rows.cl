// SPDX-License-Identifier: MIT
// area_rows: means of what shadow rays found along rows, and how far penumbrae are to be blurred.
//
// Method:  means over pixels of the same surface within a part of the penumbra's width, which is
//          that of the emitter times the ratio of the distances to blocker and emitter (Fernando
//          2005, "Percentage-Closer Soft Shadows"). Columns of them are for area_filter.cl.
// Reads:   depth, normal  with margin; normal in view space
//          sampled, cells  see area_lights.cl
// Writes:  means    2 AREA_CHANNELS + 1 x [rows, columns]: of what arrives, of what would, and the
//                   radius that they are taken from in scene units, 0 where there is no penumbra;
//                   only where area_filter reads it
// Macros:  AREA_CHANNELS (1 or 3), AREA_REACH (1..16) pixels
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    in penumbrae 2 AREA_REACH + 1 samples of 30 operations at most

#include "area_lights/area_blur.clh"

#define AREA_PART 0.5f // of a penumbra's width: the radius that samples are taken from
// Pixels between those, two to either side, where blockers are looked for: as far as samples reach.
#define AREA_STRIDE ((AREA_REACH + 1) / 2)
#define AREA_LOOK (2 * AREA_STRIDE)

__kernel void area_rows(ssgi_plane depth, ssgi_plane normal, ssgi_plane sampled,
                        __global const int *restrict cells, __global float *restrict means,
                        const int2 size, const SsgiCamera camera, const AreaParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    // Columns reach as far as rows.
    if (x >= size.x || y >= size.y || area_around(cells, size, x, y, AREA_REACH) != 3) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    vfloat width = zero, count = zero;
    for (int dy = max(-AREA_LOOK, -y); dy <= min(AREA_LOOK, size.y - 1 - y); dy += AREA_STRIDE) {
        for (int dx = -AREA_LOOK; dx <= AREA_LOOK; dx += AREA_STRIDE) {
            width = width + ssgi_load(sampled, size, 2 * AREA_CHANNELS, x + dx, y + dy);
            count = count + ssgi_load(sampled, size, 2 * AREA_CHANNELS + 1, x + dx, y + dy);
        }
    }
    const AreaPixels p = area_pixels(depth, normal, size, camera, params, x, y);
    const vfloat most = p.pixel * ((float)AREA_REACH + 0.5f);
    const vfloat blur = v_min(v_max(width / v_max(count, one) * AREA_PART, p.pixel * 0.5f), most);
    const vfloat radius = v_select(zero, blur, v_gt(count, zero));
    vfloat sum[2 * AREA_CHANNELS];
#pragma unroll
    for (int j = 0; j < 2 * AREA_CHANNELS; ++j) {
        sum[j] = ssgi_load(sampled, size, j, x, y);
    }
    // Means, so that pixels with a small radius count as much as others of their columns.
    const vfloat share = one / area_sum(depth, normal, sampled, camera, p, radius, 0, sum);
#pragma unroll
    for (int j = 0; j < 2 * AREA_CHANNELS; ++j) {
        ssgi_store(sum[j] * share, means, size, j, x, y, 0.0f);
    }
    ssgi_store(radius, means, size, 2 * AREA_CHANNELS, x, y, 0.0f);
}
