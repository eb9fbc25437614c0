"""HBAO: against formulas, and its own parameters. What it shares with others: test_slices.py."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.hbao import hbao

from ...closed_forms import hidden_by_wall
from ..analytic import camera, scene
from ..walls import wall_and_floor


@pytest.mark.parametrize(("attenuation", "falloff"), [(0.0, "none"), (1.0, "quadratic")])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_floor_by_an_infinite_wall_is_as_dark_as_the_formula_says(
    runtime: Runtime, kind: str, attenuation: float, falloff: str
) -> None:
    gbuffer, distance = wall_and_floor(kind)
    a = hbao(gbuffer, 1.0, 16, 48, attenuation=attenuation, blur_radius=0, runtime=runtime)
    for near, far in ((0.1, 0.2), (0.3, 0.4), (0.6, 0.7), (0.9, 0.95), (1.02, 1.2)):
        there = (distance > near) & (distance < far)
        wanted = [1.0 - hidden_by_wall(min(c, 1.0), "uniform", falloff) for c in distance[there]]
        # The highest point within the radius lies up to a tap, a 50th of the radius, beyond the
        # highest tap: .0066 at most, half of it with twice the taps.
        assert np.mean(a[there]) == pytest.approx(np.mean(wanted), abs=8e-3)


def test_attenuation_opens_what_is_far(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(), rng)
    images = [hbao(gbuffer, 0.6, 16, 48, attenuation=w, blur_radius=0, runtime=runtime) for w in (0.0, 0.5, 1.0)]
    # W is linear in the attenuation, and so is A; roundings of float32.
    np.testing.assert_allclose(images[1], 0.5 * (images[0] + images[2]), rtol=0, atol=2e-6)
    assert float(np.mean(images[2] - images[0])) > 5e-3


def test_angle_bias_ignores_what_is_low_and_keeps_what_is_high(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(), rng)
    plain, raised = (
        hbao(gbuffer, 0.6, angle_bias=b, attenuation=0.0, blur_radius=0, runtime=runtime)
        for b in (1e-3, math.radians(30.0))  # of 0 it is another program
    )
    assert np.mean(raised == 1.0) > np.mean(plain == 1.0)
    assert raised.min() < 0.7


def test_bad_parameter_is_refused(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(size=(4, 4)), rng)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"attenuation": 1.5}, r"attenuation is 1.5: expected a number >= 0 and <= 1"),
        ({"angle_bias": -0.1}, r"angle_bias is -0.1: expected a number >= 0.*radians"),
    ]
    for params, message in cases:
        with pytest.raises(ValueError, match=message):
            hbao(gbuffer, runtime=runtime, **params)
