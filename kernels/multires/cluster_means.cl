// SPDX-License-Identifier: MIT
// cluster_means: records of the clusters of 4, 16 and 64 lights.
//
// Method:  Walter et al. 2005, "Lightcuts", with the mean of position, normal and area in place of
//          a representative light's: then errors of first order cancel. The mean normal isn't
//          scaled to unit length, so that the light towards any far point where no light of the
//          cluster is seen from behind is that of its lights.
// Reads:   records  of the lights, see cluster_order
//          bounds   likewise
// Writes:  records  of the clusters; means in proportion to luminous flux
//          bounds   of the clusters
// Launch:  a work-item for each cluster of a segment (columns), rows are segments

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cluster.clh"

__kernel void cluster_means(__global float *restrict records, __global float *restrict bounds,
                            const int2 size, const VplParams params, const int total)
{
    const int stride = params.stride;
    const int segment = (int)get_global_id(1);
    const int record = (int)get_global_id(0) + stride;
    if (segment * stride >= max(total, 1) || record >= tree_first(stride, 4)) {
        return;
    }
    const int level = record < tree_first(stride, 2) ? 1 : record < tree_first(stride, 3) ? 2 : 3;
    const int cluster = record - tree_first(stride, level);
    const int first = cluster << (2 * level);
    const int count = min(total - segment * stride, stride);
    const int end = min(first + (1 << (2 * level)), count);
    records += segment * tree_first(stride, 4) * TREE_RECORD;
    bounds += segment * tree_first_bound(stride, 4);
    __global const float *restrict leaves = bounds;
    bounds += tree_first_bound(stride, level);

    float mean[7] = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f}; // as in a record
    float flux[3] = {0.0f, 0.0f, 0.0f};
    float bound[TREE_BOUNDS];
    for (int j = 0; j < 3; ++j) {
        bound[TREE_POSITION + j] = bound[TREE_NORMAL + j] = INFINITY;
        bound[TREE_POSITION + 3 + j] = bound[TREE_NORMAL + 3 + j] = -INFINITY;
    }
    float weight = 0.0f;
    for (int i = first; i < end; ++i) {
        __global const float *light = records + i * TREE_RECORD;
        // A light without flux has a little weight, so that there is some.
        const float own = 0.2126f * light[8] + 0.7152f * light[9] + 0.0722f * light[10] + 1e-20f;
        weight += own;
        for (int j = 0; j < 7; ++j) {
            mean[j] += own * light[j];
        }
        for (int j = 0; j < 3; ++j) {
            flux[j] += light[8 + j];
        }
        for (int j = 0; j < 6; ++j) {
            const int low = j < 3 ? TREE_POSITION + j : TREE_NORMAL + j - 3;
            bound[low] = min(bound[low], leaves[low * stride + i]);
            bound[low + 3] = max(bound[low + 3], leaves[(low + 3) * stride + i]);
        }
    }
    const bool any = end > first;
    const float scale = any ? 1.0f / weight : 0.0f;
    for (int j = 0; j < 7; ++j) {
        mean[j] *= scale;
    }
    float spread = 0.0f, turn = 0.0f;
    // The light before which a fraction of the cluster's flux lies: of a golden-ratio sequence, so
    // that over all clusters visibility is sampled in proportion to flux. The light nearest to the
    // mean would see more than the others where a surface ends.
    const float golden = ((float)cluster + 0.5f) * 0.618034f;
    float left = (golden - floor(golden)) * weight;
    int target = -1;
    for (int i = first; i < end; ++i) {
        __global const float *light = records + i * TREE_RECORD;
        const float own = 0.2126f * light[8] + 0.7152f * light[9] + 0.0722f * light[10] + 1e-20f;
        for (int j = 0; j < 3; ++j) {
            const float off = light[j] - mean[j];
            const float bent = light[4 + j] - mean[4 + j];
            spread += own * off * off;
            turn += own * bent * bent;
        }
        target = target < 0 && left < own ? i : target;
        left -= own;
    }
    bound[TREE_DEVIATION] = sqrt(spread * scale);
    bound[TREE_TURN] = sqrt(turn * scale);
    bound[TREE_AREA] = mean[3];
    bound[TREE_FLUX] = max(flux[0], max(flux[1], flux[2]));
    const int width = tree_width(stride) * (level == 1 ? 4 : 1);
    const int copies = level == 3 ? 4 : 1;
    for (int j = 0; j < TREE_BOUNDS; ++j) {
        for (int i = copies * cluster; i < min(copies * (cluster + 1), width); ++i) {
            bounds[j * width + i] = any ? bound[j] : 0.0f;
        }
    }
    __global float *restrict own = records + record * TREE_RECORD;
    for (int j = 0; j < TREE_RECORD; ++j) {
        own[j] = j < 7 ? mean[j] : j >= 8 && j < 11 ? flux[j - 8] : 0.0f;
    }
    own[TREE_TARGET] = (float)(target < 0 ? max(end - 1, first) : target);
}
