// SPDX-License-Identifier: MIT
// ssdo_views: surfaces of an auxiliary camera in the unoccluded directions of ssdo_bitmask.
//
// Method:  Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image
//          Space", add cameras that see what the first one misses.
// Departs: a sector is free if nothing covers it, or if the first camera does not see the side of
//          the surface that covers it, whose light is unknown. The free sectors of a slice are
//          split into VIEWS_STRATA parts, equal steps of the sine from the normal. In each part one
//          ray has the direction of a free sector; where it meets a surface of the other camera
//          (see surfaces.clh), that covers all free sectors of the part. So each sector is covered
//          once, with any number of cameras, and its measure is that of ssdo_bitmask. Distances of
//          taps grow by a constant factor up to the radius, from a place two pixels of the other
//          camera before the receiver: near surfaces are met at the other camera's resolution, far
//          ones in as few taps as their size needs. Surfaces that an earlier view shows are left
//          out: that view has decided which sectors they cover, and a second test would cover more
//          (see ssdo_views_unseen.cl).
// Reads:   linear   [rows, columns] with margin: 1 / depth (orthographic: depth), or INFINITY
//          normal   3 x likewise, view space, unit length
//          table    [4 rows][VIEWS_SLICES][3][16 columns]: cosine and sine of a slice's angle from
//                   +columns towards +rows, dither in [0, 1)
//          depth    VIEWS_LAYERS x [other rows, other columns] of the other camera, scene units;
//                   INFINITY where nothing is, or an earlier view shows the surface
//          seen     3 VIEWS_NORMALS x likewise: normals, its view space
//          radiance 3 VIEWS_SENDERS x likewise, W m^-2 sr^-1
// Writes:  light    image 0: A, less the newly covered fraction; from image VIEWS_BOUNCE on: 3 of
//                   irradiance, W/m^2, added to (VIEWS_SENDERS > 0)
//          masks    2 VIEWS_SLICES x [rows, columns] as a plane, int: a bit for each covered
//                   sector, and for each of them whose sender is unknown
// Macros:  VIEWS_SLICES (1..32), VIEWS_STRATA (1..16), VIEWS_TAPS (1..64), VIEWS_LAYERS (>= 1),
//          VIEWS_NORMALS (1..VIEWS_LAYERS; deeper layers are taken to lie across the viewing
//          direction), VIEWS_SENDERS (0..VIEWS_NORMALS), VIEWS_BOUNCE (>= 1)
// Launch:  SSGI_LANES receivers of a row per work-item
// Cost:    up to VIEWS_SLICES * VIEWS_STRATA * VIEWS_TAPS * VIEWS_LAYERS scattered reads, 3
//          more where one finds a surface; none where the other camera sees nothing within the
//          radius

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "ssdo/sectors.clh"

#if !defined(VIEWS_SLICES) || !defined(VIEWS_STRATA) || !defined(VIEWS_TAPS) ||                    \
    !defined(VIEWS_LAYERS) || !defined(VIEWS_NORMALS) || !defined(VIEWS_SENDERS) ||                \
    !defined(VIEWS_BOUNCE)
#error "VIEWS_SLICES, _STRATA, _TAPS, _LAYERS, _NORMALS, _SENDERS and _BOUNCE must be defined"
#endif

#include "ssdo/surfaces.clh"

#define VIEWS_GOLDEN 0.618033989f
#define VIEWS_BEFORE 2.0f // px before the receiver at which distances of taps begin to grow
#define VIEWS_FINEST 0.0009765625f // least width of a pixel, in radii

// x - floor(x) for x >= 0.
static inline vfloat views_fraction(const vfloat x) { return x - v_floor(x); }

// Whether any part of a ball is on the inner side of a plane of the other camera's frustum.
static inline vmask views_touches(const vfloat x, const vfloat y, const vfloat z,
                                  const vfloat radius, const float a, const float b, const float c,
                                  const float d)
{
    return v_gt(v_fma(x, v_splat(a), v_fma(y, v_splat(b), v_fma(z, v_splat(c), v_splat(d)))),
                -radius);
}

__kernel void ssdo_views(ssgi_plane linear, ssgi_plane normal, __global const float *restrict table,
                         ssgi_plane depth, ssgi_plane seen,
#if VIEWS_SENDERS > 0
                         ssgi_plane radiance,
#endif
                         __global float *restrict light, __global int *restrict masks,
                         const int2 size, const SsgiCamera camera, const SsgiCamera other,
                         const ViewsParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(size.x + params.margin_left + params.margin_right,
                              size.y + params.margin_top + params.margin_bottom);
    const int at_x = x + params.margin_left;
    const int at_y = y + params.margin_top;
    const vfloat zero = v_splat(0.0f);
    const vfloat one = v_splat(1.0f);
    const bool perspective = camera.perspective != 0.0f;
    const vfloat own = ssgi_load(linear, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY)) & v_ilt(v_iota() + x, v_splat_int(size.x));
    const vfloat flat = v_select(one, own, there);
    const vfloat z = perspective ? 1.0f / flat : flat;
    const vfloat k = ssgi_k(camera, z);
    const vfloat slope_x = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f);
    const vfloat slope_y = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f));
    const vfloat wanted_px = params.radius * max(fabs(camera.from_x), fabs(camera.from_y)) / k;
    const vfloat shrink = v_min(params.most_px / wanted_px, one);
    const vfloat radius = params.radius * shrink;
    const vmask active = there & v_ge(wanted_px * shrink, one);
    // The receiver in the other camera's view space.
    const vfloat px = slope_x * k, py = slope_y * k;
    const vfloat ox = v_fma(
        px, v_splat(params.xx),
        v_fma(py, v_splat(params.xy), v_fma(z, v_splat(-params.xz), v_splat(params.shift_x))));
    const vfloat oy = v_fma(
        px, v_splat(params.yx),
        v_fma(py, v_splat(params.yy), v_fma(z, v_splat(-params.yz), v_splat(params.shift_y))));
    const vfloat oz = v_fma(
        px, v_splat(params.zx),
        v_fma(py, v_splat(params.zy), v_fma(z, v_splat(-params.zz), v_splat(params.shift_z))));
    const vmask near =
        active & v_lt(oz, radius) &
        views_touches(ox, oy, oz, radius, params.left_x, 0.0f, params.left_z, params.left_w) &
        views_touches(ox, oy, oz, radius, params.right_x, 0.0f, params.right_z, params.right_w) &
        views_touches(ox, oy, oz, radius, 0.0f, params.top_y, params.top_z, params.top_w) &
        views_touches(ox, oy, oz, radius, 0.0f, params.bottom_y, params.bottom_z, params.bottom_w);
    if (!v_any(near)) {
        return;
    }
    const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
    const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
    const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
    ViewsReceiver at;
    at.x = ox;
    at.y = oy;
    at.z = oz;
    at.nx = v_fma(nx, v_splat(params.xx), v_fma(ny, v_splat(params.xy), nz * params.xz));
    at.ny = v_fma(nx, v_splat(params.yx), v_fma(ny, v_splat(params.yy), nz * params.yz));
    at.nz = v_fma(nx, v_splat(params.zx), v_fma(ny, v_splat(params.zy), nz * params.zz));
    // Width of the other camera's pixel at the receiver, and the growth of distances per tap.
    const vfloat pixel =
        v_max(radius * VIEWS_FINEST, ssgi_k(other, v_max(-oz, v_splat(params.nearest))) *
                                         max(fabs(other.to_x), fabs(other.to_y)));
    const vfloat apart = pixel * VIEWS_BEFORE;
    const vfloat octaves = v_log2(one + radius / apart) * (1.0f / (float)VIEWS_TAPS);
    const vfloat growth = v_exp2(octaves);
    const vfloat middle = v_exp2(octaves * 0.5f);
    at.floor = v_fma(at.nx, ox, v_fma(at.ny, oy, at.nz * oz)) +
               v_fma(z, v_splat(params.depth_bias), pixel * params.bias);
    const ViewsViewRay view_ray = views_view_ray(camera, slope_x, slope_y);
    const int2 others = (int2)(params.columns, params.rows);

    __global const float *restrict pattern = table + (y & 3) * (VIEWS_SLICES * 48) + (x & 3);
    bool finds = false;
    vfloat hidden = zero;
    vfloat total = v_splat(1e-30f);
    vfloat bounce[3] = {zero, zero, zero};
    for (int s = 0; s < VIEWS_SLICES; ++s) {
        __global const float *restrict slice_at = pattern + s * 48;
        const vfloat dither = v_load(slice_at + 32);
        const ViewsSlice slice =
            views_slice(camera, &view_ray, v_load(slice_at), v_load(slice_at + 16), nx, ny, nz);
        total = total + slice.share;
        const int mask_at = ssgi_index(size, s, x, y);
        const int dark_at = ssgi_index(size, VIEWS_SLICES + s, x, y);
        const vint covered = v_iload(masks + mask_at);
        const vint dark = v_iload(masks + dark_at);
        vint added = v_splat_int(0);
        vfloat from_sector = zero; // not rounded
        vint from = v_splat_int(0);
        vfloat arrives[3] = {zero, zero, zero};
        for (int j = 0; j < VIEWS_STRATA; ++j) {
            const float sine = 2.0f * (float)j / (float)VIEWS_STRATA - 1.0f;
            const float end = 2.0f * (float)(j + 1) / (float)VIEWS_STRATA - 1.0f;
            const bool last = j + 1 == VIEWS_STRATA;
            const vfloat to_sector =
                last ? v_splat(32.0f)
                     : views_sector(&slice, v_splat(end), v_splat(sqrt(1.0f - end * end)));
            const vint to =
                last ? v_splat_int(32) : v_to_int(v_clamp(to_sector + dither, 0.0f, 32.0f));
            const vint all = v_splat_int(-1);
            const vint bits = (all << from) & v_shift_right(all, 32 - to) & v_ilt(from, to) &
                              (~covered | dark) & near;
            const vfloat shift = views_fraction(v_fma(
                dither, v_splat(7.0f), v_splat((float)(s * VIEWS_STRATA + j) * VIEWS_GOLDEN)));
            if (v_any(v_ine(bits, v_splat_int(0)))) {
                // One of the free sectors: the first after a dithered place, or else the first.
                const vint place = from + v_to_int(shift * v_to_float(to - from));
                const vint later = bits & (all << v_imin(place, v_splat_int(31)));
                const vint some = v_iselect(later, bits, v_ieq(later, v_splat_int(0)));
                const vint number = v_count_bits((some & -some) - 1);
                const vfloat width = v_max(to_sector - from_sector, v_splat(1e-3f));
                const vfloat part =
                    v_clamp((v_to_float(number) + 0.5f - dither - from_sector) / width, 0.0f, 1.0f);
                const vfloat turned = v_fma(part, v_splat(end - sine), v_splat(sine));
                const vfloat upright = v_sqrt(v_max(v_fma(-turned, turned, one), zero));
                vfloat wx, wy, wz;
                views_direction(&view_ray, &slice, turned, upright, &wx, &wy, &wz);
                const vfloat dx =
                    v_fma(wx, v_splat(params.xx), v_fma(wy, v_splat(params.xy), wz * params.xz));
                const vfloat dy =
                    v_fma(wx, v_splat(params.yx), v_fma(wy, v_splat(params.yy), wz * params.yz));
                const vfloat dz =
                    v_fma(wx, v_splat(params.zx), v_fma(wy, v_splat(params.zy), wz * params.zz));
                const vmask open = v_ine(bits, v_splat_int(0));
                vfloat grown = apart * v_exp2(shift * octaves);
                ViewsRay ray = {dx, dy, dz, zero, zero};
                ViewsSurface first;
                first.distance = v_splat(INFINITY);
                first.faces = first.layer = first.column = first.row = v_splat_int(0);
                for (int t = 0; t < VIEWS_TAPS; ++t, grown = grown * growth) {
                    const vmask going = open & v_eq(first.distance, v_splat(INFINITY));
                    if (!v_any(going)) {
                        break;
                    }
                    const vfloat reach = grown - apart;
                    ray.to = t + 1 == VIEWS_TAPS ? radius : v_fma(grown, middle, -apart);
                    vint column, row;
                    const vmask inside =
                        going & views_pixel(other, others, params.nearest, v_fma(reach, dx, ox),
                                            v_fma(reach, dy, oy), -v_fma(reach, dz, oz), &column,
                                            &row);
                    if (v_any(inside)) {
                        views_meet(depth, seen, others, other, &at, &ray, inside, column, row,
                                   &first);
                    }
                    ray.from = ray.to;
                }
                const vmask found = v_lt(first.distance, v_splat(INFINITY));
                added = added | (bits & found);
                // Lanes are hit at different taps: the radiance is read once for all.
#if VIEWS_SENDERS > 0
                const vmask lit =
                    found & first.faces & v_ilt(first.layer, v_splat_int(VIEWS_SENDERS));
                if (v_any(lit)) {
                    const vint layer = v_iselect(v_splat_int(0), first.layer, lit);
                    const vint from_row = layer * (3 * params.rows) + first.row;
                    const vfloat amount = v_select(zero, v_to_float(v_count_bits(bits)), lit);
                    for (int c = 0; c < 3; ++c) {
                        const vfloat sent =
                            ssgi_gather(radiance, others, c, first.column, from_row);
                        arrives[c] = v_fma(amount, sent, arrives[c]);
                    }
                }
#endif
            }
            from = to;
            from_sector = to_sector;
        }
        if (!v_any(v_ine(added, v_splat_int(0)))) {
            continue;
        }
        finds = true;
        const vfloat each = slice.share * (1.0f / 32.0f);
        hidden = v_fma(each, v_to_float(v_count_bits(added & ~covered)), hidden);
        for (int c = 0; c < 3; ++c) {
            bounce[c] = v_fma(each, arrives[c], bounce[c]);
        }
        // The guard beyond the last column takes what it holds.
        v_istore(covered | added, masks + mask_at);
        v_istore(dark & ~added, masks + dark_at);
    }
    if (!finds) {
        return;
    }
    const int open_at = ssgi_index(size, 0, x, y);
    const vfloat before = v_load(light + open_at);
    v_store(v_select(before, v_max(before - hidden / total, zero), near), light + open_at);
#if VIEWS_SENDERS > 0
    for (int c = 0; c < 3; ++c) {
        const int bounce_at = ssgi_index(size, VIEWS_BOUNCE + c, x, y);
        const vfloat more = v_select(zero, bounce[c] * (3.14159265f / total), near);
        v_store(v_load(light + bounce_at) + more, light + bounce_at);
    }
#endif
}
