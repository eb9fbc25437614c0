// SPDX-License-Identifier: MIT
// subsplat_upsample: the light of a coarser level and of a level's own subsplats, at that level.
//
// Method:  the interpolation of Nichols and Wyman 2009, "Multiresolution Splatting for Indirect
//          Illumination", as in the authors' program for "GPU Pro" (2010). A tap is a coarse texel
//          around the parent, or where that holds no light the level's own texel on the same side.
//          3 x 3 taps have the weights of a tent, its middle 1; those without light count 0,
//          corners also where neither of the two edges beside them has any; what is left is
//          renormalised. Texels without light of either level stay so: no halo.
// Reads:   coarse_values, coarse_fractions  3 x and 1 x [rows, columns] of the coarser level: light
//                in W/m^2 and 1 where there is any, else 0
//          fine_values, fine_fractions  likewise of the level's own subsplats
// Writes:  values, fractions  likewise, of both
// Params:  coarse_size = (columns, rows)
// Launch:  SSGI_LANES texels of a row per work-item
// Cost:    72 reads and a division per texel

#define UPSAMPLE_STEP 2
#include "common/gbuffer.clh"
#include "multires/parents.clh"

#define SUBSPLAT_NEAR 0.75f // weight of the coarse neighbour that the texel lies nearer to
#define SUBSPLAT_FAR 0.25f

// Which lanes have no neighbour to the left and to the right, of a texel's own and of its parent.
typedef struct {
    vmask first, last, parent_first, parent_last;
} SubsplatBorder;

// Three taps of a row: of one image of the coarse row, and of the fine row where `open` is 1.
static inline void subsplat_row(ssgi_plane coarse, ssgi_plane fine, const int2 coarse_size,
                                const int2 size, const int image, const int x, const int coarse_row,
                                const int row, const SubsplatBorder border, const vfloat *open,
                                vfloat *taps)
{
    const vfloat c = subsplat_parents(coarse, coarse_size, image, x / 2, coarse_row);
    const vfloat c_left = subsplat_parents(coarse, coarse_size, image, x / 2 - 1, coarse_row);
    const vfloat c_right = subsplat_parents(coarse, coarse_size, image, x / 2 + 1, coarse_row);
    const vfloat f = ssgi_load(fine, size, image, x, row);
    const vfloat f_left = ssgi_load(fine, size, image, x - 1, row);
    const vfloat f_right = ssgi_load(fine, size, image, x + 1, row);
    taps[0] =
        v_fma(open[0], v_select(f_left, f, border.first), v_select(c_left, c, border.parent_first));
    taps[1] = v_fma(open[1], f, c);
    taps[2] =
        v_fma(open[2], v_select(f_right, f, border.last), v_select(c_right, c, border.parent_last));
}

__kernel void subsplat_upsample(ssgi_plane coarse_values, ssgi_plane coarse_fractions,
                                ssgi_plane fine_values, ssgi_plane fine_fractions,
                                __global float *restrict values, __global float *restrict fractions,
                                const int2 size, const int2 coarse_size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vint column = v_iota() + x;
    const vint parent = column >> 1;
    SubsplatBorder border;
    border.first = v_ieq(column, v_splat_int(0));
    border.last = v_ieq(column, v_splat_int(size.x - 1));
    border.parent_first = v_ieq(parent, v_splat_int(0));
    border.parent_last = v_ieq(parent, v_splat_int(coarse_size.x - 1));
    int fine_row[3], coarse_row[3];
    vfloat open[9], there[9];
    const vfloat zero[3] = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (int i = 0; i < 3; ++i) {
        fine_row[i] = clamp(y + i - 1, 0, size.y - 1);
        coarse_row[i] = clamp(y / 2 + i - 1, 0, coarse_size.y - 1);
        // First of the coarse level alone.
        subsplat_row(coarse_fractions, fine_fractions, coarse_size, size, 0, x, coarse_row[i],
                     fine_row[i], border, zero, there + 3 * i);
        for (int j = 0; j < 3; ++j) {
            open[3 * i + j] = 1.0f - there[3 * i + j];
        }
        subsplat_row(coarse_fractions, fine_fractions, coarse_size, size, 0, x, coarse_row[i],
                     fine_row[i], border, open + 3 * i, there + 3 * i);
    }
    const vmask odd = v_ieq(column & 1, v_splat_int(1));
    const vfloat right = v_select(v_splat(SUBSPLAT_FAR), v_splat(SUBSPLAT_NEAR), odd);
    const vfloat across[3] = {1.0f - right, v_splat(1.0f), right};
    const float below = (y & 1) ? SUBSPLAT_NEAR : SUBSPLAT_FAR;
    const float along[3] = {1.0f - below, 1.0f, below};
    vfloat weight[9];
    vfloat sum = v_splat(0.0f);
    for (int i = 0; i < 9; ++i) {
        weight[i] = there[i] * across[i % 3] * along[i / 3];
        if (i % 2 == 0 && i != 4) { // a corner: its row's middle tap, and its column's
            const vfloat beside = there[3 * (i / 3) + 1] + there[3 + i % 3];
            weight[i] = weight[i] * v_min(beside, v_splat(1.0f));
        }
        if (i == 4) {
            weight[i] = v_splat(1.0f);
        }
        sum = sum + weight[i];
    }
    const vfloat scale = there[4] / sum;
    for (int j = 0; j < 3; ++j) {
        vfloat taps[9];
        for (int i = 0; i < 3; ++i) {
            subsplat_row(coarse_values, fine_values, coarse_size, size, j, x, coarse_row[i],
                         fine_row[i], border, open + 3 * i, taps + 3 * i);
        }
        // As differences from the middle, so that even light stays as it is.
        vfloat off = v_splat(0.0f);
        for (int i = 0; i < 9; ++i) {
            off = v_fma(weight[i], taps[i] - taps[4], off);
        }
        const vfloat value = v_max(v_fma(off, scale, taps[4] * there[4]), v_splat(0.0f));
        ssgi_store(value, values, size, j, x, y, 0.0f);
    }
    ssgi_store(there[4], fractions, size, 0, x, y, 0.0f);
}
