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
// Reads:   open    [size.x][4] nodes to split: their first box, how many they have, their depth,
//                  in how many of the splits above they were the left half
// Writes:  boxes   [2][stride] those to be split in the array of their depth, odd or even; the
//                  fourth number is the triangle's (int bits)
//          halves  [size.x][2][4] what they were split into, if `once`; unless they are leaves
//          nodes   [stride][2][8] inner nodes by the box that their second half begins with, leaves
//                  by their first: minus the least corner, their first box (int bits), the greatest
//                  corner, how many they have (int bits)
//          lefts   [stride][2] one more than in how many splits above they were the left half
//          order   [stride] numbers of triangles, those of each node one after the other
// Params:  how many boxes there are: stride; whether nodes are split only once
// Launch:  a work-item for each node

#include "common/lanes.clh"

#if !defined(BVH_BINS) || !defined(BVH_LEAF) || !defined(BVH_DEEPEST) || !defined(BVH_WAITING)
#error "ssgi_cl/device/constants.py defines BVH_BINS, BVH_LEAF, BVH_DEEPEST and BVH_WAITING"
#endif

// How a node is split: box i goes to bin (middle along the axis - begin) / wide * BVH_BINS.
typedef struct {
    int axis;
    float begin, wide;
} BvhAxis;

static inline float4 bvh_middle(const float8 box) { return 0.5f * (box.hi - box.lo); }

static inline float bvh_along(const float4 v, const int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

static inline int bvh_bin(const float8 box, const BvhAxis by)
{
    const float along = (bvh_along(bvh_middle(box), by.axis) - by.begin) / by.wide;
    return clamp((int)(along * (float)BVH_BINS), 0, BVH_BINS - 1);
}

// Half the surface of a box, 0 of an empty one.
static inline float bvh_area(const float8 box)
{
    const float4 side = max(box.hi + box.lo, 0.0f);
    return side.x * side.y + side.y * side.z + side.z * side.x;
}

// The bin that the second half begins with, where the work is least; 0 if no split promises any.
static inline int bvh_best(const float8 *bins, const int *held, const int count)
{
    float behind[BVH_BINS];
    float8 box = (float8)(-INFINITY);
    for (int bin = BVH_BINS - 1; bin > 0; --bin) {
        box = max(box, bins[bin]);
        behind[bin] = bvh_area(box);
    }
    int best = 0, before = 0;
    float least = INFINITY;
    box = (float8)(-INFINITY);
    for (int bin = 1; bin < BVH_BINS; ++bin) {
        box = max(box, bins[bin - 1]);
        before += held[bin - 1];
        const float work = (float)before * bvh_area(box) + (float)(count - before) * behind[bin];
        if (before > 0 && before < count && work < least) {
            least = work;
            best = bin;
        }
    }
    return best;
}

// How many boxes the first half of a node has, after its boxes are sorted by their bins.
static inline int bvh_halve(__global const float8 *restrict from, __global float8 *restrict to,
                            const int count, const float8 middles)
{
    const float4 low = -middles.lo, apart = middles.hi - low;
    BvhAxis by;
    by.axis = apart.x >= apart.y && apart.x >= apart.z ? 0 : apart.y >= apart.z ? 1 : 2;
    by.begin = bvh_along(low, by.axis);
    by.wide = max(bvh_along(apart, by.axis), 1e-30f);
    float8 bins[BVH_BINS];
    int held[BVH_BINS];
    for (int bin = 0; bin < BVH_BINS; ++bin) {
        bins[bin] = (float8)(-INFINITY);
        held[bin] = 0;
    }
    for (int i = 0; i < count; ++i) {
        const float8 box = from[i];
        const int bin = bvh_bin(box, by);
        bins[bin] = max(bins[bin], box);
        held[bin] += 1;
    }
    const int best = bvh_best(bins, held, count);
    int next = 0, left = count / 2; // any half if all are in one place
    for (int bin = 0; bin < BVH_BINS; ++bin) {
        left = bin == best && bin > 0 ? next : left;
        const int own = held[bin];
        held[bin] = next;
        next += own;
    }
    for (int i = 0; i < count; ++i) {
        const float8 box = from[i];
        to[held[bvh_bin(box, by)]++] = box;
    }
    return left;
}

static inline void bvh_node(__global float8 *restrict nodes, __global int *restrict lefts,
                            const int place, float8 box, const int4 node)
{
    box.s3 = as_float(node.x);
    box.s7 = as_float(node.y);
    nodes[place] = box;
    lefts[place] = node.w + 1;
}

__kernel void bvh_split(__global const int4 *restrict open, __global float8 *restrict boxes,
                        __global int4 *restrict halves, __global float8 *restrict nodes,
                        __global int *restrict lefts, __global int *restrict order, const int2 size,
                        const int stride, const int once)
{
    const int item = (int)get_global_id(0);
    if (item >= size.x) {
        return;
    }
    int4 waiting[BVH_WAITING];
    waiting[0] = open[item];
    for (int left = 1; left > 0;) {
        const int4 node = waiting[--left];
        // Below the deepest level nothing is sorted.
        const int odd = min(node.z, BVH_DEEPEST) & 1;
        __global const float8 *restrict from = boxes + odd * stride + node.x;
        float8 box = (float8)(-INFINITY), middles = (float8)(-INFINITY);
        for (int i = 0; i < node.y; ++i) {
            const float4 middle = bvh_middle(from[i]);
            box = max(box, from[i]);
            middles = max(middles, (float8)(-middle, middle));
        }
        if (node.y <= BVH_LEAF) {
            for (int i = 0; i < node.y; ++i) {
                order[node.x + i] = as_int(from[i].s3);
            }
            bvh_node(nodes, lefts, 2 * node.x + 1, box, node);
            continue;
        }
        const int count =
            node.z >= BVH_DEEPEST
                ? node.y / 2
                : bvh_halve(from, boxes + (1 - odd) * stride + node.x, node.y, middles);
        bvh_node(nodes, lefts, 2 * (node.x + count), box, node);
        const int4 first = (int4)(node.x, count, node.z + 1, node.w + 1);
        const int4 second = (int4)(node.x + count, node.y - count, node.z + 1, node.w);
        if (once) {
            halves[2 * item] = first;
            halves[2 * item + 1] = second;
        } else {
            waiting[left++] = second;
            waiting[left++] = first;
        }
    }
}
