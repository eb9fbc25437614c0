// SPDX-License-Identifier: MIT
// sampled_triangles: the corners of a scene's triangles, as sampled_depth reads them.
//
// Reads:   corners    4 x [stride] vertices, and whether the back is not there
//          positions  3 x [vertex_stride] scene units, relative to the scene's origin
//          cutouts    [count] material of a triangle with holes, else -1
//          order      [stride / SAMPLED_RUN] numbers of runs of triangles
// Writes:  triangles  [10][stride] corners in the order of the runs, of triangles with holes all
//                     three the first; and 1 where the back is not there, else 0
// Macros:  SAMPLED_RUN: triangles of a run, a multiple of the lanes
// Params:  size = (stride, 1): triangles, rounded up to runs; count of them; vertex_stride
// Launch:  SSGI_LANES triangles per work-item, one row
// Cost:    14 scattered reads per triangle

#include "common/gbuffer.clh"

#ifndef SAMPLED_RUN
#error "SAMPLED_RUN must be defined by the host"
#endif

__kernel void sampled_triangles(__global const int *restrict corners,
                                __global const float *restrict positions,
                                __global const int *restrict cutouts,
                                __global const int *restrict order,
                                __global float *restrict triangles, const int2 size,
                                const int count, const int vertex_stride)
{
    const int to = ssgi_first_column();
    if (to >= size.x) {
        return;
    }
    const int first = order[to / SAMPLED_RUN] * SAMPLED_RUN + to % SAMPLED_RUN;
    const vint own = v_imin(v_iota() + first, v_splat_int(count - 1));
    const vmask solid = v_ilt(v_igather(cutouts, own), v_splat_int(0));
    const vint instead = v_iload(corners + first);
#pragma unroll
    for (int corner = 0; corner < 3; ++corner) {
        const vint vertex = v_iselect(instead, v_iload(corners + corner * size.x + first), solid);
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
            v_store(v_gather(positions + axis * vertex_stride, vertex),
                    triangles + (3 * corner + axis) * size.x + to);
        }
    }
    v_store(v_to_float(v_iload(corners + 3 * size.x + first)), triangles + 9 * size.x + to);
}
