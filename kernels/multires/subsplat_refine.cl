// SPDX-License-Identifier: MIT
// subsplat_refine: subsplats of a level: the texels that are even enough, under a parent that is
// not.
//
// Method:  Nichols, Shopf and Wyman 2009, "Hierarchical Image-Space Radiosity for Interactive
//          Global Illumination" (stencil refinement): all levels decide for themselves, and each
//          pixel that shows a surface comes to lie in one subsplat.
// Reads:   variation  5 x [rows, columns] of this level, see variation.clh
//          coarser    likewise of the next coarser one
// Writes:  values  3 x [rows, columns]: 0, to which light is added
//          fractions  [rows, columns] 1 where there is a subsplat, else 0
//          masks   of tiles, see multires/list.clh
// Params:  coarser_size = (columns, rows); limits of this level, INFINITY for the finest; those of
//          the coarser one, -INFINITY where there is none
// Launch:  a row of a tile per work-item
// Cost:    10 reads per texel

#define UPSAMPLE_STEP 2
#include "multires/list.clh"
#include "multires/variation.clh"
#include "multires/parents.clh"

__kernel void subsplat_refine(ssgi_plane variation, ssgi_plane coarser,
                              __global float *restrict values, __global float *restrict fractions,
                              __global int *restrict masks, const int2 size,
                              const int2 coarser_size, const SubsplatParams limits)
{
    const int left = (int)get_global_id(0) * MULTIRES_TILE;
    const int y = (int)get_global_id(1);
    if (left >= size.x || y >= size.y) {
        return;
    }
    int mask = 0;
    for (int x = left; x < min(left + MULTIRES_TILE, size.x); x += SSGI_LANES) {
        vfloat own[SUBSPLAT_IMAGES], parent[SUBSPLAT_IMAGES];
        for (int i = 0; i < SUBSPLAT_IMAGES; ++i) {
            own[i] = ssgi_load(variation, size, i, x, y);
            parent[i] = subsplat_parents(coarser, coarser_size, i, x / 2, y / 2);
        }
        const vmask kept = subsplat_even(own, limits.depth, limits.normal) &
                           ~subsplat_even(parent, limits.coarser_depth, limits.coarser_normal);
        const vfloat share = v_select(v_splat(0.0f), v_splat(1.0f), kept);
        for (int i = 0; i < 3; ++i) {
            ssgi_store(v_splat(0.0f), values, size, i, x, y, 0.0f);
        }
        ssgi_store(share, fractions, size, 0, x, y, 0.0f);
        mask |= multires_marks(share, x, size.x) << (x - left);
    }
    masks[multires_mask(size, left, y)] = mask;
}
