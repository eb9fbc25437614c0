// SPDX-License-Identifier: MIT
// sampled_depth: the depth that each of many small orthographic views sees, all at once.
//
// Method:  runs of SAMPLED_RUN triangles are brought to every view, a box a lane, and the triangles
//          of those whose box has the middle of a texel, a triangle a lane. Of the few that have
//          one themselves, small ones are drawn side by side, a triangle a lane, and the others one
//          by one, a texel a lane, except where nearer surfaces are in all of these. Edge functions
//          (Pineda 1988) of corners relative to the texel change sign exactly where two triangles
//          share an edge.
// Reads:   boxes      [runs][6] middle and half size of a box round the triangles of a run
//          triangles  [9][stride] corners, relative to the scene's origin; of triangles with holes,
//                     which sampled_cutouts draws, all three the same
//          corners    4 x [stride], of which the last is 1 where the back is not there
//          views      [views][12] rows of the matrix to (column, row, depth) of the map, depth > 0
// Writes:  maps       [views][texels][texels] bits of the least depth, INFINITY where nothing is;
//                     the least is the same in any order
// Macros:  SAMPLED_RUN: triangles that share a box, SAMPLED_BATCH: of a work-item; multiples of the
//          lanes, and SAMPLED_BATCH / SAMPLED_RUN too; SAMPLED_CULL: 1 where triangles may lack
//          their back
// Params:  size = (views, batches); number of triangles, texels along a map's side, views of a
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

// A triangle, texels a lane each; the map has SSGI_LANES columns at least.
static inline void sampled_draw(const SampledTriangle *t, __global int *restrict map,
                                const int texels)
{
    const vfloat z[3] = {v_splat(t->z[0]), v_splat(t->z[1]), v_splat(t->z[2])};
#if SSGI_LANES > 1
    const vint nearest =
        v_bits(v_splat(min(min(t->z[0], t->z[1]), t->z[2]) * (1.0f - SAMPLED_ROUNDED)));
#endif
    for (int row = t->top; row <= t->bottom; ++row) {
        const float middle = (float)row + 0.5f;
        const vfloat y[3] = {v_splat(t->y[0] - middle), v_splat(t->y[1] - middle),
                             v_splat(t->y[2] - middle)};
        for (int left = t->left; left <= t->right; left += SSGI_LANES) {
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
            const vmask hit = sampled_cover(x, y, z, &depth) &
                              v_ile(column, v_splat_int(t->right)) &
                              v_ige(column, v_splat_int(t->left));
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

// The triangles of a run from `first` on, up to `end`, in one view, whose matrix is `m`.
static inline void sampled_run(__global const float *restrict triangles,
                               __global const int *restrict corners,
                               __global const float *restrict m, __global int *restrict map,
                               const int first, const int end, const int stride, const int texels)
{
    const float last = (float)(texels - 1);
    for (int i = first; i < end; i += SSGI_LANES) {
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
        vmask wanted =
            v_le(from_x, to_x) & v_le(from_y, to_y) & v_ilt(v_iota() + i, v_splat_int(end));
#if SAMPLED_CULL
        wanted = wanted &
                 ~(sampled_back(x, y) & v_igt(v_iload(corners + 3 * stride + i), v_splat_int(0)));
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

// Where boxes may have the middle of a texel along an axis, whose row of the matrix is `m`.
static inline vmask sampled_reaches(__global const float *restrict m, const vfloat box[6],
                                    const int texels)
{
    const vfloat middle = sampled_row(m, box[0], box[1], box[2]);
    const vfloat half_size =
        v_fma(box[3], v_splat(fabs(m[0])),
              v_fma(box[4], v_splat(fabs(m[1])), box[5] * v_splat(fabs(m[2]))));
    const vfloat low =
        v_max(-v_floor(0.5f + SAMPLED_BOX_ROOM - (middle - half_size)), v_splat(0.0f));
    const vfloat high = v_min(v_floor(middle + half_size - (0.5f - SAMPLED_BOX_ROOM)),
                              v_splat((float)(texels - 1)));
    return v_le(low, high);
}

// The triangles of a batch from `first` on in some views.
static inline void sampled_batch(__global const float *restrict boxes,
                                 __global const float *restrict triangles,
                                 __global const int *restrict corners,
                                 __global const float *restrict views, __global int *restrict maps,
                                 const int first, const int count, const int texels, const int view,
                                 const int end_view)
{
    const int stride = (count + 15) & ~15;
    const int runs = (count + SAMPLED_RUN - 1) / SAMPLED_RUN;
    const int begin = first / SAMPLED_RUN;
    const int end = min(begin + SAMPLED_BATCH / SAMPLED_RUN, runs);
    for (int run = begin; run < end; run += SSGI_LANES) {
        const vint number = v_iota() + run;
        const vmask there = v_ilt(number, v_splat_int(end));
        const vint at = v_imin(number, v_splat_int(runs - 1)) * 6;
        vfloat box[6];
        for (int i = 0; i < 6; ++i) {
            box[i] = v_gather(boxes + i, at);
        }
        for (int i = view; i < end_view; ++i) {
            __global const float *restrict m = views + i * 12;
            const vmask wanted =
                there & sampled_reaches(m, box, texels) & sampled_reaches(m + 4, box, texels);
            if (!v_any(wanted)) {
                continue;
            }
            int want[SSGI_LANES];
            v_ikeep(wanted, want);
            for (int lane = 0; lane < SSGI_LANES; ++lane) {
                if (want[lane]) {
                    const int own = (run + lane) * SAMPLED_RUN;
                    sampled_run(triangles, corners, m, maps + i * texels * texels, own,
                                min(own + SAMPLED_RUN, count), stride, texels);
                }
            }
        }
    }
}

__kernel void sampled_depth(__global const float *restrict boxes,
                            __global const float *restrict triangles,
                            __global const int *restrict corners,
                            __global const float *restrict views, __global int *restrict maps,
                            const int2 size, const int count, const int texels, const int each,
                            const int begin)
{
    const int first = begin + (int)get_global_id(0) * each;
    for (int batch = (int)get_global_id(1); batch < size.y; batch += (int)get_global_size(1)) {
        sampled_batch(boxes, triangles, corners, views, maps, batch * SAMPLED_BATCH, count, texels,
                      first, min(first + each, size.x));
    }
}
