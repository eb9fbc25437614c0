"""Exactness of skips: frames with all of them and with none, over changing arguments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime

from ..squares import squares
from .scenes import MAPS

GLOSSY = Material(albedo=(0.3, 0.4, 0.5), specular=(0.4,) * 3, gloss=400.0)
THIN = Material(albedo=(0.9, 0.5, 0.2), alpha=0.4, blends=True)
PANE = Material(albedo=(0.05,) * 3, transmission=(0.6, 0.85, 0.85), specular=(0.1,) * 3, gloss=30.0)
GLOW = Material(albedo=(0.2,) * 3, emission=(4.0, 2.0, 1.0))
CAMERA = gi.Camera.look_at((0.4, 0.3, 4.0), (0.0, 0.0, 0.0), yfov=0.6, width=64, height=48)
LAMP, SKY = gi.PointLight((0.3, 0.8, 1.5), 4.0), gi.Environment((0.3, 0.4, 0.6))
SOLID = ((0.0, -1.0, 1.2, GLOSSY), (0.8, -0.2, 0.3, GLOW), (-0.7, -0.4, 0.4, replace(GLOSSY, gloss=50.0)))
PANES = ((-0.2, 0.4, 0.5, THIN), (0.2, 0.9, 0.35, PANE))


def steps(scene: Scene, lights: Any) -> Iterator[tuple[str, Scene, gi.Camera, Any, dict[str, Any]]]:
    """Yield what changes, and the arguments of frames of which each differs little from the one before."""
    aside = gi.Camera.look_at((0.5, 0.2, 3.9), (0.0, 0.1, 0.0), yfov=0.6, width=64, height=48)
    brighter = [*lights[:-1], gi.Environment((0.6, 0.4, 0.3))] if lights else [LAMP]
    given: dict[str, Any] = {"ao_radius": 0.02, "exposure": 1.0}
    yield "first", scene, CAMERA, lights, given
    yield "ao_radius", scene, CAMERA, lights, {**given, "ao_radius": 0.3}
    yield "multi_bounce", scene, CAMERA, lights, {**given, "ao_radius": 0.3, "multi_bounce": True}
    yield "exposure", scene, CAMERA, lights, {"ao_radius": 0.3, "exposure": 2.0, "multi_bounce": True}
    yield "lights", scene, CAMERA, brighter, given
    yield "ao_radius", scene, CAMERA, brighter, {**given, "ao_radius": 0.3}
    yield "camera", scene, aside, brighter, given
    yield "ao_radius", scene, aside, brighter, {**given, "ao_radius": 0.3}
    yield "panes", squares(*SOLID[1:]), aside, brighter, given
    yield "panes", squares(*SOLID[1:], PANES[0]), aside, brighter, given
    yield "no panes", squares(*SOLID[1:]), aside, brighter, {**given, "ao_radius": 0.3}


@pytest.mark.parametrize(
    "lights",
    [
        pytest.param([LAMP, SKY], id="lamp-sky"),
        pytest.param([SKY], id="sky", marks=pytest.mark.slow),
        pytest.param([], id="none", marks=pytest.mark.slow),
    ],
)
def test_frames_with_layers_are_the_same_with_skips(runtime: Runtime, lights: Any) -> None:
    for number, (changed, scene, camera, lit, given) in enumerate(steps(squares(*SOLID, *PANES), lights)):
        given |= {"preset": "low", "runtime": runtime, **MAPS}
        light = ["radiance", "indirect", "ao"]
        expected = gi.render(scene, camera, lit, outputs=[*light, "image"], skips=False, **given)
        for outputs in (light, ["image"]):
            found = gi.render(scene, camera, lit, outputs=outputs, **given)
            for name in outputs:
                np.testing.assert_array_equal(
                    getattr(found, name), getattr(expected, name), err_msg=f"{name}, frame {number}: {changed}"
                )
    assert np.ptp(expected.image) > 0


def test_lights_that_shine_on_layers_alone_are_not_idle(runtime: Runtime) -> None:
    # Its cone meets the pane and, past it, nothing that is seen.
    spot = gi.SpotLight((3.0, 0.0, 3.0), (-2.4, 0.0, -2.1), 0.1, 8.0)
    scene = squares((0.0, -1.0, 0.6, Material()), (0.6, 0.9, 0.3, replace(THIN, alpha=0.9)))
    options: dict[str, Any]
    for options in ({"preset": "low"}, {"bounces": 0}):
        found, expected = (
            gi.render(
                scene, CAMERA, [spot], runtime=runtime, outputs=["radiance"], skips=skips, ao=False, **MAPS, **options
            ).radiance
            for skips in (True, False)
        )
        assert np.any(expected > 0.01)
        np.testing.assert_array_equal(found, expected)
