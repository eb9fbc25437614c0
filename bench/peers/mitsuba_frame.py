"""Whole frames by Mitsuba 3's integrator `path`, by samples a pixel, denoised or not.

Diffuse surfaces, box filter, 12 bounces at most. The denoiser's guides are albedo and normals from
the same samples. Emission counts on both sides, as in the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.truth.mitsuba_scene import MitsubaScene, sensor, within

from .mitsuba_rays import VARIANT, missing
from .oidn import QUALITY

Floats = NDArray[np.float32]

MAX_DEPTH = 12
SAMPLES = (1, 4, 16, 64)
"""Per pixel."""

__all__ = ["MAX_DEPTH", "SAMPLES", "VARIANT", "PathFrames", "missing"]


class PathFrames:
    """A scene with its lights in Mitsuba, of which frames are made."""

    def __init__(self, scene: Scene, lights: Sequence[Light]) -> None:
        with within(VARIANT):
            self._world = MitsubaScene.of(scene, lights, VARIANT, emission="emitters")
        self._seed = 0

    def frame(self, camera: Camera, samples: int, *, denoised: bool) -> Floats:
        """Return radiance [rows, columns, 3]; each call takes other random numbers."""
        self._seed += 1
        with within(VARIANT) as mi:
            path: dict[str, Any] = {"type": "path", "max_depth": MAX_DEPTH}
            if denoised:
                path = {"type": "aov", "aovs": "albedo:albedo,nn:sh_normal", "image": path}
            found = np.array(mi.render(
                self._world.scene, sensor=mi.load_dict(sensor(mi, self._world, camera)),
                integrator=mi.load_dict(path), spp=samples, seed=self._seed,
            ), np.float32)  # fmt: skip
        if not denoised:
            return found
        color, albedo, normal = (
            np.ascontiguousarray(np.nan_to_num(found[..., 3 * i : 3 * i + 3])) for i in range(3)
        )
        clean: Floats = import_module("pyoidn").denoise(
            color, albedo, normal, hdr=True, quality=QUALITY
        )
        return clean
