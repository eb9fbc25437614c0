// SPDX-License-Identifier: MIT
// tonemap: linear radiance to an sRGB-encoded picture.
//
// Method:  exposure, then a filmic curve (Narkowicz 2015, a fit of the ACES reference transform:
//          x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14)) or none, then IEC 61966-2-1.
// Reads:   radiance  3 x [rows, columns] linear, >= 0
// Writes:  encoded   [rows][pitch][3] bytes red, green and blue, or as many of 16 bits; pitch is
//                    columns, rounded up to 16; beyond the columns undefined
// Macros:  TONEMAP_CURVE (0 clip at 1, 1 filmic), TONEMAP_BITS (8 or 16)
// Launch:  SSGI_LANES pixels of a row per work-item

#include "common/gbuffer.clh"

#if !defined(TONEMAP_CURVE) || !defined(TONEMAP_BITS)
#error "TONEMAP_CURVE and TONEMAP_BITS must be defined by the host"
#endif

// Write three values of each lane, one pixel after the other, from pixel number `first` on.
static inline void tonemap_store(const vint red, const vint green, const vint blue,
                                 __global uint *restrict encoded, const int first)
{
#if TONEMAP_BITS == 16
    int value[3][SSGI_LANES];
    v_ikeep(red, value[0]);
    v_ikeep(green, value[1]);
    v_ikeep(blue, value[2]);
    __global ushort *restrict to = (__global ushort *)encoded + first * 3;
    for (int i = 0; i < SSGI_LANES; ++i) {
        for (int c = 0; c < 3; ++c) {
            to[3 * i + c] = (ushort)value[c][i];
        }
    }
#elif SSGI_LANES == 1
    __global uchar *restrict to = (__global uchar *)encoded + first * 3;
    to[0] = (uchar)red;
    to[1] = (uchar)green;
    to[2] = (uchar)blue;
#else
    // Four pixels of three bytes are three words; the first byte of a word is its lowest.
    uint pixel[SSGI_LANES];
    SSGI_V(vstore)(SSGI_V(as_uint)(red | green << 8 | blue << 16), 0, pixel);
    __global uint *restrict words = encoded + first / 4 * 3;
    for (int i = 0; i < SSGI_LANES; i += 4, words += 3) {
        words[0] = pixel[i] | pixel[i + 1] << 24;
        words[1] = pixel[i + 1] >> 8 | pixel[i + 2] << 16;
        words[2] = pixel[i + 2] >> 16 | pixel[i + 3] << 8;
    }
#endif
}

__kernel void tonemap(ssgi_plane radiance, __global uint *restrict encoded, const int2 size,
                      const float exposure)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    vint coded[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        vfloat v = v_clamp(ssgi_load(radiance, size, c, x, y) * exposure, 0.0f, 1e6f);
#if TONEMAP_CURVE
        v = v * (2.51f * v + 0.03f) / (v * (2.43f * v + 0.59f) + 0.14f);
#endif
        v = v_min(v, v_splat(1.0f));
        const vfloat high =
            v_fma(v_pow(v, v_splat(1.0f / 2.4f)), v_splat(1.055f), v_splat(-0.055f));
        const vfloat s = v_select(high, v * 12.92f, v_le(v, v_splat(0.0031308f)));
        const float most = (float)((1 << TONEMAP_BITS) - 1);
        coded[c] = v_to_int(v_fma(s, v_splat(most), v_splat(0.5f)));
    }
    const int pitch = (size.x + 15) & ~15;
    tonemap_store(coded[0], coded[1], coded[2], encoded, y * pitch + x);
}
