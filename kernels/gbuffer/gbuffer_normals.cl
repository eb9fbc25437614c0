// SPDX-License-Identifier: MIT
// gbuffer_normals: view-space unit normals that face the viewer, from world-space ones or from
// depth.
//
// A normal is turned round if it and the surface seen in the depth both say that it faces away, so
// that smooth normals at a silhouette keep their side. Where the given normal is 0 (or none is
// given) it is the cross product of the smaller depth differences on either side, which stays on
// one surface at an edge. A pixel with neighbours in one direction alone takes the other difference
// from one of these; a pixel without any is taken to lie across the view ray.
//
// Reads:   depth   image `layer`: scene units, > 0; INFINITY where nothing is
//          normal  images 3 layer + c: world space, unit length or 0 (GBUFFER_GIVEN 1; with 2
//                  `normal_view` holds them, and is written over)
// Writes:  linear  1 / depth (orthographic: depth) of layer 0; INFINITY where nothing is
//          normal_view  images 3 layer + c: view space, unit length; 0 where nothing is
// Params:  rotation  world to view, row by row; layer  of depth
// Macros:  GBUFFER_GIVEN  1 if `normal` holds normals, 2 if `normal_view` does, 0 to take all from
//                         depth
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"
#include "common/surface.clh"

#ifndef GBUFFER_GIVEN
#error "GBUFFER_GIVEN must be defined by the host"
#endif

typedef struct {
    vfloat x, y, z;
} Vector;

static inline Vector view_position(const SsgiCamera camera, const vfloat x, const float y,
                                   const vfloat depth)
{
    const vfloat k = ssgi_k(camera, depth);
    const Vector p = {ssgi_slope_x(camera, x) * k, ssgi_slope_y(camera, v_splat(y)) * k, -depth};
    return p;
}

static inline Vector minus(const Vector a, const Vector b)
{
    const Vector d = {a.x - b.x, a.y - b.y, a.z - b.z};
    return d;
}

static inline Vector either(const Vector no, const Vector yes, const vmask m)
{
    const Vector v = {v_select(no.x, yes.x, m), v_select(no.y, yes.y, m), v_select(no.z, yes.z, m)};
    return v;
}

// From p to the pixel at (x, y) with a depth (`instead` if it has none), times sign.
static inline Vector difference(const SsgiCamera camera, const Vector p, const vfloat x,
                                const float y, const vfloat depth, const vfloat instead,
                                const float sign)
{
    const vmask has = v_lt(depth, v_splat(INFINITY));
    const Vector d = minus(view_position(camera, x, y, v_select(instead, depth, has)), p);
    const Vector signed_d = {d.x * sign, d.y * sign, d.z * sign};
    return signed_d;
}

// The difference of the two that changes depth less; 0 where neither neighbour has a surface.
static inline Vector smaller(const Vector forward, const vmask has_forward, const Vector backward,
                             const vmask has_backward)
{
    const vmask nearer = v_lt(v_abs(backward.z), v_abs(forward.z));
    const vmask take_backward = has_backward & (nearer | ~has_forward);
    const vmask none = ~(has_forward | has_backward);
    const vfloat zero = v_splat(0.0f);
    const Vector d = {
        v_select(v_select(forward.x, backward.x, take_backward), zero, none),
        v_select(v_select(forward.y, backward.y, take_backward), zero, none),
        v_select(v_select(forward.z, backward.z, take_backward), zero, none),
    };
    return d;
}

// Depth of a neighbour, INFINITY outside the image.
static inline vfloat neighbour(ssgi_plane depth, const int2 size, const int layer, const int x,
                               const int y)
{
    if (y < 0 || y >= size.y) {
        return v_splat(INFINITY);
    }
    const vint at = v_iota() + x;
    const vmask inside = v_ige(at, v_splat_int(0)) & v_ilt(at, v_splat_int(size.x));
    return v_select(v_splat(INFINITY), ssgi_load(depth, size, layer, x, y), inside);
}

__kernel void gbuffer_normals(ssgi_plane depth,
#if GBUFFER_GIVEN == 1
                              ssgi_plane normal,
#endif
                              __global float *restrict linear, __global float *restrict normal_view,
                              const int2 size, const SsgiCamera camera,
                              const GbufferRotation rotation, const int layer)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int first = 3 * layer;
    const vfloat infinity = v_splat(INFINITY);
    const vfloat column = v_to_float(v_iota() + x) + 0.5f;
    const float row = (float)y + 0.5f;

    const vfloat own = ssgi_load(depth, size, layer, x, y);
    const vmask there = v_lt(own, infinity);
    const vfloat safe = v_select(v_splat(1.0f), own, there);

    const vfloat left = neighbour(depth, size, layer, x - 1, y);
    const vfloat right = neighbour(depth, size, layer, x + 1, y);
    const vfloat up = neighbour(depth, size, layer, x, y - 1);
    const vfloat down = neighbour(depth, size, layer, x, y + 1);
    const vmask has_left = v_lt(left, infinity);
    const vmask has_right = v_lt(right, infinity);
    const vmask has_up = v_lt(up, infinity);
    const vmask has_down = v_lt(down, infinity);

    const Vector p = view_position(camera, column, row, safe);
    const Vector to_right = difference(camera, p, column + 1.0f, row, right, safe, 1.0f);
    const Vector to_left = difference(camera, p, column - 1.0f, row, left, safe, -1.0f);
    const Vector to_down = difference(camera, p, column, row + 1.0f, down, safe, 1.0f);
    const Vector to_up = difference(camera, p, column, row - 1.0f, up, safe, -1.0f);
    Vector du = smaller(to_right, has_right, to_left, has_left);
    Vector dv = smaller(to_down, has_down, to_up, has_up);
    vmask no_u = ~(has_right | has_left);
    vmask no_v = ~(has_down | has_up);
    if (v_any(there & (no_u | no_v))) {
        for (int i = 0; i < 4; ++i) {
            // The neighbour right, left, below, above; and the difference across that way there.
            const int dx = i == 0 ? 1 : i == 1 ? -1 : 0;
            const int dy = i == 2 ? 1 : i == 3 ? -1 : 0;
            const vfloat side = i == 0 ? right : i == 1 ? left : i == 2 ? down : up;
            const vmask has_side = v_lt(side, infinity);
            const vfloat depth_side = v_select(safe, side, has_side);
            const Vector q = view_position(camera, column + (float)dx, row + (float)dy, depth_side);
            const int ax = dy != 0 ? 1 : 0;
            const int ay = dx != 0 ? 1 : 0;
            const vfloat ahead = neighbour(depth, size, layer, x + dx + ax, y + dy + ay);
            const vfloat behind = neighbour(depth, size, layer, x + dx - ax, y + dy - ay);
            const Vector to_ahead = difference(camera, q, column + (float)(dx + ax),
                                               row + (float)(dy + ay), ahead, depth_side, 1.0f);
            const Vector to_behind = difference(camera, q, column + (float)(dx - ax),
                                                row + (float)(dy - ay), behind, depth_side, -1.0f);
            const Vector d =
                smaller(to_ahead, v_lt(ahead, infinity), to_behind, v_lt(behind, infinity));
            const vmask has_any = has_side & (v_lt(ahead, infinity) | v_lt(behind, infinity));
            if (i < 2) {
                const vmask take = has_any & no_v;
                dv = either(dv, d, take);
                no_v = no_v & ~take;
            } else {
                const vmask take = has_any & no_u;
                du = either(du, d, take);
                no_u = no_u & ~take;
            }
        }
    }
    const vfloat zero = v_splat(0.0f);
    const vfloat pixel = ssgi_k(camera, safe);
    du.x = v_select(du.x, camera.to_x * pixel, no_u);
    dv.y = v_select(dv.y, camera.to_y * pixel, no_v);

    // v runs down and u right, so v x u points to the viewer. Each is scaled by its largest
    // component first: the product of two lengths of 1e-30 would vanish.
    const vfloat size_u = v_max(v_max(v_abs(du.x), v_abs(du.y)), v_abs(du.z));
    const vfloat size_v = v_max(v_max(v_abs(dv.x), v_abs(dv.y)), v_abs(dv.z));
    const vfloat scale_u = 1.0f / v_max(size_u, v_splat(1e-37f));
    const vfloat scale_v = 1.0f / v_max(size_v, v_splat(1e-37f));
    du.x = du.x * scale_u;
    du.y = du.y * scale_u;
    du.z = du.z * scale_u;
    dv.x = dv.x * scale_v;
    dv.y = dv.y * scale_v;
    dv.z = dv.z * scale_v;
    Vector g = {dv.y * du.z - dv.z * du.y, dv.z * du.x - dv.x * du.z, dv.x * du.y - dv.y * du.x};
    const vfloat squared = g.x * g.x + g.y * g.y + g.z * g.z;
    const vmask flat = v_lt(squared, v_splat(1e-30f));
    const vfloat scale_g = v_rsqrt(v_select(squared, v_splat(1.0f), flat));
    g.x = v_select(g.x * scale_g, zero, flat);
    g.y = v_select(g.y * scale_g, zero, flat);
    g.z = v_select(g.z * scale_g, v_splat(1.0f), flat);

#if GBUFFER_GIVEN
#if GBUFFER_GIVEN == 1
    const vfloat wx = ssgi_load(normal, size, first, x, y);
    const vfloat wy = ssgi_load(normal, size, first + 1, x, y);
    const vfloat wz = ssgi_load(normal, size, first + 2, x, y);
#else
    const vfloat wx = v_load(normal_view + ssgi_index(size, first, x, y));
    const vfloat wy = v_load(normal_view + ssgi_index(size, first + 1, x, y));
    const vfloat wz = v_load(normal_view + ssgi_index(size, first + 2, x, y));
#endif
    Vector n = {
        rotation.xx * wx + rotation.xy * wy + rotation.xz * wz,
        rotation.yx * wx + rotation.yy * wy + rotation.yz * wz,
        rotation.zx * wx + rotation.zy * wy + rotation.zz * wz,
    };
    const vmask given = v_gt(v_abs(wx) + v_abs(wy) + v_abs(wz), zero);
    // The view ray of an orthographic camera is -z, of a perspective one the position.
    const vfloat flatten = v_splat(camera.perspective);
    const vfloat towards = flatten * (n.x * p.x + n.y * p.y) - n.z * safe;
    const vfloat with_surface = n.x * g.x + n.y * g.y + n.z * g.z;
    const vmask turn = v_gt(towards, zero) & v_lt(with_surface, zero);
    const vfloat sign = v_select(v_splat(1.0f), v_splat(-1.0f), turn);
    g.x = v_select(g.x, n.x * sign, given);
    g.y = v_select(g.y, n.y * sign, given);
    g.z = v_select(g.z, n.z * sign, given);
#endif
    if (layer == 0) {
        const vfloat u = ssgi_linear(camera, safe);
        ssgi_store(v_select(infinity, u, there), linear, size, 0, x, y, INFINITY);
    }
    ssgi_store(v_select(zero, g.x, there), normal_view, size, first, x, y, 0.0f);
    ssgi_store(v_select(zero, g.y, there), normal_view, size, first + 1, x, y, 0.0f);
    ssgi_store(v_select(zero, g.z, there), normal_view, size, first + 2, x, y, 0.0f);
}
