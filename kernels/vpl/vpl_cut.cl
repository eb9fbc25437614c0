// SPDX-License-Identifier: MIT
// vpl_cut: the row of texels cut into pieces of equal luminous flux, at whose middles lights are.
//
// Method:  A place in the row is looked for in the sums of blocks, then of runs, then in a run.
//          Where no more texels are lit than there are lights, each is a piece of its own.
// Reads:   position  3 x [rows, columns] of one map, scene units from its origin
//          normal    3 x [rows, columns]
//          axis      3 x [rows, columns] of lobes (VPL_GLOSSY 1)
//          order, flux, area, gloss see vpl_partial_sums
//          quarters, runs, blocks, importance   see vpl/curve.clh
//          edges    [8][edge_stride] of the pieces, every edge_step-th (VPL_MIDDLE 1, VPL_WEIGHTED
//          1)
// Writes:  found  VPL_MIDDLE 0: [8][params.stride] of each edge between pieces, red, green, blue
//                 and area before it, and what these four lack (an edge may lie in a texel);
//                 VPL_MIDDLE 1: [6][params.stride] position and normal of the texel in the middle
//                 of each piece, VPL_GLOSSY 1: [10] with the axis and exponent of its lobe too.
//                 Only of places that lie in this map.
// Macros:  VPL_MIDDLE (0, 1), VPL_GLOSSY and _WEIGHTED as in vpl_partial_sums
// Params:  params.count places; params.lights x params.split pieces; the map's first run; how far
//          its origin is from that of the result's positions
// Launch:  SSGI_LANES places per work-item

#include "common/gbuffer.clh"
#include "vpl/curve.clh"

#if !defined(VPL_MIDDLE) || !defined(VPL_GLOSSY) || !defined(VPL_WEIGHTED)
#error "VPL_MIDDLE, VPL_GLOSSY and VPL_WEIGHTED must be defined"
#endif

// Luminance is summed by importance where that is given, and pieces are cut by that sum. But a
// light is where half of its piece's flux is: a piece may begin where little is important and end
// where much is, and its flux must not all be sent from there.
#define VPL_BY_FLUX (VPL_MIDDLE && VPL_WEIGHTED)
#define VPL_PLAIN (-1) // as number of a sum: luminance without importance, from the channels

// Sum number `sum` of rows that are `stride` apart.
static inline vfloat vpl_row(__global const float *restrict rows, const int stride, const int sum,
                             const vint index, const bool same)
{
    if (!VPL_BY_FLUX || sum != VPL_PLAIN) {
        return v_fetch(rows + sum * stride, index, same);
    }
    __global const float *restrict red = rows + VPL_CHANNELS * stride;
    return vpl_luminance(v_fetch(red, index, same), v_fetch(red + stride, index, same),
                         v_fetch(red + 2 * stride, index, same));
}

// How much comes before edge number j, or the middle of piece j: j / pieces of the whole, which is
// the pair (high, low), or half a piece more.
static inline VplPair vpl_share(const float high, const float low, const vint j, const int pieces)
{
    // Halves of pieces: a number of 24 bits times a power of two, so exact.
    const float halves = 2.0f * (float)pieces;
    const float quotient = high / halves;
    const float rest = (fma(-quotient, halves, high) + low) / halves;
    const vint count = j * 2 + VPL_MIDDLE;
    const vfloat upper = v_to_float(count >> 12) * 4096.0f; // exact, as is the remainder
    const vfloat lower = v_to_float(count & 4095);
    const vfloat first = upper * quotient;
    const vfloat second = lower * quotient;
    const vfloat lost = v_fma(upper, v_splat(quotient), -first) +
                        v_fma(lower, v_splat(quotient), -second) + (upper + lower) * rest;
    return vpl_plus(vpl_pair(first, v_splat(0.0f)), second, lost);
}

static inline bool vpl_same(const vint index)
{
    return v_all(v_ieq(index, v_splat_int(v_first(index))));
}

// The last of `count` elements from `first` on before which there is no more than `wanted`.
static inline vint vpl_last(__global const float *restrict table, const int elements, const int sum,
                            const vint first, const int count, const VplPair wanted)
{
    __global const float *restrict lows = table + VPL_SUMS * elements;
    int step = 1;
    while (2 * step < count) {
        step *= 2;
    }
    vint at = v_splat_int(0);
    for (; step > 0; step /= 2) {
        const vint next = at + step;
        const vint safe = v_iselect(at, next, v_ilt(next, v_splat_int(count)));
        // Places beside each other begin with the same steps.
        const vint index = first + safe;
        const vfloat before = vpl_row(table, elements, sum, index, vpl_same(index));
        vmask fits = v_lt(before, wanted.high);
        const vmask equal = v_eq(before, wanted.high);
        if (v_any(equal)) {
            fits = fits | (equal & v_le(vpl_row(lows, elements, sum, index, false), wanted.low));
        }
        at = v_iselect(at, safe, fits);
    }
    return at;
}

__kernel void vpl_cut(ssgi_plane position, ssgi_plane normal,
#if VPL_GLOSSY
                      ssgi_plane axis, ssgi_plane gloss,
#endif
                      ssgi_plane flux, ssgi_plane area, __global const int *restrict order,
                      __global const float *restrict quarters, __global const float *restrict runs,
                      __global const float *restrict blocks,
                      ssgi_optional __global const float *restrict importance,
                      ssgi_optional __global const float *restrict edges,
                      __global float *restrict found,
                      const int2 size, // of the map
                      const VplCurveParams params, const int edge_stride, const int edge_step)
{
    const int start = ssgi_first_column();
    if (start >= params.count) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const vint j = v_imin(v_iota() + start, v_splat_int(params.count - 1));
    const int ends = params.blocks + 1;
    const float lit_all = blocks[VPL_LIT * ends + params.blocks];
    const int measure = lit_all <= (float)params.lights ? VPL_LIT
                        : VPL_BY_FLUX                   ? VPL_PLAIN
                                                        : VPL_LUMINANCE;
    VplPair wanted = vpl_share(blocks[VPL_LUMINANCE * ends + params.blocks],
                               blocks[(VPL_SUMS + VPL_LUMINANCE) * ends + params.blocks], j,
                               params.lights * params.split);
#if VPL_BY_FLUX
    wanted.high = wanted.low = zero;
    for (int side = 0; side < 2; ++side) {
        const vint edge = (j + side) * edge_step;
        __global const float *restrict rows = edges - VPL_CHANNELS * edge_stride; // has no others
        const vfloat high = vpl_row(rows, edge_stride, VPL_PLAIN, edge, false);
        const vfloat low = vpl_row(rows + 4 * edge_stride, edge_stride, VPL_PLAIN, edge, false);
        wanted = vpl_plus(wanted, 0.5f * high, 0.5f * low);
    }
#endif
    if (measure == VPL_LIT) {
        // The first part of each light has it all.
#if VPL_MIDDLE
        wanted.high = v_min(v_to_float(j / params.split) + 0.5f, v_splat(lit_all - 0.5f));
#else
        wanted.high = v_min(v_to_float((j + params.split - 1) / params.split), v_splat(lit_all));
#endif
        wanted.low = zero;
    }
    const vint none = v_splat_int(0);
    const vint block = vpl_last(blocks, ends, measure, none, params.blocks, wanted);
    const int map_blocks = params.map_runs / VPL_BLOCK_RUNS;
    const vint in_map = block - params.first_run / VPL_BLOCK_RUNS;
    const vmask here = v_ige(in_map, none) & v_ilt(in_map, v_splat_int(map_blocks));
    if (!v_any(here)) {
        return;
    }
    const bool same = vpl_same(block);
    const VplPair to_block = {vpl_row(blocks, ends, measure, block, same),
                              vpl_row(blocks + VPL_SUMS * ends, ends, measure, block, same)};
    const VplPair beyond = vpl_plus(wanted, -to_block.high, -to_block.low);
    const vint first = block * VPL_BLOCK_RUNS;
    const vint run = first + vpl_last(runs, params.runs, measure, first, VPL_BLOCK_RUNS, beyond);
    const VplPair to_run = {
        vpl_row(runs, params.runs, measure, run, false),
        vpl_row(runs + VPL_SUMS * params.runs, params.runs, measure, run, false)};
    const VplPair left = vpl_plus(beyond, -to_run.high, -to_run.low);

    // The first quarter with which there is more than is left: one in which something is lit.
    // Rounding must not take a place beyond its run.
    const vfloat in_run =
        vpl_row(quarters, 64, measure, vpl_quarter(run, 0, v_splat_int(3)), false);
    const vfloat rest =
        v_min(v_max(left.high + left.low, zero), VPL_MIDDLE ? in_run * 0.99999994f : in_run);
    vint quarter = none;
    for (int step = 2; step > 0; step /= 2) {
        const vint last = quarter + (step - 1);
        const vmask fits =
            v_le(vpl_row(quarters, 64, measure, vpl_quarter(run, 0, last), false), rest);
        quarter = v_iselect(quarter, quarter + step, fits);
    }
    const vmask is_first = v_ieq(quarter, none);
    const vint last = v_imax(quarter - 1, none);
    vfloat before =
        v_select(vpl_row(quarters, 64, measure, vpl_quarter(run, 0, last), false), zero, is_first);

    const vint in_order = run - params.first_run;
    const vint face = in_order / params.face_runs;
    const vmask in_face = here & v_ilt(face, v_splat_int(params.faces));
    const vint own = v_iselect(none, (in_order - face * params.face_runs) * 4 + quarter, in_face);
    const vint top = v_iselect(none, face * params.face_rows, in_face);
#if VPL_MIDDLE
    vint chosen = v_splat_int(-1);
#else
    vfloat sums[4];
    for (int c = 0; c < 4; ++c) {
        const vint at = vpl_quarter(run, VPL_CHANNELS + c, last);
        sums[c] = v_select(v_gather(quarters, at), zero, is_first);
    }
#endif
#if VPL_WEIGHTED && !VPL_MIDDLE
    const vfloat weight = vpl_weight_of(importance, run, params.runs);
#endif
    for (int k = 0; k < VPL_RUN / 4; ++k) {
        const vint packed = v_igather(order, own * 4 + k);
        const vmask there = in_face & v_ige(packed, none) & v_le(before, rest);
        const vint at = v_iselect(none, packed, there);
        const vint x = at & 0xffff;
        const vint y = (at >> 16) + top;
        const vfloat red = ssgi_gather(flux, size, 0, x, y);
        const vfloat green = ssgi_gather(flux, size, 1, x, y);
        const vfloat blue = ssgi_gather(flux, size, 2, x, y);
        const vmask lit = there & v_gt(v_max(red, v_max(green, blue)), zero);
        vfloat amount = measure == VPL_LIT ? v_splat(1.0f) : vpl_luminance(red, green, blue);
#if VPL_GLOSSY
        if (measure != VPL_LIT) {
            amount = amount * vpl_importance(ssgi_gather(gloss, size, 0, x, y));
        }
#endif
#if VPL_WEIGHTED && !VPL_MIDDLE
        if (measure != VPL_LIT) {
            amount = amount * weight;
        }
#endif
#if VPL_MIDDLE
        chosen = v_iselect(chosen, at, lit);
#else
        const vfloat part = v_min((rest - before) / v_max(amount, v_splat(1e-38f)), v_splat(1.0f));
        const vfloat share = v_select(zero, part, lit);
        sums[0] = v_fma(share, red, sums[0]);
        sums[1] = v_fma(share, green, sums[1]);
        sums[2] = v_fma(share, blue, sums[2]);
        sums[3] = v_fma(share, ssgi_gather(area, size, 0, x, y), sums[3]);
#endif
        before = before + v_select(zero, amount, lit);
    }
#if VPL_MIDDLE
    const vmask any = v_ige(chosen, none);
    const vint at = v_iselect(none, chosen, any);
    const vint x = at & 0xffff;
    const vint y = (at >> 16) + top;
    const float shift[3] = {params.x, params.y, params.z};
    for (int c = 0; c < 3; ++c) {
        __global float *restrict place = found + c * params.stride + start;
        __global float *restrict way = found + (3 + c) * params.stride + start;
        const vfloat p = v_select(zero, ssgi_gather(position, size, c, x, y) + shift[c], any);
        const vfloat n = v_select(zero, ssgi_gather(normal, size, c, x, y), any);
        v_store(v_select(v_load(place), p, here), place);
        v_store(v_select(v_load(way), n, here), way);
#if VPL_GLOSSY
        __global float *restrict lobe = found + (6 + c) * params.stride + start;
        const vfloat r = v_select(zero, ssgi_gather(axis, size, c, x, y), any);
        v_store(v_select(v_load(lobe), r, here), lobe);
#endif
    }
#if VPL_GLOSSY
    __global float *restrict sharp = found + 9 * params.stride + start;
    const vfloat exponent = v_select(zero, ssgi_gather(gloss, size, 0, x, y), any);
    v_store(v_select(v_load(sharp), exponent, here), sharp);
#endif
#else
    for (int c = 0; c < 4; ++c) {
        const VplPair in_block = vpl_before(runs, params.runs, VPL_CHANNELS + c, run, false);
        VplPair sum = vpl_before(blocks, ends, VPL_CHANNELS + c, block, same);
        sum = vpl_plus(sum, in_block.high, in_block.low);
        sum = vpl_plus(sum, sums[c], zero);
        __global float *restrict high = found + c * params.stride + start;
        __global float *restrict low = found + (4 + c) * params.stride + start;
        v_store(v_select(v_load(high), sum.high, here), high);
        v_store(v_select(v_load(low), sum.low, here), low);
    }
#endif
}
