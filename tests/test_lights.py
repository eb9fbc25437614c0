"""Lights: what is refused, and the irradiance of environments."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.lights import DirectionalLight, Environment, PointLight, SpotLight


def test_lights_hold_float64_arrays_that_cannot_be_changed() -> None:
    position = np.array([1.0, 2.0, 3.0])
    spot = SpotLight(position, (0, -2, 0), 0.5, 10)
    np.testing.assert_array_equal(spot.direction, [0, -1, 0])
    np.testing.assert_array_equal(spot.intensity, [10, 10, 10])
    position[0] = 9.0
    assert np.asarray(spot.position)[0] == 1.0
    for light, names in (
        (spot, ("position", "direction", "intensity")),
        (PointLight((0, 0, 0), 1), ("position", "intensity")),
        (DirectionalLight((0, -1, 0), 1), ("direction", "irradiance")),
        (Environment(1.0), ("radiance",)),
        (Environment(np.ones((2, 4, 3))), ("radiance",)),
    ):
        for name in names:
            value = getattr(light, name)
            assert value.dtype == np.float64
            with pytest.raises(ValueError, match="read-only"):
                value[...] = 5.0


def test_a_lamp_is_a_point_unless_it_has_an_extent() -> None:
    assert PointLight((0, 0, 0), 1).radius == SpotLight((0, 0, 0), (0, 0, 1), 0.5, 1).radius == 0.0
    assert PointLight((0, 0, 0), 1, radius=2).radius == 2.0
    assert DirectionalLight((0, 0, 1), 1).angle == 0.0
    assert DirectionalLight((0, 0, 1), 1, angle=0.5).angle == 0.5


def test_a_light_leaves_the_callers_array_writable() -> None:
    position, radiance = np.zeros(3), np.ones((2, 4, 3))
    PointLight(position, 1.0)
    Environment(radiance)
    position[0], radiance[0, 0, 0] = 1.0, 2.0


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: PointLight((0, 0), 1), ValueError, r"position has shape \(2,\)"),
        (lambda: PointLight((0, 0, math.nan), 1), ValueError, "position is .*finite"),
        (lambda: PointLight("abc", 1), TypeError, "position is 'abc'"),
        (lambda: PointLight((0, 0, 0), -1), ValueError, r"intensity is .*>= 0 \(W/sr\)"),
        (lambda: PointLight((0, 0, 0), math.inf), ValueError, "intensity is .*finite"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 0), 0.5, 1), ValueError, "non-zero length"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 1), 0.0, 1), ValueError, r"cone_angle .*radians"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 1), 1.6, 1), ValueError, "cone_angle is 1.6"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 1), True, 1), TypeError, "cone_angle is True"),
        (lambda: DirectionalLight((0, 0, 0), 1), ValueError, "direction is .*non-zero length"),
        (lambda: DirectionalLight((0, 1, 0), (1, 2)), ValueError, r"irradiance has shape \(2,\)"),
        (lambda: PointLight((0, 0, 0), 1, radius=-1), ValueError, r"radius is -1.*scene units"),
        (lambda: PointLight((0, 0, 0), 1, math.inf), ValueError, "radius is inf"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 1), 0.5, 1, "x"), TypeError, "radius is 'x'"),
        (lambda: DirectionalLight((0, 0, 1), 1, angle=0.6), ValueError, r"angle is 0.6.*radians"),
        (lambda: DirectionalLight((0, 0, 1), 1, math.nan), ValueError, "angle is nan"),
        (lambda: Environment(-1.0), ValueError, "radiance is .*>= 0"),
        (lambda: Environment([[[1, 1, math.nan]]]), ValueError, r"radiance\[0, 0, 2\] is nan"),
        (lambda: Environment(np.full((2, 2, 3), -1.0)), ValueError, r"radiance\[0, 0, 0\] is -1"),
        (lambda: Environment(np.zeros((0, 2, 3))), ValueError, "at least one texel"),
        (lambda: Environment(np.zeros((2, 2, 4))), ValueError, r"shape \(2, 2, 4\)"),
        (lambda: Environment(np.zeros((2, 2))), ValueError, r"shape \(2, 2\)"),
        (lambda: Environment("sky"), TypeError, "radiance is"),
    ],
)
def test_bad_lights_are_refused(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def basis(n: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = n[..., 0], n[..., 1], n[..., 2]
    one = np.ones_like(x)
    rows = [one, x, y, z, x * y, y * z, z * x, 3 * z * z - 1, x * x - y * y]
    return np.stack(rows, axis=-1)


def directions(rows: int, columns: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions of texels as Environment documents them, and their solid angles."""
    polar = (np.arange(rows) + 0.5) / rows * np.pi
    turn = ((np.arange(columns) + 0.5) / columns - 0.5) * 2 * np.pi
    polar, turn = np.meshgrid(polar, turn, indexing="ij")
    way = np.stack(
        [np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)], axis=-1
    )
    return way, np.sin(polar) * (np.pi / rows) * (2 * np.pi / columns)


def normals(rng: np.random.Generator) -> NDArray[np.float64]:
    n = rng.standard_normal((100, 3))
    return np.concatenate([np.eye(3), -np.eye(3), n / np.linalg.norm(n, axis=1, keepdims=True)])


def test_a_constant_environment_gives_pi_times_its_radiance(rng: np.random.Generator) -> None:
    coefficients = Environment((1.0, 2.0, 3.0)).irradiance_coefficients()
    irradiance = basis(normals(rng)) @ coefficients
    np.testing.assert_allclose(irradiance, np.pi * np.tile([1.0, 2.0, 3.0], (106, 1)), rtol=1e-15)


@pytest.mark.parametrize("size", [(1, 1), (2, 4), (16, 32)])
def test_a_constant_image_gives_about_the_same(size: tuple[int, int]) -> None:
    rows, columns = size
    c = Environment(np.full((rows, columns, 3), 2.0)).irradiance_coefficients()
    # The areas of the texels are exact, so the mean is; float64 sums of 512 terms.
    np.testing.assert_allclose(c[0], 2.0 * np.pi, rtol=1e-13)


@pytest.mark.parametrize("axis", [(0, 1, 0), (0, 0, -1), (1, 0, 0), (1, 2, -2), (-2, -1, 2)])
def test_a_linear_sky_has_the_irradiance_of_its_formula(
    axis: tuple[float, float, float], rng: np.random.Generator
) -> None:
    a = np.array(axis, np.float64)
    a /= np.linalg.norm(a)
    way, _ = directions(256, 512)
    radiance = np.repeat((1.0 + way @ a)[..., None], 3, axis=-1)
    n = normals(rng)
    irradiance = basis(n) @ Environment(radiance).irradiance_coefficients()
    # Int (1 + a.w) cos dw = pi + 2 pi / 3 a.n. Midpoints of texels of pi / 256 are off by 1e-4,
    # radiance is float32.
    np.testing.assert_allclose(irradiance[:, 0], np.pi + 2 * np.pi / 3 * (n @ a), atol=1e-3)


@pytest.mark.parametrize("axis", [(0, 1, 0), (0, 0, -1), (1, 0, 0), (1, 2, -2)])
def test_a_lobe_has_the_irradiance_of_a_numeric_integral(
    axis: tuple[float, float, float], rng: np.random.Generator
) -> None:
    a = np.array(axis, np.float64)
    a /= np.linalg.norm(a)
    way, solid = directions(128, 256)
    cosine = np.maximum(way @ a, 0.0)
    radiance = np.stack([cosine, cosine**2, cosine**4], axis=-1)
    n = normals(rng)
    found = basis(n) @ Environment(radiance).irradiance_coefficients()
    weights = np.maximum(n @ way.reshape(-1, 3).T, 0.0) * solid.ravel()
    truth = weights @ radiance.reshape(-1, 3)
    # What degree 2 leaves out: Ramamoorthi and Hanrahan 2001 give at most 9 % of the largest for
    # any light; lobes up to the fourth power of the cosine stay below 5 %.
    assert np.abs(found - truth).max() < 0.05 * truth.max()
    # Their mean over all normals is exact.
    everywhere, solid_n = directions(64, 128)
    mean = np.einsum("ij,ijc->c", solid_n, basis(everywhere) @ Environment(
        radiance).irradiance_coefficients()) / (4 * np.pi)
    np.testing.assert_allclose(mean, (solid[..., None] * radiance).sum(axis=(0, 1)) / 4, rtol=2e-3)
