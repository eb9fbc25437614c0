// SPDX-License-Identifier: MIT
// area_lights: irradiance by emissive polygons, and an estimate of how much of it is blocked.
//
// Method:  the irradiance that nothing blocks is that of polygons, clipped at the horizon (Lambert
//          1760; Baum, Rushmeier and Winget 1989, "Improving Radiosity Solutions Through the Use of
//          Analytically Determined Form-Factors"). AREA_RAYS points of them are drawn, a polygon in
//          proportion to what it gives (weighted reservoir sampling, Chao 1982), and a ray is cast
//          to each. What they give with and without blockers is blurred afterwards, and the ratio
//          of the two is the share of light that arrives (Heitz, Hill and McGuire 2018, "Combining
//          Analytic Direct Illumination and Stochastic Shadows"). AREA_STEP 1 draws more points
//          where any near ray was blocked and any was not.
// Reads:   depth, normal  with margin; normal in view space
//          emitters   [count][AREA_EMITTER], see ssgi_cl/techniques/area_lights/emitters.py
//          sources    [count][AREA_QUANTILES][AREA_SOURCE] triangles that points are drawn from
//          noise      [AREA_NOISE rows][3 AREA_RAYS][AREA_PITCH columns] numbers in [0, 1)
//          cells, sampled  of step 0 (AREA_STEP 1)
//          nodes, triangles; cutouts, textures, texels, decode (AREA_HOLES 1): see rays/bvh.clh
// Writes:  irradiance  3 x [rows, columns] W/m^2 with nothing in the way; 0 where nothing is
//                     (AREA_STEP 0)
//          sampled    2 AREA_CHANNELS + 2 x [rows, columns]: mean of what arrives along the rays,
//                     and of what would (W/m^2, or with one channel its luminance); sum of the
//                     penumbra's widths by blocked rays (scene units), and their number
//          cells      [rows / AREA_CELL_ROWS][columns / AREA_CELL_COLUMNS], rounded up: 1 where a
//                     ray was blocked, 2 where one was not, 3 both; starts as 0 (AREA_STEP 0)
// Macros:  AREA_RAYS (1..16), AREA_CHANNELS (1 or 3), AREA_STEP (0 or 1), AREA_HOLES (0 or 1)
// Params:  count of emitters, place of the camera in the scene, `before`: share of step 0 in the
//          rays of a pixel that both steps draw
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    some 150 operations per pixel and emitter, and the rays

#include "area_lights/area_cells.clh"
#include "common/camera.clh"
#include "common/gbuffer.clh"
#if AREA_HOLES
#define RAYS_HOLES
#endif
#include "rays/bvh.clh"

#if !defined(AREA_RAYS) || !defined(AREA_CHANNELS) || !defined(AREA_STEP) || !defined(AREA_HOLES)
#error "AREA_RAYS, AREA_CHANNELS, AREA_STEP and AREA_HOLES must be defined by the host"
#endif
#if !defined(AREA_EMITTER) || !defined(AREA_SOURCE) || !defined(AREA_QUANTILES) ||                 \
    !defined(AREA_NOISE)
#error "ssgi_cl/device/constants.py defines AREA_EMITTER, _SOURCE, _QUANTILES, _NOISE"
#endif

#define AREA_PITCH (AREA_NOISE + 16) // a row's first numbers come again after its last
#define AREA_BRIGHTEST 1e30f
#define AREA_TINY 1e-24f // squared distance
#define AREA_SHORT 1e-4f // of a ray, left out at its end

typedef struct {
    vfloat x, y, z;
} AreaPoint;

static inline vfloat area_dot(const AreaPoint a, const AreaPoint b)
{
    return v_fma(a.x, b.x, v_fma(a.y, b.y, a.z * b.z));
}

static inline AreaPoint area_cross(const AreaPoint a, const AreaPoint b)
{
    const AreaPoint c = {v_fma(a.y, b.z, -(a.z * b.y)), v_fma(a.z, b.x, -(a.x * b.z)),
                         v_fma(a.x, b.y, -(a.y * b.x))};
    return c;
}

// Part of the irradiance by an edge between two directions, times 2 pi: the angle between them
// times the cosine of the normal from that of their plane.
static inline vfloat area_edge(const AreaPoint a, const AreaPoint b, const AreaPoint n)
{
    const AreaPoint c = area_cross(a, b);
    const vfloat sine = v_sqrt(v_max(area_dot(c, c), v_splat(1e-30f)));
    const vfloat length = v_sqrt(v_max(area_dot(a, a) * area_dot(b, b), v_splat(1e-30f)));
    // Of small angles the sine is the more precise, of large ones the cosine.
    const vfloat cosine = v_min(v_max(area_dot(a, b) / length, v_splat(-1.0f)), v_splat(1.0f));
    const vfloat s = v_min(sine / length, v_splat(1.0f));
    const vfloat small =
        s * v_fma(s * s, v_fma(s * s, v_splat(0.075f), v_splat(1.0f / 6.0f)), v_splat(1.0f));
    const vfloat angle = v_select(v_acos(cosine), small, v_gt(cosine, v_splat(0.98f)));
    return area_dot(c, n) * angle / sine;
}

// Irradiance per radiance of the side of a quadrilateral whose corners [12] go round
// anti-clockwise; less than 0 from its other side.
static inline vfloat area_quad(__global const float *restrict corners, const AreaPoint at,
                               const AreaPoint n)
{
    const vfloat zero = v_splat(0.0f);
    AreaPoint a = {corners[9] - at.x, corners[10] - at.y, corners[11] - at.z};
    vfloat high = area_dot(a, n), sum = zero;
    AreaPoint out = {zero, zero, zero}, in = {zero, zero, zero}; // where it crosses the horizon
    for (int i = 0; i < 4; ++i) {
        const AreaPoint b = {corners[3 * i] - at.x, corners[3 * i + 1] - at.y,
                             corners[3 * i + 2] - at.z};
        const vfloat next = area_dot(b, n);
        const vmask above = v_gt(high, zero), below = v_gt(next, zero);
        if (v_any(above | below)) {
            const vmask crossed = above ^ below;
            const vfloat t = high / v_select(v_splat(1.0f), high - next, crossed);
            const AreaPoint c = {v_fma(b.x - a.x, t, a.x), v_fma(b.y - a.y, t, a.y),
                                 v_fma(b.z - a.z, t, a.z)};
            const vmask leaves = crossed & above, enters = crossed & below;
            const AreaPoint from = {v_select(a.x, c.x, enters), v_select(a.y, c.y, enters),
                                    v_select(a.z, c.z, enters)};
            const AreaPoint to = {v_select(b.x, c.x, leaves), v_select(b.y, c.y, leaves),
                                  v_select(b.z, c.z, leaves)};
            out.x = v_select(out.x, c.x, leaves), out.y = v_select(out.y, c.y, leaves);
            out.z = v_select(out.z, c.z, leaves);
            in.x = v_select(in.x, c.x, enters), in.y = v_select(in.y, c.y, enters);
            in.z = v_select(in.z, c.z, enters);
            sum = sum + v_select(zero, area_edge(from, to, n), above | below);
        }
        a = b;
        high = next;
    }
    return (sum + area_edge(out, in, n)) * -0.5f;
}

__kernel void
area_lights(ssgi_plane depth, ssgi_plane normal, __global const float *restrict emitters,
            __global const float *restrict sources, __global const float *restrict noise,
            __global const float *restrict nodes, __global const float *restrict triangles,
#if AREA_HOLES
            __global const float *restrict cutouts, __global const int *restrict textures,
            __global const int *restrict texels, __global const float *restrict decode,
#endif

#if AREA_STEP == 0
            __global float *restrict irradiance,
#endif
            __global float *restrict sampled, __global int *restrict cells, const int2 size,
            const SsgiCamera camera, const AreaParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
#if AREA_STEP == 1
    if (area_around(cells, size, x, y, 0) != 3) {
        return;
    }
#endif
#if AREA_HOLES
    const RaysHoles holes = {cutouts, {textures, texels, decode}};
#else
    const RaysHoles holes = 0;
#endif
    const int2 whole = (int2)(size.x + 2 * params.margin_columns, size.y + 2 * params.margin_rows);
    const int at_x = x + params.margin_columns, at_y = y + params.margin_rows;
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const vfloat own = ssgi_load(depth, whole, 0, at_x, at_y);
    const vmask there = v_lt(own, v_splat(INFINITY));
    vfloat light[3] = {zero, zero, zero};
    vfloat got[AREA_CHANNELS], meant[AREA_CHANNELS], widths = zero, hits = zero;
#pragma unroll
    for (int j = 0; j < AREA_CHANNELS; ++j) {
        got[j] = meant[j] = zero;
    }
#if AREA_STEP == 0
    int bits = 0;
#endif
    if (v_any(there)) {
        const vfloat z = v_select(one, own, there);
        const vfloat k = ssgi_k(camera, z);
        const vfloat vx = ssgi_slope_x(camera, v_to_float(v_iota() + at_x) + 0.5f) * k;
        const vfloat vy = ssgi_slope_y(camera, v_splat((float)at_y + 0.5f)) * k;
        const vfloat nx = ssgi_load(normal, whole, 0, at_x, at_y);
        const vfloat ny = ssgi_load(normal, whole, 1, at_x, at_y);
        const vfloat nz = ssgi_load(normal, whole, 2, at_x, at_y);
        // The columns of the rotation are the rows of its inverse.
        const AreaPoint n = {
            v_fma(nx, v_splat(params.xx), v_fma(ny, v_splat(params.yx), nz * params.zx)),
            v_fma(nx, v_splat(params.xy), v_fma(ny, v_splat(params.yy), nz * params.zy)),
            v_fma(nx, v_splat(params.xz), v_fma(ny, v_splat(params.yz), nz * params.zz))};
        const AreaPoint at = {
            v_fma(vx, v_splat(params.xx), v_fma(vy, v_splat(params.yx), -z * params.zx)) +
                params.eye_x,
            v_fma(vx, v_splat(params.xy), v_fma(vy, v_splat(params.yy), -z * params.zy)) +
                params.eye_y,
            v_fma(vx, v_splat(params.xz), v_fma(vy, v_splat(params.yz), -z * params.zz)) +
                params.eye_z};
        __global const float *restrict numbers =
            noise + (y % AREA_NOISE) * (3 * AREA_RAYS * AREA_PITCH) + x % AREA_NOISE;
        vint chosen[AREA_RAYS];
        vfloat turn[AREA_RAYS], given_by[AREA_RAYS]; // what the chosen one gives
        vfloat total = zero;
#pragma unroll
        for (int i = 0; i < AREA_RAYS; ++i) {
            chosen[i] = v_splat_int(0);
            turn[i] = v_load(numbers + 3 * i * AREA_PITCH);
            given_by[i] = zero;
        }
        for (int q = 0; q < params.count; ++q) {
            __global const float *restrict emitter = emitters + q * AREA_EMITTER;
            // What lies in its plane sees nothing of it.
            const AreaPoint facing = {v_splat(emitter[18]), v_splat(emitter[19]),
                                      v_splat(emitter[20])};
            const vfloat before = area_dot(at, facing) - emitter[21];
            const bool both = emitter[15] != 0.0f;
            const vmask sees = there & v_gt(both ? v_abs(before) : before, v_splat(params.lift));
            if (!v_any(sees)) {
                continue;
            }
            vfloat w = area_quad(emitter, at, n);
            w = v_select(zero, v_max(both ? v_abs(w) : w, zero), sees);
            if (!v_any(v_gt(w, zero))) {
                continue;
            }
#pragma unroll
            for (int j = 0; j < 3; ++j) {
                light[j] = v_fma(w, v_splat(emitter[12 + j]), light[j]);
            }
            const vfloat given = w * emitter[16];
            total = total + given;
            const vfloat part = given / v_max(total, v_splat(1e-30f));
#pragma unroll
            for (int i = 0; i < AREA_RAYS; ++i) {
                // One number makes all choices: what is left of it is as even as it was.
                const vmask taken = v_lt(turn[i], part);
                const vfloat rest = v_max(one - part, v_splat(1e-6f));
                turn[i] =
                    v_select((turn[i] - part) / rest, turn[i] / v_max(part, v_splat(1e-6f)), taken);
                chosen[i] = v_iselect(chosen[i], v_splat_int(q), taken);
                given_by[i] = v_select(given_by[i], given, taken);
            }
        }
        const vmask lit = v_gt(total, zero);
        if (v_any(lit)) {
            const vfloat lift = v_splat(params.lift);
            RaysRay ray = {v_fma(n.x, lift, at.x),
                           v_fma(n.y, lift, at.y),
                           v_fma(n.z, lift, at.z),
                           zero,
                           zero,
                           zero};
            for (int i = 0; i < AREA_RAYS; ++i) {
                vfloat u = v_load(numbers + (3 * i + 1) * AREA_PITCH);
                vfloat v = v_load(numbers + (3 * i + 2) * AREA_PITCH);
                const vint quantile =
                    v_iclamp(v_to_int(turn[0] * AREA_QUANTILES), 0, AREA_QUANTILES - 1);
                const vint s = (chosen[0] * AREA_QUANTILES + quantile) * AREA_SOURCE;
                const vmask over = v_gt(u + v + v_gather(sources + 12, s), one);
                u = v_select(u, one - u, over);
                v = v_select(v, one - v, over);
                const AreaPoint a = {v_gather(sources + 3, s), v_gather(sources + 4, s),
                                     v_gather(sources + 5, s)};
                const AreaPoint b = {v_gather(sources + 6, s), v_gather(sources + 7, s),
                                     v_gather(sources + 8, s)};
                const AreaPoint to = {
                    v_fma(a.x, u, v_fma(b.x, v, v_gather(sources, s))) - ray.x,
                    v_fma(a.y, u, v_fma(b.y, v, v_gather(sources + 1, s))) - ray.y,
                    v_fma(a.z, u, v_fma(b.z, v, v_gather(sources + 2, s))) - ray.z};
                // Twice the triangle's normal times its area over that: of unit length.
                const AreaPoint facing = {v_gather(sources + 9, s), v_gather(sources + 10, s),
                                          v_gather(sources + 11, s)};
                const vfloat squared = v_max(area_dot(to, to), v_splat(AREA_TINY));
                const vfloat received = v_max(area_dot(to, n), zero);
                vfloat sent = -area_dot(to, facing);
                const vint e = chosen[0] * AREA_EMITTER;
                const vmask both = v_ne(v_gather(emitters + 15, e), zero);
                sent = v_max(v_select(sent, v_abs(sent), both), zero);
                // Irradiance over the probability of the emitter, area and point.
                const vfloat geometry = received * sent / (squared * squared);
                const vfloat weight = v_select(zero,
                                               geometry * v_gather(emitters + 17, e) * total /
                                                   v_max(given_by[0], v_splat(1e-30f)),
                                               lit & v_gt(given_by[0], zero));
                ray.wx = to.x * (1.0f - AREA_SHORT);
                ray.wy = to.y * (1.0f - AREA_SHORT);
                ray.wz = to.z * (1.0f - AREA_SHORT);
                const vmask wanted = v_gt(weight, zero);
                vfloat part;
                const vmask blocked = rays_blocked_at(nodes, triangles, holes, ray, wanted, &part);
                const vfloat wide = v_sqrt(v_gather(emitters + 17, e)) * part /
                                    v_max(one - part, v_splat(AREA_SHORT));
                widths = widths + v_select(zero, wide, blocked);
                hits = hits + v_select(zero, one, blocked);
                const vfloat open = v_select(weight, zero, blocked);
#if AREA_STEP == 0
                bits |= (v_any(blocked) ? 1 : 0) | (v_any(wanted & ~blocked) ? 2 : 0);
#endif
#if AREA_CHANNELS == 1
                const vfloat bright = v_gather(emitters + 16, e);
                got[0] = v_fma(open, bright, got[0]);
                meant[0] = v_fma(weight, bright, meant[0]);
#else
#pragma unroll
                for (int j = 0; j < 3; ++j) {
                    const vfloat bright = v_gather(emitters + 12 + j, e);
                    got[j] = v_fma(open, bright, got[j]);
                    meant[j] = v_fma(weight, bright, meant[j]);
                }
#endif
                // The next one moves to the front: arrays that a variable indexes lie in memory.
#pragma unroll
                for (int r = 1; r < AREA_RAYS; ++r) {
                    chosen[r - 1] = chosen[r];
                    turn[r - 1] = turn[r];
                    given_by[r - 1] = given_by[r];
                }
            }
        }
    }
    const vfloat most = v_splat(AREA_BRIGHTEST);
    float share = 1.0f / AREA_RAYS;
#if AREA_STEP == 0
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        ssgi_store(v_min(light[j], most), irradiance, size, j, x, y, 0.0f);
    }
    if (bits != 0) {
        atomic_or(cells + area_cell(size, x, y), bits);
    }
#else
    share *= 1.0f - params.before;
#endif
#pragma unroll
    for (int j = 0; j < AREA_CHANNELS; ++j) {
        vfloat arrived = got[j] * share, sent = meant[j] * share;
#if AREA_STEP == 1
        arrived =
            v_fma(v_load(sampled + ssgi_index(size, j, x, y)), v_splat(params.before), arrived);
        sent = v_fma(v_load(sampled + ssgi_index(size, AREA_CHANNELS + j, x, y)),
                     v_splat(params.before), sent);
#endif
        ssgi_store(v_min(arrived, most), sampled, size, j, x, y, 0.0f);
        ssgi_store(v_min(sent, most), sampled, size, AREA_CHANNELS + j, x, y, 0.0f);
    }
#if AREA_STEP == 1
    widths = widths + v_load(sampled + ssgi_index(size, 2 * AREA_CHANNELS, x, y));
    hits = hits + v_load(sampled + ssgi_index(size, 2 * AREA_CHANNELS + 1, x, y));
#endif
    ssgi_store(v_min(widths, most), sampled, size, 2 * AREA_CHANNELS, x, y, 0.0f);
    ssgi_store(hits, sampled, size, 2 * AREA_CHANNELS + 1, x, y, 0.0f);
}
