"""Pass: one bounce of the light of punctual lights, by one protocol for all techniques."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import OneBounceParams
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, GBUFFER, INDIRECT, INDIRECT_PARAMS, LEVELS, RSM
from ssgi_cl.frame.stage import Stage, Values
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.multires.multires_published import MultiresPublished
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat
from ssgi_cl.techniques.rsm.rsm_gather import RsmGather
from ssgi_cl.techniques.rsm.rsm_published import RsmPublished
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat


class OneBounce(Protocol):
    """A technique of one-bounce indirect light, prepared for one size.

    Attributes:
        name: of its passes.
        blocked: whether triangles of the scene block its light: then it needs the scene.
    """

    @property
    def name(self) -> str: ...

    @property
    def blocked(self) -> bool: ...

    @property
    def params(self) -> OneBounceParams:
        """Its parameters; others of the same shape may be set between two runs."""

    @params.setter
    def params(self, params: OneBounceParams) -> None: ...

    def run(self, gbuffer: DeviceGBuffer, rsm: DeviceRsm, *, scene: DeviceScene | None = None) -> Plane:
        """Queue the passes; return the plane of irradiance.

        Args:
            gbuffer: what the camera sees.
            rsm: the reflective shadow map of all lights.
            scene: whose triangles block light; None where the technique is not `blocked`.
        """

    def levels(self) -> NDArray[np.int32] | None:
        """Return how many pixels apart the latest run computed, see `Frame.levels`, or None."""


@dataclass(eq=False)
class _Technique:
    """A technique of the library as a `OneBounce`."""

    technique: Any
    blocked: bool
    queue: Callable[[DeviceGBuffer, DeviceRsm, DeviceScene | None], Plane]
    computed: Callable[[], NDArray[np.int32]] | None = None

    @property
    def name(self) -> str:
        return str(self.technique.name)

    @property
    def params(self) -> OneBounceParams:
        params: OneBounceParams = self.technique.params
        return params

    @params.setter
    def params(self, params: OneBounceParams) -> None:
        self.technique.params = params

    def run(self, gbuffer: DeviceGBuffer, rsm: DeviceRsm, *, scene: DeviceScene | None = None) -> Plane:
        return self.queue(gbuffer, rsm, scene)

    def levels(self) -> NDArray[np.int32] | None:
        return None if self.computed is None else self.computed()


def _multires(runtime: Runtime, size: Size, params: Any, margin: Size) -> OneBounce:
    splat = MultiresSplat(runtime, size, params)
    return _Technique(
        splat, True, lambda seen, rsm, scene: splat.run(seen, rsms=[rsm], scene=scene), lambda: splat.grid.computed()
    )


def _multires_published(runtime: Runtime, size: Size, params: Any, margin: Size) -> OneBounce:
    splat = MultiresPublished(runtime, size, params)
    return _Technique(splat, False, lambda seen, rsm, scene: splat.run(seen, rsms=[rsm]))


def _vpl(runtime: Runtime, size: Size, params: Any, margin: Size) -> OneBounce:
    splat = VplSplat(runtime, size, params)
    return _Technique(splat, True, lambda seen, rsm, scene: splat.run(seen, rsms=[rsm], scene=scene))


def _gather(runtime: Runtime, size: Size, params: Any, margin: Size) -> OneBounce:
    gather = RsmGather(runtime, size, params, margin)
    return _Technique(gather, False, lambda seen, rsm, scene: gather.run(seen, rsm))


def _gather_published(runtime: Runtime, size: Size, params: Any, margin: Size) -> OneBounce:
    gather = RsmPublished(runtime, size, params, margin)
    return _Technique(gather, False, lambda seen, rsm, scene: gather.run(seen, rsm))


_MAKERS: dict[str, Callable[[Runtime, Size, Any, Size], OneBounce]] = {
    "MultiresSplatParams": _multires,
    "MultiresPublishedParams": _multires_published,
    "VplSplatParams": _vpl,
    "RsmGatherParams": _gather,
    "RsmPublishedParams": _gather_published,
}
"""Name of the parameters -> what prepares the technique."""


def one_bounce_pass(build: Build) -> list[Stage]:
    """Return the pass of the light that surfaces reflect once, or none where it is not asked for."""
    runtime, params = build.runtime, build.techniques[1]
    if params is None:
        return []
    bounce = _MAKERS[type(params).__name__](runtime, build.size, params, build.margin)

    def run(r: Values) -> tuple[Plane, Callable[[], NDArray[np.int32] | None]]:
        bounce.params = r[INDIRECT_PARAMS]
        scene = device_scene(r[CASTING], runtime) if bounce.blocked else None
        return bounce.run(r[GBUFFER], r[RSM], scene=scene), bounce.levels

    return [
        Stage(
            name="bounce",
            reads=(GBUFFER, RSM, INDIRECT_PARAMS, *((CASTING,) if bounce.blocked else ())),
            writes=(INDIRECT, LEVELS),
            run=run,
            label=bounce.name,
        )
    ]
