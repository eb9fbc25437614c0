"""Direct light, and whole frames: with SSAO, with and without skips, and held to path tracing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.params import DEFAULT_PRESET, PRESETS
from ssgi_cl.frame.render import render
from ssgi_cl.frame.skips import SKIPS
from ssgi_cl.techniques.direct.shade import Shade
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps, moving_cameras

MOVING = tuple(name for name in SKIPS if name != "unchanged")
"""Skips of a frame that differs from the one before."""

CHOICES = {"none": (), "all": MOVING, "still": tuple(SKIPS)}
"""Setting -> what may be left out."""

DRAWN = tuple(name for name in MOVING if name != "maps")
"""Skips of a frame whose lights move too."""

MODES: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    **{name: {"preset": name} for name in PRESETS if name != DEFAULT_PRESET},
    "direct": {"bounces": 0},
    "multires": {"indirect": "multires", "layers": 2, "vpls": 4096},
}
"""Name -> keyword arguments of `ssgi_cl.render`."""


def direct(context: Context, setting: str) -> Subject:
    """Make irradiance by the lights ready; the setting is the size of the shadow maps in texels."""
    maps = DrawnMaps(context, count_of(setting, "texels along a side", 16, 8192), flux=False)
    technique = Shade(context.runtime, context.size)
    seen = context.host_gbuffer
    albedo = np.ones((*context.size, 3), np.float32)
    white = DeviceGBuffer(context.runtime, context.size)
    white.upload(GBuffer(camera=context.camera, depth=seen.depth, normal=seen.normal, albedo=albedo))

    def image() -> NDArray[np.float32]:
        # A white surface of irradiance E has the radiance E / pi.
        radiance = technique.run(white, context.punctual_lights, shadows=maps.shadows()).download()
        return np.ascontiguousarray(np.float32(math.pi) * np.moveaxis(radiance, 0, -1))

    return Subject.of_image(
        image,
        quantity="direct",
        samples=9.0 * len(context.punctual_lights) * context.surface_pixels,
        truths={"world": context.direct},
        counted="shadow maps drawn",
    )


def _drawn(context: Context, options: Mapping[str, Any], **others: Any) -> Subject:
    """Return a frame without bounces, of a camera that stays, as a subject."""

    def run() -> object:
        view = context.view
        return render(
            view.scene,
            context.camera,
            view.lights,
            bounces=0,
            ao_radius=context.radius,
            runtime=context.runtime,
            **options,
        )

    return Subject(run=run, **others)


def with_ssao(context: Context, setting: str) -> Subject:
    """Make G-buffer, shadow maps, SSAO, shading and tone curve ready; the setting: SSAO's samples."""
    samples = count_of(setting, "a number of samples of SSAO", 1, 256)
    options = {"ao": "ssao", "ao_samples": samples, "skips": DRAWN}
    return _drawn(context, options, counted="the whole frame, light maps drawn")


def skipping(context: Context, setting: str) -> Subject:
    """Make scene to picture with GTAO ready; the setting says what may be left out.

    `none`, `all` that the scene and its lights allow, or `still` for what a camera that stays
    allows besides.
    """
    skips = CHOICES[checks.choice("setting", setting, tuple(CHOICES))]
    note = "with shadow maps drawn in each frame" if setting == "none" else ""
    return _drawn(context, {"skips": skips}, note=note)


def whole(context: Context, setting: str, *, first: bool = False) -> Subject:
    """Make radiance by `ssgi_cl.render` ready; the setting is a key of `MODES`.

    Args:
        context, setting: see `Family`.
        first: each frame with nothing kept but compiled programs; else scene and lights stay and
            the camera moves.
    """
    mode = MODES[checks.choice("setting", setting, tuple(MODES))]
    runtime, view, cameras = context.runtime, context.view, moving_cameras(context)
    scene = view.scene

    def forget() -> None:
        # Another scene as far as what is kept goes; and all prepared buffers are let go.
        nonlocal scene
        scene = replace(view.scene)
        runtime.forget()

    def frame(camera: Camera) -> NDArray[np.float32]:
        return render(scene, camera, view.own_lights, outputs=("radiance",), runtime=runtime, **mode).radiance

    return Subject(
        run=lambda: frame(context.camera if first else next(cameras)),
        image=lambda: frame(context.camera),
        setup=forget if first else None,
        quantity="radiance",
        truths={"world": context.radiance},
        counted="the whole frame" + (", nothing kept" if first else ", the camera moves"),
    )


FAMILIES: Mapping[str, Family] = {
    "direct": Family(direct, ("512", "1024", "2048")),
    "frame-ssao": Family(with_ssao, ("16",)),
    "frame": Family(whole, tuple(MODES)),
    "frame-first": Family(partial(whole, first=True), tuple(MODES)),
    "skips": Family(skipping, tuple(CHOICES)),
}
