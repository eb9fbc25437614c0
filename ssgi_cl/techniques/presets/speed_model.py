"""Device speed model: conversion of recorded times to times on this device."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device import sources
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.drivers.caches import cache_folder
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques import presets
from ssgi_cl.version import __version__

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique

SMALL, LARGE = (48, 64), (600, 800)
"""Sizes of the measured pictures."""
SECONDS = 0.15
"""Time for which the runs of each size are repeated."""
FEWEST = 4
"""Repetitions of each size at least."""
ALONE = 0.8
"""Share of all cores' time that an otherwise idle CPU spends on the runs, at least."""


@dataclass(frozen=True)
class SpeedModel:
    """Device time of a technique with fixed parameters, by the size of the picture.

    Attributes:
        call_ms: of a picture, however small.
        pixel_ns: of each of its pixels beside.
    """

    call_ms: float
    pixel_ns: float


def measured(
    runtime: Runtime, technique: type[OcclusionTechnique], parameters: Mapping[str, Any]
) -> tuple[SpeedModel, bool]:
    """Return a device's speed model, measured now, and whether the device was otherwise idle.

    Takes less than half a second once the kernels are compiled.
    """
    params = technique.defaults(**parameters)
    least = []
    for size in (SMALL, LARGE):
        gbuffer = on_device(rolling_ground(size), runtime)
        made = technique(runtime, size, params)
        made.run(gbuffer)  # compiles
        before = time.process_time()
        times = _times_ms(runtime, made, gbuffer)
        busy_ms = 1e3 * (time.process_time() - before)
        # What else the machine does only slows a run down.
        least.append(min(times))
    info = runtime.info
    alone = info.kind != "cpu" or busy_ms >= ALONE * info.units * sum(times)  # of the large one
    few, many = (rows * columns for rows, columns in (SMALL, LARGE))
    pixel_ms = max((least[1] - least[0]) / (many - few), 1e-9)
    call_ms = max(least[0] - pixel_ms * few, 0.0)
    return SpeedModel(call_ms=call_ms, pixel_ns=1e6 * pixel_ms), alone


def speed_model_of(runtime: Runtime, technique: type[OcclusionTechnique]) -> SpeedModel:
    """Return a device's speed model, with the parameters of the recorded one.

    It is measured once for a device, and kept in the cache folder; on a busy machine once for the
    runtime.

    Raises:
        ValueError: the technique has no presets.
    """
    parameters = presets.record(technique.name)["pace"]["parameters"]
    path = cache_folder() / f"speed-model-{_fingerprint(runtime, technique, parameters)}.json"

    def known() -> SpeedModel:
        try:
            return SpeedModel(**json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            pass  # not measured yet, or a file of something else
        speed, alone = measured(runtime, technique, parameters)
        if not alone:
            return speed
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacement(path) as file:
                file.write_text(json.dumps(asdict(speed)), encoding="utf-8")
        except OSError:
            pass  # a read-only home: the next process measures again
        return speed

    speed: SpeedModel = runtime.prepared((SpeedModel, path), known)
    return speed


def predicted_ms(runtime: Runtime, technique: type[OcclusionTechnique], ms: float, size: Size) -> float:
    """Return the device time here at a size, (rows, columns), of a setting recorded with `ms`.

    It is that of a picture full of surfaces: the defaults, with which both devices were measured on
    such a picture, take as long as there, and other settings longer or less by their recorded ratio
    to the defaults. Pictures with sky take less.

    Raises:
        ValueError: the technique has no presets.
    """
    recorded = presets.record(technique.name)
    here = speed_model_of(runtime, technique)
    call_ms = recorded["pace"]["call_ms"]
    defaults_ms = recorded["layers"][0]["default"]["ms"]
    ratio: float = max(ms - call_ms, 0.0) / max(defaults_ms - call_ms, 1e-6)
    return here.call_ms + 1e-6 * ratio * here.pixel_ns * size[0] * size[1]


def rolling_ground(size: Size) -> GBuffer:
    """Return a G-buffer of hills on a tilted ground: occlusion of all kinds and no sky."""
    rows, columns = size
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=columns, height=rows)
    y, x = (np.arange(rows)[:, None] + 0.5) / rows, (np.arange(columns) + 0.5) / rows
    hills = np.sin(17.0 * x) * np.cos(23.0 * y) + 0.5 * np.sin(41.0 * (x + y))
    depth = 6.0 - 3.0 * y + 0.3 * hills
    return GBuffer(camera=camera, depth=depth.astype(np.float32))


def _times_ms(runtime: Runtime, technique: OcclusionTechnique, gbuffer: DeviceGBuffer) -> list[float]:
    """Return the device times of some runs."""
    took: list[float] = []
    end = time.perf_counter() + SECONDS
    while len(took) < FEWEST or time.perf_counter() < end:
        with runtime.frame():
            # A caller's frame has passes of its own.
            before = sum(entry.ms for entry in runtime.times())
            technique.run(gbuffer)
            took.append(sum(entry.ms for entry in runtime.times()) - before)
    return took


def _fingerprint(runtime: Runtime, technique: type[OcclusionTechnique], parameters: Mapping[str, Any]) -> str:
    parts = (
        runtime.info.driver,
        runtime.info.label,
        str(runtime.variant),
        str(os.cpu_count()),
        __version__,
        sources.flatten(f"{technique.name}/{technique.name}.cl"),
        json.dumps(parameters, sort_keys=True),
    )
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
