"""Directions of SSDO in the half ball, and their shares of the sky."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssgi_cl.reference.ssdo.ssdo_directions import directions
from ssgi_cl.techniques.ssdo.ssdo_points import cell_flux, direction_sets


@pytest.mark.parametrize("count", [1, 5])
def test_directions_are_those_of_the_definition(count: int) -> None:
    sky = np.random.default_rng(1).random((12, 20, 3)) ** 8 * 100.0
    for image, equal in ((None, False), (sky, False), (sky, True)):
        made, expected = (one(count, image, equal=equal) for one in (direction_sets, directions))
        for name in ("direction", "length", "solid_angle", "light"):
            a, b = getattr(made, name), getattr(expected, name)
            if b is None:
                assert a is None
            else:
                np.testing.assert_allclose(a, b, atol=1e-9)


def test_solid_angles_and_light_add_up_to_the_sphere_and_the_sky() -> None:
    rng = np.random.default_rng(1)
    sky = rng.random((12, 20, 3)) ** 8 * 100.0
    sets = direction_sets(8, sky)
    assert sets.light is not None
    np.testing.assert_allclose(2.0 * sets.solid_angle.sum(axis=-1), 4.0 * math.pi, rtol=1e-3)
    edges = np.cos(np.linspace(0.0, math.pi, 13))
    whole = ((edges[:-1] - edges[1:])[:, None, None] * sky).sum(axis=(0, 1)) * 2.0 * math.pi / 20
    np.testing.assert_allclose(sets.light.sum(axis=(2, 3)), np.tile(whole, (16, 4, 1)))
    np.testing.assert_allclose(cell_flux(sky).sum(axis=(0, 1)), whole)
