"""Lights: what they hold, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight


def test_lights_hold_float64_arrays_that_cannot_be_changed() -> None:
    position, radiance = np.array([1.0, 2.0, 3.0]), np.ones((2, 4, 3))
    spot = SpotLight(position, (0, -2, 0), 0.5, 10)
    np.testing.assert_array_equal(spot.direction, [0, -1, 0])
    np.testing.assert_array_equal(spot.intensity, [10, 10, 10])
    sky = Environment(radiance)
    position[0] = radiance[0, 0, 0] = 9.0  # the caller's stay writable
    assert np.asarray(spot.position)[0] == np.asarray(sky.radiance)[0, 0, 0] == 1.0
    for light, names in (
        (spot, ("position", "direction", "intensity")),
        (PointLight((0, 0, 0), 1), ("position", "intensity")),
        (DirectionalLight((0, -1, 0), 1), ("direction", "irradiance")),
        (Environment(1.0), ("radiance",)),
        (sky, ("radiance",)),
    ):
        for name in names:
            value = getattr(light, name)
            assert value.dtype == np.float64
            with pytest.raises(ValueError, match="read-only"):
                value[...] = 5.0


def test_a_light_is_a_point_unless_it_has_an_extent() -> None:
    assert PointLight((0, 0, 0), 1).radius == SpotLight((0, 0, 0), (0, 0, 1), 0.5, 1).radius == 0.0
    assert PointLight((0, 0, 0), 1, radius=2).radius == 2.0
    assert DirectionalLight((0, 0, 1), 1).angle == 0.0
    assert DirectionalLight((0, 0, 1), 1, angle=0.5).angle == 0.5


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: PointLight((0, 0), 1), ValueError, r"position has shape \(2,\)"),
        (lambda: PointLight((0, 0, math.nan), 1), ValueError, "position is .*finite"),
        (lambda: PointLight("abc", 1), TypeError, "position is 'abc'"),
        (lambda: PointLight((0, 0, 0), -1), ValueError, r"intensity is .*>= 0 and .*\(W/sr\)"),
        (lambda: PointLight((0, 0, 0), 1e300), ValueError, r"intensity is .*1e\+30 \(W/sr\)"),
        (lambda: PointLight((0, 1e31, 0), 1), ValueError, r"position is .*1e\+30 \(scene units\)"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 1), 1, 1e31), ValueError, "intensity is"),
        (lambda: DirectionalLight((0, 0, 1), 1e31), ValueError, r"irradiance is .*\(W/m\^2\)"),
        (lambda: Environment(2e38), ValueError, r"radiance is .*<= 1e\+38 \(W m\^-2 sr\^-1\)"),
        (lambda: Environment(np.full((2, 2, 3), 2e38)), ValueError, r"radiance\[0, 0, 0\] is 1.9"),
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
