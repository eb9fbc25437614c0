// SPDX-License-Identifier: MIT
// occupancy_voxelize: marks the cells of the grid that the triangles of a scene occupy.
//
// Method:  6-separating voxelization (Laine 2013, "A Topological Approach to Voxelization"): a
//          cell is occupied if a triangle meets one of the three axis-parallel segments of a cell's
//          length through its centre. So a ray that visits every cell that it crosses passes no
//          surface, surfaces are as thin as that allows, and what is narrower than a cell occupies
//          cells in proportion to its width, not all that it touches. For each axis the triangle is
//          drawn at the centres of the columns of cells along it. Most triangles of a fine mesh lie
//          between all of these; a triangle a lane, they are found first.
// Reads:   faces      [size.x triangles][RASTER_FACE], vertices [count][RASTER_VERTEX] quads: scene
//                     units, relative to the scene's origin
//          uvs        2 x [size.y vertices, rounded up to 16]; cutouts, materials, textures,
//                     texels, decode: of triangles with holes; see raster_tiles (VOXEL_CUTOUT 1)
//          grid_box   see occupancy/grid.clh
// Writes:  occupancy  OCCUPANCY_CELLS^3 bits, to which 1s are added
// Macros:  OCCUPANCY_CELLS, VOXEL_CUTOUT (0, 1: some triangles have holes, cut out by their
//          texture's alpha)
// Params:  from positions to view space in the lengths that grid_box counts in
// Launch:  a work-item for SSGI_LANES triangles and each slice, which takes every so-many-th row of
//          columns
// Cost:    12 reads per triangle, and an atomic operation per cell that was empty

#include "common/gbuffer.clh"
#include "raster/quads.clh"
#include "raster/records.clh"
#include "raster/texture.clh"
#include "occupancy/grid.clh"

#ifndef VOXEL_CUTOUT
#error "VOXEL_CUTOUT must be defined"
#endif

#define VOXEL_EDGE 1e-3f  // cells by which triangles are wider, so that rounding leaves no gap
#define VOXEL_THIN 1e-12f // squared cells: a triangle of less area along an axis is seen edge-on

typedef struct {
    float at[3]; // in cells
} VoxelCorner;

typedef struct {
    vfloat at[3];
} VoxelCorners;

// Corners of the triangles of the lanes, which are vertices number `vertex`.
static inline VoxelCorners voxel_corners(__global const float *restrict vertices, const vint vertex,
                                         __global const float *restrict grid_box,
                                         const ToViewParams turn)
{
    const RasterQuad from = raster_quad(vertices, vertex * RASTER_VERTEX, false);
    const vfloat x = v_from_bits(from.x), y = v_from_bits(from.y), z = v_from_bits(from.z);
    const vfloat view[3] = {
        v_fma(v_splat(turn.xx), x,
              v_fma(v_splat(turn.xy), y, v_fma(v_splat(turn.xz), z, v_splat(turn.x)))),
        v_fma(v_splat(turn.yx), x,
              v_fma(v_splat(turn.yy), y, v_fma(v_splat(turn.yz), z, v_splat(turn.y)))),
        v_fma(v_splat(turn.zx), x,
              v_fma(v_splat(turn.zy), y, v_fma(v_splat(turn.zz), z, v_splat(turn.z)))),
    };
    const VoxelCorners corners = {{(view[0] - grid_box[0]) * grid_box[3],
                                   (view[1] - grid_box[1]) * grid_box[3],
                                   (view[2] - grid_box[2]) * grid_box[3]}};
    return corners;
}

// The corners of one lane, out of what voxel_keep stored.
typedef struct {
    float at[3][SSGI_LANES];
} VoxelKept;

static inline void voxel_keep(const VoxelCorners *corners, VoxelKept *kept)
{
    for (int k = 0; k < 3; ++k) {
        v_keep(corners->at[k], kept->at[k]);
    }
}

static inline VoxelCorner voxel_lane(const VoxelKept *kept, const int lane)
{
    const VoxelCorner corner = {{kept->at[0][lane], kept->at[1][lane], kept->at[2][lane]}};
    return corner;
}

// Whether the box of a lane's triangle holds the centre of a column of cells along each axis: bits.
static inline vint voxel_met(const VoxelCorners *a, const VoxelCorners *b, const VoxelCorners *c)
{
    const float most = (float)OCCUPANCY_CELLS;
    vmask centre[3], inside[3];
    for (int k = 0; k < 3; ++k) {
        const vfloat low = v_min(v_min(a->at[k], b->at[k]), c->at[k]);
        const vfloat high = v_max(v_max(a->at[k], b->at[k]), c->at[k]);
        inside[k] = v_ge(high, v_splat(0.0f)) & v_lt(low, v_splat(most));
        // ceil(low - 1/2) < ceil(high - 1/2), as the loops over columns begin and end.
        centre[k] = v_gt(v_floor(0.5f - v_clamp(low - VOXEL_EDGE, 0.0f, most)),
                         v_floor(0.5f - v_clamp(high + VOXEL_EDGE, 0.0f, most)));
    }
    return (inside[0] & centre[1] & centre[2] & 1) | (inside[1] & centre[2] & centre[0] & 2) |
           (inside[2] & centre[0] & centre[1] & 4);
}

// Twice the area of the triangle p, a, b along an axis: in a plane of the other two.
static inline vfloat voxel_area(const vfloat u, const float v, const float au, const float av,
                                const float bu, const float bv)
{
    return (u - au) * (bv - av) - (v - av) * (bu - au);
}

// A coordinate; a variable that indexed them would have them in memory.
static inline float voxel_along(const VoxelCorner *corner, const int axis)
{
    return axis == 0 ? corner->at[0] : axis == 1 ? corner->at[1] : corner->at[2];
}

// Mark what a triangle occupies along the axes whose bits are set, in every so-many-th row of
// columns from `slice` on; ia, ib, ic are its vertices.
static inline void
voxel_mark(const VoxelCorner a, const VoxelCorner b, const VoxelCorner c, const int axes,
           const int triangle, const int ia, const int ib, const int ic, const int slice,
           const int slices, const int stride, __global const float *restrict uvs,
           __global const int *restrict cutouts, __global const float *restrict materials,
           __global const int *restrict textures, __global const int *restrict texels,
           __global const float *restrict decode, __global int *restrict occupancy)
{
    for (int axis = 0; axis < 3; ++axis) {
        if (!(axes >> axis & 1)) {
            continue;
        }
        const int iu = axis == 2 ? 0 : axis + 1, iv = axis == 0 ? 2 : axis - 1;
        const float au = voxel_along(&a, iu), av = voxel_along(&a, iv), aw = voxel_along(&a, axis);
        const float bu = voxel_along(&b, iu), bv = voxel_along(&b, iv), bw = voxel_along(&b, axis);
        const float cu = voxel_along(&c, iu), cv = voxel_along(&c, iv), cw = voxel_along(&c, axis);
        // Columns have their centres at whole cells and a half.
        const float most = (float)OCCUPANCY_CELLS;
        const float low_u = clamp(min(min(au, bu), cu) - VOXEL_EDGE, 0.0f, most);
        const float low_v = clamp(min(min(av, bv), cv) - VOXEL_EDGE, 0.0f, most);
        const float high_u = clamp(max(max(au, bu), cu) + VOXEL_EDGE, 0.0f, most);
        const float high_v = clamp(max(max(av, bv), cv) + VOXEL_EDGE, 0.0f, most);
        const int first_u = (int)ceil(low_u - 0.5f), last_u = (int)ceil(high_u - 0.5f) - 1;
        const int first_v = (int)ceil(low_v - 0.5f), last_v = (int)ceil(high_v - 0.5f) - 1;
        const float low_w = min(min(aw, bw), cw), high_w = max(max(aw, bw), cw);
        const float area = (bu - au) * (cv - av) - (bv - av) * (cu - au);
        if (!(fabs(area) > VOXEL_THIN)) {
            continue;
        }
        const float per = 1.0f / area;
        const float wide_a = VOXEL_EDGE * (fabs(bu - cu) + fabs(bv - cv)) * fabs(per);
        const float wide_b = VOXEL_EDGE * (fabs(cu - au) + fabs(cv - av)) * fabs(per);
        const float wide_c = VOXEL_EDGE * (fabs(au - bu) + fabs(av - bv)) * fabs(per);
        for (int row = first_v + slice; row <= last_v; row += slices) {
            const float v = (float)row + 0.5f;
            for (int column = first_u; column <= last_u; column += SSGI_LANES) {
                const vfloat u = v_to_float(v_iota() + column) + 0.5f;
                // Weights of the corners at the columns' centres.
                const vfloat of_a = -voxel_area(u, v, bu, bv, cu, cv) * per;
                const vfloat of_b = -voxel_area(u, v, cu, cv, au, av) * per;
                const vfloat of_c = -voxel_area(u, v, au, av, bu, bv) * per;
                vmask hit = v_ilt(v_iota() + column, v_splat_int(last_u + 1)) &
                            v_ge(of_a, v_splat(-wide_a)) & v_ge(of_b, v_splat(-wide_b)) &
                            v_ge(of_c, v_splat(-wide_c));
                if (!v_any(hit)) {
                    continue;
                }
                // Of edges that are seen edge-on weights are coarse; the box bounds what they make.
                const vfloat w = v_clamp(
                    v_fma(of_b, v_splat(bw - aw), v_fma(of_c, v_splat(cw - aw), v_splat(aw))),
                    low_w, high_w);
#if VOXEL_CUTOUT
                const int cutout = cutouts[triangle];
                if (cutout >= 0) {
                    __global const float *material = materials + cutout * RASTER_MATERIAL;
                    const RasterTextures from = {textures, texels, decode};
                    const float ua = uvs[ia], va = uvs[stride + ia];
                    const vfloat tu = v_fma(of_b, v_splat(uvs[ib] - ua),
                                            v_fma(of_c, v_splat(uvs[ic] - ua), v_splat(ua)));
                    const vfloat tv =
                        v_fma(of_b, v_splat(uvs[stride + ib] - va),
                              v_fma(of_c, v_splat(uvs[stride + ic] - va), v_splat(va)));
                    const vfloat alpha =
                        raster_texture_alpha(from, (int)material[3], tu, tv) * material[4];
                    hit = hit & v_ge(alpha, v_splat(material[5]));
                }
#endif
                const vfloat vv = v_splat(v);
                occupancy_mark(occupancy,
                               axis == 0   ? w
                               : axis == 1 ? vv
                                           : u,
                               axis == 0   ? u
                               : axis == 1 ? w
                                           : vv,
                               axis == 0   ? vv
                               : axis == 1 ? u
                                           : w,
                               hit);
            }
        }
    }
}

__kernel void
occupancy_voxelize(__global const int *restrict faces, __global const float *restrict vertices,
                   __global const float *restrict uvs, __global const int *restrict cutouts,
                   __global const float *restrict materials, __global const int *restrict textures,
                   __global const int *restrict texels, __global const float *restrict decode,
                   __global const float *restrict grid_box, __global int *restrict occupancy,
                   const int2 size, const ToViewParams turn)
{
    const int first = (int)get_global_id(0) * SSGI_LANES;
    const int slice = (int)get_global_id(1);
    const int slices = (int)get_global_size(1);
    if (first >= size.x) {
        return;
    }
    const vint triangle = v_imin(v_iota() + first, v_splat_int(size.x - 1));
    const RasterQuad face = raster_quad(faces, triangle, false);
    const VoxelCorners a = voxel_corners(vertices, face.x, grid_box, turn);
    const VoxelCorners b = voxel_corners(vertices, face.y, grid_box, turn);
    const VoxelCorners c = voxel_corners(vertices, face.z, grid_box, turn);
    VoxelKept at_a, at_b, at_c;
    voxel_keep(&a, &at_a);
    voxel_keep(&b, &at_b);
    voxel_keep(&c, &at_c);
    int met[SSGI_LANES], ia[SSGI_LANES], ib[SSGI_LANES], ic[SSGI_LANES];
    v_ikeep(voxel_met(&a, &b, &c), met);
    v_ikeep(face.x, ia);
    v_ikeep(face.y, ib);
    v_ikeep(face.z, ic);
    const int stride = (size.y + 15) & ~15, count = min(size.x - first, SSGI_LANES);
    for (int lane = 0; lane < count; ++lane) {
        if (met[lane]) {
            voxel_mark(voxel_lane(&at_a, lane), voxel_lane(&at_b, lane), voxel_lane(&at_c, lane),
                       met[lane], first + lane, ia[lane], ib[lane], ic[lane], slice, slices, stride,
                       uvs, cutouts, materials, textures, texels, decode, occupancy);
        }
    }
}
