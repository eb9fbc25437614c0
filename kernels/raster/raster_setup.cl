// SPDX-License-Identifier: MIT
// raster_setup: triangles to records; those that cover no place that is sampled end here.
//
// Triangles that reach behind the near plane or far beyond the image are clipped. An edge is cut
// from its lexicographically lesser end, so both triangles that share it get the same new vertex.
//
// Method:  a box that is not seen is left out unread. The triangles of the others are looked at
//          first, and those that may cover a pixel are then taken together, so that all lanes have
//          work.
// Reads:   boxes     [number of runs of RASTER_BOXED triangles][RASTER_BOX]
//          corners   4 x [triangles] vertex indices, and whether the back is not there
//          vertices  [count][RASTER_VERTEX] quads
//          view, screen  see raster_vertices
// Writes:  records   see records.clh; at most params.capacity
//          places    [records] of those that may cover one tile alone, its number and their place
//                    among such records of the tile; of others -1
//          tiles     [2][tile count] number of records that may cover the tile and others, and of
//                    those of the tile alone
//          counters  RASTER_RECORDS
// Macros:  RASTER_BOXED: triangles per box; RASTER_RUN: per work-item, of which a box holds a whole
//          number, a multiple of the lanes; RASTER_SPREAD, see bounds.clh
// Params:  size = (triangles, 1); near plane; camera
// Launch:  a work-item for each run; with RASTER_RUN 1 in work-groups of SSGI_GROUP

#include "common/camera.clh"
#include "raster/boxes.clh"
#include "raster/clip.clh"
#include "raster/planes.clh"
#include "raster/quads.clh"
#include "raster/records.clh"
#include "raster/screen.clh"

#if !defined(RASTER_BOXED) || !defined(RASTER_RUN)
#error "RASTER_BOXED and RASTER_RUN must be defined by the host"
#endif
#ifndef SSGI_GROUP
#error "ssgi_cl/device/constants.py defines SSGI_GROUP"
#endif

// What is read of triangles.
typedef struct {
    __global const int *corners;
    int stride; // of corners
    __global const float *vertices;
    __global const float *view;
    __global const int *screen;
} RasterMesh;

static inline float3 raster_vertex(__global const float *restrict planar, const int stride,
                                   const int i)
{
    return (float3)(planar[i], planar[stride + i], planar[2 * stride + i]);
}

// Add the corners of a record's triangle to a polygon, and clip it.
static inline void raster_clip_triangle(const RasterMesh mesh, RasterPolygon *polygon,
                                        const RasterRecord record, const int back,
                                        const RasterLists lists, const SsgiCamera camera,
                                        const RasterView params)
{
    polygon->first = polygon->count = 0;
    for (int i = 0; i < 3; ++i) {
        const int vertex = mesh.corners[i * mesh.stride + record.triangle];
        raster_add(polygon, raster_vertex(mesh.view, params.vertex_stride, vertex));
    }
    raster_clip(camera, polygon, record, back, lists, params);
}

// A record whose triangle is to be clipped.
typedef struct {
    RasterRecord record;
    int back; // as raster_append takes it
    bool clips;
} RasterPending;

// Make records of `count` triangles, at most SSGI_LANES, with these numbers. With RASTER_RUN 1 one
// that is to be clipped is left to the caller.
static inline RasterPending raster_records(const int *triangles, const int count,
                                           const RasterMesh mesh, const RasterLists lists,
                                           const SsgiCamera camera, const RasterView params)
{
    RasterPending pending;
    pending.clips = false;
    vint id = v_splat_int(0);
    for (int lane = 0; lane < SSGI_LANES; ++lane) {
        ((int *)&id)[lane] = triangles[min(lane, count - 1)];
    }
    const vint a = v_igather(mesh.corners, id);
    const vint b = v_igather(mesh.corners + mesh.stride, id);
    const vint c = v_igather(mesh.corners + 2 * mesh.stride, id);
    const RasterScreen t = raster_screen(mesh.screen, params, a, b, c, v_splat_int(0));
    const RasterPlanes planes =
        raster_planes(camera, params, mesh.vertices, a, b, c, t.least, t.most);
    int4 quads[RASTER_RECORD / 4][SSGI_LANES];
    raster_keep_quads((RasterQuad){t.ax, t.ay, t.bx, t.by}, quads[0]);
    raster_keep_quads((RasterQuad){t.cx, t.cy, v_bits(planes.x), v_bits(planes.y)}, quads[1]);
    raster_keep_quads((RasterQuad){v_bits(planes.z), v_bits(planes.least), v_bits(planes.most), id},
                      quads[2]);
    const vint left = t.left / RASTER_TILE, top = t.top / RASTER_TILE;
    const vmask single =
        t.ready & v_ieq(left, t.right / RASTER_TILE) & v_ieq(top, t.bottom / RASTER_TILE);
    int tile[SSGI_LANES], clip[SSGI_LANES], ready[SSGI_LANES];
    v_ikeep(v_iselect(v_splat_int(-1), top * params.tiles_x + left, single), tile);
    v_ikeep(t.clip, clip);
    v_ikeep(t.ready, ready);
    // One step of a shared counter for all: one by one they would hold up each other's cores.
    const int index = atomic_add(lists.counters + RASTER_RECORDS, count);
    const int capacity = min(count, params.capacity - index);
    __global int *singles = lists.tiles + params.tiles_x * params.tiles_y;
    int end = 0, place = 0; // of a run within one tile
    for (int lane = 0; lane < capacity; ++lane) {
        if (tile[lane] >= 0) {
            for (int i = 0; i < RASTER_RECORD / 4; ++i) {
                lists.records[(index + lane) * (RASTER_RECORD / 4) + i] = quads[i][lane];
            }
            if (lane >= end) {
                for (end = lane + 1; end < capacity && tile[end] == tile[lane]; ++end) {
                }
                place = atomic_add(singles + tile[lane], end - lane);
            }
            lists.places[index + lane] = (int2)(tile[lane], place++);
            continue;
        }
        const int4 first = quads[0][lane], second = quads[1][lane], third = quads[2][lane];
        RasterRecord record;
        record.v[0] = first.xy;
        record.v[1] = first.zw;
        record.v[2] = second.xy;
        record.d = (float3)(as_float(second.z), as_float(second.w), as_float(third.x));
        record.range = (float2)(as_float(third.y), as_float(third.z));
        record.triangle = third.w;
        const int n = record.triangle, stride = mesh.stride;
        // What is ready shows its front, and may have been turned round.
        const bool culled = params.back != 0 && !ready[lane] && mesh.corners[3 * stride + n];
        const int back = culled ? params.back : 0;
        if (clip[lane]) {
#if RASTER_RUN == 1
            pending = (RasterPending){record, back, true};
#else
            RasterPolygon polygon;
            raster_clip_triangle(mesh, &polygon, record, back, lists, camera, params);
#endif
            // The pieces have records of their own.
            record.v[0] = record.v[1] = record.v[2];
        }
        raster_append(record, index + lane, back, lists, params);
    }
    return pending;
}

__kernel void raster_setup(__global const float *restrict boxes,
                           __global const int *restrict corners,
                           __global const float *restrict vertices,
                           __global const float *restrict view, __global const int *restrict screen,
                           __global int4 *restrict records, __global int2 *restrict places,
                           __global int *restrict tiles, __global int *restrict counters,
                           const int2 size, const SsgiCamera camera, const RasterView params)
{
    const int first = (int)get_global_id(0) * RASTER_RUN;
    const bool seen =
        first < size.x && !raster_unseen(camera, params, raster_box(boxes, first / RASTER_BOXED));
    const RasterMesh mesh = {corners, (size.x + 15) & ~15, vertices, view, screen};
    const RasterLists lists = {records, places, tiles, counters};
#if RASTER_RUN == 1
    __local float rings[RASTER_QUEUE * 3 * RASTER_RINGS];
    __local int clipped; // triangles of the work-group
    if (get_local_id(0) == 0) {
        clipped = 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    RasterPending pending;
    pending.clips = false;
#else
    int kept[RASTER_RUN];
    int count = 0;
#endif
    for (int i = first; i < min(first + RASTER_RUN, size.x) && seen; i += SSGI_LANES) {
        const RasterScreen t = raster_screen(
            screen, params, v_iload(corners + i), v_iload(corners + mesh.stride + i),
            v_iload(corners + 2 * mesh.stride + i), v_iload(corners + 3 * mesh.stride + i));
        const vmask wanted = v_ilt(v_iota() + i, v_splat_int(size.x)) & (t.ready | t.wide | t.clip);
        if (!v_any(wanted)) {
            continue;
        }
        int keep[SSGI_LANES];
        v_ikeep(wanted & ~(t.ready & raster_between(t)), keep);
#if RASTER_RUN == 1
        if (keep[0]) {
            pending = raster_records(&i, 1, mesh, lists, camera, params);
        }
#else
        // Without branches, which would be guessed wrongly.
        for (int lane = 0; lane < SSGI_LANES; ++lane) {
            kept[count] = i + lane;
            count -= keep[lane];
        }
#endif
    }
#if RASTER_RUN == 1
    const int turn = pending.clips ? atomic_inc(&clipped) : -1;
    barrier(CLK_LOCAL_MEM_FENCE);
    const int turns = clipped;
    for (int begin = 0; begin < turns; begin += RASTER_RINGS) {
        if (turn >= begin && turn < begin + RASTER_RINGS) {
            RasterPolygon polygon;
            polygon.at = rings + (turn - begin);
            raster_clip_triangle(mesh, &polygon, pending.record, pending.back, lists, camera,
                                 params);
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
#else
    for (int i = 0; i < count; i += SSGI_LANES) {
        raster_records(kept + i, min(count - i, SSGI_LANES), mesh, lists, camera, params);
    }
#endif
}
