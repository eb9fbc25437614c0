"""SSDO as published and from slices: one bounce by samples, and what a whole frame takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.auxiliary_views import SIZE, AuxiliaryViews
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Renderer
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.techniques.ssdo.ssdo import Ssdo, SsdoPlanes
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps, DrawnView

MAP_SIZE = 1024
"""Texels along a side of each shadow map."""

EXTRA_CAMERAS = 4
"""As many as published."""

FAR = {"taps": 64, "view_taps": 64}
"""Where surfaces send light however far away they are: with 20 taps a side, what four layers and
overscan add to the Cornell box is lost between them (an RMSE of .39 of the mean, of .17 with 64).
"""

FAR_VIEWS = 1.0
"""Size of auxiliary cameras there, in parts of the first one's: what they are to find in the hall
is light from next door, less than a pixel of smaller ones away.
"""

EVEN_SKY = (0.2, 0.2, 0.2)
"""W m^-2 sr^-1, of scenes without a sky."""

CORRECTIONS: Mapping[str, dict[str, Any]] = {
    "": {},
    "-layer": {"layers": 2},
    "-layers": {"layers": 4},
    "-overscan": {"overscan": 0.1},
    "-views": {"views": EXTRA_CAMERAS},
    "-all": {"layers": 4, "overscan": 0.1, "views": EXTRA_CAMERAS},
}
"""What a single view misses, and what finds it."""


@dataclass(frozen=True)
class SsdoFamily(Own):
    """Light of the lights that near surfaces reflect; the setting is that of the method.

    Attributes:
        method: see `SsdoParams`. The setting is the number of slices of "bitmask", else of samples.
        resolution: "full", "half" or "quarter".
        layers, overscan: of the G-buffer.
        views: extra cameras, drawn in each run.
        far: whether surfaces send light however far away they are, as in the truth; else up to the
            reach of ambient occlusion.
    """

    method: str
    resolution: str = "full"
    layers: int = 1
    overscan: float = 0.0
    views: int = 0
    far: bool = False
    SETTINGS: tuple[str, ...] = ("8", "16")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Draw what the technique reads, and make it ready."""
        number = count_of(setting, "a number of samples or slices", 1, 256)
        if not context.punctual_lights:
            raise ValueError(f"{context.view.name} has no light: expected at least one")
        runtime = context.runtime
        view = DrawnView(context, self.layers, self.overscan, attributes=self.layers)
        counted: dict[str, Any] = {
            **(FAR if self.far else {}),
            "slices" if self.method == "bitmask" else "samples": number,
        }
        bounds = context.view.scene.bounds
        radius = float(np.linalg.norm(bounds[1] - bounds[0])) if self.far else context.radius
        params = SsdoParams(radius=radius, method=self.method, resolution=self.resolution, **counted)
        margin = view.gbuffer.margin
        technique = Ssdo(runtime, context.size, params, margin, self.layers, self.layers)
        punctual_lights = context.punctual_lights
        maps = DrawnMaps(context, MAP_SIZE, flux=False)
        further = AuxiliaryViews(runtime, self.views, FAR_VIEWS if self.far else SIZE)

        def run() -> SsdoPlanes:
            gbuffer = _dark(view.draw())
            views = further.drawn(context.view.scene, context.camera, gbuffer, punctual_lights)
            return technique.run(
                gbuffer,
                punctual_lights,
                shadows=maps.shadows(),
                auxiliary_views=map(_dark, views) if self.views else (),
            )

        def image() -> NDArray[np.float32]:
            with runtime.frame():
                bounce = run().bounce
                if bounce is None:
                    return np.zeros((*context.size, 3), np.float32)
                return np.ascontiguousarray(np.moveaxis(bounce.download(), 0, -1))

        reads = number * (2 * params.taps if self.method == "bitmask" else params.points().taps)
        pixels = np.count_nonzero(context.seen) / RESOLUTIONS[self.resolution] ** 2
        drawn = [view.counted, "shadow maps drawn"]
        drawn += [f"{self.views} auxiliary cameras drawn"] if self.views else []
        return Subject(
            run=image,
            image=image,
            quantity="bounce",
            samples=float(pixels * reads * self.layers),
            truths={"world": context.bounce},
            counted="; ".join(filter(None, drawn)),
            note="direct light of the lights included",
        )


def _dark(view: DeviceGBuffer) -> DeviceGBuffer:
    """Return a view without emission: the truth is of lights alone."""
    view.emits = False
    return view


class Frames(Own):
    """Scene to picture as published: SSAO, and SSDO with as many samples in its place.

    The setting is what dims and reflects light, and the number of samples: "ssao-8", "direct-8"
    (directional occlusion alone), "bounce-8", "layers-8" (with a second layer), "points-16" (the
    same, corrected so that light is conserved), "bitmask-2" (the default method with as many
    slices), "bitmask-layers-2" (the same with a second layer), "views-2" (with four extra
    cameras). The rasteriser's part of these alone: "drawn-1" and "drawn-2" are a G-buffer of as
    many layers, "cameras-4" is one of a layer and those of as many extra cameras.
    """

    SETTINGS = (
        *(f"{kind}-{samples}" for samples in (8, 16) for kind in ("ssao", "direct", "bounce", "layers")),
        "points-16",
        "bitmask-1",
        "bitmask-2",
        "bitmask-layers-2",
        "views-2",
        "drawn-1",
        "drawn-2",
        f"cameras-{EXTRA_CAMERAS}",
    )

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the pipeline ready."""
        kind, _, text = setting.rpartition("-")
        number = count_of(text, "a word, - and a number such as ssao-8", 1, 256)
        runtime, view, radius = context.runtime, context.view, context.radius
        layers = 2 if kind.endswith("layers") else 1
        if kind in ("drawn", "cameras"):
            return _drawn(context, kind, number)
        if kind == "ssao":
            renderer = Renderer(
                runtime, context.size, FrameParams(bounces=0, ao=SsaoParams(radius=radius, samples=number))
            )
        elif kind in ("direct", "bounce", "layers", "points"):
            params = SsdoParams(
                radius=radius,
                method="points" if kind == "points" else "published",
                samples=number,
                bounce=kind != "direct",
            )
            renderer = Renderer(runtime, context.size, FrameParams(indirect=params, layers=layers))
        elif kind in ("bitmask", "bitmask-layers", "views"):
            params = SsdoParams(radius=radius, slices=number, resolution="half")
            views = EXTRA_CAMERAS if kind == "views" else 0
            renderer = Renderer(
                runtime, context.size, FrameParams(indirect=params, layers=layers, auxiliary_cameras=views)
            )
        else:
            raise ValueError(
                f"setting is {setting!r}: expected ssao, direct, bounce, layers, points, "
                "bitmask, bitmask-layers, views, drawn or cameras, and a number, such as ssao-8"
            )
        lights = view.lights
        if not any(isinstance(light, Environment) for light in lights):
            lights = (*lights, Environment(EVEN_SKY))  # without any, SSAO has nothing to dim
        cameras = _moving(context.camera)
        return Subject(run=lambda: renderer(view.scene, next(cameras), lights, exposure=1.0))


def _drawn(context: Context, kind: str, number: int) -> Subject:
    """Return what the rasteriser does of a frame: "drawn" layers, or further "cameras"."""
    runtime, scene = context.runtime, context.view.scene
    layers = number if kind == "drawn" else 1
    rasterizer = Rasterizer(runtime, context.size, layers=layers, attributes=layers)
    further = AuxiliaryViews(runtime, number if kind == "cameras" else 0)
    cameras = _moving(context.camera)

    def run() -> None:
        camera = next(cameras)
        gbuffer = rasterizer.render(device_scene(scene, runtime), camera)
        gbuffer.derive()
        if further.count:
            for _ in further.drawn(scene, camera, gbuffer, context.view.lights):
                pass

    return Subject(run=run, note="the rasteriser's part of a frame")


def _moving(camera: Camera) -> Iterator[Camera]:
    """Return the camera and one a little aside in turns, so that nothing of a frame is kept."""
    return cycle((camera, _moved(camera)))


def _moved(camera: Camera) -> Camera:
    """Return the camera a little aside."""
    view = camera.view.copy()
    view[0, 3] += 1e-3 * float(np.linalg.norm(camera.position) or 1.0)
    return replace(camera, view=view)


FAMILIES: Mapping[str, Family] = {
    "ssdo-published": SsdoFamily("published"),
    "ssdo-points": SsdoFamily("points"),
    "ssdo-points-layers": SsdoFamily("points", layers=2, overscan=0.1),
    "ssdo-bitmask": SsdoFamily("bitmask", SETTINGS=("1", "2", "4")),
    "ssdo-bitmask-half": SsdoFamily("bitmask", "half", SETTINGS=("1", "2", "4")),
    "ssdo-bitmask-layers": SsdoFamily("bitmask", "half", layers=2, overscan=0.1, SETTINGS=("1", "2", "4")),
    **{
        f"ssdo-far{name}": SsdoFamily("bitmask", far=True, SETTINGS=("2", "8"), **corrections)
        for name, corrections in CORRECTIONS.items()
    },
    "ssdo-frame": Frames(),
}
