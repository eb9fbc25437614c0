// SPDX-License-Identifier: MIT
// area_filter: irradiance by emissive polygons, times the share of it that arrives.
//
// Method:  the share is what arrives along rays over what would (Heitz, Hill and McGuire 2018,
//          "Combining Analytic Direct Illumination and Stochastic Shadows"), both summed up over
//          pixels of the same surface within a part of the penumbra's width, which is that of the
//          emitter times the ratio of the distances to blocker and emitter (Fernando 2005,
//          "Percentage-Closer Soft Shadows"). Where all near rays agree the share is 0 or 1.
// Reads:   depth, normal  with margin; normal in view space
//          sampled, cells  see area_lights.cl
//          light    3 x [rows, columns] W/m^2, with nothing in the way
//          direct   3 x [rows, columns] W/m^2 (AREA_ADDS 1)
// Writes:  irradiance  3 x [rows, columns] W/m^2, that of `direct` included
// Macros:  AREA_CHANNELS (1 or 3), AREA_ADDS (0 or 1), AREA_REACH (0..16) pixels
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    in penumbrae (2 AREA_REACH + 1)^2 samples of 30 operations at most

#include "area_lights/area_cells.clh"
#include "common/camera.clh"
#include "common/gbuffer.clh"

#if !defined(AREA_CHANNELS) || !defined(AREA_ADDS) || !defined(AREA_REACH)
#error "AREA_CHANNELS, AREA_ADDS and AREA_REACH must be defined by the host"
#endif

#define AREA_PART 0.5f // of a penumbra's width: the radius that samples are taken from
// Pixels between those, two to either side, where blockers are looked for: as far as samples reach.
#define AREA_STRIDE ((AREA_REACH + 1) / 2)
#define AREA_LOOK (2 * AREA_STRIDE)
#define AREA_OFF_PLANE 0.2f // of the radius

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
    const int bits = area_around(cells, size, x, y);
    vfloat arrived[AREA_CHANNELS], meant[AREA_CHANNELS];
#pragma unroll
    for (int j = 0; j < AREA_CHANNELS; ++j) {
        arrived[j] =
            bits == 3 ? ssgi_load(sampled, size, j, x, y) : v_splat(bits == 1 ? 0.0f : 1.0f);
        meant[j] = bits == 3 ? ssgi_load(sampled, size, AREA_CHANNELS + j, x, y) : one;
    }
#if AREA_REACH > 0
    if (bits == 3) {
        const int2 whole =
            (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
        const int at_x = x + params.margin_columns, at_y = y + params.margin_rows;
        const vfloat column = v_to_float(v_iota() + at_x) + 0.5f, row = v_splat((float)at_y + 0.5f);
        const vfloat own = ssgi_load(depth, whole, 0, at_x, at_y);
        const vmask there = v_lt(own, v_splat(INFINITY));
        const vfloat z = v_select(one, own, there);
        const vfloat k = ssgi_k(camera, z);
        const vfloat px = ssgi_slope_x(camera, column) * k, py = ssgi_slope_y(camera, row) * k;
        const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
        const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
        const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
        const vfloat pixel =
            v_abs(ssgi_slope_x(camera, column + 1.0f) - ssgi_slope_x(camera, column)) * k;
        vfloat width = zero, count = zero;
        for (int dy = max(-AREA_LOOK, -y); dy <= min(AREA_LOOK, size.y - 1 - y);
             dy += AREA_STRIDE) {
            for (int dx = -AREA_LOOK; dx <= AREA_LOOK; dx += AREA_STRIDE) {
                width = width + ssgi_load(sampled, size, 2 * AREA_CHANNELS, x + dx, y + dy);
                count = count + ssgi_load(sampled, size, 2 * AREA_CHANNELS + 1, x + dx, y + dy);
            }
        }
        const vfloat most = pixel * ((float)AREA_REACH + 0.5f);
        const vfloat radius =
            v_min(v_max(width / v_max(count, one) * AREA_PART, pixel * 0.5f), most);
        const vfloat inverse = one / (radius * radius);
        const vfloat off = inverse * (1.0f / (AREA_OFF_PLANE * AREA_OFF_PLANE));
        const vfloat reached = v_select(zero, radius / pixel, there & v_gt(count, zero));
        int reach = 0;
        while (reach < AREA_REACH && v_any(v_gt(reached, v_splat((float)reach + 0.75f)))) {
            ++reach;
        }
        for (int dy = max(-reach, -y); dy <= min(reach, size.y - 1 - y); ++dy) {
            for (int dx = -reach; dx <= reach; ++dx) {
                if (dx == 0 && dy == 0) {
                    continue;
                }
                const vfloat far = ssgi_load(depth, whole, 0, at_x + dx, at_y + dy);
                const vmask seen = there & v_lt(far, v_splat(INFINITY));
                const vfloat depth_there = v_select(one, far, seen);
                const vfloat scale = ssgi_k(camera, depth_there);
                const vfloat qx = v_fma(ssgi_slope_x(camera, column + (float)dx), scale, -px);
                const vfloat qy = v_fma(ssgi_slope_y(camera, row + (float)dy), scale, -py);
                const vfloat qz = z - depth_there;
                const vfloat squared = v_fma(qx, qx, v_fma(qy, qy, qz * qz));
                const vfloat height = v_fma(qx, nx, v_fma(qy, ny, qz * nz));
                const vfloat mx = ssgi_load(normal, whole, 0, at_x + dx, at_y + dy);
                const vfloat my = ssgi_load(normal, whole, 1, at_x + dx, at_y + dy);
                const vfloat mz = ssgi_load(normal, whole, 2, at_x + dx, at_y + dy);
                const vfloat near = v_max(v_fma(squared, -inverse, one), zero);
                const vfloat flat = v_max(v_fma(height * height, -off, one), zero);
                const vfloat alike = v_max(v_fma(mx, nx, v_fma(my, ny, mz * nz)), zero);
                const vfloat even = alike * alike;
                const vfloat weight = v_select(zero, near * near * flat * even * even, seen);
#pragma unroll
                for (int j = 0; j < AREA_CHANNELS; ++j) {
                    arrived[j] =
                        v_fma(weight, ssgi_load(sampled, size, j, x + dx, y + dy), arrived[j]);
                    meant[j] =
                        v_fma(weight, ssgi_load(sampled, size, AREA_CHANNELS + j, x + dx, y + dy),
                              meant[j]);
                }
            }
        }
    }
#endif
    vfloat share = zero;
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        if (j < AREA_CHANNELS) {
            const vmask known = v_gt(meant[j], zero);
            share = v_select(one, v_min(arrived[j] / v_select(one, meant[j], known), one), known);
        }
        vfloat sum = ssgi_load(light, size, j, x, y) * share;
#if AREA_ADDS
        sum = sum + ssgi_load(direct, size, j, x, y);
#endif
        ssgi_store(sum, irradiance, size, j, x, y, 0.0f);
    }
}
