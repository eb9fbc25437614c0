// SPDX-License-Identifier: MIT
// vpl_interleaved: irradiance by virtual point lights, of which each pixel of a 4 x 4 tile takes
// one in 16, with shadow rays that lights share.
//
// Method:  Keller and Heidrich 2001, "Interleaved Sampling"; Segovia et al. 2006, "Non-interleaved
//          Deferred Shading of Interleaved Sample Patterns". A pixel's lights that are neighbours
//          on the reflective shadow map share a shadow ray to one of them, chosen in proportion to
//          flux, which is followed through the occupancy grid.
// Reads:   depth   [rows, columns] with margin, scene units; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space, unit length
//          lights  [segments][params.span][VPL_FLOATS]
//          lists   [tiles][16][params.capacity] and counts [tiles][16], see vpl_lists
//          occupancy, grid_box  see occupancy/grid.clh
//          near, near_counts  see vpl_near (VPL_PARTS 1)
// Writes:  irradiance  3 x [rows, columns], W/m^2; 0 where nothing is
// Macros:  VPL_NEAR, VPL_CUT, VPL_ADD and VPL_GLOSSY as in vpl_splat; VPL_VISIBILITY (0: light
//          passes through surfaces, 1), OCCUPANCY_CELLS (32..256 cells along a side), VPL_SHARE
//          (lights that share a shadow ray), VPL_PARTS (1: in place of one in 16 of the lights near
//          by, each pixel takes one in 16 of the parts of all of them)
// Launch:  a work-item for each tile of 16 x 16, pixel of 4 x 4, and SSGI_LANES of the 16 such
//          pixels
// Cost:    1 / 16 of vpl_splat, and some 20 reads for each pixel and line

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "occupancy/grid.clh"
#include "vpl/light.clh"
#include "vpl/lobe.clh"
#include "vpl/receiver.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(VPL_ADD) || !defined(VPL_VISIBILITY) ||    \
    !defined(VPL_SHARE) || !defined(VPL_GLOSSY) || !defined(VPL_PARTS)
#error "VPL_NEAR, _CUT, _ADD, _VISIBILITY, _SHARE, _GLOSSY and _PARTS must be defined"
#endif

#define VPL_PIECES (16 / SSGI_LANES)

#if VPL_VISIBILITY
// In (0, 1), of a subset of a tile and a group of its lights: an additive recurrence (Roberts 2018,
// the R2 sequence), so that any few neighbours have numbers that are spread evenly.
static inline float vpl_number(const int x, const int y, const int group)
{
    const int number = (x * 12368 + y * 9336 + group * 10125) & 0x3fff; // of 2^14
    return ((float)number + 0.5f) * (1.0f / 16384.0f);
}

static inline float vpl_luminous(__global const float *restrict light)
{
    return 0.2126f * light[8] + 0.7152f * light[9] + 0.0722f * light[10];
}

// Whether a light is hidden from lanes that want to know.
SSGI_LARGE vmask vpl_hidden(__global const int *restrict occupancy,
                            __global const float *restrict grid_box, const OccupancyCell start,
                            __global const float *restrict light, const vmask wanted)
{
    const OccupancyCell finish = occupancy_end(light, light + VPL_NORMAL, grid_box);
    return occupancy_blocked(occupancy, start, finish, wanted);
}
#endif

#if VPL_VISIBILITY || VPL_PARTS
// Part `subset` of light segment * params.span + number.
static inline int vpl_part(const int light, const int subset, const VplParams params)
{
    const int number = light % params.span;
    return light + 15 * number + params.stride + subset;
}
#endif

#if VPL_VISIBILITY
// The light of a list that a group's shadow ray goes to: each with a probability in proportion to
// its flux. If all were alike, those would be favoured that have little: where light reaches the
// image there are many of them. `part` (>= 0): the lights' parts of that number.
static inline __global const float *vpl_target(__global const float *restrict lights,
                                               __global const int *restrict list, const int count,
                                               const float number, const int part,
                                               const VplParams params)
{
    float all = 0.0f;
    for (int i = 0; i < count; ++i) {
        const int light = part < 0 ? list[i] : vpl_part(list[i], part, params);
        all += vpl_luminous(lights + light * VPL_FLOATS);
    }
    __global const float *target = lights;
    float left = all * number;
    for (int i = 0; i < count && left >= 0.0f; ++i) {
        const int light = part < 0 ? list[i] : vpl_part(list[i], part, params);
        target = lights + light * VPL_FLOATS;
        left -= vpl_luminous(target);
    }
    return target;
}
#endif

__kernel void vpl_interleaved(ssgi_plane depth, ssgi_plane normal,
                              __global const float *restrict lights,
                              __global const int *restrict lists,
                              __global const int *restrict counts,
                              ssgi_optional __global const int *restrict occupancy,
                              ssgi_optional __global const float *restrict grid_box,
                              ssgi_optional __global const int *restrict near,
                              ssgi_optional __global const int *restrict near_counts,
                              __global float *restrict irradiance, const int2 size,
                              const SsgiCamera camera, const VplParams params)
{
    const int tile_x = (int)get_global_id(0) / (16 * VPL_PIECES);
    const int subset = (int)get_global_id(0) / VPL_PIECES % 16;
    const int piece = (int)get_global_id(0) % VPL_PIECES;
    const int tile_y = (int)get_global_id(1);
    const int2 tiles = vpl_tiles(size);
    if (tile_x >= tiles.x || tile_y >= tiles.y) {
        return;
    }
    const vint number = v_iota() + piece * SSGI_LANES;
    const vint x = (number & 3) * 4 + (tile_x * VPL_TILE + (subset & 3));
    const vint y = (number >> 2) * 4 + (tile_y * VPL_TILE + (subset >> 2));
    const vmask inside = v_ilt(x, v_splat_int(size.x)) & v_ilt(y, v_splat_int(size.y));
    const VplReceiver at =
        vpl_receiver_at(depth, normal, size, camera, params, v_imin(x, v_splat_int(size.x - 1)),
                        v_imin(y, v_splat_int(size.y - 1)));
    const vmask shone = at.there & inside;
    const int own = (tile_y * tiles.x + tile_x) * 16 + subset;
    __global const int *restrict list = lists + own * params.capacity;
    const int count = v_any(shone) ? counts[own] : 0;
    lights += (params.segment + subset) * params.span * VPL_FLOATS;
    const vfloat zero = v_splat(0.0f);
#if VPL_VISIBILITY
    const OccupancyCell start = occupancy_cell(at.x, at.y, at.z, at.nx, at.ny, at.nz, grid_box);
    const int pattern_x = tile_x * 4 + (subset & 3), pattern_y = tile_y * 4 + (subset >> 2);
#endif
    vfloat sum[3] = {zero, zero, zero};
#if VPL_PARTS
    const int near_by = v_any(shone) ? near_counts[own / 16] : 0;
    __global const int *restrict near_list = near + own / 16 * params.near_capacity;
    __global const float *restrict all_lights = lights - subset * params.span * VPL_FLOATS;
    for (int first = 0; first < near_by; first += VPL_SHARE) {
        const int end = min(first + VPL_SHARE, near_by);
        vfloat part[3] = {zero, zero, zero};
        vfloat all = zero;
        for (int i = first; i < end; ++i) {
            __global const float *restrict whole = all_lights + near_list[i] * VPL_FLOATS;
            __global const float *restrict light =
                all_lights + vpl_part(near_list[i], subset, params) * VPL_FLOATS;
            const vfloat w = VPL_WEIGHT(light, at, params) * vpl_parts_share(whole, at, params);
            all = all + w;
            for (int j = 0; j < 3; ++j) {
                part[j] = v_fma(w, v_splat(light[8 + j]), part[j]);
            }
        }
        const vmask wanted = v_gt(all, zero) & shone;
        if (!v_any(wanted)) {
            continue;
        }
#if VPL_VISIBILITY
        const float fraction = vpl_number(pattern_x, pattern_y, first / VPL_SHARE);
        __global const float *restrict one =
            vpl_target(all_lights, near_list + first, end - first, fraction, subset, params);
        const vmask open = ~vpl_hidden(occupancy, grid_box, start, one, wanted);
#else
        const vmask open = wanted;
#endif
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + v_select(zero, part[j], open);
        }
    }
#endif
    for (int first = 0; first < count; first += VPL_SHARE) {
        const int end = min(first + VPL_SHARE, count);
        vfloat part[3] = {zero, zero, zero};
        vfloat all = zero;
        for (int i = first; i < end; ++i) {
            __global const float *restrict light = lights + list[i] * VPL_FLOATS;
            vfloat w = VPL_WEIGHT(light, at, params);
#if VPL_PARTS
            if (near_by > 0) {
                w = w * (1.0f - vpl_parts_share(light, at, params));
            }
#endif
            all = all + w;
            for (int j = 0; j < 3; ++j) {
                part[j] = v_fma(w, v_splat(light[8 + j]), part[j]);
            }
        }
#if VPL_VISIBILITY
        const vmask wanted = v_gt(all, zero) & shone;
        if (!v_any(wanted)) {
            continue;
        }
        const float fraction = vpl_number(pattern_x, pattern_y, first / VPL_SHARE);
        __global const float *restrict one =
            vpl_target(lights, list + first, end - first, fraction, -1, params);
        const vmask open = ~vpl_hidden(occupancy, grid_box, start, one, wanted);
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + v_select(zero, part[j], open);
        }
#else
        for (int j = 0; j < 3; ++j) {
            sum[j] = sum[j] + part[j];
        }
#endif
    }
    // Lanes outside the image write 0 to the guard, which is 0.
    const vint place =
        v_iselect(v_splat_int(ssgi_pitch(size) - 1), y * ssgi_pitch(size) + x, inside);
    for (int j = 0; j < 3; ++j) {
        vfloat value =
            v_min(v_select(zero, sum[j], shone) * (params.gain * 16.0f), v_splat(VPL_BRIGHTEST));
        __global float *restrict image = irradiance + ssgi_index(size, j, 0, 0);
#if VPL_ADD
        value = v_min(value + v_gather(image, place), v_splat(VPL_BRIGHTEST));
#endif
        v_scatter(value, image, place);
    }
}
