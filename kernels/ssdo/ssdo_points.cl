// SPDX-License-Identifier: MIT
// ssdo_points: directional occlusion and one bounce of light from directions in the hemisphere
// above each pixel.
//
// Method:  Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image
//          Space". POINTS_PUBLISHED 1: one tap for each direction; all senders have the same area.
//          POINTS_PUBLISHED 0: a direction is unoccluded and receives the sky's light, or meets a
//          surface and receives its light, with the same weight, so light is conserved. See
//          ssdo/search.clh for both.
// Departs: directions are fixed in world space and mirrored to the receiver's side, so the light
//          from a direction is one of two numbers. A is the unoccluded share of all weights,
//          exactly 1 without occluders. Only surfaces above the receiver's tangent plane count. In
//          a row, receivers are processed by column modulo 4, so that lanes share directions and
//          read adjacent pixels.
// Reads:   depth, normal  image 0 and the first three, with margin: receivers, view space
//          thickness of the front layer, likewise, scene units; with POINTS_THICKNESS 2 only
//          planes   POINTS_LAYERS layers, see ssdo/ssdo_planes.cl
//          senders  POINTS_SENDERS layers of records, see direct/records.clh, with margin, of the
//                   sides that the camera sees
//          directions  [16 rows][4 columns][POINTS_COUNT][5, with POINTS_SKY 11]: a unit vector,
//                   view space; a number in (0, 1), see PointsDirection; the solid angle; the light
//                   from there and from the opposite side, RGB W/m^2
// Writes:  gathered [rows, columns] without margin: A in [0, 1]; with POINTS_SKY 3 images of the
//          sky's irradiance; with POINTS_SENDERS > 0 3 images of the bounce's, W/m^2. Where
//          nothing is: 1, and 0
//          kept     with POINTS_KEPT ceil(POINTS_COUNT / 32) images of int as a plane, a bit for
//                   each direction that meets something
// Macros:  POINTS_COUNT (1..256 directions), POINTS_TAPS (1..18 of a direction), POINTS_LAYERS
//          (>= 1), POINTS_SENDERS (0..POINTS_LAYERS layers that send light), POINTS_STEP (1, 2, 4
//          pixels from one receiver to the next), POINTS_SKY, POINTS_PUBLISHED, POINTS_KEPT (0, 1),
//          POINTS_THICKNESS (0..2)
// Launch:  one lane: a work-item a receiver; else 16 for pieces of 4 SSGI_LANES columns, which make
//          strips of 256 columns and one or more rows, strip by strip
// Cost:    per receiver and direction up to 2 POINTS_TAPS POINTS_LAYERS quads, and one sender
//          record; published: a quad for each layer

#if !defined(POINTS_COUNT) || !defined(POINTS_TAPS) || !defined(POINTS_LAYERS) ||                  \
    !defined(POINTS_SENDERS) || !defined(POINTS_STEP) || !defined(POINTS_SKY) ||                   \
    !defined(POINTS_PUBLISHED) || !defined(POINTS_THICKNESS) || !defined(POINTS_KEPT)
#error "the macros POINTS_* of the header must be defined by the host"
#endif

#define POINTS_SURE 0
#include "ssdo/search.clh"

#define POINTS_FIELDS (POINTS_SKY ? 11 : 5)
#define POINTS_WORDS ((POINTS_COUNT + 31) / 32)
#define POINTS_PI 3.14159265f
#define POINTS_BOUNCE (POINTS_SKY ? 4 : 1)        // the first image of the bounce
#define POINTS_PHASES (SSGI_LANES == 1 ? 1 : 4)   // of columns that have the same directions
#define POINTS_PIECE (POINTS_PHASES * SSGI_LANES) // receivers of a work-item
#define POINTS_STRIP 256                          // columns
#define POINTS_IN_STRIP (POINTS_STRIP / POINTS_PIECE)

// A plane's pixels of every fourth receiver from column x on.
static inline vfloat points_own(ssgi_plane plane, const int2 whole, const int image, const int x,
                                const int y, const PointsParams params)
{
#if POINTS_STEP == 1
    return ssgi_load_fourths(plane, whole, image, x + params.margin_columns,
                             y + params.margin_rows);
#else
    const vint column = (v_iota() * POINTS_PHASES + x) * POINTS_STEP + params.margin_columns;
    return ssgi_gather(plane, whole, image, v_imin(column, v_splat_int(whole.x - 1)),
                       v_splat_int(y * POINTS_STEP + params.margin_rows));
#endif
}

// Write a row of results, given by phase.
static inline void points_store(const vfloat *by_phase, __global float *restrict plane,
                                const int2 size, const int image, const int x, const int y)
{
#if SSGI_LANES == 1
    ssgi_store(by_phase[0], plane, size, image, x, y, 0.0f);
#else
    int4 row[SSGI_LANES];
    raster_keep_quads((RasterQuad){v_bits(by_phase[0]), v_bits(by_phase[1]), v_bits(by_phase[2]),
                                   v_bits(by_phase[3])},
                      row);
    for (int i = 0; i < POINTS_PIECE && x + i < size.x; i += SSGI_LANES) {
        ssgi_store(*(const vfloat_anywhere *)((const float *)row + i), plane, size, image, x + i, y,
                   0.0f);
    }
#endif
}

__kernel void ssdo_points(ssgi_plane depth, ssgi_plane normal,
#if POINTS_THICKNESS == 2
                          ssgi_plane thickness,
#endif
                          __global const int *restrict planes,
                          ssgi_optional __global const int *restrict senders,
                          __global const float *restrict directions,
                          __global float *restrict gathered,
                          ssgi_optional __global int *restrict kept,
                          const int2 size, // of the result
                          const SsgiCamera camera, const PointsParams params)
{
#if SSGI_LANES == 1
    const int x = (int)get_global_id(0);
    const int y = (int)get_global_id(1);
#else
    // 16 work-items cover 256 columns of one or more rows.
    const int rows = 16 / POINTS_IN_STRIP;
    const int bands = (size.y + rows - 1) / rows;
    const int strip = (int)get_global_id(1) / bands;
    const int item = (int)get_global_id(0);
    const int x = strip * POINTS_STRIP + item % POINTS_IN_STRIP * POINTS_PIECE;
    const int y = ((int)get_global_id(1) - strip * bands) * rows + item / POINTS_IN_STRIP;
#endif
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int2 whole = (int2)(params.columns, params.rows);
    const vfloat zero = v_splat(0.0f);
    vfloat open[POINTS_PHASES];
#if POINTS_SKY
    vfloat sky[3][POINTS_PHASES];
#endif
#if POINTS_SENDERS > 0
    vfloat bounce[3][POINTS_PHASES];
#endif
#if POINTS_KEPT
    vint met[POINTS_WORDS][POINTS_PHASES];
#endif
    const float row_0 = (float)(y * POINTS_STEP + params.margin_rows) + 0.5f;
    for (int phase = 0; phase < POINTS_PHASES; ++phase) {
        const vfloat own = points_own(depth, whole, 0, x + phase, y, params);
        const vint own_column = v_iota() * POINTS_PHASES + (x + phase);
        const vmask there = v_lt(own, v_splat(INFINITY)) & v_ilt(own_column, v_splat_int(size.x));
        open[phase] = v_splat(1.0f);
#if POINTS_SKY
        sky[0][phase] = sky[1][phase] = sky[2][phase] = zero;
#endif
#if POINTS_SENDERS > 0
        bounce[0][phase] = bounce[1][phase] = bounce[2][phase] = zero;
#endif
#if POINTS_KEPT
        for (int word = 0; word < POINTS_WORDS; ++word) {
            met[word][phase] = v_splat_int(0);
        }
#endif
        if (!v_any(there)) {
            continue;
        }
        PointsReceiver at;
        const vfloat z = v_select(v_splat(1.0f), own, there);
        const vfloat k = ssgi_k(camera, z);
        const float column_0 = (float)((x + phase) * POINTS_STEP + params.margin_columns) + 0.5f;
        at.z = z;
        at.x =
            ssgi_slope_x(camera, v_to_float(v_iota() * (POINTS_PHASES * POINTS_STEP)) + column_0) *
            k;
        at.y = ssgi_slope_y(camera, v_splat(row_0)) * k;
        at.nx = points_own(normal, whole, 0, x + phase, y, params);
        at.ny = points_own(normal, whole, 1, x + phase, y, params);
        at.nz = points_own(normal, whole, 2, x + phase, y, params);
        // Near the camera the hemisphere covers many pixels: it may be limited.
        const vfloat wanted_px = params.radius * max(fabs(camera.from_x), fabs(camera.from_y)) / k;
        const vfloat shrink = v_min(params.most_px / wanted_px, v_splat(1.0f));
        at.radius = params.radius * shrink;
        at.nearest = z * 0.001f;
        at.floor = v_fma(z, v_splat(params.depth_bias), at.radius * params.bias);
        const vmask active = there & v_ge(wanted_px * shrink, v_splat((float)POINTS_STEP));
        __global const float *restrict set =
            directions + ((y & 15) * 4 + ((x + phase) & 3)) * (POINTS_COUNT * POINTS_FIELDS);
        vfloat hidden = zero, all = zero;
        for (int i = 0; i < POINTS_COUNT; ++i) {
            __global const float *restrict field = set + i * POINTS_FIELDS;
            const float wx = field[0], wy = field[1], wz = field[2];
            const vfloat side = v_fma(v_splat(wx), at.nx, v_fma(v_splat(wy), at.ny, wz * at.nz));
            const vfloat turn = v_copysign(v_splat(1.0f), side);
            PointsDirection way;
            way.x = turn * wx;
            way.y = turn * wy;
            way.z = turn * wz;
            way.length = v_splat(field[3]);
            way.cosine = v_abs(side);
            way.weight = way.cosine * field[4];
            const PointsHit hit =
                points_search(&at, &way, active, planes, POINTS_GIVEN whole, camera, params);
            hidden = v_fma(way.weight, hit.hides, hidden);
            all = all + way.weight;
#if POINTS_KEPT
            met[i / 32][phase] |= v_gt(hit.hides, zero) & v_splat_int(1 << (i & 31));
#endif
#if POINTS_SENDERS > 0
            const vmask sends =
                v_gt(hit.amount, zero) & v_ilt(hit.layer, v_splat_int(POINTS_SENDERS));
            if (v_any(sends)) {
                const vint record = v_iselect(v_splat_int(0), hit.record, sends);
                const RasterQuad sent = raster_quad(senders, record, false);
                const vfloat amount = v_select(zero, hit.amount, sends);
                const vint radiance[3] = {sent.x, sent.y, sent.z};
                for (int c = 0; c < 3; ++c) {
                    const vint bits = v_iselect(v_splat_int(0), radiance[c], sends);
                    bounce[c][phase] = v_fma(amount, v_from_bits(bits), bounce[c][phase]);
                }
            }
#endif
#if POINTS_SKY
            const vmask turned = v_lt(side, zero);
            for (int c = 0; c < 3; ++c) {
                const vfloat light = v_select(v_splat(field[5 + c]), v_splat(field[8 + c]), turned);
                sky[c][phase] = v_fma(light * way.cosine, 1.0f - hit.hides, sky[c][phase]);
            }
#endif
        }
        const vfloat inverse = 1.0f / v_max(all, v_splat(1e-30f));
        const vfloat share = v_clamp(1.0f - hidden * inverse, 0.0f, 1.0f);
        open[phase] = v_select(v_splat(1.0f), share, there);
        for (int c = 0; c < 3; ++c) {
#if POINTS_SKY
            sky[c][phase] = v_select(zero, sky[c][phase], there);
#endif
#if POINTS_SENDERS > 0 && !POINTS_PUBLISHED
            // Normalise the sum of the weights to pi, that of all directions.
            bounce[c][phase] = bounce[c][phase] * (POINTS_PI * inverse);
#endif
        }
    }
    points_store(open, gathered, size, 0, x, y);
#if POINTS_KEPT
    for (int word = 0; word < POINTS_WORDS; ++word) {
        vfloat bits[POINTS_PHASES];
        for (int phase = 0; phase < POINTS_PHASES; ++phase) {
            bits[phase] = v_from_bits(met[word][phase]);
        }
        points_store(bits, (__global float *)kept, size, word, x, y);
    }
#endif
    for (int c = 0; c < 3; ++c) {
#if POINTS_SKY
        points_store(sky[c], gathered, size, 1 + c, x, y);
#endif
#if POINTS_SENDERS > 0
        points_store(bounce[c], gathered, size, POINTS_BOUNCE + c, x, y);
#endif
    }
}
