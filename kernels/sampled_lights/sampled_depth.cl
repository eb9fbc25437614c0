// SPDX-License-Identifier: MIT
// sampled_depth: the depth that each of many small orthographic views sees, all at once.
//
// Method:  every triangle is brought to every view, a lane each; few cover the middle of a texel, and
//          those are drawn one by one, texels a lane each. Edge functions (Pineda 1988) of corners
//          relative to the texel change sign exactly where two triangles share an edge.
// Reads:   triangles  [9][stride] corners, relative to the scene's origin
//          views      [views][12] rows of the matrix to (column, row, depth) of the map, depth > 0
// Writes:  maps       [views][texels][texels] bits of the least depth, INFINITY where nothing is; the
//          least is the same in any order
// Macros:  SAMPLED_BATCH: triangles of a work-item, a multiple of the lanes
// Params:  size = (views, batches); number of triangles, texels along a map's side
// Launch:  a work-item for each view of each batch

#include "common/lanes.clh"

#ifndef SAMPLED_BATCH
#error "SAMPLED_BATCH must be defined by the host"
#endif

#define SAMPLED_ROOM 1e-3f // texels by which a box is widened, against rounding

typedef struct {
    float x[3], y[3], z[3];
    int left, right, top, bottom;
} SampledTriangle;

static inline vfloat sampled_row(__global const float *restrict m, const vfloat x, const vfloat y,
                                 const vfloat z)
{
    return v_fma(x, v_splat(m[0]), v_fma(y, v_splat(m[1]), v_fma(z, v_splat(m[2]), v_splat(m[3]))));
}

static inline void sampled_draw(const SampledTriangle *t, __global int *restrict map,
                                const int texels)
{
    for (int row = t->top; row <= t->bottom; ++row) {
        const float y = (float)row + 0.5f;
        const float ya = t->y[0] - y, yb = t->y[1] - y, yc = t->y[2] - y;
        for (int column = t->left; column <= t->right; column += SSGI_LANES) {
            const vfloat x = v_to_float(v_iota() + column) + 0.5f;
            const vfloat xa = t->x[0] - x, xb = t->x[1] - x, xc = t->x[2] - x;
            const vfloat a = xb * yc - xc * yb;
            const vfloat b = xc * ya - xa * yc;
            const vfloat c = xa * yb - xb * ya;
            const vfloat zero = v_splat(0.0f), sum = a + b + c;
            const vmask inside = (v_ge(a, zero) & v_ge(b, zero) & v_ge(c, zero)) |
                                 (v_le(a, zero) & v_le(b, zero) & v_le(c, zero));
            const vmask hit = inside & v_ne(sum, zero) &
                              v_ile(v_iota() + column, v_splat_int(t->right));
            if (!v_any(hit)) {
                continue;
            }
            const vfloat scale = 1.0f / v_select(v_splat(1.0f), sum, hit);
            const vfloat depth = v_max(
                v_fma(a * scale, v_splat(t->z[0]),
                      v_fma(b * scale, v_splat(t->z[1]), c * scale * t->z[2])), zero);
            int bits[SSGI_LANES], hits[SSGI_LANES];
            v_ikeep(v_bits(depth), bits);
            v_ikeep(hit, hits);
            __global int *restrict at = map + row * texels + column;
            for (int lane = 0; lane < SSGI_LANES; ++lane) {
                if (hits[lane] && bits[lane] < at[lane]) {
                    atomic_min(at + lane, bits[lane]);
                }
            }
        }
    }
}

__kernel void sampled_depth(__global const float *restrict triangles,
                            __global const float *restrict views, __global int *restrict maps,
                            const int2 size, const int count, const int texels)
{
    const int view = (int)get_global_id(0), batch = (int)get_global_id(1);
    if (view >= size.x || batch >= size.y) {
        return;
    }
    const int stride = (count + 15) & ~15;
    __global const float *restrict m = views + view * 12;
    __global int *restrict map = maps + view * texels * texels;
    const int end = min((batch + 1) * SAMPLED_BATCH, count);
    const float last = (float)(texels - 1);
    for (int i = batch * SAMPLED_BATCH; i < end; i += SSGI_LANES) {
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
        const vmask wanted = v_le(from_x, to_x) & v_le(from_y, to_y) &
                             v_ilt(v_iota() + i, v_splat_int(end));
        if (!v_any(wanted)) {
            continue;
        }
        int want[SSGI_LANES];
        float kx[3][SSGI_LANES], ky[3][SSGI_LANES], kz[3][SSGI_LANES];
        int box[4][SSGI_LANES];
        v_ikeep(wanted, want);
        for (int corner = 0; corner < 3; ++corner) {
            v_keep(x[corner], kx[corner]);
            v_keep(y[corner], ky[corner]);
            v_keep(z[corner], kz[corner]);
        }
        v_ikeep(v_to_int(v_select(v_splat(0.0f), from_x, wanted)), box[0]);
        v_ikeep(v_to_int(v_select(v_splat(0.0f), to_x, wanted)), box[1]);
        v_ikeep(v_to_int(v_select(v_splat(0.0f), from_y, wanted)), box[2]);
        v_ikeep(v_to_int(v_select(v_splat(0.0f), to_y, wanted)), box[3]);
        for (int lane = 0; lane < SSGI_LANES; ++lane) {
            if (want[lane]) {
                const SampledTriangle t = {
                    {kx[0][lane], kx[1][lane], kx[2][lane]},
                    {ky[0][lane], ky[1][lane], ky[2][lane]},
                    {kz[0][lane], kz[1][lane], kz[2][lane]},
                    box[0][lane], box[1][lane], box[2][lane], box[3][lane],
                };
                sampled_draw(&t, map, texels);
            }
        }
    }
}
