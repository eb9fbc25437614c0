// SPDX-License-Identifier: MIT
// sky_blur: the mean of estimates along rows, then along columns, within a part of the penumbra.
//
// Method:  a pixel takes estimates of its surface (common/surface.clh) from half the width
//          of penumbrae about: that of the light times the harmonic mean of the distances to what
//          blocked it. So blur ends where a shadow touches what casts it.
// Reads:   value    SKY_CHANNELS + 1 x [rows / SKY_ROWS, columns]: see sky_rays.cl; after rows the
// last
//                   is the radius in pixels
//          linear, normal  with margin, see common/surface.clh
// Writes:  blurred  SKY_SHAPE 0: as value; 1: 3 x [rows, columns] W/m^2
// Macros:  SKY_CHANNELS (1 or 3), SKY_SHAPE (0 along rows, 1 along columns), SKY_REACH (1..16) px
// Launch:  SSGI_LANES pixels per work-item; SKY_SHAPE 0: of every SKY_ROWS-th row
// Cost:    17 samples of 20 operations at most

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "common/surface.clh"

#if !defined(SKY_ROWS) || !defined(SKY_CHANNELS) || !defined(SKY_SHAPE) || !defined(SKY_REACH)
#error "SKY_ROWS, _CHANNELS, _SHAPE and _REACH must be defined by the host"
#endif
#if SKY_REACH > SSGI_GUARD
#error "SKY_REACH is beyond the guard of a plane"
#endif

#define SKY_PART 0.5f   // of the width of a penumbra: the radius
#define SKY_LEAST 6.0f  // pixels, as of many rays a pixel has one
#define SKY_TALL 1.5f   // times SKY_REACH: greatest radius along columns
#define SKY_OTHER 1e-4f // weight of other surfaces, where no estimate is of the own one
#define SKY_RISES 0.05f // least mean of the shares of light that rays of a surface would bring
#define SKY_BRIGHTEST 1e30f

__kernel void sky_blur(ssgi_plane value, ssgi_plane linear, ssgi_plane normal,
#if SKY_SHAPE == 1
                       const float red, const float green, const float blue,
#endif
                       __global float *restrict blurred, const int2 size, const SsgiCamera camera,
                       const SkyParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1) * (SKY_SHAPE == 0 ? SKY_ROWS : 1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int2 few = (int2)(size.x, (size.y - 1) / SKY_ROWS + 1);
    const int at_x = x + params.margin_columns, at_y = y + params.margin_rows;
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const vfloat own = ssgi_load(linear, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    vfloat sum[SKY_CHANNELS + 1], total = zero, alone = zero;
    for (int j = 0; j <= SKY_CHANNELS; ++j) {
        sum[j] = zero;
    }
    vfloat radius = zero;
    if (v_any(there)) {
        const vfloat column = v_to_float(v_iota() + at_x) + 0.5f;
        const vfloat u = v_select(one, own, there);
        const SsgiFit fit = ssgi_fit_of(
            camera, column, v_splat((float)at_y + 0.5f), u, ssgi_load(normal, whole, 0, at_x, at_y),
            ssgi_load(normal, whole, 1, at_x, at_y), ssgi_load(normal, whole, 2, at_x, at_y),
            params.depth_scale, params.normal_scale);
#if SKY_SHAPE == 0
        vfloat near = zero, count = zero;
        // All columns, as neighbours would differ by chance if they took others.
        for (int dx = -8; dx <= 8; ++dx) {
            const vfloat w = ssgi_load(value, few, SKY_CHANNELS + 1, x + dx, y / SKY_ROWS);
            near = near + w;
            count = count + v_select(zero, one, v_gt(w, zero));
        }
        const vfloat depth = camera.perspective != 0.0f ? one / u : u;
        const vfloat pixel = ssgi_k(camera, depth) * fabs(camera.to_x);
        radius = v_min(
            v_max(SKY_PART * count / v_max(near * pixel, v_splat(1e-20f)), v_splat(SKY_LEAST)),
            v_splat((float)SKY_REACH * SKY_TALL + 0.5f));
#else
        vfloat rows = zero;
        for (int row = max(y / SKY_ROWS - 4, 0); row <= min(y / SKY_ROWS + 4, few.y - 1); ++row) {
            const vfloat found = ssgi_load(value, few, SKY_CHANNELS + 1, x, row);
            radius = radius + found;
            rows = rows + v_select(zero, one, v_gt(found, zero));
        }
        radius = v_max(radius / v_max(rows, one), v_splat(SKY_LEAST));
#endif
        const vfloat inverse = one / (radius * radius);
        int reach = (int)v_largest(v_select(zero, radius, there));
#if SKY_SHAPE == 0
        reach = min(reach, SKY_REACH);
        for (int d = -reach; d <= reach; ++d) {
            const int dx = d, dy = 0, row = y / SKY_ROWS;
#else
        const int first = max((y - reach + SKY_ROWS - 1) / SKY_ROWS * SKY_ROWS, 0) - y;
        for (int d = first; d <= min(reach, size.y - 1 - y); d += SKY_ROWS) {
            const int dx = 0, dy = d, row = (y + d) / SKY_ROWS;
#endif
            const vfloat seen = ssgi_load(linear, whole, 0, at_x + dx, at_y + dy);
            const vmask some =
                v_lt(seen, v_splat(INFINITY)) & v_within(v_iota() + (x + dx), size.x);
            const vfloat off =
                v_fma(v_splat((float)dy), fit.off_y, v_fma(v_splat((float)dx), fit.off_x, fit.off));
            const vfloat alike =
                ssgi_fit_weight(ssgi_fit(fit, off, v_select(one, seen, some),
                                         ssgi_load(normal, whole, 0, at_x + dx, at_y + dy),
                                         ssgi_load(normal, whole, 1, at_x + dx, at_y + dy),
                                         ssgi_load(normal, whole, 2, at_x + dx, at_y + dy)));
            const vfloat apart = v_max(v_fma(v_splat((float)(d * d)), -inverse, one), zero);
            const vfloat weight = v_select(zero, apart * apart * (alike + SKY_OTHER), some);
            total = total + weight;
            alone = alone + v_select(zero, apart * apart * alike, some);
            for (int j = 0; j <= SKY_CHANNELS; ++j) {
                const vfloat found = ssgi_load(value, few, j, x + dx, row);
                sum[j] = v_fma(weight, v_select(zero, found, some), sum[j]);
            }
        }
#if SKY_SHAPE == 1
        // Where hardly a ray of the own surface rises above it, no light comes from elsewhere
        // either.
        total = v_max(sum[SKY_CHANNELS], alone * SKY_RISES);
#endif
        const vmask any = v_gt(total, zero) & there;
        const vfloat per = v_select(zero, one / v_select(one, total, any), any);
        for (int j = 0; j <= SKY_CHANNELS; ++j) {
            sum[j] = v_min(sum[j] * per, v_splat(SKY_BRIGHTEST));
        }
    }
#if SKY_SHAPE == 0
    for (int j = 0; j <= SKY_CHANNELS; ++j) {
        ssgi_store(sum[j], blurred, few, j, x, y / SKY_ROWS, 0.0f);
    }
    // The columns' mean is of radii of surfaces: a lane without one has none, whatever its
    // neighbours.
    ssgi_store(v_select(zero, radius, there), blurred, few, SKY_CHANNELS + 1, x, y / SKY_ROWS,
               0.0f);
#else
    const float colour[3] = {red, green, blue};
    for (int j = 0; j < 3; ++j) {
        ssgi_store(sum[SKY_CHANNELS == 1 ? 0 : j] * colour[j], blurred, size, j, x, y, 0.0f);
    }
#endif
}
