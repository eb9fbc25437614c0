// SPDX-License-Identifier: MIT
// cluster_order: order of lights in which clusters of them are compact and face one way.
//
// Lights come along Hilbert curves over what the light sees, where neighbours may lie on different
// surfaces. Sorted by the axis that is nearest to their normal, and along the curve within one
// axis, runs of them seldom mix surfaces; in scenes of many small surfaces that is worth a factor
// of ten in the error of the runs.
// Reads:   lights   [segments][params.span][TREE_RECORD], see vpl/vpl_splat.cl; with `parts` 16
//                   behind them are their parts, which light what is near in their place
//          axes     [segments][params.stride] with CLUSTER_AXES 2: axis of each light
// Writes:  records  [segments][tree_first(params.stride, 4)][TREE_RECORD] of which the lights'
//          bounds   [segments][tree_first_bound(params.stride, 4)] likewise
//          axes     with CLUSTER_AXES 1; those of lights that come later are 5, so that none is put
//                   before another
// Macros:  CLUSTER_AXES: 0; 1: axes are kept; 2: lights go by axes that were kept, as they come and
//          turn: one that changed its place would change all runs behind it
// Params:  lights of all segments: total; VplParams of the first segment
// Launch:  a work-group of SSGI_GROUP work-items for each segment, each for as many lights, one
// after
//          the other

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cluster.clh"

#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

#ifndef CLUSTER_AXES
#error "CLUSTER_AXES must be defined by the host"
#endif

// 0 to 5: the axis nearest to a direction, and its sign. No two axes are weighed alike: a camera
// often looks along a diagonal of a room, whose walls must not be torn by rounding.
static inline int cluster_axis(__global const float *restrict way)
{
    const float x = fabs(way[0]), y = fabs(way[1]) * 0.94f, z = fabs(way[2]) * 1.13f;
    const int axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    return 2 * axis + (way[axis] < 0.0f ? 1 : 0);
}

__kernel void cluster_order(__global const float *restrict lights, __global float *restrict records,
                            __global float *restrict bounds,
#if CLUSTER_AXES
                            __global int *restrict axes,
#endif
                            const int2 size, const VplParams params, const int total,
                            const int parts)
{
    __local int counts[6][SSGI_GROUP]; // of lights by axis, of each work-item
    __local int places[6][SSGI_GROUP]; // where its next light of an axis goes
    const int item = (int)get_local_id(0);
    const int segment = (int)get_group_id(0);
    const int stride = params.stride;
    const int count = min(total - segment * stride, stride);
    const int share = (stride + SSGI_GROUP - 1) / SSGI_GROUP;
    const int begin = min(item * share, stride);
    const int end = segment * stride < max(total, 1) ? min(begin + share, stride) : begin;
    lights += segment * params.span * TREE_RECORD;
    records += segment * tree_first(stride, 4) * TREE_RECORD;
    bounds += segment * tree_first_bound(stride, 4);
    for (int axis = 0; axis < 6; ++axis) {
        counts[axis][item] = 0;
    }
#if CLUSTER_AXES
    axes += segment * stride;
#endif
    for (int i = begin; i < min(end, count); ++i) {
#if CLUSTER_AXES == 2
        const int axis = axes[i];
#else
        const int axis = cluster_axis(lights + i * TREE_RECORD + 4);
#endif
#if CLUSTER_AXES == 1
        axes[i] = axis;
#endif
        counts[axis][item] += 1;
    }
#if CLUSTER_AXES == 1
    for (int i = max(begin, count); i < min(begin + share, stride); ++i) {
        axes[i] = 5;
    }
#endif
    barrier(CLK_LOCAL_MEM_FENCE);
    int before = 0;
    for (int axis = 0; axis < 6; ++axis) {
        for (int other = 0; other < SSGI_GROUP; ++other) {
            if (other == item) {
                places[axis][item] = before;
            }
            before += counts[axis][other];
        }
    }
    for (int i = begin; i < end; ++i) {
        __global const float *restrict light = lights + i * TREE_RECORD;
        int to = i;
        if (i < count) {
#if CLUSTER_AXES
            const int axis = axes[i];
#else
            const int axis = cluster_axis(light + 4);
#endif
            to = places[axis][item];
            places[axis][item] = to + 1;
        }
        for (int j = 0; j < TREE_RECORD; ++j) {
            records[to * TREE_RECORD + j] = i < count ? light[j] : 0.0f;
        }
        records[to * TREE_RECORD + TREE_NUMBER] = (float)i;
        for (int j = 0; j < 6; ++j) { // position and minus the normal
            const int from = j < 3 ? j : j + 1;
            float low = i < count ? light[from] : 0.0f;
            float high = low;
            for (int part = 0; part < parts && i < count; ++part) {
                __global const float *restrict own =
                    lights + (stride + 16 * i + part) * TREE_RECORD;
                if (max(own[8], max(own[9], own[10])) > 0.0f) {
                    low = min(low, own[from]);
                    high = max(high, own[from]);
                }
            }
            const int row = j < 3 ? TREE_POSITION + j : TREE_NORMAL + j - 3;
            bounds[row * stride + to] = low;
            bounds[(row + 3) * stride + to] = high;
        }
    }
}
