// SPDX-License-Identifier: MIT
// sky_rays: irradiance by environments from rays to the parts of the sphere that send light.
//
// Method:  stratified sampling. The parts that sent light to any pixel near by share the rays, in
//          proportion to what each would give with nothing in its way; quarters of a part that did
//          not have SKY_UNSEEN times as many for what they would give. An estimate is all that
//          would be given, over the probability of the ray, where that arrives. Without blockers
//          it is exact for any number of rays. Every SKY_ROWS-th row is estimated; sky_blur makes
//          the image.
// Reads:   depth, normal  with margin; normal in view space
//          sought     see sky_spread.cl
//          strata, points, nodes, triangles; cutouts, textures, texels, decode (SKY_HOLES 1): see
//          strata.clh, rays/bvh.clh
// Writes:  sampled    SKY_CHANNELS + 1 x [rows / SKY_ROWS, columns]: W/m^2, or with one channel its
//                     luminance; of blocked rays 1 / width of what they shade, in scene units, 0
//                     where none is
// Macros:  SKY_WORDS (4..32), SKY_RAYS (1..16), SKY_CHANNELS (1 or 3), SKY_HOLES (0 or 1)
// Launch:  SSGI_LANES pixels of every SKY_ROWS-th row per work-item
// Cost:    SKY_RAYS rays and 25 operations for each part that sends light

#if SKY_HOLES
#define RAYS_HOLES
#endif
#include "sky_rays/strata.clh"

#if !defined(SKY_RAYS) || !defined(SKY_CHANNELS)
#error "SKY_RAYS and SKY_CHANNELS must be defined by the host"
#endif
#if !defined(SKY_NOISE) || !defined(SKY_ROWS)
#error "ssgi_cl/device/constants.py defines SKY_NOISE and SKY_ROWS"
#endif
#define SKY_UNSEEN 0.25f

// Bits of the quarters of a part of which light came.
static inline uint sky_quarters(__global const int *restrict live, const int stratum)
{
    return (uint)live[stratum / 8] >> stratum % 8 * 4 & 15;
}

// Of a part of which light came from these quarters, what is left of its share of rays.
static inline float sky_share(const uint quarters)
{
    return 0.25f * SKY_UNSEEN * 4.0f + 0.25f * (1.0f - SKY_UNSEEN) * (float)popcount(quarters);
}

__kernel void sky_rays(ssgi_plane depth, ssgi_plane normal, __global const float *restrict strata,
                       __global const float *restrict points, __global const float *restrict nodes,
                       __global const float *restrict triangles,
#if SKY_HOLES
                       __global const float *restrict cutouts,
                       __global const int *restrict textures, __global const int *restrict texels,
                       __global const float *restrict decode,
#endif
                       __global const float *restrict noise, __global const int *restrict sought,
                       __global float *restrict sampled, const int2 size, const SsgiCamera camera,
                       const SkyParams params)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1) * SKY_ROWS;
    if (x >= size.x || y >= size.y) {
        return;
    }
#if SKY_HOLES
    const RaysHoles holes = {cutouts, {textures, texels, decode}};
#else
    const RaysHoles holes = 0;
#endif
    const int2 few = (int2)(size.x, (size.y - 1) / SKY_ROWS + 1);
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const SkyPoint p = sky_point(depth, normal, size, x, y, camera, params);
    vfloat got[SKY_CHANNELS], meant = zero, width = zero, hits = zero;
    for (int j = 0; j < SKY_CHANNELS; ++j) {
        got[j] = zero;
    }
    if (v_any(p.there)) {
        __global const int *restrict live = sought + sky_cell(size, x, y) / 4 * 5;
        vfloat total = zero, whole = zero, open = zero;
        for (int w = 0; w < SKY_WORDS / 4; ++w) {
            for (uint bits = (uint)live[SKY_WORDS + w]; bits != 0; bits &= bits - 1) {
                const int s = w * 32 + v_lowest_bit(bits);
                const float share = sky_share(sky_quarters(live, s));
                __global const float *restrict stratum = strata + s * SKY_STRATUM;
                const vfloat given = sky_given(stratum, p);
                total = v_fma(sky_chance(stratum, p), v_splat(share), total);
                whole = whole + given;
                open = open + v_select(zero, v_splat(stratum[9] * share), v_gt(given, zero));
            }
        }
        meant = v_select(zero, one, p.there); // where no part sends light that is what arrives
        const vmask lit = p.there & v_gt(total, zero);
        if (v_any(lit)) {
            vfloat place[SKY_RAYS], weight[SKY_RAYS], rest[SKY_RAYS];
            vint chosen[SKY_RAYS];
            const vfloat start =
                v_load(noise + (y % SKY_NOISE / SKY_ROWS) * (SKY_NOISE + 16) + x % SKY_NOISE);
            for (int i = 0; i < SKY_RAYS; ++i) {
                place[i] = (start + (float)i) * (1.0f / SKY_RAYS) * total;
                chosen[i] = v_splat_int(0);
                weight[i] = rest[i] = zero;
            }
            meant = v_select(meant, zero, lit);
            vfloat sum = zero;
            for (int w = 0; w < SKY_WORDS / 4; ++w) {
                for (uint bits = (uint)live[SKY_WORDS + w]; bits != 0; bits &= bits - 1) {
                    const int s = w * 32 + v_lowest_bit(bits);
                    const uint quarters = sky_quarters(live, s);
                    const vfloat chance = sky_chance(strata + s * SKY_STRATUM, p);
                    const vfloat per = strata[s * SKY_STRATUM + 3] / v_max(chance, v_splat(1e-30f));
                    for (int q = 0; q < 4; ++q) {
                        const float share = quarters >> q & 1 ? 0.25f : 0.25f * SKY_UNSEEN;
                        for (int i = 0; i < SKY_RAYS; ++i) {
                            const vmask taken = v_ge(place[i], sum) & v_gt(chance, zero);
                            rest[i] = v_select(
                                rest[i], (place[i] - sum) / v_max(chance * share, v_splat(1e-30f)),
                                taken);
                            chosen[i] = v_iselect(chosen[i], v_splat_int(s * 4 + q), taken);
                            weight[i] = v_select(weight[i], per * (0.25f / share), taken);
                        }
                        sum = v_fma(chance, v_splat(share), sum);
                    }
                }
            }
            const vfloat scale = total / v_max(whole, v_splat(1e-30f)) * (1.0f / SKY_RAYS);
            const vfloat per = v_rsqrt(v_max(v_min(open, one), v_splat(1e-6f)));
            for (int i = 0; i < SKY_RAYS; ++i) {
                const vint point =
                    v_iclamp(v_to_int(rest[i] * (SKY_POINTS / 4)), 0, SKY_POINTS / 4 - 1);
                const SkyRay to =
                    sky_ray(points, (point + chosen[i] * (SKY_POINTS / 4)) * 3, p, params);
                // Of what all directions of the part give in the mean.
                const vfloat own = v_max(to.cosine, zero) * weight[i];
                const vmask wanted = lit & v_gt(own, zero);
                vfloat part;
                const vmask blocked =
                    rays_blocked_at(nodes, triangles, holes, to.ray, wanted, &part);
                const vfloat near = per / v_max(part * params.far, v_splat(params.lift));
                width = width + v_select(zero, near, blocked);
                hits = hits + v_select(zero, one, blocked);
                meant = v_fma(own, scale, meant);
                const vfloat arrived =
                    v_select(zero, own * total, wanted & ~blocked) * (1.0f / SKY_RAYS);
#if SKY_CHANNELS == 1
                got[0] = got[0] + arrived;
#else
                const vint colour = chosen[i] / 4 * SKY_STRATUM + 4;
                for (int j = 0; j < 3; ++j) {
                    got[j] = v_fma(arrived, v_gather(strata + j, colour), got[j]);
                }
#endif
            }
        }
    }
    for (int j = 0; j < SKY_CHANNELS; ++j) {
        ssgi_store(got[j], sampled, few, j, x, y / SKY_ROWS, 0.0f);
    }
    ssgi_store(meant, sampled, few, SKY_CHANNELS, x, y / SKY_ROWS, 0.0f);
    ssgi_store(width / v_max(hits, one), sampled, few, SKY_CHANNELS + 1, x, y / SKY_ROWS, 0.0f);
}
