// SPDX-License-Identifier: MIT
// radiosity_direct: irradiance of points by punctual lights, a shadow ray for each pair.
//
// Method:  E = sum I cos / d^2 (parallel light: E cos) where no triangle is between the point and a
//          place of the light: one of its sphere, or of its disc of directions, that is another for
//          each point. Penumbrae are soft over several points.
// Reads:   points     see radiosity/points.clh
//          lights     [count][DIRECT_LIGHT]: position, or direction to parallel light; 1 of
//          parallel
//                     light; axis of the cone; its cosine, -2 of none; radius, or tangent of the
//                     angle; intensity over unit^2, or irradiance
//          nodes, triangles  see rays/bvh.clh
// Writes:  irradiance 3 x [size.x] as that of lights
// Params:  count; lift: height above their surfaces at which rays begin; unit: diagonal of the
//          scene's box
// Launch:  SSGI_LANES points per work-item, one row
// Cost:    50 operations and a ray for each light that faces the point

#include "radiosity/points.clh"

#ifndef DIRECT_LIGHT
#error "ssgi_cl/device/constants.py defines DIRECT_LIGHT"
#endif

#define DIRECT_REACH 2.0f    // length of rays to parallel light, in diagonals
#define DIRECT_NEAREST 1e30f // unit^2 / d^2 at most

__kernel void radiosity_direct(__global const float *restrict points,
                               __global const float *restrict lights,
                               __global const float *restrict nodes,
                               __global const float *restrict triangles,
                               __global float *restrict irradiance, const int2 size,
                               const int count, const float lift, const float unit)
{
    const int first = ssgi_first_column();
    const int stride = size.x;
    if (first >= stride) {
        return;
    }
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const SurfacePoint at = surface_point(points, stride, first, lift);
    const vfloat p = v_load(points + POINT_PLACE * stride + first);
    const vfloat q = v_load(points + (POINT_PLACE + 1) * stride + first);
    vfloat sum[3] = {zero, zero, zero};
    for (int i = 0; i < count; ++i) {
        __global const float *restrict light = lights + i * DIRECT_LIGHT;
        const bool parallel = light[3] != 0.0f;
        vfloat wx = v_splat(light[0]), wy = v_splat(light[1]), wz = v_splat(light[2]);
        if (!parallel) {
            wx = wx - at.x;
            wy = wy - at.y;
            wz = wz - at.z;
        }
        const vfloat squared = v_max(v_fma(wx, wx, v_fma(wy, wy, wz * wz)), v_splat(1e-37f));
        const vfloat per = v_rsqrt(squared);
        const vfloat dx = wx * per, dy = wy * per, dz = wz * per;
        const vfloat cosine = v_fma(dx, at.nx, v_fma(dy, at.ny, dz * at.nz));
        const vfloat axis =
            -v_fma(dx, v_splat(light[4]), v_fma(dy, v_splat(light[5]), dz * light[6]));
        const vmask lit = v_gt(cosine, zero) & v_ge(axis, v_splat(light[7]));
        if (!v_any(lit)) {
            continue;
        }
        // A place of the disc that the light shows to the point (Duff et al. 2017).
        const vfloat sign = v_copysign(one, dz);
        const vfloat a = -1.0f / (sign + dz), b = dx * dy * a;
        const vfloat s = p * light[8], t = q * light[8];
        const vfloat length = v_splat(parallel ? DIRECT_REACH * unit : 1.0f);
        const vfloat rx = wx + v_fma(s, v_fma(sign * dx * dx, a, one), t * b);
        const vfloat ry = wy + v_fma(s, sign * b, t * v_fma(dy * dy, a, sign));
        const vfloat rz = wz - v_fma(s, sign * dx, t * dy);
        const RaysRay ray = {at.x, at.y, at.z, rx * length, ry * length, rz * length};
        const vmask seen = lit & ~rays_blocked(nodes, triangles, ray, lit);
        const vfloat near = v_min(per * unit * (per * unit), v_splat(DIRECT_NEAREST));
        const vfloat share = v_select(zero, parallel ? cosine : cosine * near, seen);
        for (int c = 0; c < 3; ++c) {
            sum[c] = v_fma(share, v_splat(light[9 + c]), sum[c]);
        }
    }
    for (int c = 0; c < 3; ++c) {
        v_store(sum[c], irradiance + c * stride + first);
    }
}
