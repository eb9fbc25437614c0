// SPDX-License-Identifier: MIT
// raster_thickness: how far closed surfaces reach behind what is seen of them.
//
// From the front, a layer that shows an outer side begins a solid, and one that shows an inner side
// ends one: where as many end as began, the solids are left, at the latest where the first inner
// sides in a row end. More may have begun where solids touch, of which one layer shows the inner
// side of one and the outer side of the other. A solid that no layer ends is left at the first
// inner side behind the last layer.
//
// Reads:   depth  THICKNESS_LAYERS x [rows, columns], scene units; INFINITY where nothing is
//          backs  [rows, columns] depth of the first inner side behind the last layer, INFINITY
//                 where there is none
// Writes:  thickness  THICKNESS_LAYERS x [rows, columns], scene units: 0 for an inner side; -1
//                     where it is not known; holds the side that each layer shows before, see
//                     raster_attributes
// Macros:  THICKNESS_LAYERS (>= 1)
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    memory: 3 planes a layer and 1

#include "common/gbuffer.clh"

#ifndef THICKNESS_LAYERS
#error "THICKNESS_LAYERS must be defined by the host"
#endif

// The side that a layer shows; layers are drawn where anything may be seen alone.
static inline vfloat raster_turned(__global const float *thickness, const vfloat depth,
                                   const int2 size, const int layer, const int x, const int y)
{
    return v_select(v_splat(0.0f), v_load(thickness + ssgi_index(size, layer, x, y)),
                    v_lt(depth, v_splat(INFINITY)));
}

__kernel void raster_thickness(ssgi_plane depth, ssgi_plane backs,
                               __global float *restrict thickness, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const vfloat zero = v_splat(0.0f), none = v_splat(-1.0f);
    vfloat begun = zero; // solids that the layers so far began and did not end
    for (int layer = 0; layer < THICKNESS_LAYERS; ++layer) {
        const vfloat own = ssgi_load(depth, size, layer, x, y);
        const vfloat side = raster_turned(thickness, own, size, layer, x, y);
        const vmask outer = v_gt(side, zero), inner = v_lt(side, zero);
        vfloat found = v_select(none, zero, inner & v_gt(begun, zero));
        if (v_any(outer)) {
            vfloat inside = v_splat(1.0f), end = ssgi_load(backs, size, 0, x, y);
            vmask open = outer, ending = v_splat_int(0);
            for (int other = layer + 1; other < THICKNESS_LAYERS && v_any(open); ++other) {
                const vfloat at = ssgi_load(depth, size, other, x, y);
                const vfloat turned = raster_turned(thickness, at, size, other, x, y);
                inside = inside + turned;
                const vmask ends = open & v_lt(turned, zero);
                open = open & ~(ending & v_gt(turned, zero));
                end = v_select(end, at, ends);
                ending = ending | ends;
                open = open & v_gt(inside, zero);
            }
            found = v_select(found, end - own, outer & v_lt(end, v_splat(INFINITY)));
        }
        begun = v_max(begun + side, zero);
        ssgi_store(v_max(found, none), thickness, size, layer, x, y, 0.0f);
    }
}
