// SPDX-License-Identifier: MIT
// smooth_edges: the mean of what is seen at places within each pixel.
//
// A place has the radiance of the pixel of 3 x 3 that shows its surface; of 5 x 5 where none of 3 x
// 3 has a score below SMOOTH_OTHER. It is the pixel itself where both see the same triangle or its
// score is at most SMOOTH_OWN; else the one of least score
//   min(e, SMOOTH_FAR) + SMOOTH_OTHER (another material) + SMOOTH_APART d^2,
// e the distance of the place's point from the pixel's tangent plane and d the distance on the
// screen, both in pixels. e and SMOOTH_OTHER do not count for the triangle that the place sees. A
// surface has SMOOTH_NEVER in place of them where the other is background.
//
// Means are kept as m + (c - m) / n: equal colours leave every bit of them as it is.
//
// Reads:   triangles, depths  [tile count][32][32][SMOOTH_STRIDE] see raster_places; the first
//          place is the centre
//          places     [2][SMOOTH_STRIDE] steps right of the centre, and below it
//          faces      [triangles][RASTER_FACE] vertices, material
//          depth      scene units, INFINITY where nothing is; with margin, as much on all sides
//          normal     3 x with margin; view space
//          radiance   3 x [rows, columns]
// Writes:  smooth     3 x [rows, columns]
// Macros:  SMOOTH_PLACES, at most SMOOTH_STRIDE; SMOOTH_FIRST: 0 if the mean has the centre in it,
//          else 1
// Params:  size = image; whole = columns and rows of `depth`; camera, view: of the image
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "raster/records.clh"

#if !defined(SMOOTH_FAR) || !defined(SMOOTH_OTHER) || !defined(SMOOTH_APART) ||                    \
    !defined(SMOOTH_NEVER) || !defined(SMOOTH_OWN)
#error "ssgi_cl/device/constants.py defines SMOOTH_FAR, _OTHER, _APART, _NEVER, _OWN"
#endif
#if !defined(SMOOTH_PLACES) || !defined(SMOOTH_STRIDE) || !defined(SMOOTH_FIRST)
#error "SMOOTH_PLACES, SMOOTH_STRIDE and SMOOTH_FIRST must be defined by the host"
#endif

// The surface at a place of each lane's pixel.
typedef struct {
    vint triangle;
    vmask there;        // is anything seen?
    vint material;      // where something is
    vfloat depth, x, y; // view space
    vfloat per_pixel;   // 1 / extent of a pixel at its depth
    float right, down;  // from the pixel's centre, pixels
} SmoothPlace;

static inline vint smooth_material(__global const int *restrict faces, const vint triangle)
{
    return v_igather(faces + 3, v_imax(triangle, v_splat_int(0)) * RASTER_FACE);
}

static inline SmoothPlace smooth_place(const int x, const int y, const vint triangle,
                                       const vfloat d, const int2 place,
                                       __global const int *restrict faces, const SsgiCamera camera)
{
    SmoothPlace at;
    const vfloat one = v_splat(1.0f);
    at.triangle = triangle;
    at.there = v_ige(triangle, v_splat_int(0));
    at.material = smooth_material(faces, triangle);
    const vfloat seen = v_select(one, d, at.there);
    at.depth = camera.perspective != 0.0f ? 1.0f / seen : -seen;
    const vfloat k = ssgi_k(camera, at.depth);
    at.right = (float)place.x / RASTER_SUBPIXELS;
    at.down = (float)place.y / RASTER_SUBPIXELS;
    at.x = ssgi_slope_x(camera, v_to_float(v_iota() + x) + (0.5f + at.right)) * k;
    at.y = ssgi_slope_y(camera, v_splat((float)y + (0.5f + at.down))) * k;
    at.per_pixel = 1.0f / (k * fabs(camera.to_y));
    return at;
}

// What each lane's pixel shows and, where lanes share what finds it, the 3 x 3 round it: their
// triangles, or -1, and materials. The pixel is number SMOOTH_MIDDLE. With one lane the others are
// read again for each place: GPUs would keep an array in memory, behind what is read.
#define SMOOTH_MIDDLE (SSGI_LANES == 1 ? 0 : 4)
typedef struct {
    vint triangle[2 * SMOOTH_MIDDLE + 1], material[2 * SMOOTH_MIDDLE + 1];
    bool whole; // are the others there?
} SmoothSquare;

// The pixels that show best what a place sees.
typedef struct {
    vint column, row;
    vfloat score;
} SmoothBest;

// What is read.
typedef struct {
    int2 size, whole, margin;
    SsgiCamera camera;
    __global const int *faces;
} SmoothImage;

// Triangles that the pixels (dx, dy) away show; beside the image what is at its side.
static inline vint smooth_seen(const SmoothImage *in, const int x, const int y,
                               __global const int *restrict triangles, const RasterView view)
{
    const vint column = v_iclamp(v_iota() + x, 0, in->size.x - 1);
    const int row = clamp(y, 0, in->size.y - 1);
    const vint tile = column / RASTER_TILE + row / RASTER_TILE * view.tiles_x;
    const vint line = tile * RASTER_TILE + (row & (RASTER_TILE - 1));
    return v_igather(triangles,
                     (line * RASTER_TILE + (column & (RASTER_TILE - 1))) * SMOOTH_STRIDE);
}

// How badly the pixels (dx, dy) away, which show a triangle of a material, show the surface at a
// place.
static inline vfloat smooth_score(const SmoothPlace *at, const vint seen, const vint material,
                                  const int dx, const int dy, const SmoothImage *in, const int x,
                                  const int y, ssgi_plane depth, ssgi_plane normal)
{
    const SsgiCamera camera = in->camera;
    const int column = x + dx + in->margin.x, row = y + dy + in->margin.y;
    const vmask both = v_ige(seen, v_splat_int(0)) & at->there;
    const vfloat z = v_select(at->depth, ssgi_load(depth, in->whole, 0, column, row), both);
    const vfloat k = ssgi_k(camera, z);
    const vfloat px = ssgi_slope_x(camera, v_to_float(v_iota() + (x + dx)) + 0.5f) * k;
    const vfloat py = ssgi_slope_y(camera, v_splat((float)(y + dy) + 0.5f)) * k;
    const vfloat nx = ssgi_load(normal, in->whole, 0, column, row);
    const vfloat ny = ssgi_load(normal, in->whole, 1, column, row);
    const vfloat nz = ssgi_load(normal, in->whole, 2, column, row);
    const vfloat scale = at->per_pixel, zero = v_splat(0.0f);
    const vfloat from_plane =
        nx * ((at->x - px) * scale) + ny * ((at->y - py) * scale) - nz * ((at->depth - z) * scale);
    const vmask alike = v_ieq(material, at->material);
    vfloat score = v_min(v_abs(from_plane), v_splat(SMOOTH_FAR)) +
                   v_select(v_splat(SMOOTH_OTHER), zero, alike);
    score = v_select(v_splat(SMOOTH_NEVER), score, both);
    score = v_select(score, zero, v_ieq(seen, at->triangle));
    const float right = (float)dx - at->right, down = (float)dy - at->down;
    return score + SMOOTH_APART * (right * right + down * down);
}

// Take the pixels (dx, dy) away in lanes that want them and where they are better.
static inline void smooth_try(SmoothBest *best, const vmask wants, const SmoothPlace *at,
                              const vint seen, const vint material, const int dx, const int dy,
                              const SmoothImage *in, const int x, const int y, ssgi_plane depth,
                              ssgi_plane normal)
{
    const vint column = v_iota() + (x + dx);
    const vfloat score = smooth_score(at, seen, material, dx, dy, in, x, y, depth, normal);
    const vmask better = wants & v_lt(score, best->score) & v_within(column, in->size.x);
    best->score = v_select(best->score, score, better);
    best->column = v_iselect(best->column, column, better);
    best->row = v_iselect(best->row, v_splat_int(y + dy), better);
}

// Pixels that show what a place sees, where it sees no triangle of `square`'s middle.
static inline SmoothBest smooth_best(const SmoothPlace *at, const vmask changes,
                                     SmoothSquare *square, const SmoothImage *in, const int x,
                                     const int y, __global const int *restrict triangles,
                                     ssgi_plane depth, ssgi_plane normal, const RasterView view)
{
    SmoothBest best = {v_imin(v_iota() + x, v_splat_int(in->size.x - 1)), v_splat_int(y),
                       smooth_score(at, square->triangle[SMOOTH_MIDDLE],
                                    square->material[SMOOTH_MIDDLE], 0, 0, in, x, y, depth,
                                    normal)};
    const vmask wants = changes & v_gt(best.score, v_splat(SMOOTH_OWN));
    if (!v_any(wants)) {
        return best;
    }
    for (int i = 0; i < 9; ++i) {
        const int dx = i % 3 - 1, dy = i / 3 - 1;
        if (i == 4) {
            continue;
        }
#if SSGI_LANES == 1
        const vint seen = smooth_seen(in, x + dx, y + dy, triangles, view);
        const vint material = smooth_material(in->faces, seen);
#else
        if (!square->whole) {
            square->triangle[i] = smooth_seen(in, x + dx, y + dy, triangles, view);
            square->material[i] = smooth_material(in->faces, square->triangle[i]);
        }
        const vint seen = square->triangle[i], material = square->material[i];
#endif
        if (y + dy >= 0 && y + dy < in->size.y) {
            smooth_try(&best, wants, at, seen, material, dx, dy, in, x, y, depth, normal);
        }
    }
    square->whole = true;
    // Things thinner than a pixel are seen by few centres.
    const vmask lost = wants & v_ge(best.score, v_splat(SMOOTH_OTHER));
    if (!v_any(lost)) {
        return best;
    }
    for (int i = 0; i < 25; ++i) {
        const int dx = i % 5 - 2, dy = i / 5 - 2;
        if (max(abs(dx), abs(dy)) < 2 || y + dy < 0 || y + dy >= in->size.y) {
            continue;
        }
        const vint seen = smooth_seen(in, x + dx, y + dy, triangles, view);
        smooth_try(&best, lost, at, seen, smooth_material(in->faces, seen), dx, dy, in, x, y, depth,
                   normal);
    }
    return best;
}

// Places where some of the pixels from `first` on see another triangle than at their centres, a bit
// each. Place 64 has that of the centre, which never differs from itself: shifts are modulo 64.
static inline ulong smooth_changes(__global const int *restrict triangles, const int first)
{
    ulong changes = 0;
    for (int pixel = 0; pixel < SSGI_LANES; ++pixel) {
        __global const int *restrict own = triangles + first + pixel * SMOOTH_STRIDE;
        const vint centre = v_splat_int(own[0]);
        for (int p = 0; p < SMOOTH_PLACES; p += SSGI_LANES) {
            changes |= (ulong)v_lane_bits(v_ine(v_iload(own + p), centre)) << p;
        }
    }
    return changes;
}

__kernel void smooth_edges(__global const int *restrict triangles,
                           __global const float *restrict depths,
                           __global const int *restrict places, __global const int *restrict faces,
                           ssgi_plane depth, ssgi_plane normal, ssgi_plane radiance,
                           __global float *restrict smooth, const int2 size, const int2 whole,
                           const SsgiCamera camera, const RasterView view)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int first = raster_place(view.tiles_x, x, y) * SMOOTH_STRIDE;
    const vint here = v_iota() * SMOOTH_STRIDE + first;
    const vint centre = v_igather(triangles, here);
    const vmask inside = v_within(v_iota() + x, size.x);
    const SmoothImage in = {size, whole, (whole - size) / 2, camera, faces};
    SmoothSquare square;
    square.triangle[SMOOTH_MIDDLE] = centre;
    square.material[SMOOTH_MIDDLE] = smooth_material(faces, centre);
    square.whole = false;
    vfloat own[3], mean[3];
    for (int c = 0; c < 3; ++c) {
        own[c] = ssgi_load(radiance, size, c, x, y);
        mean[c] = own[c];
    }
    const ulong differing = smooth_changes(triangles, first);
    if (differing == 0) {
        for (int c = 0; c < 3; ++c) {
            ssgi_store(own[c], smooth, size, c, x, y, 0.0f);
        }
        return;
    }
    for (int p = SMOOTH_FIRST; p < SMOOTH_PLACES; ++p) {
        const float share = 1.0f / (float)(p - SMOOTH_FIRST + 1);
        vfloat other[3] = {own[0], own[1], own[2]};
        if ((differing >> p & 1) != 0) {
            const vint triangle = v_igather(triangles + p, here);
            const vmask changes = v_ine(triangle, centre) & inside;
            const SmoothPlace at =
                smooth_place(x, y, triangle, v_gather(depths + p, here),
                             (int2)(places[p], places[SMOOTH_STRIDE + p]), faces, camera);
            const SmoothBest best =
                smooth_best(&at, changes, &square, &in, x, y, triangles, depth, normal, view);
            for (int c = 0; c < 3; ++c) {
                other[c] = ssgi_gather(radiance, size, c, best.column, best.row);
            }
        }
        for (int c = 0; c < 3; ++c) {
            // The first one is all of the mean, to the bit.
            mean[c] = p == SMOOTH_FIRST ? other[c] : mean[c] + (other[c] - mean[c]) * share;
        }
    }
    for (int c = 0; c < 3; ++c) {
        ssgi_store(mean[c], smooth, size, c, x, y, 0.0f);
    }
}
