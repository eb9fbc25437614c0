"""Base of the ambient occlusion techniques: reduce, occlude, blur, upsample to full size."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypedDict, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import BlurResolution, Preset, Resolution
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane, Size, plane_bytes
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleBlur, UpsampleParams, coarse_size
from ssgi_cl.techniques.presets.choose import params_for
from ssgi_cl.techniques.source import Source

RESOLUTIONS: dict[str, int] = dict(zip(get_args(Resolution), (1, 2, 4), strict=True))
"""Step of the pixels of each."""
BLUR_DEPTH_SIGMA = 0.002
"""Of the blur, per pixel of the result: small enough to keep reliefs a few pixels wide."""
_UNREAD = ("albedo", "emission", "specular", "gloss", "motion")
"""Arrays of a G-buffer that occlusion does not read."""
BLUR_RESOLUTIONS = get_args(BlurResolution)
"""Size at which the blur works: that at which occlusion is computed, or the full one."""


@dataclass(frozen=True, kw_only=True)
class OcclusionParams(Params):
    """Parameters of every technique of ambient occlusion."""

    max_radius_px: float = param(
        math.inf, "limit of the projected radius, for a near view", low=1.0, high=math.inf, unit="px"
    )
    resolution: Resolution = param("full", "size at which occlusion is computed", choices=tuple(RESOLUTIONS))
    blur_radius: int = param(2, "edge-aware blur against noise; 0 for none", low=0, high=16, unit="px")
    blur_passes: int = param(1, "how often it is blurred", low=0, high=64)
    blur_resolution: BlurResolution = param(
        "own",
        "size at which the blur works and its radius counts: that of `resolution`, or full",
        choices=BLUR_RESOLUTIONS,
    )

    cancelling: ClassVar[Mapping[int, float]] = {}
    """Radius of the blur -> its standard deviation in space, px, with which nothing is left of the pattern."""

    @property
    def channels(self) -> int:
        """Images of a result: A, and the technique's other results; all are blurred alike."""
        return 1

    @property
    def halved(self) -> bool:
        """Whether every other pixel is computed, as on a checkerboard, and the blur finds the others."""
        return False

    @property
    def blur(self) -> BilateralParams:
        """Parameters of the blur of A."""
        every = RESOLUTIONS[self.resolution]
        step = every if self.blur_resolution == "own" else 1
        return BilateralParams(
            radius=self.blur_radius,
            passes=self.blur_passes,
            depth_sigma=BLUR_DEPTH_SIGMA * step,
            sigma=self.cancelling.get(self.blur_radius, 0.0) if step == every else 0.0,
        )


class OcclusionKeywords(TypedDict, total=False):
    """`OcclusionParams` as keyword arguments."""

    max_radius_px: float
    resolution: Resolution
    blur_radius: int
    blur_passes: int
    blur_resolution: BlurResolution


class AskedKeywords(TypedDict, total=False):
    """What the techniques' functions take beside parameters."""

    preset: Preset | None
    error: float | None
    budget_ms: float | None
    max_memory: int | None
    runtime: Runtime | None


class OcclusionTechnique(Prepared[Any], ABC):
    """A technique of ambient occlusion, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: of the technique; by default its defaults.
        margin: (rows, columns) by which the G-buffers exceed the result on every side.
        layers: depth layers of the G-buffers.
    """

    name: ClassVar[str]
    """Of the technique, its kernel and its pass."""
    defaults: ClassVar[type[Any]]
    """The dataclass of its parameters, an `OcclusionParams`."""

    def __init__(
        self, runtime: Runtime, size: Size, params: Any = None, margin: Size = (0, 0), layers: int = 1
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.margin = margin
        self.layers = layers
        params = self._params = params or self.defaults()
        self._step = step = RESOLUTIONS[params.resolution]
        coarse, channels = coarse_size(size, step), params.channels
        self._reduced: ReducedGBuffer | None = None
        blur = params.blur
        self._upsample: Upsample | UpsampleBlur | None = None
        late = step > 1 and blur.passes * blur.radius > 0 and params.blur_resolution == "full"
        if late and channels == 1:
            self._upsample = UpsampleBlur(runtime, size, step, blur, background=1.0, kept=blur.passes == 1)
            blur = replace(blur, passes=blur.passes - 1)
        elif step > 1:
            self._upsample = Upsample(runtime, size, UpsampleParams(step=step, background=1.0), channels, kept=not late)
        self._blur = Bilateral(
            runtime, size if late else coarse, blur, channels, kept=late or step == 1, checkerboard=params.halved
        )
        self._blur_first = not late
        last = step == 1 and not self._blur.active
        self._visibility = Target(runtime, channels, coarse, 1.0, kept=last)
        runtime.transient.reserve(2 * plane_bytes(channels, coarse))
        self._prepare()

    @abstractmethod
    def _prepare(self) -> None:
        """Compile the kernels, and allocate what they read beside the G-buffer."""

    def run(self, gbuffer: DeviceGBuffer) -> Plane:
        """Queue the passes; return the plane of A, and of the technique's other results.

        Nothing is allocated after the first call.
        """
        self._check(gbuffer)
        source: Source = gbuffer
        if self._upsample is not None:
            if self._reduced is None:
                self._reduced = ReducedGBuffer(gbuffer, self._step)
            self._reduced.update(gbuffer)
            source = self._reduced
        region = gbuffer.seen_every(self._step)
        background = (1.0, *(0.0,) * (self.params.channels - 1))
        with self._visibility.over(region, background=background) as (result, over):
            self._occlude(result, gbuffer, source, over)
        if self._blur_first:
            result = self._blur.run(source, result, region=region)
        if self._upsample is not None and self._reduced is not None:
            result = self._upsample.run(gbuffer, result, reduced=self._reduced)
        if not self._blur_first and self._blur.active:
            result = self._blur.run(gbuffer, result, region=gbuffer.seen)
        return result

    def __call__(self, gbuffer: GBuffer | DeviceGBuffer, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return A [rows, columns] float32 in [0, 1], written to `out` if given."""
        device = on_device(gbuffer, self.runtime)
        with self.runtime.frame():
            result = self.run(device).download(None if out is None else out[None])
        a: NDArray[np.float32] = result[0]
        return a

    @abstractmethod
    def _check(self, gbuffer: DeviceGBuffer) -> None:
        """Raise ValueError if this was prepared for other G-buffers."""

    @abstractmethod
    def _occlude(self, out: Plane, gbuffer: DeviceGBuffer, source: Source, region: Region | None) -> None:
        """Queue the passes that write A to `out` from `source`: the G-buffer, full or reduced.

        Only pixels in `region` are needed.
        """


T = TypeVar("T", bound=OcclusionTechnique)
G = TypeVar("G", bound=GBuffer | DeviceGBuffer)


def made_for(
    technique: type[T], gbuffer: GBuffer | DeviceGBuffer, runtime: Runtime | None, **given: Any
) -> tuple[T, DeviceGBuffer]:
    """Return a technique, prepared unless it was before, and the G-buffer on its device.

    Args:
        technique: its class.
        gbuffer, runtime, **given: as its function was called; see `params_for`.
    """
    params = params_for(technique, gbuffer, runtime, **given)
    device = surfaces_on_device(gbuffer, runtime)
    return prepared_for(technique, device, params), device


def surfaces_on_device(gbuffer: GBuffer | DeviceGBuffer, runtime: Runtime | None) -> DeviceGBuffer:
    """Return the G-buffer in device memory; of one in host memory only what occlusion reads goes there."""
    if isinstance(gbuffer, GBuffer):
        gbuffer = _without(gbuffer, _UNREAD)
    return on_device(gbuffer, runtime)


def without_thickness(gbuffer: GBuffer | DeviceGBuffer) -> GBuffer | DeviceGBuffer:
    """Return a G-buffer of the same memory whose surfaces' ends are guessed."""
    return _without(gbuffer, ("thickness",))


def _without(gbuffer: G, names: Iterable[str]) -> G:
    """Return a G-buffer of the same memory that lacks some arrays."""
    other = copy(gbuffer)
    for name in names:
        object.__setattr__(other, name, None)
    return other


def prepared_for(technique: type[T], gbuffer: DeviceGBuffer, params: Any) -> T:
    """Return a technique for G-buffers like this one, prepared unless it was before."""
    made: T = gbuffer.runtime.prepared(
        (technique, gbuffer.size, gbuffer.margin, gbuffer.layers, params.shape()),
        lambda: technique(gbuffer.runtime, gbuffer.size, params, gbuffer.margin, gbuffer.layers),
    )
    made.params = params
    return made
