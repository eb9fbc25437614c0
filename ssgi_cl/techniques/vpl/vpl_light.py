"""Parameters and helpers shared by the techniques that are lit by virtual point lights."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.params import Params, param
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import MOST_VPLS
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.bands import CELL, Plan
from ssgi_cl.techniques.occupancy.occupancy_grid import MOST_CELLS
from ssgi_cl.techniques.vpl.vpl_choice import on_device_rsms

NEARS = ("disk", "clamped")
LEAST_CUT, MOST_CUT = 1e-30, 1e30
"""Between these float32 holds what is made of a cutoff; all lights exceed one, none the other."""


def cutoff_param(default: float) -> Any:
    """Declare the parameter `cutoff`, whose default differs from technique to technique."""
    return param(
        default,
        "a light counts where its irradiance is more than this share of what it is at "
        "`unit_distance`, face to face; 0: everywhere",
        low=0.0,
        high=1e6,
        shape=bool,
    )


def importance_param() -> Any:
    """Declare the parameter `importance`."""
    return param(
        True,
        "with `visibility`, lights from maps are more where their light reaches what the "
        "camera sees, and so change with it; False: in proportion to flux alone",
    )


def refine_param(more: str = "") -> Any:
    """Declare the parameter `refine`; `more`: what else there is to say of it."""
    about = f"from a distance of sqrt(refine A) to half of that, a light gives way to the 16 that it is made of {more}"
    return param(4.0, about.strip(), low=0.0, high=1e6, shape=bool)


@dataclass(frozen=True, kw_only=True)
class VplParams(Params):
    """Parameters of the lights, and of how far and how near they shine."""

    vpls: int = param(1024, "virtual point lights in all", low=1, high=MOST_VPLS)
    cutoff: float = cutoff_param(0.01)
    unit_distance: float = param(
        1.0, "cutoff k reaches 1 / sqrt(k) such distances", low=0.0, high=1e30, above=True, unit="scene units"
    )
    near: str = param("disk", "near field: form factor of a disc, or 1 / (pi d^2) clamped to 1 / A", choices=NEARS)

    def scaled_cutoff(self, unit: float) -> float:
        """Return cos / (pi d^2) below which a light does not count, d in lengths of `unit`."""
        own = self.cutoff / (math.pi * self.unit_distance**2) * unit**2
        return min(max(own, LEAST_CUT), MOST_CUT) if own > 0.0 else 0.0


class VplKeywords(TypedDict, total=False):
    """Parameters that the functions of both splatting techniques take."""

    unit_distance: float
    near: str
    refine: float
    visibility: bool
    grid: int
    share: int
    importance: bool


def camera_of(gbuffer: DeviceGBuffer, size: Size) -> Camera:
    """Return the camera of a G-buffer.

    Raises:
        ValueError: its size is not (rows, columns) `size`, or it is empty.
    """
    if gbuffer.size != size:
        raise ValueError(f"the G-buffer's size is {gbuffer.size}: expected {size}")
    if gbuffer.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    return gbuffer.camera


class NoLight:
    """The result of a technique to which no light is given: black, with a skipped pass.

    Args:
        runtime: the device.
        size: (rows, columns).
        name: of the pass.
    """

    def __init__(self, runtime: Runtime, size: Size, name: str) -> None:
        self.runtime = runtime
        self.size = size
        self.name = name
        self._black: Plane | None = None

    def skipped(self) -> Plane:
        """Note that the pass is skipped; return a plane of 3 images that is 0, always the same."""
        self.runtime.skip(self.name, "no light")
        if self._black is None:
            self._black = self.runtime.plane(3, self.size)
        return self._black


def lit_by_maps(
    technique: Any,
    params: VplParams,
    gbuffer: GBuffer | DeviceGBuffer,
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    runtime: Runtime | None,
    scene: Scene | None = None,
) -> NDArray[np.float32]:
    """Return irradiance [rows, columns, 3] by lights that are chosen from maps on the device.

    Args:
        technique: its class, prepared unless it was before, with no more lights than texels.
        params: of the technique.
        gbuffer, rsms, runtime, scene: what its function was called with.
    """
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    maps = on_device_rsms(rsms, runtime)
    solid = None if scene is None else device_scene(scene, runtime)
    if not maps:
        return np.zeros((*device.size, 3), np.float32)
    texels = sum(rsm.size[0] * rsm.size[1] for rsm in maps)
    fitting: Any = replace(params, vpls=min(params.vpls, texels))
    if scene is not None and fitting.grid == 0:
        fitting = replace(fitting, grid=MOST_CELLS)  # no pixels have to fill it
    made = runtime.prepared((technique, device.size, fitting.shape()), lambda: technique(runtime, device.size, fitting))
    made.params = fitting
    with runtime.frame():
        where: dict[str, Any] = {} if solid is None else {"scene": solid}
        result = made.run(device, rsms=maps, **where).download()
    return np.ascontiguousarray(np.moveaxis(result, 0, -1))


def lights_plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
    """Return the plan of a technique of virtual point lights: all bands have the same lights, and one occupancy."""
    if arguments.get("visibility") and arguments.get("scene") is None:
        raise ValueError("scene is None: expected a Scene with visibility=True and max_memory, bands show parts of it")
    chosen = {} if arguments.get("method") == "published" else {"importance": False}
    return Plan({**arguments, **chosen}, CELL)
