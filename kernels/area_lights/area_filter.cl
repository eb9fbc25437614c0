// SPDX-License-Identifier: MIT
// area_filter: irradiance by emissive polygons, times the share of it that arrives.
//
// Method:  the share is what arrives along rays over what would (Heitz, Hill and McGuire 2018,
//          "Combining Analytic Direct Illumination and Stochastic Shadows"), both summed up over
//          pixels of the same surface within a part of the penumbra's width, which is that of the
//          emitter times the ratio of the distances to blocker and emitter (Fernando 2005,
//          "Percentage-Closer Soft Shadows"). Where all near rays agree the share is 0 or 1.
//          Means are taken along rows (AREA_ALONG 0), and of these sums along columns (AREA_ALONG
//          1).
// Reads:   depth, normal  with margin; normal in view space
//          sampled, cells  see area_lights.cl; with AREA_ALONG 1 `sampled` is `means`, or without a
//                   blur (AREA_REACH 0) as it was
//          light    3 x [rows, columns] W/m^2, with nothing in the way (AREA_ALONG 1)
//          direct   3 x [rows, columns] W/m^2 (AREA_ADDS 1)
// Writes:  means       2 AREA_CHANNELS + 1 x [rows, columns]: of what arrives, of what would, and
//                      the radius that they are taken from in scene units, 0 where there is no
//                      penumbra (AREA_ALONG 0)
//          irradiance  3 x [rows, columns] W/m^2, that of `direct` included (AREA_ALONG 1)
// Macros:  AREA_ALONG (0 or 1), AREA_CHANNELS (1 or 3), AREA_ADDS (0 or 1), AREA_REACH (0..16)
//          pixels
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    in penumbrae 2 AREA_REACH + 1 samples of 30 operations at most along either

#include "area_lights/area_cells.clh"
#include "common/camera.clh"
#include "common/gbuffer.clh"

#if !defined(AREA_ALONG) || !defined(AREA_CHANNELS) || !defined(AREA_ADDS) || !defined(AREA_REACH)
#error "AREA_ALONG, AREA_CHANNELS, AREA_ADDS and AREA_REACH must be defined by the host"
#endif

#define AREA_PART 0.5f // of a penumbra's width: the radius that samples are taken from
// Pixels between those, two to either side, where blockers are looked for: as far as samples reach.
#define AREA_STRIDE ((AREA_REACH + 1) / 2)
#define AREA_LOOK (2 * AREA_STRIDE)
#define AREA_OFF_PLANE 0.2f // of the radius

#if AREA_REACH > 0
// Pixels of a row, and the radius about each that samples are taken from.
typedef struct {
    int2 size, whole; // without and with the margin
    int x, y, at_x, at_y;
    vmask there;
    vfloat z, px, py, nx, ny, nz, pixel; // depth, place, normal; a pixel's width
    vfloat column, row;
} AreaPixels;

static inline AreaPixels area_pixels(ssgi_plane depth, ssgi_plane normal, const int2 size,
                                     const SsgiCamera camera, const AreaParams params, const int x,
                                     const int y)
{
    AreaPixels p;
    p.size = size;
    p.whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    p.x = x, p.y = y;
    p.at_x = x + params.margin_columns, p.at_y = y + params.margin_rows;
    p.column = v_to_float(v_iota() + p.at_x) + 0.5f;
    p.row = v_splat((float)p.at_y + 0.5f);
    const vfloat own = ssgi_load(depth, p.whole, 0, p.at_x, p.at_y);
    p.there = v_lt(own, v_splat(INFINITY));
    p.z = v_select(v_splat(1.0f), own, p.there);
    const vfloat k = ssgi_k(camera, p.z);
    p.px = ssgi_slope_x(camera, p.column) * k;
    p.py = ssgi_slope_y(camera, p.row) * k;
    p.nx = ssgi_load(normal, p.whole, 0, p.at_x, p.at_y);
    p.ny = ssgi_load(normal, p.whole, 1, p.at_x, p.at_y);
    p.nz = ssgi_load(normal, p.whole, 2, p.at_x, p.at_y);
    p.pixel = v_abs(ssgi_slope_x(camera, p.column + 1.0f) - ssgi_slope_x(camera, p.column)) * k;
    return p;
}

// Adds the samples of pixels within `radius` along a row or a column to those of the pixels;
// returns the sum of their weights.
static inline vfloat area_sum(ssgi_plane depth, ssgi_plane normal, ssgi_plane sampled,
                              const SsgiCamera camera, const AreaPixels p, const vfloat radius,
                              vfloat sums[2 * AREA_CHANNELS])
{
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    vfloat total = one;
    const vmask wide = p.there & v_gt(radius, zero);
    const vfloat inverse = one / v_select(one, radius * radius, wide);
    const vfloat off = inverse * (1.0f / (AREA_OFF_PLANE * AREA_OFF_PLANE));
    const vfloat reached = v_select(zero, radius / p.pixel, wide);
    int reach = 0;
    while (reach < AREA_REACH && v_any(v_gt(reached, v_splat((float)reach + 0.75f)))) {
        ++reach;
    }
#if AREA_ALONG == 0
    const int first = -reach, last = reach;
#else
    const int first = max(-reach, -p.y), last = min(reach, p.size.y - 1 - p.y);
#endif
    for (int i = first; i <= last; ++i) {
        if (i == 0) {
            continue;
        }
        const int dx = AREA_ALONG == 0 ? i : 0, dy = i - dx;
        const vfloat far = ssgi_load(depth, p.whole, 0, p.at_x + dx, p.at_y + dy);
        const vmask seen = wide & v_lt(far, v_splat(INFINITY));
        const vfloat depth_there = v_select(one, far, seen);
        const vfloat scale = ssgi_k(camera, depth_there);
        const vfloat qx = v_fma(ssgi_slope_x(camera, p.column + (float)dx), scale, -p.px);
        const vfloat qy = v_fma(ssgi_slope_y(camera, p.row + (float)dy), scale, -p.py);
        const vfloat qz = p.z - depth_there;
        const vfloat squared = v_fma(qx, qx, v_fma(qy, qy, qz * qz));
        const vfloat height = v_fma(qx, p.nx, v_fma(qy, p.ny, qz * p.nz));
        const vfloat mx = ssgi_load(normal, p.whole, 0, p.at_x + dx, p.at_y + dy);
        const vfloat my = ssgi_load(normal, p.whole, 1, p.at_x + dx, p.at_y + dy);
        const vfloat mz = ssgi_load(normal, p.whole, 2, p.at_x + dx, p.at_y + dy);
        const vfloat near = v_max(v_fma(squared, -inverse, one), zero);
        const vfloat flat = v_max(v_fma(height * height, -off, one), zero);
        const vfloat alike = v_max(v_fma(mx, p.nx, v_fma(my, p.ny, mz * p.nz)), zero);
        const vfloat even = alike * alike;
        const vfloat weight = v_select(zero, near * near * flat * even * even, seen);
        total = total + weight;
#pragma unroll
        for (int j = 0; j < 2 * AREA_CHANNELS; ++j) {
            sums[j] = v_fma(weight, ssgi_load(sampled, p.size, j, p.x + dx, p.y + dy), sums[j]);
        }
    }
    return total;
}
#endif

#if AREA_ALONG == 0

__kernel void area_filter(ssgi_plane depth, ssgi_plane normal, ssgi_plane sampled,
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
    const vfloat share = one / area_sum(depth, normal, sampled, camera, p, radius, sum);
#pragma unroll
    for (int j = 0; j < 2 * AREA_CHANNELS; ++j) {
        ssgi_store(sum[j] * share, means, size, j, x, y, 0.0f);
    }
    ssgi_store(radius, means, size, 2 * AREA_CHANNELS, x, y, 0.0f);
}

#else

__kernel void area_filter(ssgi_plane depth, ssgi_plane normal, ssgi_plane sampled, ssgi_plane light,
#if AREA_ADDS
                          ssgi_plane direct,
#endif
                          __global const int *restrict cells, __global float *restrict irradiance,
                          const int2 size, const SsgiCamera camera, const AreaParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const int bits = area_around(cells, size, x, y, 0);
    vfloat sum[2 * AREA_CHANNELS]; // what arrives, and what would
#pragma unroll
    for (int j = 0; j < 2 * AREA_CHANNELS; ++j) {
        const float agreed = j < AREA_CHANNELS && bits == 1 ? 0.0f : 1.0f;
        sum[j] = bits == 3 ? ssgi_load(sampled, size, j, x, y) : v_splat(agreed);
    }
#if AREA_REACH > 0
    if (bits == 3) {
        const AreaPixels p = area_pixels(depth, normal, size, camera, params, x, y);
        const vfloat radius = ssgi_load(sampled, size, 2 * AREA_CHANNELS, x, y);
        (void)area_sum(depth, normal, sampled, camera, p, radius, sum);
    }
#endif
    vfloat share = zero;
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        if (j < AREA_CHANNELS) {
            const vfloat meant = sum[AREA_CHANNELS + j];
            const vmask known = v_gt(meant, zero);
            share = v_select(one, v_min(sum[j] / v_select(one, meant, known), one), known);
        }
        vfloat light_there = ssgi_load(light, size, j, x, y) * share;
#if AREA_ADDS
        light_there = light_there + ssgi_load(direct, size, j, x, y);
#endif
        ssgi_store(light_there, irradiance, size, j, x, y, 0.0f);
    }
}

#endif
