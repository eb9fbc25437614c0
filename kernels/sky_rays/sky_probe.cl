// SPDX-License-Identifier: MIT
// sky_probe: which parts of the sphere send light to the pixels of each cell of the image.
//
// Method:  every `step`-th row sends rays to two opposite parts of the sphere `each` times; 16
// pixels
//          of a row to the same two, the next ones to others.
// Reads:   depth, normal  with margin; normal in view space
//          strata, points, nodes, triangles; cutouts, textures, texels, decode (SKY_HOLES 1): see
//          strata.clh, rays/bvh.clh
// Writes:  cells      [rows / SKY_CELL][columns / SKY_CELL][SKY_WORDS], rounded up: bits of
//                     quarters of strata of which light arrives at a pixel; starts as 0
// Macros:  SKY_WORDS (4..32), SKY_HOLES (0 or 1)
// Params:  step; each
// Launch:  SSGI_LANES pixels of every `step`-th row per work-item
// Cost:    about a ray for each

#if SKY_HOLES
#define RAYS_HOLES
#endif
#include "sky_rays/strata.clh"

__kernel void sky_probe(ssgi_plane depth, ssgi_plane normal, __global const float *restrict points,
                        __global const float *restrict nodes,
                        __global const float *restrict triangles,
#if SKY_HOLES
                        __global const float *restrict cutouts,
                        __global const int *restrict textures, __global const int *restrict texels,
                        __global const float *restrict decode,
#endif
                        __global int *restrict cells, const int2 size, const SsgiCamera camera,
                        const SkyParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1) * params.step;
    if (x >= size.x || y >= size.y) {
        return;
    }
#if SKY_HOLES
    const RaysHoles holes = {cutouts, {textures, texels, decode}};
#else
    const RaysHoles holes = 0;
#endif
    const SkyPoint p = sky_point(depth, normal, size, x, y, camera, params);
    if (!v_any(p.there)) {
        return;
    }
    const int half_of = SKY_WORDS * 4;
    for (int k = 0; k < 2 * params.each; ++k) {
        // The nine cells about a pixel have 24 such rows of 6 times 16 columns, or more times
        // `each`: every part is met there.
        const int number = (y / params.step + x / 16 * 24) * params.each + k / 2;
        const int s = number * 37 % half_of + k % 2 * half_of;
        const vint point = sky_turn(x, y / params.step, k);
        const SkyRay to = sky_ray(points, (point + s * SKY_POINTS) * 3, p, params);
        const vmask wanted = p.there & v_gt(to.cosine, v_splat(0.0f));
        if (!v_any(wanted)) {
            continue;
        }
        vfloat part;
        const vmask open =
            wanted & ~rays_blocked_at(nodes, triangles, holes, to.ray, wanted, &part);
        int bits = 0;
        for (int q = 0; q < 4; ++q) {
            bits |= v_any(open & v_ieq(point / (SKY_POINTS / 4), v_splat_int(q))) ? 1 << q : 0;
        }
        if (bits != 0) {
            atomic_or(cells + sky_cell(size, x, y) + s / 8, bits << (s % 8 * 4));
        }
    }
}
