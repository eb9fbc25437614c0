"""Scenes of any scale, light of any power: right, or refused with what is allowed."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, PointLight
from ssgi_cl.core.scene import Material
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene

BOUNCES: dict[str, Callable[..., Any]] = {
    "multires_splat": lambda *given, **options: gi.multires_splat(*given, vpls=64, **options),
    "vpl_splat": lambda *given, **options: gi.vpl_splat(*given, vpls=64, **options),
    "rsm_gather": lambda *given, unit_distance, **options: gi.rsm_gather(*given, **options),
}
REFUSED = r"rsm shows surfaces .* from its light's camera: .* expects 1e.* to 1e.* \(scene units\)"


def seen(scale: float, runtime: Runtime) -> tuple[Any, Any]:
    """Return the G-buffer and the sun's map of the same picture at another scale."""
    box = make_scene("cornell_box")
    positions = (box.scene.positions.astype(np.float64) * scale).astype(np.float32)
    scene = dataclasses.replace(box.scene, origin=box.scene.origin * scale, positions=positions)
    eye, target = np.multiply(box.eye, scale), np.multiply(box.target, scale)
    camera = Camera.look_at(eye, target, box.up, yfov=box.yfov, width=48, height=36)
    sun = DirectionalLight((0.1, -0.3, 1.0), 5.0)
    rsm = gi.rasterize.rsm(scene, sun, size=32, runtime=runtime)
    return gi.rasterize.gbuffer(scene, camera, runtime=runtime), rsm


@pytest.mark.parametrize("name", BOUNCES)
def test_light_of_maps_is_the_same_at_any_scale_or_refused(name: str, runtime: Runtime) -> None:
    technique = BOUNCES[name]
    expected = technique(*seen(1.0, runtime), unit_distance=1.0, runtime=runtime)
    assert expected.max() > 0.1
    refused = []
    for exponent in (-20, -16, -12, -6, 6, 12, 16, 20):
        scale = 10.0**exponent
        gbuffer, rsm = seen(scale, runtime)
        try:
            found = technique(gbuffer, rsm, unit_distance=scale, runtime=runtime)
        except ValueError as error:
            if not re.match(REFUSED, str(error)):
                raise
            refused.append(exponent)
            continue
        # float32 roundings of a scene scaled by no power of two move samples at silhouettes.
        assert np.mean(np.abs(found - expected)) < 0.01 * expected.mean(), exponent
    assert {-20, 20} <= set(refused) <= {-20, -16, -12, 12, 16, 20}


@pytest.mark.parametrize("emission", [1e20, 1e30])
def test_emission_gives_finite_light(emission: float, runtime: Runtime) -> None:
    box = make_scene("cornell_box")
    glowing = tuple(dataclasses.replace(m, emission=(emission,) * 3) for m in box.scene.materials)
    scene = dataclasses.replace(box.scene, materials=glowing)
    camera = box.camera(48, 36)
    lights = (*box.lights, PointLight(box.target, 1e30))
    frame = gi.render(scene, camera, lights, indirect=True, shadow_size=64, runtime=runtime)
    for values in (frame.radiance, frame.indirect, frame.image):
        assert np.isfinite(np.asarray(values)).all()
    assert np.asarray(frame.radiance).max() >= np.float32(emission)


def test_emission_beyond_float32_is_refused() -> None:
    for emission in (1e300, 1e31):
        with pytest.raises(ValueError, match=r"emission is .*<= 1e\+30 \(W m\^-2 sr\^-1\)"):
            Material(emission=(emission, 0.0, 0.0))
