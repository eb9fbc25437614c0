// SPDX-License-Identifier: MIT
// sampled_cutouts: triangles with holes in the depth maps of sampled lights.
//
// Texels whose middle meets a hole, which the alpha of the material's texture cuts out, stay as
// they are.
//
// Reads:   chosen     [size.y] triangles with holes
//          corners    4 x [triangles, rounded up to 16] vertices, and whether the back is not there
//          positions  3 x [vertex_stride] scene units, relative to the scene's origin
//          uvs        2 x [vertex_stride]; cutouts, materials, textures, texels, decode: see
//                     raster_tiles
//          views      see sampled_depth
// Writes:  maps       see sampled_depth
// Params:  size = (views, chosen triangles); triangles of the scene, vertex_stride, side: texels
//          along a side of a map
// Launch:  a work-item for each view of each chosen triangle
// Cost:    60 operations, and 50 per SSGI_LANES texels of the triangle's box

#include "common/lanes.clh"
#include "raster/records.clh"
#include "raster/texture.clh"
#include "sampled_lights/cover.clh"

__kernel void
sampled_cutouts(__global const int *restrict chosen, __global const int *restrict corners,
                __global const float *restrict positions, __global const float *restrict uvs,
                __global const int *restrict cutouts, __global const float *restrict materials,
                __global const int *restrict textures, __global const int *restrict texels,
                __global const float *restrict decode, __global const float *restrict views,
                __global int *restrict maps, const int2 size, const int triangles,
                const int vertex_stride, const int side)
{
    const int view = (int)get_global_id(0), number = (int)get_global_id(1);
    if (view >= size.x || number >= size.y) {
        return;
    }
    __global const float *restrict m = views + view * 12;
    __global int *restrict map = maps + view * side * side;
    const int triangle = chosen[number], stride = (triangles + 15) & ~15;
    float kx[3], ky[3];
    vfloat z[3], u[3], v[3];
    for (int k = 0; k < 3; ++k) {
        const int vertex = corners[k * stride + triangle];
        const float px = positions[vertex], py = positions[vertex_stride + vertex];
        const float pz = positions[2 * vertex_stride + vertex];
        kx[k] = fma(px, m[0], fma(py, m[1], fma(pz, m[2], m[3])));
        ky[k] = fma(px, m[4], fma(py, m[5], fma(pz, m[6], m[7])));
        z[k] = v_splat(fma(px, m[8], fma(py, m[9], fma(pz, m[10], m[11]))));
        u[k] = v_splat(uvs[vertex]);
        v[k] = v_splat(uvs[vertex_stride + vertex]);
    }
    const vfloat whole_x[3] = {v_splat(kx[0]), v_splat(kx[1]), v_splat(kx[2])};
    const vfloat whole_y[3] = {v_splat(ky[0]), v_splat(ky[1]), v_splat(ky[2])};
    if (corners[3 * stride + triangle] && v_any(sampled_back(whole_x, whole_y))) {
        return;
    }
    const float room = 0.5f + SAMPLED_ROOM, last = (float)(side - 1);
    const float from_x = max(ceil(min(min(kx[0], kx[1]), kx[2]) - room), 0.0f);
    const float from_y = max(ceil(min(min(ky[0], ky[1]), ky[2]) - room), 0.0f);
    const float to_x = min(floor(max(max(kx[0], kx[1]), kx[2]) - 0.5f + SAMPLED_ROOM), last);
    const float to_y = min(floor(max(max(ky[0], ky[1]), ky[2]) - 0.5f + SAMPLED_ROOM), last);
    if (!(from_x <= to_x && from_y <= to_y)) {
        return;
    }
    __global const float *material = materials + cutouts[triangle] * RASTER_MATERIAL;
    const RasterTextures from = {textures, texels, decode};
    for (int row = (int)from_y; row <= (int)to_y; ++row) {
        const float middle = (float)row + 0.5f;
        const vfloat y[3] = {v_splat(ky[0] - middle), v_splat(ky[1] - middle),
                             v_splat(ky[2] - middle)};
        for (int first = (int)from_x; first <= (int)to_x; first += SSGI_LANES) {
            const vint column = v_iota() + first;
            const vfloat at = v_to_float(column) + 0.5f;
            const vfloat x[3] = {kx[0] - at, kx[1] - at, kx[2] - at};
            vfloat weight[3];
            vmask hit = sampled_weights(x, y, weight) & v_ile(column, v_splat_int((int)to_x));
            if (!v_any(hit)) {
                continue;
            }
            const vfloat tu = v_fma(weight[0], u[0], v_fma(weight[1], u[1], weight[2] * u[2]));
            const vfloat tv = v_fma(weight[0], v[0], v_fma(weight[1], v[1], weight[2] * v[2]));
            const vfloat zero = v_splat(0.0f);
            const vfloat alpha =
                raster_texture_alpha(from, (int)material[3], v_select(zero, tu, hit),
                                     v_select(zero, tv, hit)) *
                material[4];
            hit = hit & v_ge(alpha, v_splat(material[5]));
            int bits[SSGI_LANES], hits[SSGI_LANES];
            v_ikeep(v_bits(sampled_mixed(weight, z)), bits);
            v_ikeep(hit, hits);
            for (int lane = 0; lane < SSGI_LANES; ++lane) {
                __global int *restrict texel = map + row * side + first + lane;
                if (hits[lane] && bits[lane] < *texel) {
                    atomic_min(texel, bits[lane]);
                }
            }
        }
    }
}
