"""Whole frames by Mitsuba 3's integrator `path`, by samples a pixel, denoised or not.

Surfaces as in the reference, box filter, paths of at most 12 segments. The denoiser's guides are
albedo and normals by rays of their own: asked for together with the paths they take twice the time.
Emission counts on both sides, as in the reference.
"""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.truth.light import MOST_PATHS
from ssgi_cl.truth.mitsuba_scene import MitsubaScene, sensor, within
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import moving_cameras
from .mitsuba_rays import QUALITY, VARIANT, families

Floats = NDArray[np.float32]

MAX_DEPTH = 12
GUIDE_SAMPLES = 4
"""Per pixel of the denoiser's guides, at most."""


class PathFrames:
    """A scene with its lights in Mitsuba, of which frames are made.

    Args:
        scene, lights: what is seen.
        samples: paths per pixel.
        denoised: whether Intel's denoiser follows.
    """

    def __init__(self, scene: Scene, lights: Sequence[Light], samples: int, *, denoised: bool) -> None:
        self._samples, self._denoised = samples, denoised
        # `path` takes what is seen through for opaque on the way from a light.
        kind = "volpath" if scene.is_seen_through else "path"
        path: dict[str, Any] = {"type": kind, "max_depth": MAX_DEPTH}
        guides: dict[str, Any] = {"type": "aov", "aovs": "albedo:albedo,nn:sh_normal"}
        with within(VARIANT) as mi:
            self._world = MitsubaScene.of(
                scene, lights, VARIANT, emission="emitters", lobes="surfaces", through="surfaces"
            )
            self._path, self._guides = mi.load_dict(path), mi.load_dict(guides)
        self._sensor: Any = None
        self._size = (0, 0)
        self._seed = 0

    def frame(self, camera: Camera) -> Floats:
        """Return radiance [rows, columns, 3]; each call takes other random numbers."""
        self._seed += 1
        with within(VARIANT) as mi:
            wanted = sensor(mi, self._world, camera)
            if camera.size != self._size:
                self._sensor, self._size = mi.load_dict(wanted), camera.size
            # A sensor that is moved needs no other kernel, as a new one does. Without the first
            # move a value that happens to be 0 would become a part of the code.
            values = mi.traverse(self._sensor)
            values["to_world"] = mi.Transform4f(wanted["to_world"].matrix)
            values.update()
            color = self._rendered(mi, self._path, self._samples)
            if not self._denoised:
                return color
            guides = self._rendered(mi, self._guides, min(self._samples, GUIDE_SAMPLES))
        albedo, normal = (np.ascontiguousarray(guides[..., i : i + 3]) for i in (0, 3))
        clean: Floats = import_module("pyoidn").denoise(
            color, np.clip(albedo, 0.0, 1.0), np.nan_to_num(normal), hdr=True, quality=QUALITY
        )
        return clean

    def _rendered(self, mi: Any, integrator: Any, samples: int) -> Floats:
        image = mi.render(self._world.scene, sensor=self._sensor, integrator=integrator, spp=samples, seed=self._seed)
        return np.array(image, np.float32)


def frames(context: Context, setting: str, *, denoised: bool = False, first: bool = False) -> Subject:
    """Load the scene, to make whole frames of it; the setting is the number of paths a pixel.

    Args:
        context, setting: see `Family`.
        denoised: whether Intel's denoiser follows.
        first: each frame with the scene loaded anew; else it stays and the camera moves.
    """
    samples = count_of(setting, "paths per pixel", 1, MOST_PATHS)
    view, cameras = context.view, moving_cameras(context)
    made: PathFrames | None = None

    def forget() -> None:
        nonlocal made
        made = None
        gc.collect()

    def frame(camera: Camera) -> Floats:
        nonlocal made
        if made is None:
            made = PathFrames(view.scene, view.own_lights, samples, denoised=denoised)
        return made.frame(camera)

    return Subject(
        run=lambda: frame(context.camera if first else next(cameras)),
        image=lambda: frame(context.camera),
        setup=forget if first else None,
        on_device=False,
        quantity="radiance",
        truths={"world": context.radiance},
        counted="the whole frame"
        + (", the scene loaded" if first else ", the camera moves")
        + (", denoised" if denoised else ""),
    )


KEPT: Mapping[str, Family] = {f"mitsuba-frame{suffix}": family for suffix, family in families(frames).items()}
"""Of a scene that stays."""
FAMILIES: Mapping[str, Family] = {
    **KEPT,
    **{f"mitsuba-frame{suffix}-first": family for suffix, family in families(frames, first=True).items()},
}
