// SPDX-License-Identifier: MIT
// bvh_split: nodes of a hierarchy of boxes round triangles (rays/bvh.clh).
//
// A node's triangles go to BVH_BINS bins by the middles of their boxes, along the axis in which
// these lie farthest apart. It is split between the bins where the areas of the halves' boxes,
// times how many triangles they hold, sum to the least (Wald 2007, "On fast Construction of
// SAH-based Bounding Volume Hierarchies"). Nodes below BVH_DEEPEST others are halved instead.
//
// A box is a float8: minus its least corner, any number, its greatest corner, any number; so that
// the box round two is their greater numbers. Boxes of a level are sorted from one array to
// another, and those of the next level back.
//
// With one lane the work-items of a group find a node's bounds together and sort equal shares of
// its boxes, which stay in order. With more lanes a group has a single work-item.
//
// Reads:   open    [size.x][4] nodes to split: their first box, how many they have, their depth,
//                  in how many of the splits above they were the left half
// Writes:  even, odd  [boxes] those to be split in the array of their depth; the fourth number is
//                  the triangle's (int bits)
//          halves  [size.x][2][4] what they were split into, if `once`; unless they are leaves
//          nodes   [boxes][2][8] inner nodes by the box that their second half begins with, leaves
//                  by their first: minus the least corner, their first box (int bits), the greatest
//                  corner, how many they have (int bits)
//          lefts   [boxes][2] one more than in how many splits above they were the left half
//          order   [boxes] numbers of triangles, those of each node one after the other
// Params:  whether nodes are split only once
// Launch:  a work-group for each node: of SSGI_GROUP work-items with one lane, else of one

#include "common/lanes.clh"

#if !defined(BVH_BINS) || !defined(BVH_LEAF) || !defined(BVH_DEEPEST) || !defined(BVH_WAITING)
#error "ssgi_cl/device/constants.py defines BVH_BINS, BVH_LEAF, BVH_DEEPEST and BVH_WAITING"
#endif

#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

#if SSGI_LANES == 1
#define BVH_GROUP SSGI_GROUP
#define BVH_WAIT() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
typedef int8 BvhBox; // integers in the order of numbers, which atomic operations know
#else
#define BVH_GROUP 1
#define BVH_WAIT()
typedef float8 BvhBox;
#endif

// What work-items of a group share.
typedef struct {
    BvhBox bounds[2][2]; // of every other node: round boxes, and round their middles
    BvhBox bins[BVH_BINS];
    int held[BVH_BINS][BVH_GROUP + 1]; // boxes of a bin by whose share they are in, and of all
    int begin[BVH_BINS];               // where the boxes of a bin go
    float work[2][BVH_BINS];           // of either half where the second begins with this bin
    int4 waiting[BVH_WAITING];         // nodes
} BvhShared;

// How a node is split: box i goes to bin (middle along the axis - begin) / wide * BVH_BINS.
typedef struct {
    int axis;
    float begin, wide;
} BvhAxis;

// The bin of one of the boxes. A coordinate of a vector of its own would be chosen each time.
static inline int bvh_bin(__global const float8 *restrict boxes, const int i, const BvhAxis by)
{
    __global const float *restrict box = (__global const float *)(boxes + i) + by.axis;
    const float along = (0.5f * (box[4] - box[0]) - by.begin) / by.wide;
    return clamp((int)(along * (float)BVH_BINS), 0, BVH_BINS - 1);
}

// Half the surface of a box, 0 of an empty one.
static inline float bvh_area(const float8 box)
{
    const float4 side = max(box.hi + box.lo, 0.0f);
    return side.x * side.y + side.y * side.z + side.z * side.x;
}

#if BVH_GROUP > 1
static inline BvhBox bvh_kept(const float8 box)
{
    const int8 bits = as_int8(box);
    return bits ^ (bits >> 31 & INT_MAX);
}

static inline float8 bvh_box(const BvhBox kept) { return as_float8(kept ^ (kept >> 31 & INT_MAX)); }

static inline void bvh_widen(__local BvhBox *box, const float8 by)
{
    const BvhBox kept = bvh_kept(by);
    __local int *numbers = (__local int *)box;
    atomic_max(numbers, kept.s0);
    atomic_max(numbers + 1, kept.s1);
    atomic_max(numbers + 2, kept.s2);
    atomic_max(numbers + 4, kept.s4);
    atomic_max(numbers + 5, kept.s5);
    atomic_max(numbers + 6, kept.s6);
}
#else
static inline BvhBox bvh_kept(const float8 box) { return box; }
static inline float8 bvh_box(const BvhBox kept) { return kept; }
static inline void bvh_widen(__local BvhBox *box, const float8 by) { *box = max(*box, by); }
#endif

// The work of one half for each bin that the second begins with; INFINITY if it is empty.
static inline void bvh_work(__local BvhShared *shared, const int side)
{
    BvhBox box = bvh_kept((float8)(-INFINITY));
    int count = 0;
#pragma unroll 1
    for (int i = 0; i < BVH_BINS; ++i) {
        const int bin = side == 0 ? i : BVH_BINS - 1 - i;
        if (side == 0) {
            shared->begin[bin] = count;
            shared->work[0][bin] = count > 0 ? (float)count * bvh_area(bvh_box(box)) : INFINITY;
        }
        box = max(box, shared->bins[bin]);
        count += shared->held[bin][BVH_GROUP];
        if (side == 1) {
            shared->work[1][bin] = count > 0 ? (float)count * bvh_area(bvh_box(box)) : INFINITY;
        }
    }
}

// The axis in which middles lie farthest apart. GPUs keep vectors in memory of which a variable
// chooses a number: hence the sum.
static inline BvhAxis bvh_axis(const float8 middles)
{
    const float4 apart = middles.hi + middles.lo;
    const float wide = max(max(apart.x, apart.y), apart.z);
    const int axis = apart.x == wide ? 0 : apart.y == wide ? 1 : 2;
    const float x = axis == 0, y = axis == 1, z = axis == 2;
    const BvhAxis by = {axis, -(middles.s0 * x + middles.s1 * y + middles.s2 * z),
                        max(wide, 1e-30f)};
    return by;
}

static inline void bvh_node(__global float8 *restrict nodes, __global int *restrict lefts,
                            const int place, float8 box, const int4 node)
{
    box.s3 = as_float(node.x);
    box.s7 = as_float(node.y);
    nodes[place] = box;
    lefts[place] = node.w + 1;
}

__kernel void bvh_split(__global const int4 *restrict open, __global float8 *restrict even,
                        __global float8 *restrict odd, __global int4 *restrict halves,
                        __global float8 *restrict nodes, __global int *restrict lefts,
                        __global int *restrict order, const int2 size, const int once)
{
    __local BvhShared shared;
    const int item = (int)get_local_id(0), group = (int)get_group_id(0);
    if (group >= size.x) {
        return;
    }
    const BvhBox empty = bvh_kept((float8)(-INFINITY));
    if (item == 0) {
        shared.waiting[0] = open[group];
        shared.bounds[0][0] = empty;
        shared.bounds[0][1] = empty;
    }
    int turn = 0;
    for (int left = 1; left > 0; turn = 1 - turn) {
        BVH_WAIT();
        const int4 node = shared.waiting[--left];
        // Below the deepest level nothing is sorted.
        const bool leaf = node.y <= BVH_LEAF, sorted = !leaf && node.z < BVH_DEEPEST;
        const bool is_odd = min(node.z, BVH_DEEPEST) & 1;
        __global const float8 *from = (is_odd ? odd : even) + node.x;
        __global float8 *to = (is_odd ? even : odd) + node.x;
        float8 box = (float8)(-INFINITY), middles = (float8)(-INFINITY);
        for (int i = item; i < node.y; i += BVH_GROUP) {
            const float4 middle = 0.5f * (from[i].hi - from[i].lo);
            box = max(box, from[i]);
            middles.lo = max(middles.lo, -middle);
            middles.hi = max(middles.hi, middle);
        }
        if (item < node.y) {
            bvh_widen(&shared.bounds[turn][0], box);
            bvh_widen(&shared.bounds[turn][1], middles);
        }
        for (int bin = 0; sorted && bin < BVH_BINS; ++bin) {
            shared.held[bin][item] = 0;
            if (bin % BVH_GROUP == item) {
                shared.bins[bin] = empty;
            }
        }
        BVH_WAIT();
        const BvhAxis by = bvh_axis(bvh_box(shared.bounds[turn][1]));
        const int share = sorted ? (node.y + BVH_GROUP - 1) / BVH_GROUP : 0;
        const int first = min(item * share, node.y), end = min(first + share, node.y);
        for (int i = first; i < end; ++i) {
            const int bin = bvh_bin(from, i, by);
            bvh_widen(&shared.bins[bin], from[i]);
            shared.held[bin][item] += 1;
        }
        BVH_WAIT();
        for (int bin = item; sorted && bin < BVH_BINS; bin += BVH_GROUP) {
            int sum = 0;
#pragma unroll 4
            for (int i = 0; i < min(node.y, BVH_GROUP); ++i) {
                const int own = shared.held[bin][i];
                shared.held[bin][i] = sum;
                sum += own;
            }
            shared.held[bin][BVH_GROUP] = sum;
        }
        BVH_WAIT();
        for (int side = item; sorted && side < 2; side += BVH_GROUP) {
            bvh_work(&shared, side);
        }
        BVH_WAIT();
        int count = node.y / 2; // any half if no split promises anything
        float least = INFINITY;
        for (int bin = 1; sorted && bin < BVH_BINS; ++bin) {
            const float work = shared.work[0][bin] + shared.work[1][bin];
            count = work < least ? shared.begin[bin] : count;
            least = min(least, work);
        }
        for (int i = first; i < end; ++i) {
            const int bin = bvh_bin(from, i, by);
            to[shared.begin[bin] + shared.held[bin][item]++] = from[i];
        }
        for (int i = item; leaf && i < node.y; i += BVH_GROUP) {
            order[node.x + i] = as_int(from[i].s3);
        }
        if (item == 0) {
            const int place = leaf ? 2 * node.x + 1 : 2 * (node.x + count);
            bvh_node(nodes, lefts, place, bvh_box(shared.bounds[turn][0]), node);
            shared.bounds[1 - turn][0] = empty;
            shared.bounds[1 - turn][1] = empty;
            const int4 first_half = (int4)(node.x, count, node.z + 1, node.w + 1);
            const int4 second_half = (int4)(node.x + count, node.y - count, node.z + 1, node.w);
            if (!leaf && once) {
                halves[2 * group] = first_half;
                halves[2 * group + 1] = second_half;
            } else if (!leaf) {
                shared.waiting[left] = second_half;
                shared.waiting[left + 1] = first_half;
            }
        }
        left += leaf || once ? 0 : 2;
    }
}
