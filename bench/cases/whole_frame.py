"""Whole frames, held to path tracing of all light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.frame.params import DEFAULT_PRESET, PRESETS
from ssgi_cl.frame.render import render
from ssgi_cl.tuning.case import Family, Own, Subject
from ssgi_cl.tuning.context import Context

from ..views import moving_cameras

MODES: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    **{name: {"preset": name} for name in PRESETS if name != DEFAULT_PRESET},
    "direct": {"bounces": 0},
    "multires": {"indirect": "multires", "layers": 2, "vpls": 4096},
}
"""Name -> keyword arguments of `ssgi_cl.render`."""


class Frame(Own):
    """Radiance by `ssgi_cl.render`; the setting is a key of `MODES`.

    Args:
        first: each frame with nothing kept but compiled programs; else scene and lights stay and
            the camera moves.
    """

    SETTINGS = tuple(MODES)

    def __init__(self, *, first: bool = False) -> None:
        self._first = first

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the frames ready."""
        if setting not in MODES:
            raise ValueError(f"setting is {setting!r}: expected one of {', '.join(MODES)}")
        runtime, view, cameras = context.runtime, context.view, moving_cameras(context)
        scene = view.scene

        def forget() -> None:
            nonlocal scene
            scene = replace(view.scene)  # results that a scene keeps itself belong to the former one
            runtime.forget()

        def frame(camera: Camera) -> NDArray[np.float32]:
            return render(
                scene, camera, view.own_lights, outputs=("radiance",), runtime=runtime, **MODES[setting]
            ).radiance

        return Subject(
            run=lambda: frame(context.camera if self._first else next(cameras)),
            image=lambda: frame(context.camera),
            setup=forget if self._first else None,
            quantity="radiance",
            truths={"world": context.radiance},
            counted="the whole frame" + (", nothing kept" if self._first else ", the camera moves"),
        )


FAMILIES: Mapping[str, Family] = {"frame": Frame(), "frame-first": Frame(first=True)}
