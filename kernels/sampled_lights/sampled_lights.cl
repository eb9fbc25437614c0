// SPDX-License-Identifier: MIT
// sampled_lights: irradiance by directions of an environment, each tested in its own depth map.
//
// Method:  each pixel of 4 x 4 takes every 16th direction, another set each (interleaved sampling,
//          Keller and Heidrich 2001); an edge-aware blur takes their mean afterwards. The receiver
//          is moved along its normal by about a texel, so that no surface shadows itself; the
//          result of 2 x 2 comparisons is interpolated (percentage-closer filtering, Reeves et al.
//          1987).
// Reads:   depth, normal  with margin; normal in view space
//          samples  [directions / 16][4 rows][SAMPLED_FIELDS][16 columns], see
//                   ssgi_cl/techniques/sampled_lights/sampled_lights.py
//          maps     [directions][texels][texels] bits of the depth, see sampled_depth
// Writes:  irradiance  3 x [rows, columns] W/m^2, 0 where nothing is
// Macros:  SAMPLED_COUNT: directions of a pixel
// Params:  margin; texels along a map's side
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    4 scattered reads for each direction above the horizon

#include "common/camera.clh"
#include "common/gbuffer.clh"

#ifndef SAMPLED_COUNT
#error "SAMPLED_COUNT must be defined by the host"
#endif

#define SAMPLED_FIELDS 20
#define SAMPLED_BRIGHTEST 1e30f

static inline vfloat sampled_field(__global const float *restrict sample, const int field)
{
    return v_load(sample + field * 16);
}

static inline vfloat sampled_place(__global const float *restrict sample, const int first,
                                   const vfloat x, const vfloat y, const vfloat z)
{
    return v_fma(
        sampled_field(sample, first), x,
        v_fma(sampled_field(sample, first + 1), y,
              v_fma(sampled_field(sample, first + 2), z, sampled_field(sample, first + 3))));
}

// Share of light at a place of the map that begins at `base`.
static inline vfloat sampled_visible(__global const int *restrict maps, const vint base,
                                     const int texels, const vfloat column, const vfloat row,
                                     const vfloat depth)
{
    const vfloat left = v_floor(column - 0.5f), top = v_floor(row - 0.5f);
    const vfloat fx = column - 0.5f - left, fy = row - 0.5f - top;
    const vint x0 = v_iclamp(v_to_int(left), 0, texels - 1);
    const vint y0 = v_iclamp(v_to_int(top), 0, texels - 1);
    const vint x1 = v_imin(x0 + 1, v_splat_int(texels - 1));
    const vint y1 = v_imin(y0 + 1, v_splat_int(texels - 1));
    const vint upper = base + y0 * texels, lower = base + y1 * texels;
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const vfloat a = v_select(zero, one, v_ge(v_from_bits(v_igather(maps, upper + x0)), depth));
    const vfloat b = v_select(zero, one, v_ge(v_from_bits(v_igather(maps, upper + x1)), depth));
    const vfloat c = v_select(zero, one, v_ge(v_from_bits(v_igather(maps, lower + x0)), depth));
    const vfloat d = v_select(zero, one, v_ge(v_from_bits(v_igather(maps, lower + x1)), depth));
    const vfloat above = v_fma(b - a, fx, a), below = v_fma(d - c, fx, c);
    return v_fma(below - above, fy, above);
}

__kernel void sampled_lights(ssgi_plane depth, ssgi_plane normal,
                             __global const float *restrict samples,
                             __global const int *restrict maps, __global float *restrict irradiance,
                             const int2 size, const SsgiCamera camera, const int margin_columns,
                             const int margin_rows, const int texels)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * margin_columns, size.y + 2 * margin_rows);
    const int at_x = x + margin_columns, at_y = y + margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat own = ssgi_load(depth, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    vfloat red = zero, green = zero, blue = zero;
    if (v_any(there)) {
        const vfloat z = v_select(v_splat(1.0f), own, there);
        const vfloat k = ssgi_k(camera, z);
        const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * k;
        const vfloat py = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * k;
        const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
        const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
        const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
        for (int i = 0; i < SAMPLED_COUNT; ++i) {
            __global const float *restrict sample =
                samples + (i * 4 + (y & 3)) * (SAMPLED_FIELDS * 16) + (x & 3);
            const vfloat cosine =
                v_fma(sampled_field(sample, 0), nx,
                      v_fma(sampled_field(sample, 1), ny, sampled_field(sample, 2) * nz));
            const vmask lit = there & v_gt(cosine, zero);
            if (!v_any(lit)) {
                continue;
            }
            const vfloat off = sampled_field(sample, 18);
            const vfloat qx = v_fma(nx, off, px), qy = v_fma(ny, off, py), qz = v_fma(nz, off, -z);
            const vfloat visible = sampled_visible(
                maps, v_to_int(sampled_field(sample, 19)) * (texels * texels), texels,
                sampled_place(sample, 6, qx, qy, qz), sampled_place(sample, 10, qx, qy, qz),
                sampled_place(sample, 14, qx, qy, qz));
            const vfloat weight = v_select(zero, cosine * visible, lit);
            red = v_fma(weight, sampled_field(sample, 3), red);
            green = v_fma(weight, sampled_field(sample, 4), green);
            blue = v_fma(weight, sampled_field(sample, 5), blue);
        }
    }
    const vfloat most = v_splat(SAMPLED_BRIGHTEST);
    ssgi_store(v_min(red, most), irradiance, size, 0, x, y, 0.0f);
    ssgi_store(v_min(green, most), irradiance, size, 1, x, y, 0.0f);
    ssgi_store(v_min(blue, most), irradiance, size, 2, x, y, 0.0f);
}
