// SPDX-License-Identifier: MIT
// subsplat_variation: finest level of the min-max mipmap: variation of depth and normals over
// 3 x 3 pixels.
//
// Method:  Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination": depth
//          variation (largest - least) / own linear depth, least and largest x and y of the
//          normals. 3 x 3 pixels, so that discontinuities between two texels of a coarser level are
//          found.
// Departs: the published depth variation has the distance of the far plane as a factor, which here
//          is part of the threshold. With an orthographic camera it is over the view's height.
// Reads:   depth, normal  the front layer, with margin; scene units, view space
// Writes:  variation  5 x [rows, columns], see variation.clh; depth variation is INFINITY beside
//                     pixels that show nothing
// Params:  whole = (columns, rows) with margin; margin = (columns, rows); camera
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    27 reads per pixel

#include "common/camera.clh"
#include "multires/variation.clh"

// The lanes of a row from column x on and their neighbours left and right, at the image's border
// the lanes themselves.
static inline void subsplat_beside(ssgi_plane plane, const int2 whole, const int image, const int x,
                                   const int y, const vmask first, const vmask last, vfloat *beside)
{
    beside[1] = ssgi_load(plane, whole, image, x, y);
    beside[0] = v_select(ssgi_load(plane, whole, image, x - 1, y), beside[1], first);
    beside[2] = v_select(ssgi_load(plane, whole, image, x + 1, y), beside[1], last);
}

__kernel void subsplat_variation(ssgi_plane depth, ssgi_plane normal,
                                 __global float *restrict variation, const int2 size,
                                 const int2 whole, const int2 margin, const SsgiCamera camera)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint column = v_iota() + x;
    const vmask first = v_ieq(column, v_splat_int(0));
    const vmask last = v_ieq(column, v_splat_int(size.x - 1));
    vfloat most[SUBSPLAT_IMAGES];
    for (int i = 0; i < SUBSPLAT_IMAGES; ++i) {
        most[i] = v_splat(-INFINITY);
    }
    vfloat nearest = v_splat(INFINITY);
    for (int down = -1; down <= 1; ++down) {
        const int row = clamp(y + down, 0, size.y - 1) + margin.y;
        vfloat beside[3];
        subsplat_beside(depth, whole, 0, x + margin.x, row, first, last, beside);
        for (int i = 0; i < 3; ++i) {
            most[0] = v_max(most[0], beside[i]);
            nearest = v_min(nearest, beside[i]);
        }
        for (int axis = 0; axis < 2; ++axis) {
            subsplat_beside(normal, whole, axis, x + margin.x, row, first, last, beside);
            for (int i = 0; i < 3; ++i) {
                most[1 + axis] = v_max(most[1 + axis], -beside[i]);
                most[3 + axis] = v_max(most[3 + axis], beside[i]);
            }
        }
    }
    const vfloat own = ssgi_load(depth, whole, 0, x + margin.x, y + margin.y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    const vfloat z = v_select(v_splat(1.0f), own, there);
    most[0] = (most[0] - v_select(v_splat(0.0f), nearest, there)) / ssgi_tolerance_depth(camera, z);
    for (int i = 0; i < SUBSPLAT_IMAGES; ++i) {
        ssgi_store(v_select(v_splat(SUBSPLAT_EMPTY), most[i], there), variation, size, i, x, y,
                   SUBSPLAT_EMPTY);
    }
}
