// SPDX-License-Identifier: MIT
// ssdo_point_seen: darkens what an earlier camera sees too, so that each surface sends light once.
//
// Reads:   depth, normal  of the layer, with margin, view space of the further camera
//          earlier  SEEN_LAYERS x depth of the camera before it, with margin, scene units: those
//                   of its layers that send
// Writes:  senders  records of the layer, see lit_layers/records.clh: without radiance where the
//                   earlier camera sees the same side of the same surface, no farther from its
//                   plane than one of its pixels is wide
// Macros:  SEEN_LAYERS (>= 1)
// Params:  further to earlier view space; columns, rows of the earlier depth; layer
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    4 planes and the records read, SEEN_LAYERS scattered reads per pixel

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "lit_layers/records.clh"
#include "raster/quads.clh"

#if !defined(SEEN_LAYERS)
#error "SEEN_LAYERS must be defined by the host"
#endif

// The struct PointViewsParams is generated from ssgi_cl.techniques.ssdo_point_views.

__kernel void ssdo_point_seen(ssgi_plane depth, ssgi_plane normal, ssgi_plane earlier,
                              __global int *restrict senders, const int2 size,
                              const SsgiCamera camera, const SsgiCamera before,
                              const PointViewsParams view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 others = (int2)(view.columns, view.rows);
    const vfloat zero = v_splat(0.0f);
    const vfloat own = ssgi_load(depth, size, view.layer, x, y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    if (!v_any(there)) {
        return;
    }
    const vfloat z = v_select(v_splat(1.0f), own, there);
    const vfloat k = ssgi_k(camera, z);
    const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + x) + 0.5f) * k;
    const vfloat py = ssgi_slope_y(camera, v_splat((float)y + 0.5f)) * k;
    const vfloat mx = ssgi_load(normal, size, 3 * view.layer, x, y);
    const vfloat my = ssgi_load(normal, size, 3 * view.layer + 1, x, y);
    const vfloat mz = ssgi_load(normal, size, 3 * view.layer + 2, x, y);
    const vfloat ox = v_fma(px, v_splat(view.xx), v_fma(py, v_splat(view.xy),
                                                       v_fma(z, v_splat(-view.xz),
                                                             v_splat(view.shift_x))));
    const vfloat oy = v_fma(px, v_splat(view.yx), v_fma(py, v_splat(view.yy),
                                                       v_fma(z, v_splat(-view.yz),
                                                             v_splat(view.shift_y))));
    const vfloat oz = -v_fma(px, v_splat(view.zx), v_fma(py, v_splat(view.zy),
                                                        v_fma(z, v_splat(-view.zz),
                                                              v_splat(view.shift_z))));
    const vfloat nx = v_fma(mx, v_splat(view.xx), v_fma(my, v_splat(view.xy), mz * view.xz));
    const vfloat ny = v_fma(mx, v_splat(view.yx), v_fma(my, v_splat(view.yy), mz * view.yz));
    const vfloat nz = v_fma(mx, v_splat(view.zx), v_fma(my, v_splat(view.zy), mz * view.zz));
    const vfloat safe = v_max(oz, v_splat(view.nearest));
    const vfloat before_k = ssgi_k(before, safe);
    const vfloat column = ssgi_column(before, ox / before_k);
    const vfloat row = ssgi_row(before, oy / before_k);
    const vmask inside = there & v_gt(oz, v_splat(view.nearest)) & v_ge(column, zero) &
                         v_ge(row, zero) & v_lt(column, v_splat((float)others.x)) &
                         v_lt(row, v_splat((float)others.y));
    if (!v_any(inside)) {
        return;
    }
    const vint column_at = v_to_int(v_clamp(column, 0.0f, (float)(others.x - 1)));
    const vint row_at = v_to_int(v_clamp(row, 0.0f, (float)(others.y - 1)));
    const vfloat slope_x = ssgi_slope_x(before, v_to_float(column_at) + 0.5f);
    const vfloat slope_y = ssgi_slope_y(before, v_to_float(row_at) + 0.5f);
    // Its line of sight there meets the lit side.
    const float perspective = before.perspective;
    const vmask faces = v_lt(
        v_fma(nx, slope_x * perspective, v_fma(ny, slope_y * perspective, -nz)), zero);
    const vfloat pixel = max(fabs(before.to_x), fabs(before.to_y)) * before_k;
    vmask found = v_splat_int(0);
    for (int layer = 0; layer < SEEN_LAYERS; ++layer) {
        const vfloat surface = ssgi_gather(earlier, others, layer, column_at, row_at);
        const vmask shows = v_lt(surface, v_splat(INFINITY));
        const vfloat front = v_select(safe, surface, shows);
        const vfloat front_k = ssgi_k(before, front);
        const vfloat apart =
            v_fma(nx, v_fma(slope_x, front_k, -ox),
                  v_fma(ny, v_fma(slope_y, front_k, -oy), nz * (oz - front)));
        found = found | (shows & v_le(v_abs(apart), pixel));
    }
    const vmask dark = inside & faces & found;
    if (!v_any(dark)) {
        return;
    }
    const vint place =
        ssgi_record(size, v_splat_int(view.layer), v_iota() + x, v_splat_int(y));
    RasterQuad sent = raster_quad(senders, place, false);
    sent.x = v_iselect(sent.x, v_splat_int(0), dark);
    sent.y = v_iselect(sent.y, v_splat_int(0), dark);
    sent.z = v_iselect(sent.z, v_splat_int(0), dark);
    raster_store_quads(sent, senders + 4 * v_first(place));
}
