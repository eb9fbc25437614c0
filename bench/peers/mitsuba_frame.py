"""Whole frames by Mitsuba 3's integrator `path`, by samples a pixel, denoised or not.

Surfaces as in the reference, box filter, paths of at most 12 segments. Emission counts on both
sides, as in the reference. After the paths comes nothing, this library's blur (`frame_blur`), or
Intel's Open Image Denoise. Its guides are albedo and normals by rays of their own: asked for
together with the paths they take twice the time.

Kernels that are frozen (`drjit.freeze`) are no faster here: what is a constant of the code becomes an
argument. Paths of `cornell_box` at 800 x 600 take 187 ms in place of 123 with one sample a pixel, of
`hall` 1362 in place of 807, guides 15.3 in place of 16.2 (Dr.Jit 1.5, two cores).
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
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
from .frame_blur import FrameBlur, radius_of
from .mitsuba_rays import VARIANT, missing

Floats = NDArray[np.float32]

MAX_DEPTH = 12
SETTINGS = ("1", "2", "4", "8")
"""Paths a pixel."""


@dataclass(frozen=True)
class Denoiser:
    """A mode of Intel's Open Image Denoise.

    Attributes:
        quality: of its network: "fast" or "high".
        guide_samples: per pixel of the guides.
        clean_below: paths a pixel below which guides are declared free of noise.
    """

    quality: str
    guide_samples: int
    clean_below: int


DENOISERS: Mapping[str, Denoiser] = {"oidn": Denoiser("fast", 4, 4), "oidn-high": Denoiser("high", 16, MOST_PATHS + 1)}
"""Ending of a family's name -> mode. Mean FLIP on the built-in scenes and cornell_box-spot at 400 x 300, with 1, 2, 4
and 8 paths: fast with 4 samples a pixel .135, .113, .096 and .082, declared clean .132, .114, .097 and .083, with 16
samples .130, .112, .095 and .082 (three times as many rays); high with 4 samples .126, .106, .091 and .079, with 16
declared clean .118, .100, .085 and .074, for which the denoiser takes 4 times as long as the fast one. Guides of one
sample at the pixel's middle, as of a G-buffer, err more in all."""


class PathFrames:
    """A scene with its lights in Mitsuba, of which frames are made.

    Args:
        scene, lights: what is seen.
        samples: paths per pixel.
        denoiser: what follows, if anything.
    """

    def __init__(self, scene: Scene, lights: Sequence[Light], samples: int, denoiser: Denoiser | None = None) -> None:
        self._samples, self._denoiser = samples, denoiser
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
            if self._denoiser is None:
                return color
            guides = self._rendered(mi, self._guides, self._denoiser.guide_samples)
        albedo, normal = (np.ascontiguousarray(guides[..., i : i + 3]) for i in (0, 3))
        denoised: Floats = import_module("pyoidn").denoise(
            color,
            np.clip(albedo, 0.0, 1.0),
            np.nan_to_num(normal),
            hdr=True,
            quality=self._denoiser.quality,
            clean_aux=self._samples < self._denoiser.clean_below,
        )
        return denoised

    def _rendered(self, mi: Any, integrator: Any, samples: int) -> Floats:
        image = mi.render(self._world.scene, sensor=self._sensor, integrator=integrator, spp=samples, seed=self._seed)
        return np.array(image, np.float32)


def frames(context: Context, setting: str, *, then: str = "", first: bool = False) -> Subject:
    """Load the scene, to make whole frames of it; the setting is the number of paths a pixel.

    Args:
        context, setting: see `Family`.
        then: what follows: "" nothing, "blur" this library's, or a key of `DENOISERS`.
        first: each frame with the scene loaded anew; else it stays and the camera moves.
    """
    samples = count_of(setting, "paths per pixel", 1, MOST_PATHS)
    view, cameras = context.view, moving_cameras(context)
    made: Callable[[Camera], Floats] | None = None
    scene, ending = view.scene, ""
    if then == "blur":
        ending = f", G-buffer drawn, blurred on the device ({radius_of(samples)} px)"
    elif then:
        ending = f", denoised ({DENOISERS[then].quality})"

    def forget() -> None:
        nonlocal made, scene
        made, scene = None, replace(view.scene)  # another one, as far as what the blur keeps of it goes
        gc.collect()

    def frame(camera: Camera) -> Floats:
        nonlocal made
        if made is None:
            paths = PathFrames(scene, view.own_lights, samples, DENOISERS.get(then)).frame
            made = paths
            if then == "blur":
                blur = FrameBlur(context.runtime, context.size, scene, samples)
                made = lambda camera: blur.run(paths(camera), camera)  # noqa: E731
        return made(camera)

    return Subject(
        run=lambda: frame(context.camera if first else next(cameras)),
        image=lambda: frame(context.camera),
        setup=forget if first else None,
        on_device=False,
        quantity="radiance",
        truths={"world": context.radiance},
        counted="the whole frame" + (", the scene loaded" if first else ", the camera moves") + ending,
    )


def _families(*, first: bool) -> dict[str, Family]:
    return {
        f"mitsuba-frame{then and '-' + then}{'-first' if first else ''}": Family(
            partial(frames, then=then, first=first), SETTINGS, missing=partial(missing, denoised=then in DENOISERS)
        )
        for then in ("", "blur", *DENOISERS)
    }


KEPT: Mapping[str, Family] = _families(first=False)
"""Of a scene that stays."""
FAMILIES: Mapping[str, Family] = {**KEPT, **_families(first=True)}
