// SPDX-License-Identifier: MIT
// slices_slopes: the planes that surfaces lie in, as changes of `inv_depth` round its pixels.
//
// Layers that have normals lie in the planes across them: of a deeper layer the neighbours may be
// of other surfaces, and of a detail as fine as a pixel all are. No plane is nearer to the view ray
// than SLOPES_LEAST_N_DOT_V. Of the others, in a row and in a column the difference to that
// neighbour counts whose own line misses the pixel the least, so that it stays on one surface at an
// edge and at a crease; the mean of both counts where they differ no more than the neighbours'
// lines bend.
//
// Reads:   depth   SLOPES_LAYERS x [rows, columns] with margin, scene units; INFINITY for nothing
//          normal  3 SLOPES_NORMALS x likewise, view space, unit length, on either side
// Writes:  slopes  2 SLOPES_LAYERS x [rows, 4 stride], where slices_inv_depth puts the pixels:
//                  change of `inv_depth` along columns, then along rows, per slope of the view
//                  ray (perspective) or per pixel's width (orthographic); 0 where nothing is
// Macros:  SLOPES_LAYERS (>= 1), SLOPES_NORMALS (1 to SLOPES_LAYERS): layers that have normals
// Launch:  SSGI_LANES floats of a row of `slopes` per work-item
// Cost:    4 reads and 2 writes per pixel and layer with normals, 9 and 2 without

#include "common/camera.clh"
#include "slices/sorted.clh"

#if !defined(SLOPES_LAYERS) || !defined(SLOPES_NORMALS)
#error "SLOPES_LAYERS and SLOPES_NORMALS must be defined by the host"
#endif

#define SLOPES_LEAST_N_DOT_V 0.05f // cosine between normal and view ray
#define SLOPES_TINY 1e-30f

// `inv_depth` of depths; that of the pixel itself where nothing is.
static inline vfloat slopes_near(const vfloat z, const vfloat own, const SsgiCamera camera,
                                 const float unit)
{
    const vmask there = v_lt(z, v_splat(INFINITY));
    const vfloat depth = v_select(v_splat(1.0f), z, there);
    return v_select(own, camera.perspective != 0.0f ? 1.0f / depth : depth * unit, there);
}

// A column or row of five pixels, with the pixel itself in the middle.
typedef struct {
    vfloat z[5];
} SlopesLine;

// The change of `inv_depth` from one pixel to the next; 0 if there is no neighbour.
static inline vfloat slopes_change(const SlopesLine *line, const SsgiCamera camera,
                                   const float unit)
{
    const vfloat none = v_splat(INFINITY), zero = v_splat(0.0f);
    const vfloat own = slopes_near(line->z[2], zero, camera, unit);
    const vfloat before = slopes_near(line->z[1], own, camera, unit);
    const vfloat behind = slopes_near(line->z[3], own, camera, unit);
    const vfloat down = own - before, up = behind - own;
    const vfloat bend = v_abs(up - down);
    const vfloat down_miss =
        v_select(bend, v_abs(down - (before - slopes_near(line->z[0], before, camera, unit))),
                 v_lt(line->z[0], none));
    const vfloat up_miss =
        v_select(bend, v_abs(slopes_near(line->z[4], behind, camera, unit) - behind - up),
                 v_lt(line->z[4], none));
    const vmask has_down = v_lt(line->z[1], none), has_up = v_lt(line->z[3], none);
    const vmask lesser =
        v_lt(down_miss, up_miss) | (v_eq(down_miss, up_miss) & v_le(v_abs(down), v_abs(up)));
    const vfloat one = v_select(up, down, ~has_up | (has_down & lesser));
    const vmask alike = has_down & has_up & v_le(bend, 2.0f * v_min(down_miss, up_miss));
    return v_select(one, 0.5f * (down + up), alike);
}

// The changes of `inv_depth` along the plane across a layer's normal, per slope of the view ray.
static inline void slopes_of_plane(ssgi_plane normal, const SsgiSorted *at, const int layer,
                                   const vfloat z, const SsgiCamera camera, vfloat *along,
                                   vfloat *down)
{
    const vfloat nx = ssgi_load_sorted(normal, at, 3 * layer);
    const vfloat ny = ssgi_load_sorted(normal, at, 3 * layer + 1);
    const vfloat nz = ssgi_load_sorted(normal, at, 3 * layer + 2);
    const vfloat one = v_splat(1.0f);
    const vfloat x = ssgi_slope_x(camera, v_to_float(at->from_x) + 0.5f) * camera.perspective;
    const vfloat y = ssgi_slope_y(camera, v_to_float(at->from_y) + 0.5f) * camera.perspective;
    const vfloat view_ray = v_fma(nx, x, v_fma(ny, y, -nz));
    const vfloat length = v_sqrt(v_fma(x, x, v_fma(y, y, one)));
    const vfloat n_dot_v =
        v_copysign(v_max(v_abs(view_ray), length * SLOPES_LEAST_N_DOT_V), view_ray);
    const vfloat gain = camera.perspective != 0.0f
                            ? 1.0f / (v_max(z, v_splat(SLOPES_TINY)) * n_dot_v)
                            : -1.0f / n_dot_v;
    *along = nx * gain;
    *down = ny * gain;
}

__kernel void slices_slopes(ssgi_plane depth, ssgi_plane normal, __global float *restrict slopes,
                            const int2 size, const int2 fine_size, const int columns,
                            const int lead, const int step, const int first_x, const int first_y,
                            const float ortho_unit, const SsgiCamera camera)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const float unit = camera.perspective != 0.0f ? 1.0f : ortho_unit;
    const float per_x = 1.0f / (camera.to_x * unit), per_y = 1.0f / (camera.to_y * unit);
    const SsgiSorted at =
        ssgi_sorted(size.x, x, y, fine_size, columns, lead, step, first_x, first_y);
    const vfloat none = v_splat(INFINITY), zero = v_splat(0.0f);
    for (int layer = 0; layer < SLOPES_LAYERS; ++layer) {
        const vfloat z = ssgi_load_sorted(depth, &at, layer);
        const vmask there = at.inside & v_lt(z, none);
        vfloat along = zero, down = zero;
        if (layer < SLOPES_NORMALS) {
            slopes_of_plane(normal, &at, layer, v_select(v_splat(1.0f), z, there), camera, &along,
                            &down);
        } else if (v_any(there)) {
            SlopesLine row, column;
            for (int i = 0; i < 5; ++i) {
                // Beyond the border nothing is.
                const vint x_i = at.from_x + (i - 2), y_i = at.from_y + (i - 2);
                const vfloat in_row = ssgi_gather(depth, fine_size, layer,
                                                  v_iclamp(x_i, 0, fine_size.x - 1), at.from_y);
                const vfloat in_column = ssgi_gather(depth, fine_size, layer, at.from_x,
                                                     v_iclamp(y_i, 0, fine_size.y - 1));
                row.z[i] = v_select(none, in_row, v_within(x_i, fine_size.x) & there);
                column.z[i] = v_select(none, in_column, v_within(y_i, fine_size.y) & there);
            }
            along = slopes_change(&row, camera, unit) * per_x;
            down = slopes_change(&column, camera, unit) * per_y;
        }
        ssgi_store(v_select(zero, along, there), slopes, size, 2 * layer, x, y, 0.0f);
        ssgi_store(v_select(zero, down, there), slopes, size, 2 * layer + 1, x, y, 0.0f);
    }
}
