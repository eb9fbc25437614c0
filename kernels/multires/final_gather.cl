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
//          nodes, blocks, triangles  see rays/first.clh
//          cells, volume  its cells and records, see radiosity/volume.clh
//          fractions   [rows, columns] what the light counts for, see multires_interpolate
// Writes:  values   3 x [rows, columns], W/m^2: the light is added, at the samples alone; with
//                   GATHER_KEPT 5 x, where the light is written, the mean of 1 / distance of what
//                   rays meet, in lengths of the receivers, and the number of rays
// Macros:  GATHER_RAYS, GATHER_KEPT (0, 1), RAYS_ONE (0, 1), GATHER_ITEMS: work-items that share
//          the rays of a sample, 1 or, with one lane, a power of two up to SSGI_GROUP
// Params:  RaysParams; GatherParams: cells of the volume per unit of the hierarchy's space, and
//          where its origin is in cells; length of rays; columns and rows that the tiles are moved
//          by; begin, most: pieces of SSGI_LANES samples before those of the launch, and its own at
//          most
// Launch:  any number of work-items, each of which takes every so-many-th piece of SSGI_LANES; with
//          more GATHER_ITEMS as many as samples have, in work-groups of SSGI_GROUP
// Cost:    a walk through the hierarchy and 13 reads for each ray

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"
#include "rays/ends.clh"
#include "rays/first.clh"
#include "rays/hemisphere.clh"
#include "radiosity/volume.clh"

#if !defined(GATHER_RAYS) || !defined(GATHER_KEPT)
#error "GATHER_RAYS and GATHER_KEPT must be defined by the host"
#endif
#ifndef GATHER_ITEMS
#error "GATHER_ITEMS must be defined by the host"
#endif
#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif
#if GATHER_ITEMS > 1 && (SSGI_LANES != 1 || SSGI_GROUP % GATHER_ITEMS != 0)
#error "GATHER_ITEMS is 1 or, with one lane, a part of a work-group"
#endif

#define GATHER_CHANNELS (3 + GATHER_KEPT)
#define GATHER_SAMPLES (SSGI_GROUP / GATHER_ITEMS) // of a work-group

__kernel void
final_gather(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
             __global const float *restrict ways, __global const float *restrict nodes,
             __global const float *restrict blocks, __global const float *restrict triangles,
             const RaysParams rays, __global const int *restrict cells,
             __global const float *restrict volume, ssgi_plane fractions,
             __global float *restrict values, const int2 size, const SsgiCamera camera,
             const VplParams params, const GatherParams gather, const int begin, const int most)
{
    const int listed = list[0];
    const vfloat zero = v_splat(0.0f);
    const int pieces = min((listed + SSGI_LANES - 1) / SSGI_LANES, begin + most);
#if GATHER_ITEMS > 1
    __local float found[GATHER_CHANNELS * GATHER_RAYS * GATHER_SAMPLES]; // by each ray
    const int sample = (int)get_local_id(0) / GATHER_ITEMS;
    const int item = (int)get_local_id(0) % GATHER_ITEMS;
    const int first = begin + (int)get_group_id(0) * GATHER_SAMPLES; // of a work-group
    if (first >= pieces) {
        return;
    }
    const int own = first + sample;
    {
#else
    const int item = 0;
    const int left = pieces - begin;
    for (int turn = 0, piece = cut_own(0, left); piece < left; piece = cut_own(++turn, left)) {
        const int own = begin + piece;
#endif
        const vint pixel = cut_pixels(list, own * SSGI_LANES);
        const vint column = pixel & 0xffff, row = pixel >> 16;
        const VplReceiver at = cut_receiver(depth, normal, pixel, size, camera, params);
        const RaysEnd from = rays_end(at.x, at.y, at.z, at.nx, at.ny, at.nz, rays);
        // The normal in the space of the hierarchy.
        const vfloat ax = at.nx * rays.xx + at.ny * rays.xy + at.nz * rays.xz;
        const vfloat ay = at.nx * rays.yx + at.ny * rays.yy + at.nz * rays.yz;
        const vfloat az = at.nx * rays.zx + at.ny * rays.zy + at.nz * rays.zz;
        const vfloat per = v_rsqrt(v_max(v_fma(ax, ax, v_fma(ay, ay, az * az)), v_splat(1e-30f)));
        const Hemisphere frame = hemisphere_of(ax * per, ay * per, az * per);
        const vint tile = ((row + gather.rows_on) & (GATHER_TILE - 1)) * GATHER_TILE +
                          ((column + gather.columns_on) & (GATHER_TILE - 1));
        // Loops over it are unrolled: in kernels with barriers PoCL 3.1 mixes up the arrays of
        // work-items that variables index.
        vfloat sum[3] = {zero, zero, zero};
#if GATHER_KEPT
        const vfloat per_way = v_splat(1.0f / (gather.reach * params.per_unit));
        vfloat near = zero;
#endif
        for (int ray = item; ray < GATHER_RAYS; ray += GATHER_ITEMS) {
#if GATHER_ITEMS > 1
#pragma unroll
            for (int c = 0; c < GATHER_CHANNELS; ++c) {
                found[(c * GATHER_RAYS + ray) * GATHER_SAMPLES + sample] = 0.0f;
            }
#endif
            vfloat way[3];
            hemisphere_way(frame, ways, ray, tile, way);
            const vfloat wx = way[0], wy = way[1], wz = way[2];
            const RaysRay line = {
                from.x, from.y, from.z, wx * gather.reach, wy * gather.reach, wz * gather.reach};
            const RaysHit hit = rays_first(nodes, blocks, triangles, line, at.there);
            const vmask met = v_ige(hit.triangle, v_splat_int(0));
            if (!v_any(met)) {
                continue;
            }
            const vint t = v_iselect(v_splat_int(0), hit.triangle, met) * RAYS_TRIANGLE;
            vfloat away[3];
            rays_away(triangles, t, wx, wy, wz, away);
            const vfloat scale = v_splat(gather.per_cell);
            const VolumePlace place = volume_surface(
                cells, volume,
                v_fma(v_fma(line.wx, hit.where, line.x), scale, v_splat(gather.cell_x)),
                v_fma(v_fma(line.wy, hit.where, line.y), scale, v_splat(gather.cell_y)),
                v_fma(v_fma(line.wz, hit.where, line.z), scale, v_splat(gather.cell_z)), away[0],
                away[1], away[2]);
#pragma unroll
            for (int c = 0; c < 3; ++c) {
                const vfloat radiance = v_select(zero, volume_radiance(volume, place, c), met);
#if GATHER_ITEMS > 1
                found[(c * GATHER_RAYS + ray) * GATHER_SAMPLES + sample] = radiance;
#else
                sum[c] = sum[c] + radiance;
#endif
            }
#if GATHER_KEPT
            const vfloat nearness = v_select(zero, per_way / v_max(hit.where, v_splat(1e-6f)), met);
#if GATHER_ITEMS > 1
            found[(3 * GATHER_RAYS + ray) * GATHER_SAMPLES + sample] = nearness;
#else
            near = near + nearness;
#endif
#endif
        }
#if GATHER_ITEMS > 1
        // The sums of channels, in the order of the rays, so that they are bit-identical.
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item > 0 || own >= pieces) {
            return;
        }
        for (int ray = 0; ray < GATHER_RAYS; ++ray) {
#pragma unroll
            for (int c = 0; c < 3; ++c) {
                sum[c] += found[(c * GATHER_RAYS + ray) * GATHER_SAMPLES + sample];
            }
#if GATHER_KEPT
            near += found[(3 * GATHER_RAYS + ray) * GATHER_SAMPLES + sample];
#endif
        }
#endif
        const vint to = row * ssgi_pitch(size) + column;
#if !GATHER_KEPT
        const vfloat share = ssgi_gather(fractions, size, 0, column, row);
#endif
#pragma unroll
        for (int c = 0; c < 3; ++c) {
            __global float *restrict image = values + ssgi_index(size, c, 0, 0);
            const vfloat value =
                v_min(sum[c] * (3.14159265f / GATHER_RAYS), v_splat(VPL_BRIGHTEST));
#if GATHER_KEPT
            v_scatter(value, image, to);
        }
        v_scatter(near * (1.0f / GATHER_RAYS), values + ssgi_index(size, 3, 0, 0), to);
        v_scatter(v_splat((float)GATHER_RAYS), values + ssgi_index(size, 4, 0, 0), to);
#else
            v_scatter(v_fma(share, value, v_gather(image, to)), image, to);
        }
#endif
    }
}
