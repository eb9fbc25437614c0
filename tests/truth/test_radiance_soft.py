"""World truth of radiance by lights with a size: closed forms of their penumbrae."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Light, PointLight
from ssgi_cl.truth.radiance import radiance

from .surfaces import FLOOR, above, closely, grey, quads

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")


ALBEDO = 0.6
BOARD = ((-5, 1, -5), (0, 0, 10), (5, 0, 0))
"""Half a plane, up to x = 0, at height 1."""
ABOVE = Camera.orthographic((0, 0.5, 0), (0, 0, 0), (0, 0, 1), view_height=0.2, width=64, height=8)
"""Between floor and board, 1.6 wide."""


def beyond(x: np.ndarray) -> np.ndarray:
    """Return the share of a unit disc on the side of a chord at x, of which x = -1 has all."""
    x = np.clip(x, -1.0, 1.0)
    share: np.ndarray = (np.arccos(x) - x * np.sqrt(1.0 - x * x)) / math.pi
    return share


@pytest.mark.slow
def test_penumbra_of_a_sun_before_an_edge() -> None:
    light = DirectionalLight((0, -1, 0), 2.0, angle=0.4)
    found = radiance(quads(FLOOR, BOARD, materials=[grey(ALBEDO)]), ABOVE, [light], 256, 0)
    x = ABOVE.unproject(np.full(ABOVE.size, 0.5, np.float32))[..., 0]
    expected = ALBEDO / math.pi * 2.0 * beyond(-x / math.tan(0.4))
    assert expected.min() < 0.1 * expected.max()
    closely(found, np.repeat(expected[..., None], 3, axis=-1), 1e-4)
    # Pixel by pixel: 256 paths have a standard error of at most .03 of the light.
    assert np.abs(found.mean[..., 0] - expected).max() < 5.0 * 0.5 / math.sqrt(256) * expected.max()


def test_penumbra_of_a_point_light_before_an_edge() -> None:
    light = PointLight((0.0, 4.0, 0.0), 10.0, radius=1.0)
    scene = quads(FLOOR, BOARD, materials=[grey(ALBEDO)])
    found = radiance(scene, ABOVE, [light], 256, 0)
    x = ABOVE.unproject(np.full(ABOVE.size, 0.5, np.float32))[..., 0]
    # Straight below, the board's edge cuts the disc at -3 x; the light's middle is 4 away.
    expected = ALBEDO / math.pi * 10.0 / 16.0 * beyond(-3.0 * x)
    middle = np.abs(x) < 0.4  # further off the disc is turned and the light weaker
    assert np.abs(found.mean[..., 0] - expected)[middle].max() < 0.2 * expected.max()
    assert abs(float((found.mean[..., 0] - expected)[middle].mean())) < 0.01 * expected.max()


def test_light_that_nothing_hides_is_that_of_a_point() -> None:
    scene = quads(FLOOR, materials=[grey(ALBEDO)])
    pairs: tuple[tuple[Light, Light], ...] = (
        (PointLight((0.4, 2.0, 0.1), 3.0, radius=0.5), PointLight((0.4, 2.0, 0.1), 3.0)),
        (DirectionalLight((0.3, -1, 0.2), 3.0, angle=0.2), DirectionalLight((0.3, -1, 0.2), 3.0)),
    )
    for soft, hard in pairs:
        found, expected = (radiance(scene, above(8, 6), [light], 1, 0).mean for light in (soft, hard))
        np.testing.assert_allclose(found, expected, rtol=1e-5)
