// SPDX-License-Identifier: MIT
// radiosity_emission: irradiance of points by places of emissive surfaces, a ray to each.
//
// Method:  E = pi sum L F / (rays F + count q), F = cos cos / (pi d^2) where no triangle is
// between:
//          `count` places are drawn in proportion to what they emit, and so many rays that
//          radiosity_rays sends find the rest (balance heuristic: Veach and Guibas 1995, "Optimally
//          Combining Sampling Techniques for Monte Carlo Rendering"). q: luminance of the place
//          over that of all surfaces together, in W/m^2 over W, the density with which it is drawn.
// Reads:   points     see radiosity/points.clh
//          chosen     [count][size.x] numbers of points that emit
//          emission   [points][4] radiance; q, negative where radiosity_rays meets nothing
//          nodes, triangles  see rays/bvh.clh
// Writes:  irradiance 3 x [size.x]: the light is added
// Params:  count; rays: of a point that radiosity_rays sends; lift: height above their surfaces at
//          which rays begin and end; near: square of the distance within which places with a
//          negative q give nothing
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    30 operations and a ray for each place

#include "radiosity/points.clh"

__kernel void
radiosity_emission(__global const float *restrict points, __global const int *restrict chosen,
                   __global const float *restrict emission, __global const float *restrict nodes,
                   __global const float *restrict triangles, __global float *restrict irradiance,
                   const int2 size, const int count, const float rays, const float lift,
                   const float near)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const SurfacePoint at = surface_point(points, stride, first, lift);
    vfloat sum[3] = {zero, zero, zero};
    for (int i = 0; i < count; ++i) {
        const vint to = v_iload(chosen + i * stride + first);
        const vfloat mx = v_gather(points + 3 * stride, to), my = v_gather(points + 4 * stride, to);
        const vfloat mz = v_gather(points + 5 * stride, to);
        const vfloat wx = v_fma(mx, v_splat(lift), v_gather(points, to)) - at.x;
        const vfloat wy = v_fma(my, v_splat(lift), v_gather(points + stride, to)) - at.y;
        const vfloat wz = v_fma(mz, v_splat(lift), v_gather(points + 2 * stride, to)) - at.z;
        const vfloat received = v_fma(wx, at.nx, v_fma(wy, at.ny, wz * at.nz));
        const vfloat emitted = -v_fma(wx, mx, v_fma(wy, my, wz * mz));
        const vmask facing = v_gt(received, zero) & v_gt(emitted, zero);
        if (!v_any(facing)) {
            continue;
        }
        const RaysRay ray = {at.x, at.y, at.z, wx, wy, wz};
        const vfloat squared = v_fma(wx, wx, v_fma(wy, wy, wz * wz));
        const vfloat own = v_gather(emission + 3, to * 4);
        const vmask far = v_ge(own, zero) | v_ge(squared, v_splat(near));
        const vmask seen = facing & far & ~rays_blocked(nodes, triangles, ray, facing);
        const vfloat per = 1.0f / v_max(squared, v_splat(1e-30f));
        const vfloat factor = received * per * (emitted * per) * 0.318309886f;
        const vfloat density = v_abs(own) * (float)count;
        const vfloat share = v_select(
            zero,
            factor * 3.14159265f / v_max(v_fma(factor, v_splat(rays), density), v_splat(1e-37f)),
            seen);
        for (int c = 0; c < 3; ++c) {
            sum[c] = v_fma(share, v_gather(emission + c, to * 4), sum[c]);
        }
    }
    for (int c = 0; c < 3; ++c) {
        __global float *restrict to = irradiance + c * stride + first;
        v_store(v_load(to) + sum[c], to);
    }
}
