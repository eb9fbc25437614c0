// SPDX-License-Identifier: MIT
// tiles_open: which tiles are open: ambient occlusion is exactly 1 in each of their pixels.
//
// A tile is open if it is empty; if the radius covers less than a pixel; or if it is flat: nothing
// within reach rises above any of its pixels' tangent planes. On a plane v (tiles/summary.clh) is
// linear in the pixel position, so that planes which bound a tile from above and tangent planes
// from below compare at the corners of the tiles within reach. What is on the very plane differs by
// roundings: it may rise by a part of the bias that techniques have against the same.
// With TILES_PIECES taps stand for pieces of their planes (ssdo_bitmask/pieces.clh): all that is
// within reach must be flat and of one layer, and its planes are compared as far beyond their tiles
// as pieces go.
// Reads:   summary  TILES_COUNT x [rows of tiles, columns of tiles], those of the margin too
// Writes:  open   [rows of tiles, columns of tiles] of the image: bits of tiles/open.clh
// Macros:  TILES_PIECES (0, 1)
// Params:  slopes of view rays by the image's pixel; reach in pixels and its limits, slack
//          relative to v; see ssgi_cl.techniques.tiles.Reach
// Launch:  a tile per work-item
// Cost:    7 loads and 50 operations for each tile within reach, up to the first that rises

#include "common/gbuffer.clh"
#include "tiles/open.clh"

#ifndef TILES_PIECES
#error "TILES_PIECES must be defined by the host"
#endif

// The struct TileParams is generated from ssgi_cl.techniques.tiles.

#define TILES_ROUNDING 4e-7f    // of a height, relative to the distance from the eye
#define TILES_FARTHEST_REACH 16 // tiles: beyond, a proof would take longer than it saves
#define TILES_HORIZON 1e-3f     // of v: what pieces are at least; 1 - PIECES_FARTHEST

// The pixel of a tile's side, from its middle, or so far beyond.
static inline float tiles_end(const int last, const float beyond)
{
    return last != 0 ? (float)(TILES_SIDE - 1 - TILES_MIDDLE) + beyond
                     : (float)-TILES_MIDDLE - beyond;
}

// By how much a length across a view ray is longer in the image than it is in its middle, at
// most, in the tiles from this column on that scan together.
static inline float tiles_slant(const TileParams params, const int tile_x, const int tile_y)
{
    const float first = (float)(tile_x * TILES_SIDE), top = (float)(tile_y * TILES_SIDE);
    const float last = first + (float)(max(params.group, 1) * TILES_SIDE);
    const float x =
        max(fabs(fma(params.to_x, first, params.at_x)), fabs(fma(params.to_x, last, params.at_x)));
    const float y = max(fabs(fma(params.to_y, top, params.at_y)),
                        fabs(fma(params.to_y, top + TILES_SIDE, params.at_y)));
    return sqrt(fma(x, x, fma(y, y, 1.0f)));
}

__kernel void tiles_open(ssgi_plane summary, __global int *restrict open, const int2 size,
                         const TileParams params)
{
    const int tile_x = (int)get_global_id(0);
    const int tile_y = (int)get_global_id(1);
    if (tile_x >= size.x || tile_y >= size.y) {
        return;
    }
    const int2 whole = (int2)(params.columns, params.rows);
    const int own_x = tile_x + params.lead_columns;
    const int own_y = tile_y + params.lead_rows;
    float own[TILES_COUNT];
    for (int image = 0; image < TILES_COUNT; ++image) {
        own[image] = as_float(v_first(v_bits(ssgi_load(summary, whole, image, own_x, own_y))));
    }
    const bool perspective = params.perspective != 0.0f;
    const float nearest = own[TILES_NEAREST];
    int found = 0;
    if (nearest == -INFINITY) {
        found = TILES_IS_OPEN;
    } else if ((perspective ? nearest : 1.0f) * params.far_px < 0.999f) {
        found = TILES_IS_OPEN | TILES_IS_FAR;
    } else if (own[TILES_BELOW] < INFINITY) {
        // Pixels that scan together reach as far as the nearest of them.
        float longest = nearest;
        const int group = tile_x / params.group * params.group + params.lead_columns;
        for (int x = group; x < min(group + params.group, whole.x); ++x) {
            longest =
                max(longest,
                    as_float(v_first(v_bits(ssgi_load(summary, whole, TILES_NEAREST, x, own_y)))));
        }
        const float along = perspective ? longest : 1.0f;
        const float slant =
            perspective ? tiles_slant(params, group - params.lead_columns, tile_y) : 1.0f;
        const float bulge = 1.0f - params.bulge * longest * params.perspective;
        const float px = slant * min(along * params.reach_px / max(bulge, 1e-3f), params.most_px);
        const int reach = (int)min(ceil((px + params.more_px) / TILES_SIDE), 1e6f);
        bool flat = reach <= TILES_FARTHEST_REACH;
        const float beyond = fma(px, params.beyond, params.beyond_px);
        const int left = max(own_x - reach, 0), right = min(own_x + reach, whole.x - 1);
        const int last = min(own_y + reach, whole.y - 1);
        for (int y = max(own_y - reach, 0); flat && y <= last; ++y) {
            for (int x = left; flat && x <= right; x += SSGI_LANES) {
                const vfloat v = ssgi_load(summary, whole, TILES_V, x, y) +
                                 ssgi_load(summary, whole, TILES_ABOVE, x, y);
                const vfloat v_x = ssgi_load(summary, whole, TILES_V_X, x, y);
                const vfloat v_y = ssgi_load(summary, whole, TILES_V_Y, x, y);
                vmask rises = v_splat_int(0);
#if TILES_PIECES
                const vmask there =
                    v_gt(ssgi_load(summary, whole, TILES_NEAREST, x, y), v_splat(-INFINITY));
                rises = v_gt(ssgi_load(summary, whole, TILES_LAYER, x, y), v_splat(1.0f)) |
                        (there &
                         ~v_lt(ssgi_load(summary, whole, TILES_BELOW, x, y), v_splat(INFINITY)));
                const vfloat turned = (ssgi_load(summary, whole, TILES_BELOW_X, x, y) +
                                       ssgi_load(summary, whole, TILES_BELOW_Y, x, y)) *
                                      beyond;
#endif
                for (int corner = 0; corner < 4; ++corner) {
                    const float i = tiles_end(corner & 1, beyond);
                    const float j = tiles_end(corner >> 1, beyond);
                    const vfloat dx = v_to_float((v_iota() + (x - own_x)) * TILES_SIDE) + i;
                    const float dy = (float)((y - own_y) * TILES_SIDE) + j;
                    const vfloat least =
                        v_fma(v_abs(dx), v_splat(-own[TILES_BELOW_X]),
                              v_fma(dx, v_splat(own[TILES_V_X]),
                                    v_splat(fma(dy, own[TILES_V_Y], own[TILES_V]) -
                                            fma(fabs(dy), own[TILES_BELOW_Y], own[TILES_BELOW]))));
                    vfloat most = v_fma(v_x, v_splat(i), v_fma(v_y, v_splat(j), v));
#if TILES_PIECES
                    most = most + turned;
                    if (perspective) {
                        most = v_max(most, v_splat(nearest * TILES_HORIZON));
                    }
                    most = v_select(v_splat(-INFINITY), most, there);
#endif
                    const vfloat base = perspective ? least : v_splat(fabs(nearest));
                    const vfloat slack = v_fma(base, v_splat(params.slack),
                                               v_splat(fabs(nearest) * -TILES_ROUNDING));
                    rises = rises | ~v_le(most - least, slack);
                }
                const vmask within = v_ile(v_iota() + x, v_splat_int(right));
                flat = !v_any(rises & within);
            }
        }
        found = flat ? TILES_IS_OPEN | TILES_IS_FLAT : 0;
    }
    open[tile_y * size.x + tile_x] = found;
}
