// SPDX-License-Identifier: MIT
// vpl_view_importance: irradiance of the image by the texels of a reflective shadow map, per watt.
//
// Method:  Georgiev and Slusallek 2010, "Simple and Robust Iterative Importance Sampling of Virtual
//          Point Lights": lights are to be where their light reaches what the camera sees. Of four
//          lit texels one sends a shadow ray to one pixel, of a sequence that spreads any number of
//          consecutive ones over the image (Roberts 2018, the R2 sequence). The irradiance that a
//          watt gives there counts, with what is closer than a 16th of the grid taken to be a disc
//          of that radius, so that no pixel counts for all.
// Reads:   position  3 x [rows, columns] of the map, scene units from its origin
//          normal    3 x [rows, columns]
//          flux      3 x [rows, columns] W
//          order     see vpl_partial_sums
//          depth, seen_normal  of the G-buffer, with margin; view space
//          occupancy, grid_box  see occupancy/grid.clh
// Writes:  importance  [2][params.runs]: sums over the texels of a run that sent a ray, and how
//                      many these are
// Macros:  OCCUPANCY_CELLS
// Params:  camera and size of the image; from the map's positions to view space in lengths of
//          vpl.per_unit
// Launch:  SSGI_LANES runs per work-item
// Cost:    4 rays a run

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/curve.clh"
#include "occupancy/grid.clh"
#include "vpl/receiver.clh"

#define VPL_EVERY 4    // texels of a run, of which one sends a ray
#define VPL_R2_X 24735 // 2^15 over the plastic number, and over its square, rounded to odd numbers
#define VPL_R2_Y 18673
#define VPL_R2_MASK 0x7fff

__kernel void vpl_view_importance(ssgi_plane position, ssgi_plane normal, ssgi_plane flux,
                                  __global const int *restrict order, ssgi_plane depth,
                                  ssgi_plane seen_normal, __global const int *restrict occupancy,
                                  __global const float *restrict grid_box,
                                  __global float *restrict importance,
                                  const int2 size, // of the map
                                  const SsgiCamera camera, const VplParams vpl,
                                  const VplCurveParams params, const ToViewParams turn,
                                  const int columns, const int rows)
{
    const int first = ssgi_first_column();
    if (first >= params.map_runs) {
        return;
    }
    const vfloat zero = v_splat(0.0f);
    const vint run = v_iota() + first;
    const vint face = run / params.face_runs;
    const vmask in_map = v_ilt(face, v_splat_int(params.faces));
    const vint own = v_iselect(v_splat_int(0), run - face * params.face_runs, in_map);
    const vint top = v_iselect(v_splat_int(0), face * params.face_rows, in_map);
    const float near = (float)OCCUPANCY_CELLS / 16.0f / grid_box[3];
    vfloat sum = zero, count = zero;
    for (int i = 0; i < VPL_RUN; i += VPL_EVERY) {
        const vint k = (run & (VPL_EVERY - 1)) + i;
        const vint packed = v_igather(order, own * VPL_RUN + k);
        const vmask there = in_map & v_ige(packed, v_splat_int(0));
        const vint texel = v_iselect(v_splat_int(0), packed, there);
        const vint x = texel & 0xffff;
        const vint y = (texel >> 16) + top;
        const vmask lit =
            there &
            v_gt(v_max(ssgi_gather(flux, size, 0, x, y),
                       v_max(ssgi_gather(flux, size, 1, x, y), ssgi_gather(flux, size, 2, x, y))),
                 zero);
        if (!v_any(lit)) {
            continue;
        }
        count = count + v_select(zero, v_splat(1.0f), lit);
        const vfloat p[3] = {ssgi_gather(position, size, 0, x, y),
                             ssgi_gather(position, size, 1, x, y),
                             ssgi_gather(position, size, 2, x, y)};
        const vfloat n[3] = {ssgi_gather(normal, size, 0, x, y), ssgi_gather(normal, size, 1, x, y),
                             ssgi_gather(normal, size, 2, x, y)};
        const float unit = vpl.per_unit;
        const vfloat lx = (p[0] * turn.xx + p[1] * turn.xy + p[2] * turn.xz + turn.x) * unit;
        const vfloat ly = (p[0] * turn.yx + p[1] * turn.yy + p[2] * turn.yz + turn.y) * unit;
        const vfloat lz = (p[0] * turn.zx + p[1] * turn.zy + p[2] * turn.zz + turn.z) * unit;
        const vfloat mx = n[0] * turn.xx + n[1] * turn.xy + n[2] * turn.xz;
        const vfloat my = n[0] * turn.yx + n[1] * turn.yy + n[2] * turn.yz;
        const vfloat mz = n[0] * turn.zx + n[1] * turn.zy + n[2] * turn.zz;
        const vint number =
            ((run + params.first_run) * (VPL_RUN / VPL_EVERY) + i / VPL_EVERY) & VPL_R2_MASK;
        const vint column = (number * VPL_R2_X & VPL_R2_MASK) * columns >> 15;
        const vint row = (number * VPL_R2_Y & VPL_R2_MASK) * rows >> 15;
        const VplReceiver at =
            vpl_receiver_at(depth, seen_normal, (int2)(columns, rows), camera, vpl, column, row);
        const vfloat dx = lx - at.x, dy = ly - at.y, dz = lz - at.z;
        const vfloat d2 = v_max(v_fma(dx, dx, v_fma(dy, dy, dz * dz)), v_splat(1e-24f));
        const vfloat received = v_max(v_fma(dx, at.nx, v_fma(dy, at.ny, dz * at.nz)), zero);
        const vfloat emitted = v_max(-v_fma(dx, mx, v_fma(dy, my, dz * mz)), zero);
        const vfloat w = received * emitted / (d2 * 3.14159265f * (d2 + near * near));
        const vmask wanted = lit & at.there & v_gt(w, zero);
        if (!v_any(wanted)) {
            continue;
        }
        const OccupancyCell start = occupancy_cell(at.x, at.y, at.z, at.nx, at.ny, at.nz, grid_box);
        const OccupancyCell end = occupancy_cell(lx, ly, lz, mx, my, mz, grid_box);
        sum = sum + v_select(zero, w, wanted & ~occupancy_blocked(occupancy, start, end, wanted));
    }
    v_store(sum, importance + params.first_run + first);
    v_store(count, importance + params.runs + params.first_run + first);
}
