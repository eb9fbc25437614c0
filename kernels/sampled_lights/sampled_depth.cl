// SPDX-License-Identifier: MIT
// sampled_depth: the depth that each of many small orthographic views sees, all at once.
//
// Method:  runs of SAMPLED_RUN triangles are brought to every view, a box a lane, and the triangles
//          of those whose box has the middle of a texel, a triangle a lane. Of the few that have
//          one themselves, small ones are drawn side by side, a triangle a lane, and the others one
//          by one, row by row, a texel a lane. Where a map has one work-item, boxes and rows behind
//          what their texels show are left out. Edge functions (Pineda 1988) of corners relative to
//          the texel change sign exactly where two triangles share an edge.
// Reads:   boxes      [runs][6] middle and half size of a box round the triangles of a run: large
//                     ones first, behind which others are
//          triangles  [10][runs][SAMPLED_RUN], see sampled_triangles
//          views      [views][12] rows of the matrix to (column, row, depth) of the map, depth > 0
// Writes:  maps       [views][texels][texels] bits of the least depth, INFINITY where nothing is;
//                     the least is the same in any order
// Macros:  SAMPLED_RUN: triangles that share a box, SAMPLED_BATCH: of a work-item; multiples of the
//          lanes, and SAMPLED_BATCH / SAMPLED_RUN too; SAMPLED_CULL: 1 where triangles may lack
//          their back
// Params:  size = (views, batches); number of runs, texels along a map's side, views of a
//          work-item, the first of them
// Launch:  one row for each batch and a column for each `each` views; with SSGI_LANES > 1 one row
//          in all, so that a map has one work-item that writes it and no store is atomic
// Cost:    60 operations per box and view, 90 per triangle of those that have a texel; 30 per
//          SSGI_LANES texels or small triangles

#include "common/lanes.clh"
#include "sampled_lights/cover.clh"

#if !defined(SAMPLED_BATCH) || !defined(SAMPLED_RUN) || !defined(SAMPLED_CULL)
#error "SAMPLED_BATCH, SAMPLED_RUN and SAMPLED_CULL must be defined by the host"
#endif

#define SAMPLED_SMALL 12.0f    // texels of a box up to which triangles are drawn side by side
#define SAMPLED_ROUNDED 2e-6f  // part of depths by which they may be rounded below their corners
#define SAMPLED_LEVEL 0.01f    // texels between rows up to which edges count as level
#define SAMPLED_BOX_ROOM 8e-3f // texels by which boxes of runs are widened, as SAMPLED_ROOM

typedef struct {
    float x[3], y[3], z[3];
    int left, right, top, bottom;
} SampledTriangle;

static inline void sampled_least(__global int *restrict texel, const int bits)
{
    if (bits < *texel) {
#if SSGI_LANES > 1
        *texel = bits;
#else
        atomic_min(texel, bits);
#endif
    }
}

#if SSGI_LANES > 1
// First and last columns that a triangle may cover in rows of texels whose middles are `at`.
static inline void sampled_spans(const SampledTriangle *t, const vfloat at, vint *from, vint *to)
{
    const vfloat nowhere = v_splat(1e9f);
    vfloat least = nowhere, most = -nowhere;
#pragma unroll
    for (int i = 0; i < 3; ++i) {
        const int j = i == 2 ? 0 : i + 1;
        const float low = min(t->y[i], t->y[j]), high = max(t->y[i], t->y[j]);
        const vmask crossed =
            v_ge(at, v_splat(low - SAMPLED_ROOM)) & v_le(at, v_splat(high + SAMPLED_ROOM));
        vfloat first = v_splat(min(t->x[i], t->x[j])), last = v_splat(max(t->x[i], t->x[j]));
        if (high - low > SAMPLED_LEVEL) {
            const float per_row = (t->x[j] - t->x[i]) / (t->y[j] - t->y[i]);
            const vfloat x = v_fma(at - t->y[i], v_splat(per_row), v_splat(t->x[i]));
            const vfloat room = v_splat(SAMPLED_ROOM * (1.0f + fabs(per_row)));
            first = v_max(first, v_min(x - room, last));
            last = v_min(last, v_max(x + room, first));
        }
        least = v_min(least, v_select(nowhere, first, crossed));
        most = v_max(most, v_select(-nowhere, last, crossed));
    }
    *from = v_imax(v_to_int(-v_floor(0.5f + SAMPLED_ROOM - least)), v_splat_int(t->left));
    *to = v_imin(v_to_int(v_floor(most - (0.5f - SAMPLED_ROOM))), v_splat_int(t->right));
}
#endif

// A row of a triangle's texels, a lane each; the map has SSGI_LANES columns at least. `nearest`:
// bits of a depth that the triangle has nowhere before it.
static inline void sampled_draw_row(const SampledTriangle *t, const vfloat z[3], const vint nearest,
                                    const int row, const int from, const int to,
                                    __global int *restrict map, const int texels)
{
    const float middle = (float)row + 0.5f;
    const vfloat y[3] = {v_splat(t->y[0] - middle), v_splat(t->y[1] - middle),
                         v_splat(t->y[2] - middle)};
    for (int left = from; left <= to; left += SSGI_LANES) {
        const int first = min(left, texels - SSGI_LANES);
        const vint column = v_iota() + first;
        __global int *restrict texel = map + row * texels + first;
#if SSGI_LANES > 1
        const vint before = v_iload(texel);
        if (!v_any(v_igt(before, nearest))) {
            continue; // nearer surfaces are in all of these texels
        }
#endif
        const vfloat at = v_to_float(column) + 0.5f;
        const vfloat x[3] = {t->x[0] - at, t->x[1] - at, t->x[2] - at};
        vfloat depth;
        const vmask hit = sampled_cover(x, y, z, &depth) & v_ile(column, v_splat_int(to)) &
                          v_ige(column, v_splat_int(from));
        if (!v_any(hit)) {
            continue;
        }
#if SSGI_LANES > 1
        v_istore(v_iselect(before, v_imin(before, v_bits(depth)), hit), texel);
#else
        sampled_least(texel, v_bits(depth));
#endif
    }
}

// A triangle, row after row.
static inline void sampled_draw(const SampledTriangle *t, __global int *restrict map,
                                const int texels)
{
    const vfloat z[3] = {v_splat(t->z[0]), v_splat(t->z[1]), v_splat(t->z[2])};
    const vint nearest =
        v_bits(v_splat(min(min(t->z[0], t->z[1]), t->z[2]) * (1.0f - SAMPLED_ROUNDED)));
#if SSGI_LANES > 1
    for (int block = t->top; block <= t->bottom; block += SSGI_LANES) {
        vint first, last;
        int from[SSGI_LANES], to[SSGI_LANES];
        sampled_spans(t, v_to_float(v_iota() + block) + 0.5f, &first, &last);
        v_ikeep(first, from);
        v_ikeep(last, to);
        const int end = min(block + SSGI_LANES - 1, t->bottom);
        for (int row = block; row <= end; ++row) {
            sampled_draw_row(t, z, nearest, row, from[row - block], to[row - block], map, texels);
        }
    }
#else
    for (int row = t->top; row <= t->bottom; ++row) {
        sampled_draw_row(t, z, nearest, row, t->left, t->right, map, texels);
    }
#endif
}

// Triangles where `wanted`, a lane each: all walk through the texels of their boxes at once.
static inline void sampled_draw_small(const vfloat x[3], const vfloat y[3], const vfloat z[3],
                                      const vfloat left, const vfloat right, const vfloat top,
                                      const vfloat bottom, vmask wanted, __global int *restrict map,
                                      const int texels)
{
    vfloat column = left, row = top;
    while (v_any(wanted)) {
        const vfloat at_x = column + 0.5f, at_y = row + 0.5f;
        const vfloat dx[3] = {x[0] - at_x, x[1] - at_x, x[2] - at_x};
        const vfloat dy[3] = {y[0] - at_y, y[1] - at_y, y[2] - at_y};
        vfloat depth;
        const vmask hit = sampled_cover(dx, dy, z, &depth) & wanted;
        if (v_any(hit)) {
            int bits[SSGI_LANES], hits[SSGI_LANES], texel[SSGI_LANES];
            v_ikeep(v_bits(depth), bits);
            v_ikeep(hit, hits);
            v_ikeep(v_to_int(v_fma(row, v_splat((float)texels), column)), texel);
            for (int lane = 0; lane < SSGI_LANES; ++lane) {
                if (hits[lane]) {
                    sampled_least(map + texel[lane], bits[lane]);
                }
            }
        }
        const vmask end = v_ge(column, right);
        row = v_select(row, row + 1.0f, end);
        column = v_select(column + 1.0f, left, end);
        wanted = wanted & v_le(row, bottom);
    }
}

// The triangles of a run from `first` on in one view, whose matrix is `m`.
static inline void sampled_run(__global const float *restrict triangles,
                               __global const float *restrict m, __global int *restrict map,
                               const int first, const int stride, const int texels)
{
    const float last = (float)(texels - 1);
    for (int i = first; i < first + SAMPLED_RUN; i += SSGI_LANES) {
        vfloat x[3], y[3], z[3];
        for (int corner = 0; corner < 3; ++corner) {
            __global const float *restrict at = triangles + 3 * corner * stride + i;
            const vfloat px = v_load(at), py = v_load(at + stride), pz = v_load(at + 2 * stride);
            x[corner] = sampled_row(m, px, py, pz);
            y[corner] = sampled_row(m + 4, px, py, pz);
            z[corner] = sampled_row(m + 8, px, py, pz);
        }
        // Columns and rows whose middle the box has: from ceil(least - 0.5) to floor(most - 0.5).
        const float room = 0.5f + SAMPLED_ROOM;
        const vfloat left = -v_floor(room - v_min(v_min(x[0], x[1]), x[2]));
        const vfloat top = -v_floor(room - v_min(v_min(y[0], y[1]), y[2]));
        const vfloat right = v_floor(v_max(v_max(x[0], x[1]), x[2]) - (0.5f - SAMPLED_ROOM));
        const vfloat bottom = v_floor(v_max(v_max(y[0], y[1]), y[2]) - (0.5f - SAMPLED_ROOM));
        const vfloat from_x = v_max(left, v_splat(0.0f)), to_x = v_min(right, v_splat(last));
        const vfloat from_y = v_max(top, v_splat(0.0f)), to_y = v_min(bottom, v_splat(last));
        vmask wanted = v_le(from_x, to_x) & v_le(from_y, to_y);
#if SAMPLED_CULL
        const vfloat one_sided = v_load(triangles + 9 * stride + i);
        wanted = wanted & ~(sampled_back(x, y) & v_gt(one_sided, v_splat(0.0f)));
#endif
        if (!v_any(wanted)) {
            continue;
        }
        const vmask small =
            wanted & v_le((to_x - from_x + 1.0f) * (to_y - from_y + 1.0f), v_splat(SAMPLED_SMALL));
        sampled_draw_small(x, y, z, from_x, to_x, from_y, to_y, small, map, texels);
        const vmask large = wanted & ~small;
        if (!v_any(large)) {
            continue;
        }
        int want[SSGI_LANES];
        float kx[3][SSGI_LANES], ky[3][SSGI_LANES], kz[3][SSGI_LANES];
        int box[4][SSGI_LANES];
        v_ikeep(large, want);
        for (int corner = 0; corner < 3; ++corner) {
            v_keep(x[corner], kx[corner]);
            v_keep(y[corner], ky[corner]);
            v_keep(z[corner], kz[corner]);
        }
        v_ikeep(v_to_int(v_select(v_splat(0.0f), from_x, large)), box[0]);
        v_ikeep(v_to_int(v_select(v_splat(0.0f), to_x, large)), box[1]);
        v_ikeep(v_to_int(v_select(v_splat(0.0f), from_y, large)), box[2]);
        v_ikeep(v_to_int(v_select(v_splat(0.0f), to_y, large)), box[3]);
        for (int lane = 0; lane < SSGI_LANES; ++lane) {
            if (want[lane]) {
                const SampledTriangle t = {
                    {kx[0][lane], kx[1][lane], kx[2][lane]},
                    {ky[0][lane], ky[1][lane], ky[2][lane]},
                    {kz[0][lane], kz[1][lane], kz[2][lane]},
                    box[0][lane],
                    box[1][lane],
                    box[2][lane],
                    box[3][lane],
                };
                sampled_draw(&t, map, texels);
            }
        }
    }
}

// Middle and half size of boxes along an axis of a view, whose row of the matrix is `m`.
static inline void sampled_along(__global const float *restrict m, const vfloat box[6],
                                 vfloat *middle, vfloat *half_size)
{
    *middle = sampled_row(m, box[0], box[1], box[2]);
    *half_size = v_fma(box[3], v_splat(fabs(m[0])),
                       v_fma(box[4], v_splat(fabs(m[1])), box[5] * v_splat(fabs(m[2]))));
}

// Where boxes may have the middle of a texel along an axis, and the first and last of these.
static inline vmask sampled_reaches(__global const float *restrict m, const vfloat box[6],
                                    const int texels, vfloat *first, vfloat *last)
{
    vfloat middle, half_size;
    sampled_along(m, box, &middle, &half_size);
    *first = v_max(-v_floor(0.5f + SAMPLED_BOX_ROOM - (middle - half_size)), v_splat(0.0f));
    *last = v_min(v_floor(middle + half_size - (0.5f - SAMPLED_BOX_ROOM)),
                  v_splat((float)(texels - 1)));
    return v_le(*first, *last);
}

#if SSGI_LANES > 1
// Whether no texel from the columns and rows `first` to `last` is farther than `nearest`, bits of
// a depth.
static inline bool sampled_hidden(__global const int *restrict map, const int texels,
                                  const int2 first, const int2 last, const int nearest)
{
    for (int row = first.y; row <= last.y; ++row) {
        for (int left = first.x; left <= last.x; left += SSGI_LANES) {
            const int at = min(left, texels - SSGI_LANES);
            const vint column = v_iota() + at;
            const vmask inside =
                v_ige(column, v_splat_int(first.x)) & v_ile(column, v_splat_int(last.x));
            const vint there = v_iload(map + row * texels + at);
            if (v_any(inside & v_igt(there, v_splat_int(nearest)))) {
                return false;
            }
        }
    }
    return true;
}
#endif

// Runs from `first` on, up to `end`, of `runs`, in some views.
static inline void sampled_batch(__global const float *restrict boxes,
                                 __global const float *restrict triangles,
                                 __global const float *restrict views, __global int *restrict maps,
                                 const int first, const int end, const int runs, const int texels,
                                 const int view, const int end_view)
{
    for (int run = first; run < end; run += SSGI_LANES) {
        const vint number = v_iota() + run;
        const vmask there = v_ilt(number, v_splat_int(end));
        const vint at = v_imin(number, v_splat_int(runs - 1)) * 6;
        vfloat box[6];
        for (int i = 0; i < 6; ++i) {
            box[i] = v_gather(boxes + i, at);
        }
        for (int i = view; i < end_view; ++i) {
            __global const float *restrict m = views + i * 12;
            __global int *restrict map = maps + i * texels * texels;
            vfloat left, right, top, bottom;
            const vmask wanted = there & sampled_reaches(m, box, texels, &left, &right) &
                                 sampled_reaches(m + 4, box, texels, &top, &bottom);
            if (!v_any(wanted)) {
                continue;
            }
            int want[SSGI_LANES];
            v_ikeep(wanted, want);
#if SSGI_LANES > 1
            vfloat middle, half_size;
            sampled_along(m + 8, box, &middle, &half_size);
            const vfloat rounded = (v_abs(middle) + half_size) * SAMPLED_ROUNDED;
            int nearest[SSGI_LANES], edges[4][SSGI_LANES];
            v_ikeep(v_bits(v_max(middle - half_size - rounded, v_splat(0.0f))), nearest);
            v_ikeep(v_to_int(left), edges[0]);
            v_ikeep(v_to_int(top), edges[1]);
            v_ikeep(v_to_int(right), edges[2]);
            v_ikeep(v_to_int(bottom), edges[3]);
#endif
            for (int lane = 0; lane < SSGI_LANES; ++lane) {
                if (!want[lane]) {
                    continue;
                }
#if SSGI_LANES > 1
                const int2 first_texel = (int2)(edges[0][lane], edges[1][lane]);
                const int2 last_texel = (int2)(edges[2][lane], edges[3][lane]);
                if (sampled_hidden(map, texels, first_texel, last_texel, nearest[lane])) {
                    continue;
                }
#endif
                sampled_run(triangles, m, map, (run + lane) * SAMPLED_RUN, runs * SAMPLED_RUN,
                            texels);
            }
        }
    }
}

__kernel void sampled_depth(__global const float *restrict boxes,
                            __global const float *restrict triangles,
                            __global const float *restrict views, __global int *restrict maps,
                            const int2 size, const int runs, const int texels, const int each,
                            const int begin)
{
    const int first = begin + (int)get_global_id(0) * each;
    const int own = SAMPLED_BATCH / SAMPLED_RUN;
    for (int batch = (int)get_global_id(1); batch < size.y; batch += (int)get_global_size(1)) {
        sampled_batch(boxes, triangles, views, maps, batch * own, min(batch * own + own, runs),
                      runs, texels, first, min(first + each, size.x));
    }
}
