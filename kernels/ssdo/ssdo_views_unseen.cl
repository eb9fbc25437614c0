// SPDX-License-Identifier: MIT
// ssdo_views_unseen: removes from an auxiliary view the surfaces that an earlier view shows.
//
// Each surface belongs to the first view that shows it. So no surface is found twice, and a view
// that shows nothing new adds nothing.
//
// A point counts as shown where the surface at one of the four pixel centres round its image lies
// on the point's tangent plane, no farther from it than one pixel of the earlier camera is wide,
// and has the same normal to within 60 degrees, or the opposite one: a thin surface is the same
// from behind. The four centres surround the point, so a camera that moves by less than a pixel, or
// has fewer pixels, shows nothing new.
//
// Reads:   normal   3 UNSEEN_NORMALS x [rows, columns] with margin, view space of the
//                   auxiliary camera
//          earlier  SEEN_LAYERS x depth of the earlier view, with margin, scene units
//          facing   3 SEEN_NORMALS x its normals likewise, view space of its camera
// Writes:  depth    UNSEEN_LAYERS x [rows, columns] of the auxiliary view, with margin, scene
//                   units: INFINITY where the earlier view shows the point
// Macros:  UNSEEN_LAYERS, SEEN_LAYERS (>= 1), UNSEEN_NORMALS (1..UNSEEN_LAYERS; deeper layers are
//          taken to lie across the viewing direction), SEEN_NORMALS (1..SEEN_LAYERS; deeper layers
//          may have any normal)
// Params:  auxiliary to earlier view space; columns, rows of the earlier depth
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    4 planes read, one written, 16 * SEEN_LAYERS scattered reads per pixel and layer

#include "common/camera.clh"
#include "common/gbuffer.clh"

#if !defined(UNSEEN_LAYERS) || !defined(UNSEEN_NORMALS) || !defined(SEEN_LAYERS) ||                \
    !defined(SEEN_NORMALS)
#error "UNSEEN_LAYERS, UNSEEN_NORMALS, SEEN_LAYERS and SEEN_NORMALS must be defined by the host"
#endif

// The struct OtherViewParams is generated from ssgi_cl.techniques.ssdo.ssdo_views.

// A point of the earlier camera's view space, its normal, and how far from its plane others may
// lie.
typedef struct {
    vfloat x, y, z, nx, ny, nz, within;
} UnseenPoint;

#define UNSEEN_ALIKE 0.5f // least cosine between the normals of one surface

// Whether the surface at a pixel of the earlier view is on the tangent plane of a point.
static inline vmask unseen_shows(ssgi_plane earlier, ssgi_plane facing, const int2 size,
                                 const SsgiCamera before, const UnseenPoint *at, const vint column,
                                 const vint row)
{
    const vfloat slope_x = ssgi_slope_x(before, v_to_float(column) + 0.5f);
    const vfloat slope_y = ssgi_slope_y(before, v_to_float(row) + 0.5f);
    vmask shows = v_splat_int(0);
    for (int layer = 0; layer < SEEN_LAYERS; ++layer) {
        const vfloat surface = ssgi_gather(earlier, size, layer, column, row);
        const vmask there = v_lt(surface, v_splat(INFINITY));
        const vfloat depth = v_select(v_splat(1.0f), surface, there);
        const vfloat k = ssgi_k(before, depth);
        const vfloat apart =
            v_fma(at->nx, v_fma(slope_x, k, -at->x),
                  v_fma(at->ny, v_fma(slope_y, k, -at->y), -(at->nz * (depth + at->z))));
        vmask same = there & v_le(v_abs(apart), at->within);
        if (layer < SEEN_NORMALS && v_any(same)) {
            const vfloat nx = ssgi_gather(facing, size, 3 * layer, column, row);
            const vfloat ny = ssgi_gather(facing, size, 3 * layer + 1, column, row);
            const vfloat nz = ssgi_gather(facing, size, 3 * layer + 2, column, row);
            const vfloat cosine = v_fma(at->nx, nx, v_fma(at->ny, ny, at->nz * nz));
            same = same & v_ge(v_abs(cosine), v_splat(UNSEEN_ALIKE));
        }
        shows = shows | same;
    }
    return shows;
}

__kernel void ssdo_views_unseen(ssgi_plane normal, ssgi_plane earlier, ssgi_plane facing,
                                __global float *restrict depth, const int2 size,
                                const SsgiCamera camera, const SsgiCamera before,
                                const OtherViewParams view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 others = (int2)(view.columns, view.rows);
    const vfloat zero = v_splat(0.0f);
    const vfloat ray_x = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f);
    const vfloat ray_y = ssgi_slope_y(camera, v_splat((float)y + 0.5f));
    for (int layer = 0; layer < UNSEEN_LAYERS; ++layer) {
        __global float *restrict own_at = depth + ssgi_index(size, layer, x, y);
        const vfloat own = v_load(own_at);
        const vmask there = v_lt(own, v_splat(INFINITY));
        if (!v_any(there)) {
            continue;
        }
        const vfloat z = v_select(v_splat(1.0f), own, there);
        const vfloat k = ssgi_k(camera, z);
        const vfloat px = ray_x * k, py = ray_y * k;
        UnseenPoint at;
        at.x =
            v_fma(px, v_splat(view.xx),
                  v_fma(py, v_splat(view.xy), v_fma(z, v_splat(-view.xz), v_splat(view.shift_x))));
        at.y =
            v_fma(px, v_splat(view.yx),
                  v_fma(py, v_splat(view.yy), v_fma(z, v_splat(-view.yz), v_splat(view.shift_y))));
        at.z =
            v_fma(px, v_splat(view.zx),
                  v_fma(py, v_splat(view.zy), v_fma(z, v_splat(-view.zz), v_splat(view.shift_z))));
        vfloat mx = zero, my = zero, mz = v_splat(1.0f);
        if (layer < UNSEEN_NORMALS) {
            mx = ssgi_load(normal, size, 3 * layer, x, y);
            my = ssgi_load(normal, size, 3 * layer + 1, x, y);
            mz = ssgi_load(normal, size, 3 * layer + 2, x, y);
        }
        at.nx = v_fma(mx, v_splat(view.xx), v_fma(my, v_splat(view.xy), mz * view.xz));
        at.ny = v_fma(mx, v_splat(view.yx), v_fma(my, v_splat(view.yy), mz * view.yz));
        at.nz = v_fma(mx, v_splat(view.zx), v_fma(my, v_splat(view.zy), mz * view.zz));
        const vfloat ahead = v_max(-at.z, v_splat(view.nearest));
        const vfloat before_k = ssgi_k(before, ahead);
        at.within = before_k * max(fabs(before.to_x), fabs(before.to_y));
        const vfloat column = ssgi_column(before, at.x / before_k);
        const vfloat row = ssgi_row(before, at.y / before_k);
        const vmask inside = there & v_gt(-at.z, v_splat(view.nearest)) & v_ge(column, zero) &
                             v_ge(row, zero) & v_lt(column, v_splat((float)others.x)) &
                             v_lt(row, v_splat((float)others.y));
        if (!v_any(inside)) {
            continue;
        }
        // The four pixels whose centres surround the point's image; at the border fewer.
        vmask shown = v_splat_int(0);
        for (int corner = 0; corner < 4; ++corner) {
            const vint c = v_to_int(
                v_clamp(column + ((corner & 1) ? 0.5f : -0.5f), 0.0f, (float)(others.x - 1)));
            const vint r =
                v_to_int(v_clamp(row + ((corner & 2) ? 0.5f : -0.5f), 0.0f, (float)(others.y - 1)));
            shown = shown | unseen_shows(earlier, facing, others, before, &at, c, r);
        }
        shown = shown & inside;
        if (v_any(shown)) {
            v_store(v_select(own, v_splat(INFINITY), shown), own_at);
        }
    }
}
