// SPDX-License-Identifier: MIT
// gather_smooth: irradiance at samples from what rays found at them and at their neighbours.
//
// Method:  a line in both directions of the lattice, fitted to what is found at 5 x 5 samples by
//          weighted least squares, at the middle one. A sample's weight falls to 0 where its
//          distance is GATHER_REACH harmonic mean distances of what rays meet, as light changes no
//          faster than things around turn with the place (Ward, Rubinstein and Clear 1988, "A Ray
//          Tracing Solution for Diffuse Interreflection"), and where it lies off the middle one's
//          plane or is turned. Where that distance stays the same, as along an edge of walls,
//          light does so farther: weights are 0 at GATHER_ALONG distances. Weights are in
//          proportion to the rays of a sample. Neighbours' rays differ, so that errors cancel.
// Reads:   depth, normal  of the samples' G-buffer, with margin; view space
//          list     how many samples there are, and so many times row << 16 | column
//          found    5 x [rows, columns] irradiance, W/m^2, the mean of 1 / distance, in lengths of
//                   the receivers (vpl/receiver.clh), and the number of rays: 0 where none were
//          fractions   [rows, columns] what the light counts for, see multires_interpolate
// Writes:  values   3 x [rows, columns], W/m^2: the light is added, at the samples alone
// Params:  see vpl/receiver.clh
// Launch:  any number of work-items, each of which takes every so-many-th piece of SSGI_LANES
// Cost:    9 reads and 80 operations for each of 25 neighbours

#include "common/camera.clh"
#include "common/gbuffer.clh"
#include "multires/cut.clh"

#define GATHER_WIDE 2      // neighbours on each side
#define GATHER_REACH 0.3f  // in harmonic mean distances
#define GATHER_ALONG 0.8f  // where that stays the same, as along edges
#define GATHER_SLOPE 2.0f  // 1 / its change over the way at which that counts nothing
#define GATHER_OFF 4.0f    // 1 / the height above the plane, in distances, of weight 0
#define GATHER_ALIKE 20.0f // 1 / (1 - cosine of the normals' angle), of weight 0
#define GATHER_STEADY 1.0f // of squared lattice steps: slopes that few samples tell are small

__kernel void gather_smooth(ssgi_plane depth, ssgi_plane normal, __global const int *restrict list,
                            ssgi_plane found, ssgi_plane fractions, __global float *restrict values,
                            const int2 size, const SsgiCamera camera, const VplParams params)
{
    const int listed = list[0];
    const vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    const int pieces = (listed + SSGI_LANES - 1) / SSGI_LANES;
    for (int turn = 0, own = cut_own(0, pieces); own < pieces; own = cut_own(++turn, pieces)) {
        const vint pixel = cut_pixels(list, own * SSGI_LANES);
        const vint column = pixel & 0xffff, row = pixel >> 16;
        const VplReceiver at = cut_receiver(depth, normal, pixel, size, camera, params);
        const vfloat near = ssgi_gather(found, size, 3, column, row);
        // Sums of weights, and of weights times columns, rows, their products and light.
        vfloat sum = zero, sx = zero, sy = zero, sxx = zero, sxy = zero, syy = zero;
        vfloat light[3] = {zero, zero, zero}, lx[3] = {zero, zero, zero},
               ly[3] = {zero, zero, zero};
        for (int dy = -GATHER_WIDE; dy <= GATHER_WIDE; ++dy) {
            for (int dx = -GATHER_WIDE; dx <= GATHER_WIDE; ++dx) {
                const vint y = v_imin(v_imax(row + dy, v_splat_int(0)), v_splat_int(size.y - 1));
                const vint x = v_imin(v_imax(column + dx, v_splat_int(0)), v_splat_int(size.x - 1));
                const VplReceiver to =
                    cut_receiver(depth, normal, y << 16 | x, size, camera, params);
                const vmask inside = v_ieq(x, column + dx) & v_ieq(y, row + dy) & to.there;
                const vfloat rays = ssgi_gather(found, size, 4, x, y);
                const vfloat wx = to.x - at.x, wy = to.y - at.y, wz = to.z - at.z;
                const vfloat squared = v_fma(wx, wx, v_fma(wy, wy, wz * wz));
                const vfloat up = v_abs(v_fma(wx, at.nx, v_fma(wy, at.ny, wz * at.nz)));
                const vfloat per = v_rsqrt(v_max(squared, v_splat(1e-30f)));
                const vfloat alike = v_fma(at.nx, to.nx, v_fma(at.ny, to.ny, at.nz * to.nz)) - 1.0f;
                const vfloat other = ssgi_gather(found, size, 3, x, y);
                const vfloat away = squared * per * v_max(near, other);
                const vfloat slope =
                    v_abs(near - other) * per / v_max(near * other, v_splat(1e-30f));
                const vfloat along =
                    (one - away * (1.0f / GATHER_ALONG)) * (one - v_min(slope * GATHER_SLOPE, one));
                const vfloat fit =
                    v_max(one - away * (1.0f / GATHER_REACH), along) - up * per * GATHER_OFF;
                const vfloat turned = v_fma(alike, v_splat(GATHER_ALIKE), one);
                vfloat weight = v_max(fit, zero) * v_clamp(turned, 0.0f, 1.0f);
                weight = v_select(zero, (dx == 0 && dy == 0 ? one : weight) * rays, inside);
                const vfloat across = weight * (float)dx, down = weight * (float)dy;
                sum = sum + weight;
                sx = sx + across;
                sy = sy + down;
                sxx = v_fma(across, v_splat((float)dx), sxx);
                sxy = v_fma(across, v_splat((float)dy), sxy);
                syy = v_fma(down, v_splat((float)dy), syy);
                for (int c = 0; c < 3; ++c) {
                    const vfloat value =
                        v_select(zero, ssgi_gather(found, size, c, x, y), v_gt(weight, zero));
                    light[c] = v_fma(weight, value, light[c]);
                    lx[c] = v_fma(across, value, lx[c]);
                    ly[c] = v_fma(down, value, ly[c]);
                }
            }
        }
        // The fit at the middle sample, from the normal equations.
        const vfloat steady = ssgi_gather(found, size, 4, column, row) * GATHER_STEADY;
        const vfloat xx = sxx + steady, yy = syy + steady;
        const vfloat inverse = 1.0f / v_fma(xx, yy, -(sxy * sxy));
        const vfloat u = v_fma(yy, sx, -(sxy * sy)) * inverse;
        const vfloat v = v_fma(xx, sy, -(sxy * sx)) * inverse;
        const vfloat rest = v_max(sum - v_fma(u, sx, v * sy), v_splat(1e-6f));
        const vint to = row * ssgi_pitch(size) + column;
        const vfloat share = ssgi_gather(fractions, size, 0, column, row) / rest;
        for (int c = 0; c < 3; ++c) {
            __global float *restrict image = values + ssgi_index(size, c, 0, 0);
            const vfloat value = v_max(light[c] - v_fma(u, lx[c], v * ly[c]), zero);
            v_scatter(v_fma(share, value, v_gather(image, to)), image, to);
        }
    }
}
