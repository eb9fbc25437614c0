// SPDX-License-Identifier: MIT
// cut_lists: for each group of samples, the lights and clusters of lights that shine on it.
//
// Method:  A cut through a tree of lights as in Walter et al. 2005, "Lightcuts", but for a group of
//          samples and by an estimate of the error in place of a bound: see cut.clh. A run stands
//          for its lights where its error is below the tolerance; runs and lights that face away
//          from the whole group, with all of their parts, are left out.
// Reads:   depth, normal  of the samples' G-buffer, with margin; view space
//          list     how many samples there are, and so many times row << 16 | column
//          bounds   of all segments, see cluster.clh
//          limits   [1] is the tolerance, W/m^2, [2] all light over that of the lights
// Writes:  kept     [groups][CUT_SAMPLE][CUT_GROUP] the samples, so that they are gathered once
//          lists    [segments][groups][params.capacity] numbers of records, in an order that
//                   depends on no lane; + CUT_SHARED where all lights of the run of 64 share a
//                   shadow ray, + CUT_BRIGHT where those of a run of 4 do
//          counts   [segments][groups]
// Macros:  CUT_ITEMS: work-items that a group of samples has, 1 or, with one lane, CUT_GROUP
// Params:  CutParams: the first group and how many at most; segments from params.segment on, and
//          lights of all; scale from W/m^2 to the lights' unit;
//          share of the tolerance below which the light of a run of 64 is faint, and above which
//          that of a run of 16 is bright
// Launch:  a row of work-groups for each segment: of any number of work-items, each of which takes
//          every so-many-th group; with more CUT_ITEMS a work-group of these for each group
// Cost:    per group 4 reads a sample, 200 operations for each run of 16, and 24 for each light
//          and 90 for each run of 4 in those that are open

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"

#if CUT_BRIGHT != 2 * CUT_SHARED
#error "CUT_BRIGHT is twice CUT_SHARED"
#endif

#ifndef CUT_ITEMS
#error "CUT_ITEMS must be defined by the host"
#endif
#if CUT_ITEMS > 1 && (CUT_ITEMS != CUT_GROUP || SSGI_LANES != 1)
#error "CUT_ITEMS is 1 or, with one lane, CUT_GROUP"
#endif

#define CUT_OUTSHONE 0.2f // 1 / that ratio from which on more lights share a shadow ray

// What becomes of a run.
#define CUT_OPEN 0 // its parts are looked at
#define CUT_DARK 1 // nothing
#define CUT_FITS 2 // it stands for its lights
#define CUT_MOST 3 // the run of 64 that it begins does

static inline vint cut_state(const CutTest test)
{
    const vint open = v_iselect(v_splat_int(CUT_OPEN), v_splat_int(CUT_FITS), test.fits);
    return v_iselect(open, v_splat_int(CUT_DARK), test.dark);
}

// What the light of runs of 16 and 64 is compared with.
typedef struct {
    float tolerance, faint, bright;
} CutLimits;

// Of runs of 16 from number `run` on: states, and 0, 1 (CUT_SHARED) or 2 (CUT_BRIGHT).
static inline void cut_run(__global const float *restrict most,
                           __global const float *restrict sixteens, const int width, const int run,
                           const CutGroup *group, const CutLimits limits, vint *state, vint *shared)
{
    const CutTest whole = cut_test(most, width, run, group, limits.tolerance);
    const CutTest part = cut_test(sixteens, width, run, group, limits.tolerance);
    // A run of 64 is listed at the first of its four parts.
    const vmask leads = v_ieq((v_iota() + run) & 3, v_splat_int(0));
    const vint listed = v_iselect(v_splat_int(CUT_DARK), v_splat_int(CUT_MOST), leads);
    *state = v_iselect(cut_state(part), listed, whole.fits & ~whole.dark);
    const vmask weak = cut_faint(most, width, run, group, limits.faint);
    const vmask strong = ~cut_faint(sixteens, width, run, group, limits.bright);
    const vint rays = v_iselect(v_splat_int(0), v_splat_int(2), strong);
    *shared = v_iselect(rays, v_splat_int(1), weak);
}

#if CUT_ITEMS > 1

#define CUT_PITCH (CUT_GROUP + 1) // neighbours in different banks

// What bounds the samples of a group, which are kept, a sample of each work-item.
static inline CutGroup cut_group(ssgi_plane depth, ssgi_plane normal,
                                 __global const int *restrict list, const int start,
                                 const int2 size, const SsgiCamera camera, const VplParams params,
                                 const bool keeps, __global float *restrict kept,
                                 __local float *samples, __local float *most)
{
    const int item = (int)get_local_id(0);
    const VplReceiver at =
        cut_receiver(depth, normal, cut_pixels(list, start + item), size, camera, params);
    const float height = v_fma(at.nx, at.x, v_fma(at.ny, at.y, at.nz * at.z));
    const float values[7] = {at.x, at.y, at.z, at.nx, at.ny, at.nz, height};
#pragma unroll
    for (int j = 0; j < 7; ++j) {
        samples[j * CUT_PITCH + item] = values[j];
        if (keeps && j < CUT_SAMPLE) {
            kept[j * CUT_GROUP + item] = values[j];
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < 14) {
        const float sign = item & 1 ? 1.0f : -1.0f;
        float largest = -INFINITY;
#pragma unroll 4
        for (int i = 0; i < CUT_GROUP; ++i) {
            largest = v_max(largest, samples[item / 2 * CUT_PITCH + i] * sign);
        }
        most[item] = largest;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    CutGroup group;
    group.at[14] = 0.0f;
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        group.at[j] = -most[2 * j];
        group.at[3 + j] = most[2 * j + 1];
        group.at[6 + j] = -most[6 + 2 * j];
        group.at[9 + j] = most[7 + 2 * j];
        group.at[14] += max(fabs(group.at[j]), fabs(group.at[3 + j]));
    }
    group.at[12] = -most[12];
    group.at[13] = most[13];
    return group;
}

// Which lights of a run of 16, or runs of 4 at the first of their lights, are listed: bits; and, in
// the bits above, at which of the four runs their lights are.
static inline uint cut_open(__global const float *restrict bounds,
                            __global const float *restrict fours, const int stride,
                            const int fours_width, const int run, const CutGroup *group,
                            const int lights, const float tolerance)
{
    uint bits = 0;
#pragma unroll 1
    for (int j = 0; j < 4; ++j) {
        const int state = cut_state(cut_test(fours, fours_width, 4 * run + j, group, tolerance));
        if (state == CUT_FITS) {
            bits |= 1u << 4 * j;
        }
        if (state == CUT_OPEN) {
            bits |= 1u << (16 + j);
#pragma unroll 1
            for (int i = 4 * j; i < 4 * j + 4; ++i) {
                const int light = 16 * run + i;
                if (light < lights && !cut_dark(bounds, stride, light, group)) {
                    bits |= 1u << i;
                }
            }
        }
    }
    return bits;
}

#else

// What bounds the samples of a group, which are kept.
static inline CutGroup cut_group(ssgi_plane depth, ssgi_plane normal,
                                 __global const int *restrict list, const int start,
                                 const int2 size, const SsgiCamera camera, const VplParams params,
                                 const bool keeps, __global float *restrict kept)
{
    vfloat most[14];
#pragma unroll
    for (int j = 0; j < 14; ++j) {
        most[j] = v_splat(-INFINITY);
    }
    for (int i = 0; i < CUT_GROUP; i += SSGI_LANES) {
        const VplReceiver at =
            cut_receiver(depth, normal, cut_pixels(list, start + i), size, camera, params);
        const vfloat sample[CUT_SAMPLE] = {at.x, at.y, at.z, at.nx, at.ny, at.nz};
        if (keeps) {
#pragma unroll
            for (int j = 0; j < CUT_SAMPLE; ++j) {
                v_store(sample[j], kept + j * CUT_GROUP + i);
            }
        }
        const vfloat height = v_fma(at.nx, at.x, v_fma(at.ny, at.y, at.nz * at.z));
        const vfloat values[7] = {at.x, at.y, at.z, at.nx, at.ny, at.nz, height};
#pragma unroll
        for (int j = 0; j < 7; ++j) {
            most[2 * j] = v_max(most[2 * j], -values[j]);
            most[2 * j + 1] = v_max(most[2 * j + 1], values[j]);
        }
    }
    CutGroup group;
    group.at[14] = 0.0f;
#pragma unroll
    for (int j = 0; j < 3; ++j) {
        group.at[j] = -v_largest(most[2 * j]);
        group.at[3 + j] = v_largest(most[2 * j + 1]);
        group.at[6 + j] = -v_largest(most[6 + 2 * j]);
        group.at[9 + j] = v_largest(most[7 + 2 * j]);
        group.at[14] += max(fabs(group.at[j]), fabs(group.at[3 + j]));
    }
    group.at[12] = -v_largest(most[12]);
    group.at[13] = v_largest(most[13]);
    return group;
}

// States of up to 16 runs, or which lights share their rays. With one lane they are bits of a
// number: variables index no registers, and GPUs would keep an array in memory.
typedef struct {
#if SSGI_LANES == 1
    uint bits;
#else
    int at[16];
#endif
} CutStates;

static inline void cut_keep(CutStates *states, const vint state, const int i)
{
#if SSGI_LANES == 1
    states->bits = (i == 0 ? 0 : states->bits) | (uint)state << 2 * i;
#else
    v_ikeep(state, states->at + i);
#endif
}

static inline int cut_kept_state(const CutStates *states, const int i)
{
#if SSGI_LANES == 1
    return (int)(states->bits >> 2 * i & 3);
#else
    return states->at[i];
#endif
}

// Appends what is listed of a run of 16, given the states of its parts from number `first` on;
// returns the new count.
static inline int cut_append(__global const float *restrict bounds, const int stride, const int run,
                             const CutStates *parts, const int first, const CutGroup *group,
                             const int lights, const int shared, __global int *restrict to,
                             int count)
{
    const int part[4] = {cut_kept_state(parts, first), cut_kept_state(parts, first + 1),
                         cut_kept_state(parts, first + 2), cut_kept_state(parts, first + 3)};
    for (int i = 0; i < 16; i += SSGI_LANES) {
        const vint n = v_iota() + i;
        vint state = v_splat_int(part[0]);
#pragma unroll
        for (int j = 1; j < 4; ++j) {
            state = v_iselect(state, v_splat_int(part[j]), v_ige(n, v_splat_int(4 * j)));
        }
        const vint light = n + 16 * run;
        const vmask open = v_ieq(state, v_splat_int(CUT_OPEN));
        const vmask leads = v_ieq(n & 3, v_splat_int(0));
        vmask lit = v_ilt(light, v_splat_int(lights));
        if (v_any(open)) {
            lit = lit & ~cut_dark(bounds, stride, 16 * run + i, group);
        }
        // Of each light, or of its part at the first of four: the record, and -1 where it is
        // listed.
        int record[SSGI_LANES], listed[SSGI_LANES];
        v_ikeep(v_iselect((n >> 2) + (stride + 4 * run), light, open), record);
        v_ikeep((open & lit) | (v_ieq(state, v_splat_int(CUT_FITS)) & leads), listed);
        // What is not listed is written over; branches would be guessed wrong too often.
#pragma unroll
        for (int lane = 0; lane < SSGI_LANES; ++lane) {
            to[count] = record[lane] | shared;
            count -= listed[lane];
        }
    }
    return count;
}

// Runs of 16 that are looked at together: those of a run of 64, and as many as there are lanes.
#define CUT_TOGETHER (SSGI_LANES > 4 ? SSGI_LANES : 4)

// Of such runs from number `begin` on: states, and 0, 1 (CUT_SHARED) or 2 (CUT_BRIGHT).
static inline void cut_states(__global const float *restrict most,
                              __global const float *restrict sixteens, const int width,
                              const int begin, const CutGroup *group, const CutLimits limits,
                              CutStates *states, CutStates *shared)
{
    for (int i = 0; i < CUT_TOGETHER; i += SSGI_LANES) {
        vint state, rays; // there are as many runs as lanes load
        cut_run(most, sixteens, width, begin + i, group, limits, &state, &rays);
        cut_keep(states, state, i);
        cut_keep(shared, rays, i);
    }
}

#endif

__kernel void cut_lists(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                        __global const float *restrict bounds,
                        __global const float *restrict limits, __global float *restrict kept,
                        __global int *restrict lists, __global int *restrict counts,
                        const int2 size, const SsgiCamera camera, const VplParams params,
                        const CutParams cut)
{
    const int number = (int)get_group_id(1); // the same in a work-group
    if (number >= cut.segments) {
        return;
    }
    const int stride = params.stride;
    const int segment = params.segment + number;
    const int lights = min(cut.lights - segment * stride, stride);
    const int runs = stride / 16;
    lists += number * cut.groups * params.capacity;
    counts += number * cut.groups;
    const int width = tree_width(stride);
    const int fours_width = 4 * width;
    CutLimits most_light;
    most_light.tolerance = limits[1] * cut.scale;
    // Where other light outshines what the lights give, their shadows are hard to see.
    most_light.faint =
        most_light.tolerance * cut.faint * clamp(limits[2] * CUT_OUTSHONE, 1.0f, 2.0f);
    // Where no error is allowed, all lights share rays alike.
    most_light.bright = most_light.tolerance > 0.0f ? most_light.tolerance * cut.bright : INFINITY;
    bounds += segment * tree_first_bound(stride, 4);
    __global const float *restrict fours = bounds + tree_first_bound(stride, 1);
    __global const float *restrict sixteens = bounds + tree_first_bound(stride, 2);
    __global const float *restrict most = bounds + tree_first_bound(stride, 3);
    const int end = min(cut.groups, (list[0] + CUT_GROUP - 1) / CUT_GROUP - cut.first);
#if CUT_ITEMS > 1
    __local float samples[7 * CUT_PITCH], bounding[14];
    __local int found[CUT_GROUP]; // how many records each work-item lists
    const int own = (int)get_group_id(0), item = (int)get_local_id(0);
    if (own >= end) {
        return;
    }
    const CutGroup group =
        cut_group(depth, normal, list, (cut.first + own) * CUT_GROUP, size, camera, params,
                  number == 0, kept + own * (CUT_SAMPLE * CUT_GROUP), samples, bounding);
    __global int *restrict to = lists + own * params.capacity;
    int count = 0; // of the runs before
    for (int first = 0; first < runs; first += CUT_ITEMS) {
        const int run = first + item; // a work-item's own
        int state = CUT_DARK, rays = 0;
        uint bits = 0;
        if (run < runs) {
            cut_run(most, sixteens, width, run, &group, most_light, &state, &rays);
            if (state == CUT_OPEN) {
                bits = cut_open(bounds, fours, stride, fours_width, run, &group, lights,
                                most_light.tolerance);
            }
        }
        found[item] = state == CUT_OPEN ? (int)popcount(bits & 0xffff) : state != CUT_DARK;
        barrier(CLK_LOCAL_MEM_FENCE);
        int at = count;
#pragma unroll 4 // all of them would take as many registers
        for (int i = 0; i < CUT_ITEMS; ++i) {
            at += i < item ? found[i] : 0;
            count += found[i];
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        rays *= CUT_SHARED;
        if (state == CUT_FITS) {
            to[at] = rays | (tree_first(stride, 2) + run);
        } else if (state == CUT_MOST) {
            to[at] = rays | (tree_first(stride, 3) + run / 4);
        }
        const uint open = bits >> 16;
        for (bits &= 0xffff; bits != 0; bits &= bits - 1) {
            const int i = v_lowest_bit(bits);
            to[at] = rays | (open >> i / 4 & 1 ? 16 * run + i : stride + 4 * run + i / 4);
            at += 1;
        }
    }
    if (item == 0) {
        counts[own] = count;
    }
#else
    for (int turn = 0, own = cut_own(0, end); own < end; own = cut_own(++turn, end)) {
        const CutGroup group =
            cut_group(depth, normal, list, (cut.first + own) * CUT_GROUP, size, camera, params,
                      number == 0, kept + own * (CUT_SAMPLE * CUT_GROUP));
        __global int *restrict to = lists + own * params.capacity;
        CutStates states, shared;
        int count = 0;
        const int next = (cut.first + cut_own(turn + 1, end)) * CUT_GROUP;
        const int asked = (4 * CUT_GROUP + runs - 1) / runs;
        for (int first = 0; first < runs; first += 4) {
            const int begin = first / CUT_TOGETHER * CUT_TOGETHER;
            if (first == begin) {
                cut_states(most, sixteens, width, begin, &group, most_light, &states, &shared);
            }
            const int ask = next + first / 4 * asked;
            cut_ask(depth, normal, list, ask, min(ask + asked, next + CUT_GROUP), size, params);
            const int last = min(first + 4, runs);
            bool open = false;
            for (int run = first; run < last; ++run) {
                open = open || cut_kept_state(&states, run - begin) == CUT_OPEN;
            }
            CutStates parts; // of 4
            for (int i = 0; i < 16 && open; i += SSGI_LANES) {
                const CutTest part =
                    cut_test(fours, fours_width, 4 * first + i, &group, most_light.tolerance);
                cut_keep(&parts, cut_state(part), i);
            }
            for (int run = first; run < last; ++run) {
                const int state = cut_kept_state(&states, run - begin);
                const int rays = cut_kept_state(&shared, run - begin) * CUT_SHARED;
                if (state == CUT_OPEN) {
                    count = cut_append(bounds, stride, run, &parts, 4 * (run - first), &group,
                                       lights, rays, to, count);
                } else if (state != CUT_DARK) {
                    to[count] = rays | (state == CUT_FITS ? tree_first(stride, 2) + run
                                                          : tree_first(stride, 3) + run / 4);
                    count += 1;
                }
            }
        }
        counts[own] = count;
    }
#endif
}
