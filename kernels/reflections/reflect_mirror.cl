// SPDX-License-Identifier: MIT
// reflect_mirror: mean radiance that arrives within the lobes of pixels, of some of a lobe's exact
// rays each.
//
// Method:  what a ray meets first among the triangles of the scene sends what the image shows of
//          it, and otherwise its emission or what a volume has of surfaces that face the same way;
//          where it meets nothing, the environments.
// Reads:   linear, normal, albedo, specular, gloss  with margin
//          radiance  3 x [rows, columns] W m^-2 sr^-1, without lobes
//          light     3 x [rows, columns] irradiance / pi
//          sky, places  see sky.clh; cells, volume  see radiosity/volume.clh
//          nodes, blocks, triangles  see rays/first.clh
//          surfaces  [triangles, 8] emission, W m^-2 sr^-1; 1 where there is any; specular
//                    reflectance of smooth ones, otherwise 0; the share of what one sends that is
//                    matt
// Writes:  reflected 3 x [rows, columns] W m^-2 sr^-1; 0 where nothing is glossy
// Macros:  REFLECT_RAYS (of a pixel), RAYS_ONE (0, 1)
// Params:  view to world rotation, the eye relative to the scene's origin, margin, see the struct
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/sky.clh"
#include "rays/first.clh"
#include "reflections/image.clh"
#include "reflections/pattern.clh"
#include "radiosity/volume.clh"

#ifndef REFLECT_RAYS
#error "REFLECT_RAYS must be defined by the host"
#endif

#define REFLECT_LIFT 0.0625f // widths of a pixel off the surface at which rays start
#define REFLECT_MIRRORINGS 6 // of a ray at most; the last surface counts as matt
#define REFLECT_BEYOND 1e6f  // rows and columns
#define REFLECT_OFF 1.0f // widths of a pixel between what it shows and the same surface, at most

__kernel void
reflect_mirror(ssgi_plane linear, ssgi_plane normal, ssgi_plane albedo, ssgi_plane specular,
               ssgi_plane gloss, __global const float *restrict radiance,
               __global const float *restrict light, __global const float *restrict sky,
               __global const int *restrict places, __global const int *restrict cells,
               __global const float *restrict volume, __global const float *restrict nodes,
               __global const float *restrict blocks, __global const float *restrict triangles,
               __global const float *restrict surfaces, __global float *restrict reflected,
               const int2 size, const SsgiCamera camera, const ReflectParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns;
    const int at_y = y + params.margin_rows;
    const vfloat zero = v_splat(0.0f);
    const vfloat u = ssgi_load(linear, whole, 0, at_x, at_y);
    const SsgiLobe lobe = ssgi_lobe(albedo, specular, gloss, whole, at_x, at_y);
    const vmask there = lobe.there & v_lt(u, v_splat(INFINITY));
#if SSGI_LANES > 1 // a work-item alone comes to the same end as soon
    if (!v_any(there)) {
        for (int c = 0; c < 3; ++c) {
            ssgi_store(zero, reflected, size, c, x, y, 0.0f);
        }
        return;
    }
#endif
    const bool perspective = camera.perspective != 0.0f;
    const vfloat known = v_select(v_splat(1.0f), u, there);
    const vfloat depth = perspective ? 1.0f / known : known;
    const vfloat k = ssgi_k(camera, depth);
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * k;
    const vfloat py = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * k;
    const SsgiWay mirrored = ssgi_mirrored(camera, px, py, -depth, nx, ny, nz);
    // Off the surface, so that it does not meet itself.
    const float width = fmax(fabs(camera.to_x), fabs(camera.to_y));
    const vfloat lift = k * v_splat(width * REFLECT_LIFT);
    const vfloat sx = v_fma(nx, lift, px), sy = v_fma(ny, lift, py), sz = v_fma(nz, lift, -depth);
    const vmask perfect = v_ge(lobe.gloss, v_splat(params.perfect));
    const vint tile = reflect_number(v_iota() + x, y, lobe.gloss);
    const float reach = params.reach * 4.0f; // more than across the scene and to it
    vfloat sum[3] = {zero, zero, zero};
    for (int ray = 0; ray < REFLECT_RAYS; ++ray) {
        const vfloat number = v_to_float(tile * REFLECT_RAYS + ray) + 0.5f;
        SsgiWay way = reflect_way(&lobe, mirrored, reflect_fraction(number * REFLECT_FIRST),
                                  reflect_fraction(number * REFLECT_SECOND));
        way.x = v_select(way.x, mirrored.x, perfect);
        way.y = v_select(way.y, mirrored.y, perfect);
        way.z = v_select(way.z, mirrored.z, perfect);
        const vfloat rise = v_fma(way.x, nx, v_fma(way.y, ny, way.z * nz));
        const vfloat density =
            ssgi_lobe_value(&lobe, mirrored, way.x, way.y, way.z) * (16.0f * REFLECT_RAYS);
        const vfloat angle = 1.0f / v_max(density, v_splat(1e-3f));
        vmask above = there & v_gt(rise, zero);
        vfloat fx = sx, fy = sy, fz = sz, along = depth;
        vfloat left[3] = {v_splat(1.0f), v_splat(1.0f), v_splat(1.0f)};
        for (int leg = 0; leg < REFLECT_MIRRORINGS && v_any(above); ++leg) {
            const vfloat wx = params.xx * way.x + params.xy * way.y + params.xz * way.z;
            const vfloat wy = params.yx * way.x + params.yy * way.y + params.yz * way.z;
            const vfloat wz = params.zx * way.x + params.zy * way.y + params.zz * way.z;
            const RaysRay line = {
                params.xx * fx + params.xy * fy + params.xz * fz + params.eye_x,
                params.yx * fx + params.yy * fy + params.yz * fz + params.eye_y,
                params.zx * fx + params.zy * fy + params.zz * fz + params.eye_z,
                wx * reach,
                wy * reach,
                wz * reach,
            };
            const RaysHit hit = rays_first(nodes, blocks, triangles, line, above);
            const vmask met = above & v_ige(hit.triangle, v_splat_int(0));
            // Where it is seen, if it is: the pixel there shows a point of the same plane.
            const vfloat length = hit.where * reach;
            const vfloat hx = v_fma(way.x, length, fx), hy = v_fma(way.y, length, fy);
            const vfloat hz = v_fma(way.z, length, fz);
            const vmask ahead = met & v_lt(hz, depth * -1e-3f);
            const vfloat far = v_select(v_splat(1.0f), -hz, ahead);
            const vfloat at_k = ssgi_k(camera, far);
            const vfloat column = ssgi_column(camera, hx / at_k), row = ssgi_row(camera, hy / at_k);
            const vint cx =
                v_to_int(v_floor(v_clamp(column, -1.0f, REFLECT_BEYOND))) - params.margin_columns;
            const vint cy =
                v_to_int(v_floor(v_clamp(row, -1.0f, REFLECT_BEYOND))) - params.margin_rows;
            const vint ix = v_iclamp(cx, 0, size.x - 1);
            const vint iy = v_iclamp(cy, 0, size.y - 1);
            const vint gx = ix + params.margin_columns, gy = iy + params.margin_rows;
            const ReflectPixel pixel = {gx, gy, ix, iy};
            const vfloat seen_u = ssgi_gather(linear, whole, 0, gx, gy);
            vmask shown = ahead & v_ieq(ix, cx) & v_ieq(iy, cy) & v_lt(seen_u, v_splat(INFINITY));
            const vfloat seen =
                perspective ? 1.0f / v_select(v_splat(1.0f), seen_u, shown) : seen_u;
            const vfloat seen_k = ssgi_k(camera, seen);
            const vfloat ax = ssgi_gather(normal, whole, 0, gx, gy);
            const vfloat ay = ssgi_gather(normal, whole, 1, gx, gy);
            const vfloat az = ssgi_gather(normal, whole, 2, gx, gy);
            const vfloat bx = hx - ssgi_slope_x(camera, v_to_float(gx) + 0.5f) * seen_k;
            const vfloat by = hy - ssgi_slope_y(camera, v_to_float(gy) + 0.5f) * seen_k;
            const vfloat off = v_fma(ax, bx, v_fma(ay, by, az * (hz + seen)));
            const vfloat facing = v_fma(ax, way.x, v_fma(ay, way.y, az * way.z));
            shown = shown & v_lt(v_abs(off), seen_k * (width * REFLECT_OFF)) & v_lt(facing, zero);
            const vmask hidden = met & ~shown;
            const vmask escapes = above & ~met;
            const vint t = v_iselect(v_splat_int(0), hit.triangle, met) * RAYS_TRIANGLE;
            const vint own = v_bits(v_gather(triangles, t + 10)) * 8;
            vmask smooth = v_splat_int(0);
            if (leg + 1 < REFLECT_MIRRORINGS) {
                smooth = met & v_gt(v_gather(surfaces, own + 4) + v_gather(surfaces, own + 5) +
                                        v_gather(surfaces, own + 6),
                                    zero);
            }
            vfloat open[3] = {zero, zero, zero}, sent[3] = {zero, zero, zero};
            vmask glows = v_splat_int(0);
            vfloat ux = ax, uy = ay, uz = az; // the normal of what is met, in view space
            if (v_any(hidden)) {
                vfloat away[3];
                rays_away(triangles, t, wx, wy, wz, away);
                const vfloat qx = away[0], qy = away[1], qz = away[2];
                const vfloat scale = v_splat(params.per_cell * params.per_unit);
                volume_smooth(cells, volume,
                              v_fma(params.xx * hx + params.xy * hy + params.xz * hz, scale,
                                    v_splat(params.cell_x)),
                              v_fma(params.yx * hx + params.yy * hy + params.yz * hz, scale,
                                    v_splat(params.cell_y)),
                              v_fma(params.zx * hx + params.zy * hy + params.zz * hz, scale,
                                    v_splat(params.cell_z)),
                              qx, qy, qz, sent);
                ux = v_select(ux, -(params.xx * qx + params.yx * qy + params.zx * qz), hidden);
                uy = v_select(uy, -(params.xy * qx + params.yy * qy + params.zy * qz), hidden);
                uz = v_select(uz, -(params.xz * qx + params.yz * qy + params.zz * qz), hidden);
                const vfloat matt = v_select(v_splat(1.0f), v_gather(surfaces, own + 7), smooth);
                for (int c = 0; c < 3; ++c) {
                    sent[c] = sent[c] * matt;
                }
                glows = hidden & v_gt(v_gather(surfaces, own + 3), zero);
            }
            if (params.levels > 0 && v_any(escapes)) {
                sky_radiance(sky, places, wx, wy, wz, angle, params.texels_per_angle, params.levels,
                             open);
            }
#pragma unroll 1
            for (int c = 0; c < 3; ++c) {
                // What a smooth surface mirrors is what the next leg meets.
                vfloat arriving = v_select(open[0], sent[0], hidden);
                arriving = v_select(arriving, v_gather(surfaces, own + c), glows);
                if (v_any(shown)) {
                    const vfloat image = reflect_image(pixel, c, smooth, albedo, specular, gloss,
                                                       whole, light, radiance, size);
                    arriving = v_select(arriving, image, shown);
                }
                const vfloat total = sum[0] + v_select(zero, arriving * left[0], above);
                const vfloat rest = left[0] * v_gather(surfaces, own + 4 + c);
                // The next channel moves to the front: arrays that a variable indexes lie in
                // memory.
                sum[0] = sum[1], left[0] = left[1], open[0] = open[1], sent[0] = sent[1];
                sum[1] = sum[2], left[1] = left[2], open[1] = open[2], sent[1] = sent[2];
                sum[2] = total, left[2] = rest;
            }
            // On from what mirrors.
            above = smooth;
            along = along + length;
            const vfloat off_it = along * width * REFLECT_LIFT;
            fx = v_fma(ux, off_it, hx);
            fy = v_fma(uy, off_it, hy);
            fz = v_fma(uz, off_it, hz);
            const vfloat twice = v_fma(ux, way.x, v_fma(uy, way.y, uz * way.z)) * -2.0f;
            way.x = v_fma(twice, ux, way.x);
            way.y = v_fma(twice, uy, way.y);
            way.z = v_fma(twice, uz, way.z);
        }
    }
    for (int c = 0; c < 3; ++c) {
        ssgi_store(sum[c] * (1.0f / REFLECT_RAYS), reflected, size, c, x, y, 0.0f);
    }
}
