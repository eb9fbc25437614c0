// SPDX-License-Identifier: MIT
// shadow_blocks: planes above and below all depths of a shadow map in and near each of its blocks.
//
// Where both decide the result of a filter's taps, shade_light reads these in place of the taps.
// Method:  the slope is that of one half of the span, through its middle, whichever is less: where
//          a surface ends or bends in the other half, this one's plane may still lie above all;
//          any other is as right, but farther from what is there
// Reads:   map     depth that the light sees; `faces` images from number `first` on
// Writes:  blocks  SHADOW_IMAGES an image x [rows, columns] of blocks, see direct/blocks.clh
// Params:  count = (columns, rows) of an image's blocks; perspective: 1, or 0: orthographic
// Launch:  a work-item per block; rows of all images, one after the other
// Cost:    121 reads per block of 64 texels

#include "common/gbuffer.clh"
#include "direct/blocks.clh"

// The measure of depth in the lanes of a row.
static inline vfloat shadow_measure(ssgi_plane map, const int2 size, const int face, const int x,
                                    const int y, const float perspective)
{
    const vfloat depth = ssgi_load(map, size, face, x, y);
    return perspective != 0.0f ? 1.0f / depth : -depth;
}

// The same of one texel.
static inline float shadow_texel(ssgi_plane map, const int2 size, const int face, const int x,
                                 const int y, const float perspective)
{
    const vfloat u = shadow_measure(map, size, face, x, y, perspective);
    return v_largest(v_select(v_splat(-INFINITY), u, v_ilt(v_iota(), v_splat_int(1))));
}

// The lesser slope of those from the first texel to the middle and from there to the last, each
// `texels` away; 0 where there is none.
static inline float shadow_slope(const float first, const float middle, const float last,
                                 const int texels)
{
    const float before = (middle - first) / (float)max(texels, 1);
    const float after = (last - middle) / (float)max(texels, 1);
    const float slope = fabs(before) <= fabs(after) || isnan(after) ? before : after;
    return fabs(slope) < 1e30f ? slope : 0.0f;
}

__kernel void shadow_blocks(ssgi_plane map, __global float *restrict blocks, const int2 size,
                            const int2 count, const int first, const int faces,
                            const float perspective)
{
    const int column = (int)get_global_id(0);
    const int face = first + (int)get_global_id(1) / count.y;
    const int row = (int)get_global_id(1) % count.y;
    if (column >= count.x || face >= first + faces) {
        return;
    }
    const int first_x = column * SHADOW_BLOCK;
    const int first_y = row * SHADOW_BLOCK;
    const int2 extent = min((int2)(SHADOW_SPAN), size - (int2)(first_x, first_y));
    const int2 half_way = (extent - 1) / 2;
    const int2 middle = (int2)(first_x, first_y) + half_way;
    const int2 last = middle + half_way;
    const float at_middle = shadow_texel(map, size, face, middle.x, middle.y, perspective);
    const float b =
        shadow_slope(shadow_texel(map, size, face, first_x, middle.y, perspective), at_middle,
                     shadow_texel(map, size, face, last.x, middle.y, perspective), half_way.x);
    const float c =
        shadow_slope(shadow_texel(map, size, face, middle.x, first_y, perspective), at_middle,
                     shadow_texel(map, size, face, middle.x, last.y, perspective), half_way.y);
    vfloat highest = v_splat(-INFINITY);
    vfloat lowest = v_splat(INFINITY);
    for (int x = 0; x < extent.x; x += SSGI_LANES) {
        const vmask inside = v_ilt(v_iota() + x, v_splat_int(extent.x));
        const vfloat along = v_to_float(v_iota() + x) * b;
        for (int y = 0; y < extent.y; ++y) {
            const vfloat u = shadow_measure(map, size, face, first_x + x, first_y + y, perspective);
            const vfloat off = u - v_fma(v_splat((float)y), v_splat(c), along);
            highest = v_max(highest, v_select(v_splat(-INFINITY), off, inside));
            lowest = v_min(lowest, v_select(v_splat(INFINITY), off, inside));
        }
    }
    __global float *restrict to = blocks + ssgi_index(count, face * SHADOW_IMAGES, column, row);
    const int image = count.y * ssgi_pitch(count);
    to[SHADOW_HIGHEST * image] = v_largest(highest);
    to[SHADOW_LOWEST * image] = -v_largest(-lowest);
    to[SHADOW_B * image] = b;
    to[SHADOW_C * image] = c;
}
