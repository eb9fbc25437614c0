// SPDX-License-Identifier: MIT
// vpl_splat: irradiance by virtual point lights, each tile by its list of them.
//
// Method:  Keller 1997, "Instant Radiosity"; Dachsbacher and Stamminger 2006, "Splatting Indirect
//          Illumination". E = sum over lights of flux * w with the form factor of a point and a
//          disc of the light's area A, w = cos cos / (pi d^2 + A) (Nichols and Wyman 2009).
// Departs: the cutoff fades w linearly from 2 cutoff down to cutoff, so that splats have no edge.
// Reads:   depth   [rows, columns] with margin, scene units; INFINITY where nothing is
//          normal  3 x [rows, columns] with margin, view space, unit length
//          lights  [segments][params.span][VPL_FLOATS]
//          lists   [tiles][params.capacity] and counts [tiles], see vpl_lists
// Writes:  irradiance  3 x [rows, columns], W/m^2; 0 where nothing is
// Macros:  VPL_NEAR (0 disc, 1 clamped: max(pi d^2, A) for the sum), VPL_CUT (0, 1; 2: what 1
//          leaves out), VPL_LISTS (0: all lights, 1), VPL_ADD (1: to what is there), VPL_PARTS (1:
//          as in vpl_lists, with VPL_LISTS), VPL_ROWS (of a work-item, 1 to 16, divides 16),
//          VPL_GLOSSY (0 diffuse lights, 1 with Phong lobes)
// Launch:  SSGI_LANES pixels of VPL_ROWS rows per work-item
// Cost:    24 operations and a division per pixel and light, of lobes 70, four and a root

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "vpl/light.clh"
#include "vpl/lobe.clh"
#include "vpl/receiver.clh"

#if !defined(VPL_NEAR) || !defined(VPL_CUT) || !defined(VPL_LISTS) || !defined(VPL_ADD) ||         \
    !defined(VPL_PARTS) || !defined(VPL_ROWS) || !defined(VPL_GLOSSY)
#error "VPL_NEAR, _CUT, _LISTS, _ADD, _PARTS, _ROWS and _GLOSSY must be defined"
#endif

#ifndef VPL_TERMS
#error "ssgi_cl/device/constants.py defines VPL_TERMS"
#endif

__kernel void vpl_splat(ssgi_plane depth, ssgi_plane normal, __global const float *restrict lights,
                        __global const int *restrict lists, __global const int *restrict counts,
                        __global float *restrict irradiance, const int2 size,
                        const SsgiCamera camera, const VplParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1) * VPL_ROWS;
    if (x >= size.x || y >= size.y) {
        return;
    }
    __global const float *restrict own = lights + params.segment * params.span * VPL_FLOATS;
    const vfloat zero = v_splat(0.0f);
    VplReceiver at[VPL_ROWS];
    vfloat sum[VPL_ROWS][3];
    vmask any = v_splat_int(0);
    for (int r = 0; r < VPL_ROWS; ++r) {
        at[r] = vpl_receiver(depth, normal, size, camera, params, x, min(y + r, size.y - 1));
        any = any | at[r].there;
        sum[r][0] = sum[r][1] = sum[r][2] = zero;
    }
#if VPL_LISTS
    const int tile = y / VPL_TILE * vpl_tiles(size).x + x / VPL_TILE;
    const int listed = counts[tile];
    __global const int *restrict list = lists + tile * params.capacity;
#else
    const int listed = params.count;
#endif
    const int count = v_any(any) ? listed : 0;
    for (int start = 0; start < count; start += VPL_TERMS) {
        const int end = min(start + VPL_TERMS, count);
        vfloat part[VPL_ROWS][3];
        for (int r = 0; r < VPL_ROWS; ++r) {
            part[r][0] = part[r][1] = part[r][2] = zero;
        }
        for (int i = start; i < end; ++i) {
#if VPL_LISTS
            const int listed_number = list[i];
            const int number = listed_number < 0 ? -1 - listed_number : listed_number;
            __global const float *restrict light = own + number * VPL_FLOATS;
#else
            __global const float *restrict light = own + i * VPL_FLOATS;
#endif
            for (int r = 0; r < VPL_ROWS; ++r) {
                vfloat w = VPL_WEIGHT(light, at[r], params);
#if VPL_PARTS
                if (number >= params.stride) {
                    const int whole = (number - params.stride) / 16;
                    w = w * vpl_parts_share(own + whole * VPL_FLOATS, at[r], params);
                } else if (listed_number < 0) {
                    w = w * (1.0f - vpl_parts_share(light, at[r], params));
                }
#endif
                for (int j = 0; j < 3; ++j) {
                    part[r][j] = v_fma(w, v_splat(light[8 + j]), part[r][j]);
                }
            }
        }
        for (int r = 0; r < VPL_ROWS; ++r) {
            for (int j = 0; j < 3; ++j) {
                sum[r][j] = sum[r][j] + part[r][j];
            }
        }
    }
    for (int r = 0; r < VPL_ROWS && y + r < size.y; ++r) {
        for (int j = 0; j < 3; ++j) {
            vfloat value =
                v_min(v_select(zero, sum[r][j], at[r].there) * params.gain, v_splat(VPL_BRIGHTEST));
#if VPL_ADD
            value = value + v_load(irradiance + ssgi_index(size, j, x, y + r));
#endif
            ssgi_store(value, irradiance, size, j, x, y + r, 0.0f);
        }
    }
}
