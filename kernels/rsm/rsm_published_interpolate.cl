// SPDX-License-Identifier: MIT
// rsm_published_interpolate: light from the low-resolution pass where it suits, and where it
// doesn't.
//
// Method:  Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", section 4.2: of the four
//          low-resolution pixels around, those with a similar normal and a near position are
//          suitable. With three or four of them light is interpolated by their bilinear weights,
//          renormalised; other pixels are left to a last pass that gathers for them.
// Reads:   depth, normal  the front layer, with margin; scene units, view space
//          lattice  3 x [rows, columns] W/m^2 at the pixels of the lattice, see lattice.clh
// Writes:  values  3 x [rows, columns] interpolated light, 0 where it is to be gathered
//          fractions  [rows, columns] 1 where it is to be gathered, else 0
//          masks   of tiles, see multires/list.clh
// Params:  whole = (columns, rows) with margin; reach = the largest distance of a suitable pixel's
//          position over the receiver's k (depth, or 1 with an orthographic camera), squared;
//          cosine = the least of two normals; step = pixels along a block
// Launch:  a row of a tile per work-item
// Cost:    28 scattered reads and a division per pixel

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/list.clh"
#include "rsm/lattice.clh"

// Pixels in view space.
typedef struct {
    vmask there;
    vfloat k, x, y, z, nx, ny, nz; // scene units; unit length
} RsmSurface;

static inline RsmSurface rsm_surface(ssgi_plane depth, ssgi_plane normal, const vint column,
                                     const vint row, const int2 whole, const SsgiCamera camera,
                                     const RsmInterpolateParams params)
{
    const vint x = column + params.margin_columns, y = row + params.margin_rows;
    const vfloat seen = ssgi_gather(depth, whole, 0, x, y);
    RsmSurface s;
    s.there = v_lt(seen, v_splat(INFINITY));
    s.z = v_select(v_splat(1.0f), seen, s.there);
    s.k = ssgi_k(camera, s.z);
    s.x = ssgi_slope_x(camera, v_to_float(x) + 0.5f) * s.k;
    s.y = ssgi_slope_y(camera, v_to_float(y) + 0.5f) * s.k;
    s.nx = ssgi_gather(normal, whole, 0, x, y);
    s.ny = ssgi_gather(normal, whole, 1, x, y);
    s.nz = ssgi_gather(normal, whole, 2, x, y);
    return s;
}

static inline vmask rsm_suits(const RsmSurface own, const RsmSurface other,
                              const RsmInterpolateParams params)
{
    const vfloat inverse = 1.0f / own.k;
    const vfloat dx = (other.x - own.x) * inverse;
    const vfloat dy = (other.y - own.y) * inverse;
    const vfloat dz = (other.z - own.z) * inverse;
    const vfloat square = v_fma(dx, dx, v_fma(dy, dy, dz * dz));
    const vfloat cosine = v_fma(own.nx, other.nx, v_fma(own.ny, other.ny, own.nz * other.nz));
    return other.there & v_le(square, v_splat(params.reach)) & v_ge(cosine, v_splat(params.cosine));
}

__kernel void rsm_published_interpolate(ssgi_plane depth, ssgi_plane normal, ssgi_plane lattice,
                                        __global float *restrict values,
                                        __global float *restrict fractions,
                                        __global int *restrict masks, const int2 size,
                                        const int2 whole, const SsgiCamera camera,
                                        const RsmInterpolateParams params)
{
    const int left = (int)get_global_id(0) * MULTIRES_TILE;
    const int y = (int)get_global_id(1);
    if (left >= size.x || y >= size.y) {
        return;
    }
    const int step = params.step;
    const vfloat zero = v_splat(0.0f);
    const vint row = v_splat_int(y);
    // In blocks, from the middle of the first; whole part and rest of a number that may be
    // negative.
    const float down = (float)(y - step / 2) / (float)step;
    const float top = floor(down);
    int mask = 0;
    for (int x = left; x < min(left + MULTIRES_TILE, size.x); x += SSGI_LANES) {
        const vint column = v_imin(v_iota() + x, v_splat_int(size.x - 1));
        const vfloat across = v_to_float(column - step / 2) / (float)step;
        const vfloat first = v_floor(across);
        const RsmSurface own = rsm_surface(depth, normal, column, row, whole, camera, params);
        vint suitable = v_splat_int(0);
        vfloat sum = zero, light[3] = {zero, zero, zero};
        for (int i = 0; i < 4; ++i) {
            const vint at_x = rsm_middle(v_to_int(first) + (i & 1), size.x, step);
            const vint at_y = rsm_middle(v_splat_int((int)top + i / 2), size.y, step);
            const vmask suits = rsm_suits(
                own, rsm_surface(depth, normal, at_x, at_y, whole, camera, params), params);
            const vfloat wx = (i & 1) ? across - first : 1.0f - (across - first);
            const float wy = i / 2 ? down - top : 1.0f - (down - top);
            const vfloat weight = v_select(zero, wx * wy, suits);
            suitable = suitable - suits; // a true mask is -1
            sum = sum + weight;
            for (int j = 0; j < 3; ++j) {
                light[j] = v_fma(weight, ssgi_gather(lattice, size, j, at_x, at_y), light[j]);
            }
        }
        const vmask fits = v_ige(suitable, v_splat_int(3)) & v_gt(sum, zero) & own.there;
        const vfloat inverse = 1.0f / v_select(v_splat(1.0f), sum, fits);
        for (int j = 0; j < 3; ++j) {
            ssgi_store(v_select(zero, light[j] * inverse, fits), values, size, j, x, y, 0.0f);
        }
        const vfloat share = v_select(zero, v_splat(1.0f), own.there & ~fits);
        ssgi_store(share, fractions, size, 0, x, y, 0.0f);
        mask |= multires_marks(share, x, size.x) << (x - left);
    }
    masks[multires_mask(size, left, y)] = mask;
}
