// SPDX-License-Identifier: MIT
// sampled_triangles: the corners of a scene's triangles, as sampled_depth reads them.
//
// Reads:   corners    4 x [stride] vertices, and whether the back is not there
//          positions  3 x [vertex_stride] scene units, relative to the scene's origin
//          cutouts    [count] material of a triangle with holes, else -1
// Writes:  triangles  [9][stride] corners; of triangles with holes all three are the first
// Params:  size = (stride, 1): triangles, rounded up to 16; count of them; vertex_stride
// Launch:  SSGI_LANES triangles per work-item, one row
// Cost:    13 scattered reads per triangle

#include "common/gbuffer.clh"

__kernel void sampled_triangles(__global const int *restrict corners,
                                __global const float *restrict positions,
                                __global const int *restrict cutouts,
                                __global float *restrict triangles, const int2 size,
                                const int count, const int vertex_stride)
{
    const int first = ssgi_first_column();
    if (first >= size.x) {
        return;
    }
    const vint own = v_imin(v_iota() + first, v_splat_int(count - 1));
    const vmask solid = v_ilt(v_igather(cutouts, own), v_splat_int(0));
    const vint instead = v_iload(corners + first);
#pragma unroll
    for (int corner = 0; corner < 3; ++corner) {
        const vint vertex = v_iselect(instead, v_iload(corners + corner * size.x + first), solid);
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
            v_store(v_gather(positions + axis * vertex_stride, vertex),
                    triangles + (3 * corner + axis) * size.x + first);
        }
    }
}
