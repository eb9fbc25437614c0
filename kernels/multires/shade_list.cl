// SPDX-License-Identifier: MIT
// shade_list: irradiance at samples by the lights and clusters of lights that their group listed.
//
// Method:  as vpl/vpl_splat.cl: E = sum over the list of flux * w, w = cos cos / (pi d^2 + A).
// Reads:   list     how many samples there are, and so many times row << 16 | column
//          samples  as cut_lists keeps them
//          all_records  of all segments, see cluster.clh
//          lists, counts  see cut_lists
//          lights   [segments][params.span][TREE_RECORD] of which the parts; with SHADE_PARTS alone
//          occupancy, grid_box  with VPL_VISIBILITY alone; see occupancy/grid.clh
//          fractions   [rows, columns] what the light counts for, see multires_interpolate
// Writes:  values   3 x [rows, columns], W/m^2: the light is added, at the samples alone
// Macros:  VPL_NEAR, VPL_CUT (0, 1), SHADE_ROWS (times SSGI_LANES samples of a work-item, so that
//          each light is read once for all of them; 1 to 4),
//          VPL_VISIBILITY (1: surfaces block light), OCCUPANCY_CELLS (32..256 cells along a side),
//          SHADE_LINE (lights that share a shadow ray: runs of 4: 1, of 16: 2, or of 64: 3; those
//          that are listed with CUT_SHARED: of 64; with CUT_BRIGHT: of 4),
//          SHADE_PARTS (1: lights give way to their 16 parts near by, as in vpl/vpl_splat.cl)
// Params:  CutParams: first group, groups at most, segments from params.segment on; camera: the
// samples' (VPL_VISIBILITY 1) Launch:  any number of work-items, each of which takes every
// so-many-th piece of a group Cost:    24 operations and a division per sample and light of its
// list; with VPL_VISIBILITY, some
//          20 reads per sample and view ray

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"
#include "occupancy/grid.clh"
#include "rays/ends.clh"
#include "vpl/light.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(SHADE_ROWS) || !defined(VPL_VISIBILITY) || \
    !defined(SHADE_LINE) || !defined(SHADE_PARTS)
#error "VPL_NEAR, _CUT, _VISIBILITY, SHADE_ROWS, _LINE and _PARTS must be defined"
#endif

#define SHADE_BLOCK 64 // lights summed before they are added to the sum: float32 rounds less so
#define SHADE_PIECE (SSGI_LANES * SHADE_ROWS)
#define SHADE_PIECES (CUT_GROUP / SHADE_PIECE)

#if VPL_VISIBILITY == 2
typedef RaysEnd ShadeEnd;
#elif VPL_VISIBILITY
typedef OccupancyCell ShadeEnd;
#endif

#if VPL_VISIBILITY
// Record whose target a record's shadow ray goes to: the run of 4^line lights that it belongs to,
// or itself where it is a longer one.
static inline int shade_run(const int record, const int stride, const int line)
{
    int level = 0;
    while (level < line && record >= tree_first(stride, level + 1)) {
        ++level;
    }
    return level == line ? record
                         : tree_first(stride, line) +
                               ((record - tree_first(stride, level)) >> 2 * (line - level));
}

#if VPL_VISIBILITY == 1
// Where shadow rays of samples start: towards the eye where their cells hold a surface.
static inline OccupancyCell shade_towards(__global const int *restrict occupancy,
                                          const OccupancyCell start, const VplReceiver at,
                                          const SsgiCamera camera)
{
    const vfloat tx = at.x * -camera.perspective, ty = at.y * -camera.perspective;
    const vfloat tz = v_fma(at.z, v_splat(-camera.perspective), v_splat(1.0f - camera.perspective));
    const vfloat squared = v_fma(tx, tx, v_fma(ty, ty, tz * tz));
    const vfloat per = v_rsqrt(v_max(squared, v_splat(1e-30f)));
    return occupancy_towards(occupancy, start, tx * per, ty * per, tz * per);
}

// Where a shadow ray to a run ends: at one of its lights, lifted off its surface. The mean of them
// may be inside of something.
static inline OccupancyCell shade_end(__global const float *restrict records, const int run,
                                      __global const float *restrict grid_box)
{
    __global const float *restrict light =
        records + (int)records[run * TREE_RECORD + TREE_TARGET] * TREE_RECORD;
    return occupancy_end(light, light + 4, grid_box);
}
#else
// Where a shadow ray to a run ends: at one of its lights.
static inline RaysEnd shade_end(__global const float *restrict records, const int run,
                                const RaysParams rays)
{
    return rays_light(records + (int)records[run * TREE_RECORD + TREE_TARGET] * TREE_RECORD, rays);
}
#endif
#endif

#if SHADE_PARTS
// Adds a share of the light of 16 parts to `sum`.
static inline void shade_parts(__global const float *restrict parts, const vfloat share,
                               const VplReceiver at, const VplParams params, vfloat sum[3])
{
    for (int i = 0; i < 16; ++i) {
        __global const float *restrict light = parts + i * TREE_RECORD;
        const vfloat w = vpl_weight(light, at, params) * share;
#pragma unroll
        for (int j = 0; j < 3; ++j) {
            sum[j] = v_fma(w, v_splat(light[8 + j]), sum[j]);
        }
    }
}
#endif

__kernel void shade_list(__global const int *restrict list, __global const float *restrict samples,
                         __global const float *restrict all_records,
                         __global const int *restrict lists, __global const int *restrict counts,
#if SHADE_PARTS
                         __global const float *restrict lights,
#endif
#if VPL_VISIBILITY == 2
                         __global const float *restrict nodes,
                         __global const float *restrict triangles, const RaysParams rays,
#elif VPL_VISIBILITY
                         __global const int *restrict occupancy,
                         __global const float *restrict grid_box, const SsgiCamera camera,
#endif
                         ssgi_plane fractions, __global float *restrict values, const int2 size,
                         const VplParams params, const CutParams cut)
{
    const int listed = list[0];
    const vfloat zero = v_splat(0.0f);
    const int pieces = min(cut.groups * SHADE_PIECES,
                           (listed + SHADE_PIECE - 1) / SHADE_PIECE - cut.first * SHADE_PIECES);
    for (int turn = 0, own = cut_own(0, pieces); own < pieces; own = cut_own(++turn, pieces)) {
        const int group = own / SHADE_PIECES;
        const int start = cut.first * CUT_GROUP + own * SHADE_PIECE;
        __global const float *restrict kept =
            samples + group * (CUT_SAMPLE * CUT_GROUP) + own % SHADE_PIECES * SHADE_PIECE;
        VplReceiver at[SHADE_ROWS];
#pragma unroll
        for (int r = 0; r < SHADE_ROWS; ++r) {
            at[r] = cut_kept(kept, r * SSGI_LANES);
        }
#if VPL_VISIBILITY
        ShadeEnd eye[SHADE_ROWS];
        vmask open[SHADE_ROWS];
#pragma unroll
        for (int r = 0; r < SHADE_ROWS; ++r) {
#if VPL_VISIBILITY == 2
            eye[r] = rays_end(at[r].x, at[r].y, at[r].z, at[r].nx, at[r].ny, at[r].nz, rays);
#else
            eye[r] =
                occupancy_cell(at[r].x, at[r].y, at[r].z, at[r].nx, at[r].ny, at[r].nz, grid_box);
            eye[r] = shade_towards(occupancy, eye[r], at[r], camera);
#endif
        }
#endif
        cut_ask_values(fractions, values, list, start, start + SHADE_PIECE, size);
        for (int number = 0; number < cut.segments; ++number) {
            const int segment = params.segment + number;
            __global const float *restrict records =
                all_records + segment * tree_first(params.stride, 4) * TREE_RECORD;
#if SHADE_PARTS
            __global const float *restrict parts =
                lights + (segment * params.span + params.stride) * TREE_RECORD;
#endif
            vfloat sum[SHADE_ROWS][3];
#pragma unroll
            for (int r = 0; r < SHADE_ROWS; ++r) {
                sum[r][0] = sum[r][1] = sum[r][2] = zero;
#if VPL_VISIBILITY
                open[r] = v_splat_int(-1);
#endif
            }
#if VPL_VISIBILITY
            int latest = -1; // run that `open` is about
#endif
            const int listing = number * cut.groups + group;
            const int count = counts[listing];
            __global const int *restrict chosen = lists + listing * params.capacity;
            for (int block = 0; block < count; block += SHADE_BLOCK) {
                const int end = min(block + SHADE_BLOCK, count);
                vfloat part[SHADE_ROWS][3];
#pragma unroll
                for (int r = 0; r < SHADE_ROWS; ++r) {
                    part[r][0] = part[r][1] = part[r][2] = zero;
                }
                for (int i = block; i < end; ++i) {
                    const int record = chosen[i] & (CUT_SHARED - 1);
                    __global const float *restrict light = records + record * TREE_RECORD;
#if VPL_VISIBILITY
                    const int kind = chosen[i] - record;
                    const int line = kind == CUT_SHARED ? 3 : kind == CUT_BRIGHT ? 1 : SHADE_LINE;
                    const int run = shade_run(record, params.stride, line);
                    if (run != latest) {
                        latest = run;
#if VPL_VISIBILITY == 2
                        const ShadeEnd goal = shade_end(records, run, rays);
#else
                        const ShadeEnd goal = shade_end(records, run, grid_box);
#endif
#pragma unroll
                        for (int r = 0; r < SHADE_ROWS; ++r) {
#if VPL_VISIBILITY == 2
                            open[r] = ~rays_hidden(nodes, triangles, eye[r], goal, at[r].there);
#else
                            open[r] = ~occupancy_blocked(occupancy, eye[r], goal, at[r].there);
#endif
                        }
                    }
#endif
#pragma unroll
                    for (int r = 0; r < SHADE_ROWS; ++r) {
#if VPL_VISIBILITY
                        vfloat w = v_select(zero, vpl_weight(light, at[r], params), open[r]);
#else
                        vfloat w = vpl_weight(light, at[r], params);
#endif
#if SHADE_PARTS
                        if (record < params.stride) {
                            vfloat near = vpl_parts_share(light, at[r], params);
#if VPL_VISIBILITY
                            near = v_select(zero, near, open[r]);
#endif
                            w = v_fma(-near, w, w);
                            if (v_any(v_gt(near, zero))) {
                                shade_parts(parts + 16 * (int)light[TREE_NUMBER] * TREE_RECORD,
                                            near, at[r], params, part[r]);
                            }
                        }
#endif
#pragma unroll
                        for (int j = 0; j < 3; ++j) {
                            part[r][j] = v_fma(w, v_splat(light[8 + j]), part[r][j]);
                        }
                    }
                }
#pragma unroll
                for (int r = 0; r < SHADE_ROWS; ++r) {
#pragma unroll
                    for (int j = 0; j < 3; ++j) {
                        sum[r][j] = sum[r][j] + part[r][j];
                    }
                }
            }
#pragma unroll
            for (int r = 0; r < SHADE_ROWS; ++r) {
                if (start + r * SSGI_LANES >= listed) {
                    break;
                }
                // Past the list's end the last sample comes again, with the same value.
                const vint pixel = cut_pixels(list, start + r * SSGI_LANES);
                const vint column = pixel & 0xffff, row = pixel >> 16;
                const vint to = row * ssgi_pitch(size) + column;
                const vfloat share = ssgi_gather(fractions, size, 0, column, row);
#pragma unroll
                for (int j = 0; j < 3; ++j) {
                    __global float *restrict image = values + ssgi_index(size, j, 0, 0);
                    const vfloat value = v_min(sum[r][j] * params.gain, v_splat(VPL_BRIGHTEST));
                    v_scatter(v_fma(share, value, v_gather(image, to)), image, to);
                }
            }
        }
    }
}
