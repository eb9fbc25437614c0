// SPDX-License-Identifier: MIT
// layer_shading: radiance of the surfaces of one layer, on the side that the camera sees or, with
// `facing` -1, on the other.
//
// L = albedo / pi (E_lights + A E_ambient) + emission.
// Reads:   depth, normal, albedo, emission  with margin: image `layer`, or 3 layer + c
//          lights     3 x [rows, columns] W/m^2 of this layer (LAYERS_LIGHTS 1)
//          visibility  image 0: A of every LAYERS_STEP-th pixel without margin (LAYERS_VISIBILITY
//                      1)
//          ambient   W/m^2 (LAYERS_AMBIENT 1), see direct/ambient.clh
// Writes:  radiance  images `image` + c, W m^-2 sr^-1; 0 where nothing is (LAYERS_RECORDS 0)
//          records   layer `image` of records, see direct/records.clh, where something is
//                    (LAYERS_RECORDS 1)
// Macros:  LAYERS_LIGHTS, LAYERS_AMBIENT, LAYERS_VISIBILITY, LAYERS_EMISSION, LAYERS_RECORDS (0,
//          1); LAYERS_STEP; AMBIENT_SIZE, see `ambient`
// Params:  view to world rotation, margin; open_size columns and rows of `visibility`
// Launch:  SSGI_LANES pixels of a row per work-item
// Cost:    memory: 13 planes read, 3 or 4 written; one scattered read per pixel with visibility

#include "common/gbuffer.clh"
#include "direct/records.clh"
#include "raster/quads.clh"
#include "direct/ambient.clh"

#if !defined(LAYERS_LIGHTS) || !defined(LAYERS_AMBIENT) || !defined(LAYERS_VISIBILITY) ||          \
    !defined(LAYERS_EMISSION) || !defined(LAYERS_RECORDS) || !defined(LAYERS_STEP) ||              \
    !defined(AMBIENT_SIZE)
#error "LAYERS_LIGHTS, _AMBIENT, _VISIBILITY, _EMISSION, _RECORDS, _STEP,
AMBIENT_SIZE must be defined "
#endif

    __kernel void layer_shading(ssgi_plane depth, ssgi_plane normal, ssgi_plane albedo,
#if LAYERS_EMISSION
                                ssgi_plane emission,
#endif
#if LAYERS_LIGHTS
                                ssgi_plane punctual_lights,
#endif
#if LAYERS_VISIBILITY
                                ssgi_plane visibility,
#endif
#if LAYERS_AMBIENT
                                __global const float *restrict ambient,
#endif
#if LAYERS_RECORDS
                                __global int *restrict records,
#else
                            __global float *restrict radiance,
#endif
                                const int2 size, const LitParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    const int first = 3 * params.layer;
    const vfloat zero = v_splat(0.0f);
    const vmask there = v_lt(ssgi_load(depth, size, params.layer, x, y), v_splat(INFINITY));
    if (!v_any(there)) {
#if !LAYERS_RECORDS
        for (int c = 0; c < 3; ++c) {
            ssgi_store(zero, radiance, size, params.image + c, x, y, 0.0f);
        }
#endif
        return;
    }
#if LAYERS_AMBIENT || LAYERS_RECORDS
    const vfloat vx = ssgi_load(normal, size, first, x, y) * params.facing;
    const vfloat vy = ssgi_load(normal, size, first + 1, x, y) * params.facing;
    const vfloat vz = ssgi_load(normal, size, first + 2, x, y) * params.facing;
#endif
#if LAYERS_AMBIENT
    const vfloat nx = params.xx * vx + params.xy * vy + params.xz * vz;
    const vfloat ny = params.yx * vx + params.yy * vy + params.yz * vz;
    const vfloat nz = params.zx * vx + params.zy * vy + params.zz * vz;
#if LAYERS_VISIBILITY
    // The nearest pixel that has one; the margin takes the border's.
    const int2 open_size = (int2)(params.open_columns, params.open_rows);
    const vint column =
        (v_iclamp(v_iota() + (x - params.margin_columns), 0, open_size.x * LAYERS_STEP - 1) +
         (LAYERS_STEP / 2)) /
        LAYERS_STEP;
    const int row =
        (clamp(y - params.margin_rows, 0, open_size.y * LAYERS_STEP - 1) + LAYERS_STEP / 2) /
        LAYERS_STEP;
    const vfloat a =
        ssgi_gather(visibility, open_size, 0, v_imin(column, v_splat_int(open_size.x - 1)),
                    v_splat_int(min(row, open_size.y - 1)));
#endif
#endif
    vfloat sent[3];
#if LAYERS_AMBIENT
    vfloat environment[3];
    ssgi_ambient(ambient, nx, ny, nz, environment);
#endif
    for (int c = 0; c < 3; ++c) {
        vfloat light = zero;
#if LAYERS_AMBIENT
        light = environment[c];
#if LAYERS_VISIBILITY
        light = light * a;
#endif
#endif
#if LAYERS_LIGHTS
        light = light + ssgi_load(punctual_lights, size, c, x, y);
#endif
        vfloat sum = ssgi_load(albedo, size, first + c, x, y) * light * M_1_PI_F;
#if LAYERS_EMISSION
        sum = sum + ssgi_load(emission, size, first + c, x, y);
#endif
        sent[c] = v_select(zero, sum, there);
    }
#if LAYERS_RECORDS
    const vint place = ssgi_record(size, v_splat_int(params.image), v_splat_int(x), v_splat_int(y));
    raster_store_quads((RasterQuad){v_bits(sent[0]), v_bits(sent[1]), v_bits(sent[2]),
                                    ssgi_packed_normal(vx, vy, vz)},
                       records + 4 * v_first(place));
#else
    for (int c = 0; c < 3; ++c) {
        ssgi_store(sent[c], radiance, size, params.image + c, x, y, 0.0f);
    }
#endif
}
