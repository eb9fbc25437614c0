"""Irradiance of environments: skies of every kind against their integrals and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.direct.ambient import ambient_reference, irradiance
from ssgi_cl.reference.direct.shade import world_surface
from ssgi_cl.techniques.direct.ambient import AMBIENT_SIZE, Ambient, irradiance_map, vertices
from ssgi_cl.techniques.direct.shade import shade

from ..analytic import camera, scene

Doubles = NDArray[np.float64]

RMS = 0.005
"""Of the error over all normals, relative to the mean of E. The worst single direction of light has
.0042, which bounds all skies; parts of an image that cross the horizon add up to .0005."""
MOST = 0.021
"""Error at one normal, relative to the greatest E. A single direction has at most .019, at normals
across it; a few parts in 10^4 come on top."""

BLUE = (0.3, 0.5, 1.0)

LOOK_UP = """
#include "common/gbuffer.clh"
#include "direct/ambient.clh"
__kernel void look_up(ssgi_plane normal, __global const float *restrict irradiance,
                      __global float *restrict result, const int2 size)
{
    const int x = ssgi_first_column(), y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    vfloat light[3];
    ssgi_ambient(irradiance, ssgi_load(normal, size, 0, x, y), ssgi_load(normal, size, 1, x, y),
                 ssgi_load(normal, size, 2, x, y), light);
    for (int c = 0; c < 3; ++c) {
        ssgi_store(light[c], result, size, c, x, y, 0.0f);
    }
}
"""


def looked_up(runtime: Runtime, skies: list[Environment], normal: Doubles) -> Doubles:
    """Return what kernels find for normals [n, 3]."""
    ambient = Ambient(runtime)
    ambient.set(skies)
    size = (1, len(normal))
    plane, result = runtime.plane(3, size), runtime.plane(3, size)
    plane.upload(normal.T.reshape(3, *size).astype(np.float32))
    kernel = runtime.kernel_from_text("look_up", LOOK_UP, ambient.macros)
    kernel.run(size, normal=plane, irradiance=ambient.irradiance, result=result)
    return result.download().reshape(3, -1).T.astype(np.float64)


def everywhere(count: int = 1000) -> Doubles:
    """Return normals [n, 3] of equal areas (a Fibonacci lattice)."""
    y = 1.0 - (np.arange(count) + 0.5) / count * 2.0
    turn = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    across = np.sqrt(1.0 - y * y)
    return np.stack([across * np.cos(turn), y, across * np.sin(turn)], axis=-1)


def creases() -> Doubles:
    """Return normals [n, 3] on and next to the octahedron's corners and edges."""
    around = np.linspace(-1.0, 1.0, 9)
    found = [
        np.insert([side, 1.0 - abs(side)], axis, shift) * sign
        for axis in range(3)
        for sign in (1.0, -1.0)
        for side in around
        for shift in (0.0, 1e-7, -1e-7, 1e-3, -1e-3)
    ]
    return np.array(found) / np.linalg.norm(found, axis=-1, keepdims=True)


def unit(*components: float) -> Doubles:
    way = np.array(components)
    return way / np.linalg.norm(way)


def texel_directions(rows: int, columns: int) -> Doubles:
    """Return the directions [rows, columns, 3] of the middles of an image's texels."""
    polar = (np.arange(rows)[:, None] + 0.5) / rows * np.pi
    turn = ((np.arange(columns) + 0.5) / columns - 0.5) * 2.0 * np.pi
    return np.stack(
        np.broadcast_arrays(np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)), axis=-1
    )


def disc(toward: Doubles, degrees: float, times: float, rows: int) -> Doubles:
    """Return a blue sky with a disc of that diameter, `times` as bright."""
    image = np.full((rows, 2 * rows, 3), BLUE)
    inside = texel_directions(rows, 2 * rows) @ toward > math.cos(math.radians(degrees / 2.0))
    assert inside.any()
    image[inside] = (times, 0.9 * times, 0.7 * times)
    return image


def suns(rng: np.random.Generator, count: int) -> Doubles:
    image = np.full((32, 64, 3), 0.1)
    for _ in range(count):
        image[rng.integers(32), rng.integers(64)] = 10.0 ** rng.uniform(2.0, 5.0, 3)
    return image


def one_texel(rows: int, columns: int, row: int, column: int) -> Doubles:
    """Return black but for a texel."""
    image = np.zeros((rows, columns, 3))
    image[row, column] = (1.0, 10.0, 1e5)
    return image


def noise(rng: np.random.Generator, rows: int, columns: int, decades: float) -> Doubles:
    return 10.0 ** rng.uniform(-decades / 2.0, decades / 2.0, (rows, columns, 3))


def gradient() -> Doubles:
    up = texel_directions(24, 48)[..., 1]
    return np.stack([0.2 + 0.1 * up, np.where(up > 0.0, up, 0.05), np.exp(-8.0 * up**2)], axis=-1)


RANDOM = np.random.default_rng(77)
SKIES: dict[str, Doubles] = {
    "even": np.full((5, 9, 3), 2.0),
    "gradient": gradient(),
    "sun of .5 degrees at the zenith": disc(unit(0, 1, 0), 0.5, 1e5, 720),
    "sun of .5 degrees": disc(unit(0.4, 0.7, -0.3), 0.5, 1e5, 720),
    "sun of 1 degree at the horizon": disc(unit(-0.4, 0.02, 0.9), 1.0, 1e3, 360),
    "sun of 5 degrees": disc(unit(-0.9, 0.3, 0.1), 5.0, 1e4, 180),
    "sun of 5 degrees below": disc(unit(0.2, -0.8, 0.5), 5.0, 1e3, 180),
    "two suns": suns(RANDOM, 2),
    "nine suns": suns(RANDOM, 9),
    "noise over 2 decades": noise(RANDOM, 40, 80, 2.0),
    "noise over 12 decades": noise(RANDOM, 16, 32, 12.0),
    "one texel": one_texel(64, 128, 20, 100),
    "one texel at the pole": one_texel(64, 128, 63, 7),
    "one texel at the seam": one_texel(17, 31, 9, 0),
    "1 x 1": np.full((1, 1, 3), (1.0, 2.0, 3.0)),
    "3 x 2": RANDOM.random((3, 2, 3)) ** 4,
    "one texel of 3 x 2": one_texel(3, 2, 1, 1),
    "17 x 31": noise(RANDOM, 17, 31, 4.0),
    "1 x 7": RANDOM.random((1, 7, 3)),
    "200 x 3": RANDOM.random((200, 3, 3)) ** 8,
}


@pytest.mark.parametrize("name", [pytest.param(s, marks=[pytest.mark.slow] * (i % 2)) for i, s in enumerate(SKIES)])
def test_every_sky_has_the_irradiance_of_its_integral(runtime: Runtime, name: str) -> None:
    sky = Environment(SKIES[name])
    normal = np.concatenate([everywhere(), creases()])
    found = looked_up(runtime, [sky], normal)
    # What is the same all round is known.
    even = SKIES[name].min(axis=(0, 1))
    truth = np.pi * even + irradiance([Environment(SKIES[name] - even)], normal)
    count = len(everywhere())
    mean, greatest = truth[:count].mean(axis=0), truth.max(axis=0)
    off = np.abs(found - truth)
    assert (np.sqrt((off[:count] ** 2).mean(axis=0)) <= RMS * mean).all()
    assert (off.max(axis=0) <= MOST * greatest).all()
    assert (found >= 0.0).all()


FAST = (((0, 1, 0), 2.0), ((1, 2, -3), 5.0), ((1, 2, -3), 90.0), ((0, -1, 0.01), 30.0))
"""Directions and diameters of discs: each of both once."""


def cap(toward: Doubles, angle: float, normal: Doubles) -> Doubles:
    """Return E [n] of a disc of radiance 1 and half-angle `angle`, also where it sets.

    Snyder 1996, "Area light sources for real-time graphics", for spheres; as in Lagarde and de
    Rousiers 2014, "Moving Frostbite to Physically Based Rendering", listing 7.
    """
    cosine = normal @ toward
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 1e-30))
    x = 1.0 / math.tan(angle)
    y = np.clip(-x * cosine / sine, -1.0, 1.0)
    root = sine * np.sqrt(1.0 - y * y)
    setting = (cosine * np.arccos(y) - x * root) * math.sin(angle) ** 2 + np.arctan(root / x)
    whole = np.pi * math.sin(angle) ** 2 * np.maximum(cosine, 0.0)
    return np.where(np.abs(cosine) >= math.sin(angle), whole, setting)


@pytest.mark.parametrize(
    ("toward", "degrees"),
    [
        pytest.param(toward, degrees, marks=[pytest.mark.slow] * ((toward, degrees) not in FAST))
        for toward in ((0, 1, 0), (1, 2, -3), (0, -1, 0.01))
        for degrees in (2.0, 5.0, 30.0, 90.0)
    ],
)
def test_a_disc_has_the_irradiance_of_its_closed_form(
    runtime: Runtime, degrees: float, toward: tuple[float, float, float]
) -> None:
    way, half = unit(*toward), math.radians(degrees / 2.0)
    image = np.repeat((texel_directions(400, 800) @ way > math.cos(half))[..., None], 3, axis=-1)
    normal = everywhere()
    expected = cap(way, half, normal)
    sky = Environment(image.astype(float))
    found = looked_up(runtime, [sky], normal)[:, 0]
    # Texels on the rim are all in or all out, so the disc's area differs.
    found *= cap(way, half, way[None])[0] / irradiance([sky], way[None])[0, 0]
    assert np.sqrt(np.mean((found - expected) ** 2)) <= RMS * expected.mean()
    assert np.abs(found - expected).max() <= MOST * expected.max()


@pytest.mark.parametrize(
    "axis",
    [(0, 0, -1), (-2, -1, 2), *(pytest.param(a, marks=pytest.mark.slow) for a in ((0, 1, 0), (1, 0, 0), (1, 2, -2)))],
)
def test_a_linear_sky_has_the_irradiance_of_its_formula(runtime: Runtime, axis: tuple[float, float, float]) -> None:
    way, normal = unit(*axis), everywhere()
    image = np.repeat((1.0 + texel_directions(256, 512) @ way)[..., None], 3, axis=-1)
    found = looked_up(runtime, [Environment(image)], normal)
    # Int (1 + a.w) cos dw = pi + 2 pi / 3 a.n. E is smooth, so interpolation is off by the square
    # of half a cell, .04^2, and parts across the horizon by 3e-4 of pi.
    truth = np.pi + 2.0 * np.pi / 3.0 * (normal @ way)
    np.testing.assert_allclose(found, np.repeat(truth[:, None], 3, axis=1), atol=4e-3)


def test_a_constant_environment_gives_pi_times_its_radiance(runtime: Runtime) -> None:
    skies = [Environment((1.0, 2.0, 3.0)), Environment(0.5)]
    found = looked_up(runtime, skies, everywhere(100))
    np.testing.assert_allclose(found, np.tile(np.pi * np.array([1.5, 2.5, 3.5]), (100, 1)), 1e-7)


@pytest.mark.parametrize("name", ["17 x 31", "one texel of 3 x 2", "two suns"])
def test_every_kernel_variant_interpolates_as_the_reference_does(variant_runtime: Runtime, name: str) -> None:
    skies = [Environment(SKIES[name]), Environment((0.1, 0.2, 0.3))]
    normal = np.concatenate([everywhere(300), creases(), vertices().reshape(-1, 3)[::31]])
    found = looked_up(variant_runtime, skies, normal)
    expected = ambient_reference(skies, normal)
    # E changes by less than a tenth of its greatest within a cell, where coordinates round by
    # 32 / 2^24.
    assert (np.abs(found - expected) <= 1e-6 * expected.max(axis=0)).all()


def test_length_of_a_normal_does_not_matter_and_none_is_finite(variant_runtime: Runtime) -> None:
    skies, normal = [Environment(SKIES["17 x 31"])], everywhere(200)
    once = looked_up(variant_runtime, skies, normal)
    np.testing.assert_array_equal(looked_up(variant_runtime, skies, 4.0 * normal), once)
    assert np.isfinite(looked_up(variant_runtime, skies, 0.0 * normal)).all()


def test_what_faces_away_from_the_only_light_stays_black(runtime: Runtime) -> None:
    sky = Environment(one_texel(64, 128, 20, 100))
    normal = everywhere()
    cosine = normal @ texel_directions(64, 128)[20, 100]
    found = looked_up(runtime, [sky], normal)
    # A triangle of the octahedron is 4.4 degrees wide at most, the texel 2.8.
    away = cosine < -math.sin(math.radians(4.4 + 1.4))
    assert away.sum() > 400
    np.testing.assert_array_equal(found[away], 0.0)


def test_sky_turned_by_quarters_gives_what_turned_normals_get(runtime: Runtime) -> None:
    image = noise(np.random.default_rng(5), 12, 24, 4.0)
    normal = everywhere(500)
    found = looked_up(runtime, [Environment(image)], normal)
    # Columns run from +z over -x to -z and +x: 6 of 24 take -z to +x and +x to +z.
    turned = np.stack([-normal[:, 2], normal[:, 1], normal[:, 0]], axis=-1)
    rolled = looked_up(runtime, [Environment(np.roll(image, 6, axis=1))], turned)
    np.testing.assert_allclose(rolled, found, atol=4e-6 * found.max())


def test_shaded_ball_under_a_sun_is_within_the_bounds(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("ball", camera(size=(48, 64)), rng)
    gbuffer = replace(gbuffer, albedo=np.full((48, 64, 3), 0.5))
    _, normal, there = world_surface(gbuffer)
    sky = Environment(disc(unit(0.5, 0.3, 0.8), 5.0, 1e4, 120))
    truth = 0.5 / np.pi * irradiance([sky], normal[there])
    found = shade(gbuffer, [sky], runtime=runtime)[there]
    # Relative to the greatest, as a ball shows but half of all normals.
    assert np.abs(found - truth).max() <= MOST * truth.max()
    assert np.sqrt(np.mean((found - truth) ** 2)) <= RMS * truth.max()


def test_bright_skies_stay_finite_and_dark_ones_do_not_shine(runtime: Runtime) -> None:
    bright = Environment(np.full((4, 8, 3), 1e38))
    assert np.isfinite(looked_up(runtime, [bright, bright], everywhere(50))).all()
    ambient = Ambient(runtime)
    assert ambient.set([Environment(np.zeros((2, 4, 3))), Environment(0.0)])
    assert not ambient.shines
    assert ambient.set([bright])
    assert ambient.shines
    assert not ambient.set([bright])


def test_map_of_an_environment_is_made_once() -> None:
    sky = Environment(np.ones((2, 4, 3)))
    assert irradiance_map(sky) is irradiance_map(sky)
    assert irradiance_map(sky).shape == (AMBIENT_SIZE + 1, AMBIENT_SIZE + 1, 3)
    assert irradiance_map(Environment(2.0)).shape == (3,)
