"""The sky's map: its flux, its directions, and the light that the bitmask finds in it."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.lights import Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.direct.ambient import irradiance
from ssgi_cl.reference.direct.sky import texel
from ssgi_cl.techniques.direct.sky import BRIGHTEST, Sky, directions, filtered
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams

from ..analytic import camera, tilted, trace, uploaded


def sun(row: int = 10, column: int = 40, radiance: float = 1e5) -> Environment:
    """Return a dim sky with one bright texel of 32 x 64."""
    image = np.full((32, 64, 3), 0.2)
    image[row, column] = radiance, 0.9 * radiance, 0.7 * radiance
    return Environment(image)


def flux(environment: Environment) -> np.ndarray:
    """Return the integral [3] of radiance over all directions."""
    image = np.asarray(environment.radiance)
    edges = np.linspace(0.0, np.pi, image.shape[0] + 1)
    height = np.cos(edges[:-1]) - np.cos(edges[1:])
    return np.einsum("rcd,r->d", image, height) * 2.0 * np.pi / image.shape[1]


def test_texels_lie_where_directions_are_looked_up() -> None:
    way, solid_angle = directions()
    number = np.arange(way[..., 0].size, dtype=float).reshape(*way.shape[:2], 1)
    np.testing.assert_array_equal(texel(number, way), number)
    assert float(solid_angle.sum()) == pytest.approx(4.0 * np.pi)
    # The sphere's octants are alike.
    assert float(solid_angle[way[..., 1] > 0.0].sum()) == pytest.approx(2.0 * np.pi, rel=0.05)


@pytest.mark.parametrize("size", [(32, 64), (1, 1), (2, 4), (300, 700)])
def test_filter_keeps_the_flux_of_any_image(rng: np.random.Generator, size: tuple[int, int]) -> None:
    environment = Environment(10.0 ** rng.uniform(-6.0, 6.0, (*size, 3)))
    kept = np.einsum("rcd,rc->d", filtered(np.asarray(environment.radiance)), directions()[1])
    np.testing.assert_allclose(kept, flux(environment), rtol=1e-9)


def test_sun_stays_where_it_is() -> None:
    environment = sun()
    look_up = filtered(np.asarray(environment.radiance))
    way, solid_angle = directions()
    centre = np.einsum("rcd,rc,rc->d", way, look_up[..., 0], solid_angle)
    polar, azimuth = (10.5 / 32) * np.pi, (40.5 / 64 - 0.5) * 2.0 * np.pi
    there = [np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)]
    cosine = centre @ there / np.linalg.norm(centre)
    assert np.degrees(np.arccos(cosine)) < 1.0


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 55.0])
def test_open_plane_receives_the_integral_over_its_hemisphere(runtime: Runtime, kind: str, degrees: float) -> None:
    made = camera(kind, size=(32, 64))
    plane = tilted(made, degrees)
    gbuffer = trace(made, [plane])
    environment = sun()
    device = uploaded(runtime, gbuffer)
    sky = Sky(runtime)
    sky.set([environment])
    end = SsdoBitmask(runtime, gbuffer.size, SsdoBitmaskParams(radius=0.3))
    with runtime.frame():
        found = end.run(device, device, sky=sky).download()
    normal = np.asarray(plane.normal, np.float64)
    wanted = irradiance([environment], normal[None] / np.linalg.norm(normal))[0]
    mean = found[1:].reshape(3, -1).mean(axis=1)
    # 32 directions round the normal with 8 heights each, in a map whose sun is 11 degrees wide: a
    # sun that is up is found within 6 %, and one at the horizon within 2 % of an upright one's.
    upright = float(flux(environment)[0])
    np.testing.assert_allclose(mean, wanted, rtol=0.06, atol=0.02 * upright)


def test_constants_and_images_are_told_apart(runtime: Runtime) -> None:
    sky = Sky(runtime)
    assert sky.map is None
    sky.set([Environment(1.0), Environment((0.5, 0.0, 2.0)), Environment(np.zeros((2, 4, 3)))])
    np.testing.assert_array_equal(sky.constant, [1.5, 1.0, 3.0])
    assert sky.map is None
    assert sky.image is None
    two = Environment(np.ones((2, 4, 3))), Environment(np.ones((3, 2, 3)))
    sky.set(two)
    np.testing.assert_array_equal(sky.constant, 0.0)
    assert sky.image is not None
    np.testing.assert_array_equal(sky.image, np.full((6, 4, 3), 2.0))
    before = sky.image
    sky.set(two)
    assert sky.image is before
    sky.set([])
    assert sky.map is None


def test_any_radiance_gives_a_finite_map(runtime: Runtime) -> None:
    sky = Sky(runtime)
    sky.set([Environment(np.full((4, 8, 3), 1e38))])
    assert sky.map is not None
    assert np.isfinite(sky.map.download()).all()
    assert sky.map.download().max() < 1.1 * BRIGHTEST
