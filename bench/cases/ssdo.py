"""SSDO as published and from slices: one bounce by samples, and whole frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment
from ssgi_cl.core.names import Resolution, SsdoMethod
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.auxiliary_views import SIZE, AuxiliaryViews
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Renderer
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.techniques.ssdo.ssdo import Ssdo
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps, DrawnView

MAP_SIZE = 1024
"""Texels along a side of each shadow map."""

EXTRA_CAMERAS = 4
"""As many as published."""

FAR = {"taps": 64, "view_taps": 64}
"""Taps where surfaces send light however far away they are: with 20 a side, what four layers and
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
"""Additions to a single view that find what it misses."""


def bounced(
    context: Context,
    setting: str,
    *,
    method: SsdoMethod = "bitmask",
    resolution: Resolution = "full",
    layers: int = 1,
    overscan: float = 0.0,
    views: int = 0,
    far: bool = False,
) -> Subject:
    """Make light of the lights that near surfaces reflect ready.

    The setting is the number of slices of "bitmask", else of samples.

    Args:
        context, setting: see `Family`.
        method: see `SsdoParams`.
        resolution: "full", "half" or "quarter".
        layers, overscan: of the G-buffer.
        views: extra cameras, drawn in each run.
        far: whether surfaces send light however far away they are, as in the truth; else up to the
            reach of ambient occlusion.
    """
    number = count_of(setting, "a number of samples or slices", 1, 256)
    runtime, punctual_lights = context.runtime, context.some_lights()
    view = DrawnView(context, layers, overscan, attributes=layers)
    counted: dict[str, Any] = {**(FAR if far else {}), "slices" if method == "bitmask" else "samples": number}
    bounds = context.view.scene.bounds
    radius = float(np.linalg.norm(bounds[1] - bounds[0])) if far else context.radius
    params = SsdoParams(radius=radius, method=method, resolution=resolution, **counted)
    technique = Ssdo(runtime, context.size, params, view.gbuffer.margin, layers, layers)
    maps = DrawnMaps(context, MAP_SIZE, flux=False)
    further = AuxiliaryViews(runtime, views, FAR_VIEWS if far else SIZE)

    def image() -> NDArray[np.float32]:
        with runtime.frame():
            gbuffer = _dark(view.draw())
            others = further.drawn(context.view.scene, context.camera, gbuffer, punctual_lights)
            shadows = maps.shadows()
            bounce = technique.run(
                gbuffer, punctual_lights, shadows=shadows, auxiliary_views=map(_dark, others) if views else ()
            ).bounce
            if bounce is None:
                return np.zeros((*context.size, 3), np.float32)
            return np.ascontiguousarray(np.moveaxis(bounce.download(), 0, -1))

    reads = number * (2 * params.taps if method == "bitmask" else params.points().taps)
    drawn = [view.counted, "shadow maps drawn", f"{views} auxiliary cameras drawn" if views else ""]
    return Subject.of_image(
        image,
        quantity="bounce",
        samples=float(context.surface_pixels / RESOLUTIONS[resolution] ** 2 * reads * layers),
        truths={"world": context.bounce},
        counted="; ".join(filter(None, drawn)),
        note="direct light of the lights included",
    )


def _dark(view: DeviceGBuffer) -> DeviceGBuffer:
    """Return a view without emission: the truth is of lights alone."""
    view.emits = False
    return view


FRAMES = (
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
"""Usual settings of `frames`."""


def frames(context: Context, setting: str) -> Subject:
    """Make scene to picture as published ready: SSAO, and SSDO with as many samples in its place.

    The setting is what dims and reflects light, and the number of samples: "ssao-8", "direct-8"
    (directional occlusion alone), "bounce-8", "layers-8" (with a second layer), "points-16" (the
    same, corrected so that light is conserved), "bitmask-2" (the default method with as many
    slices), "bitmask-layers-2" (the same with a second layer), "views-2" (with four extra
    cameras). The rasteriser's part of these alone: "drawn-1" and "drawn-2" are a G-buffer of as
    many layers, "cameras-4" is one of a layer and those of as many extra cameras.
    """
    kind, _, text = setting.rpartition("-")
    number = count_of(text, "a word, - and a number such as ssao-8", 1, 256)
    radius, layers = context.radius, 2 if kind.endswith("layers") else 1
    if kind in ("drawn", "cameras"):
        return _drawn(context, kind, number)
    if kind == "ssao":
        params = FrameParams(bounces=0, ao=SsaoParams(radius=radius, samples=number))
    elif kind in ("direct", "bounce", "layers", "points"):
        method: SsdoMethod = "points" if kind == "points" else "published"
        ssdo = SsdoParams(radius=radius, method=method, samples=number, bounce=kind != "direct")
        params = FrameParams(indirect=ssdo, layers=layers)
    elif kind in ("bitmask", "bitmask-layers", "views"):
        ssdo = SsdoParams(radius=radius, slices=number, resolution="half")
        views = EXTRA_CAMERAS if kind == "views" else 0
        params = FrameParams(indirect=ssdo, layers=layers, auxiliary_cameras=views)
    else:
        raise ValueError(
            f"setting is {setting!r}: expected ssao, direct, bounce, layers, points, "
            "bitmask, bitmask-layers, views, drawn or cameras, and a number, such as ssao-8"
        )
    renderer = Renderer(context.runtime, context.size, params)
    scene, lights = context.view.scene, context.view.lights
    if not any(isinstance(light, Environment) for light in lights):
        lights = (*lights, Environment(EVEN_SKY))  # without any, SSAO has nothing to dim
    cameras = _moving(context.camera)
    return Subject(run=lambda: renderer(scene, next(cameras), lights, exposure=1.0))


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
    view = camera.view.copy()
    view[0, 3] += 1e-3 * float(np.linalg.norm(camera.position) or 1.0)
    return cycle((camera, replace(camera, view=view)))


SAMPLES, SLICES = ("8", "16"), ("1", "2", "4")
FAMILIES: Mapping[str, Family] = {
    "ssdo-published": Family(partial(bounced, method="published"), SAMPLES),
    "ssdo-points": Family(partial(bounced, method="points"), SAMPLES),
    "ssdo-points-layers": Family(partial(bounced, method="points", layers=2, overscan=0.1), SAMPLES),
    "ssdo-bitmask": Family(bounced, SLICES),
    "ssdo-bitmask-half": Family(partial(bounced, resolution="half"), SLICES),
    "ssdo-bitmask-layers": Family(partial(bounced, resolution="half", layers=2, overscan=0.1), SLICES),
    **{
        f"ssdo-far{name}": Family(partial(bounced, far=True, **corrections), ("2", "8"))
        for name, corrections in CORRECTIONS.items()
    },
    "ssdo-frame": Family(frames, FRAMES),
}
