// SPDX-License-Identifier: MIT
// final_gather: irradiance at samples by rays over the hemisphere to the surfaces that they meet.
//
// Method:  E = pi / n sum L(y_i), where y_i is what ray i meets first, n rays in proportion to the
//          cosine, one in each of as many strata of equal weight. L is that of a volume, of the
//          surfaces round y_i that face the same way. What meets nothing adds nothing.
//          Samples of a tile of GATHER_TILE x GATHER_TILE have other rays, which together are as
//          many strata as finer: errors of neighbours differ, and rays of one stratum are alike.
// Reads:   depth, normal  of the samples' G-buffer, with margin; view space
//          list     how many samples there are, and so many times row << 16 | column
//          ways     [GATHER_RAYS][3][GATHER_TILE^2] directions, z along the normal
//          nodes, triangles  see rays/bvh.clh
//          volume   see radiosity/volume.clh
//          fractions   [rows, columns] what the light counts for, see multires_interpolate
// Writes:  values   3 x [rows, columns], W/m^2: the light is added, at the samples alone; with
//                   GATHER_KEPT 4 x, where the light is written, and the mean of 1 / distance of
//                   what rays meet, in lengths of the receivers
// Macros:  GATHER_RAYS, VOLUME_CELLS (along a side), GATHER_KEPT (0, 1)
// Params:  RaysParams; GatherParams: cells of the volume per unit of the hierarchy's space and
// where
//          its origin is in cells; length of rays; columns and rows that the tiles are moved by
// Launch:  any number of work-items, each of which takes every so-many-th piece of SSGI_LANES
// Cost:    a walk through the hierarchy and 12 reads for each ray

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"
#include "rays/ends.clh"
#include "radiosity/volume.clh"

#if !defined(GATHER_RAYS) || !defined(GATHER_KEPT) || !defined(GATHER_TILE)
#error "the host defines GATHER_RAYS, GATHER_KEPT, ssgi_cl/device/constants.py GATHER_TILE, of 2"
#endif

#define GATHER_TURNS -0.5f // component z of normals below which their other directions turn

__kernel void final_gather(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                           __global const float *restrict ways,
                           __global const float *restrict nodes,
                           __global const float *restrict triangles, const RaysParams rays,
                           __global const float *restrict volume, ssgi_plane fractions,
                           __global float *restrict values, const int2 size,
                           const SsgiCamera camera, const VplParams params,
                           const GatherParams gather)
{
    const int listed = list[0];
    const vfloat zero = v_splat(0.0f);
    const int pieces = (listed + SSGI_LANES - 1) / SSGI_LANES;
    for (int turn = 0, own = cut_own(0, pieces); own < pieces; own = cut_own(++turn, pieces)) {
        const vint pixel = cut_pixels(list, own * SSGI_LANES);
        const vint column = pixel & 0xffff, row = pixel >> 16;
        const VplReceiver at = cut_receiver(depth, normal, pixel, size, camera, params);
        const RaysEnd from = rays_end(at.x, at.y, at.z, at.nx, at.ny, at.nz, rays);
        // The normal in the space of the hierarchy, and two directions across it (Duff et al.
        // 2017), which turn round where walls are few.
        const vfloat ax = at.nx * rays.xx + at.ny * rays.xy + at.nz * rays.xz;
        const vfloat ay = at.nx * rays.yx + at.ny * rays.yy + at.nz * rays.yz;
        const vfloat az = at.nx * rays.zx + at.ny * rays.zy + at.nz * rays.zz;
        const vfloat per = v_rsqrt(v_max(v_fma(ax, ax, v_fma(ay, ay, az * az)), v_splat(1e-30f)));
        const vfloat nx = ax * per, ny = ay * per, nz = az * per;
        const vfloat sign =
            v_select(v_splat(-1.0f), v_splat(1.0f), v_gt(nz, v_splat(GATHER_TURNS)));
        const vfloat a = -1.0f / (sign + nz), b = nx * ny * a;
        const vfloat ux = v_fma(sign * nx * nx, a, v_splat(1.0f)), uy = sign * b, uz = -sign * nx;
        const vfloat vx = b, vy = v_fma(ny * ny, a, sign), vz = -ny;
        const vint tile = ((row + gather.rows_on) & (GATHER_TILE - 1)) * GATHER_TILE +
                          ((column + gather.columns_on) & (GATHER_TILE - 1));
        vfloat sum[3] = {zero, zero, zero};
#if GATHER_KEPT
        const vfloat per_way = v_splat(1.0f / (gather.reach * params.per_unit));
        vfloat near = zero;
#endif
        for (int ray = 0; ray < GATHER_RAYS; ++ray) {
            __global const float *restrict way = ways + ray * (3 * GATHER_TILE * GATHER_TILE);
            const vfloat p = v_gather(way, tile);
            const vfloat q = v_gather(way + GATHER_TILE * GATHER_TILE, tile);
            const vfloat r = v_gather(way + 2 * GATHER_TILE * GATHER_TILE, tile);
            const vfloat wx = v_fma(p, ux, v_fma(q, vx, r * nx));
            const vfloat wy = v_fma(p, uy, v_fma(q, vy, r * ny));
            const vfloat wz = v_fma(p, uz, v_fma(q, vz, r * nz));
            const RaysRay line = {
                from.x, from.y, from.z, wx * gather.reach, wy * gather.reach, wz * gather.reach};
            const RaysHit hit = rays_closest(nodes, triangles, line, at.there);
            const vmask met = v_ige(hit.triangle, v_splat_int(0));
            if (!v_any(met)) {
                continue;
            }
            const vint t = v_iselect(v_splat_int(0), hit.triangle, met) * RAYS_TRIANGLE;
            vfloat away[3];
            rays_away(triangles, t, wx, wy, wz, away);
            const vfloat scale = v_splat(gather.per_cell);
            vfloat sent[3];
            volume_radiance(volume,
                            v_fma(v_fma(line.wx, hit.where, line.x), scale,
                                  v_fma(away[0], v_splat(-VOLUME_BEFORE), v_splat(gather.cell_x))),
                            v_fma(v_fma(line.wy, hit.where, line.y), scale,
                                  v_fma(away[1], v_splat(-VOLUME_BEFORE), v_splat(gather.cell_y))),
                            v_fma(v_fma(line.wz, hit.where, line.z), scale,
                                  v_fma(away[2], v_splat(-VOLUME_BEFORE), v_splat(gather.cell_z))),
                            away[0], away[1], away[2], sent);
            for (int c = 0; c < 3; ++c) {
                sum[c] = sum[c] + v_select(zero, sent[c], met);
            }
#if GATHER_KEPT
            near = near + v_select(zero, per_way / v_max(hit.where, v_splat(1e-6f)), met);
#endif
        }
        const vint to = row * ssgi_pitch(size) + column;
#if !GATHER_KEPT
        const vfloat share = ssgi_gather(fractions, size, 0, column, row);
#endif
        for (int c = 0; c < 3; ++c) {
            __global float *restrict image = values + ssgi_index(size, c, 0, 0);
            const vfloat value =
                v_min(sum[c] * (3.14159265f / GATHER_RAYS), v_splat(VPL_BRIGHTEST));
#if GATHER_KEPT
            v_scatter(value, image, to);
        }
        v_scatter(near * (1.0f / GATHER_RAYS), values + ssgi_index(size, 3, 0, 0), to);
#else
            v_scatter(v_fma(share, value, v_gather(image, to)), image, to);
        }
#endif
    }
}
