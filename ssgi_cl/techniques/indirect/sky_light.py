"""Light of environments at the pixels of a G-buffer, with visibility at any distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, rotation_values
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.indirect.occupancy_grid import OccupancyGrid
from ssgi_cl.techniques.indirect.packed_vpls import VPL
from ssgi_cl.techniques.indirect.sky_directions import sky_directions

BRIGHTEST = 1e30
"""W m^-2 sr^-1: brighter skies count as this, so that float32 holds all sums."""

CONTACT = 2.0
"""Cells of the occupancy grid within which visibility rays miss what blocks them: ambient occlusion
of that radius stands in for them."""

SKY = Struct(
    "SkyParams",
    (
        *floats(*ROTATION, "shift_x", "shift_y", "shift_z", "per_unit", "lift", "facing"),
        *((n, "int") for n in ("directions", "margin_columns", "margin_rows", "layer")),
    ),
)


@dataclass(frozen=True, kw_only=True)
class SkyLightParams(Params):
    """Parameters of the light of environments."""

    directions: int = param(
        128, "that stand for the sky, of which each pixel tries a sixteenth", low=16, high=4096
    )
    blur_radius: int = param(
        4, "of the edge-aware blur, which joins the sixteenths of 4 x 4 pixels; 0: none",
        low=0, high=16, unit="px",
    )
    blur_passes: int = param(1, "how often it is applied", low=0, high=8)


class SkyLight(Prepared[SkyLightParams]):
    """Irradiance by environments, which the triangles of a scene block at any distance.

    Interleaved sampling (Wald et al. 2002, "Interactive Global Illumination using Fast Ray
    Tracing"): each pixel of a 4 x 4 square sends visibility rays through the scene's occupancy grid
    along another sixteenth of a stratified set of directions; the edge-aware blur joins them.
    What blocks within a few cells of a pixel does not count: see `CONTACT`.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `SkyLightParams`.
    """

    def __init__(
        self, runtime: Runtime, size: Size, params: SkyLightParams | None = None
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or SkyLightParams()
        self._raw = Target(runtime, 3, size, kept=False)
        self._blur = Bilateral(
            runtime, size,
            BilateralParams(radius=params.blur_radius, passes=params.blur_passes, sigma=4.0),
            3,
        )
        self._given: tuple[Any, ...] = ()
        self._directions = runtime.array(np.zeros(8, np.float32))
        self._count = 0

    def run(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], *, grid: OccupancyGrid,
        space: Camera,
        unit: float,
    ) -> Plane | None:
        """Queue the passes; return the plane of irradiance, 3 images in W/m^2; None without sky.

        Args:
            gbuffer: what the camera sees.
            lights: of which environments count.
            grid: the occupancy grid of the scene.
            space: the camera in whose view space that grid lies.
            unit: scene units in which the grid counts.
        """
        skies = [each for each in lights if isinstance(each, Environment)]
        skies = [each for each in skies if np.any(np.asarray(each.radiance))]
        if not skies:
            self.runtime.skip("sky light", "no environment shines")
            return None
        camera = gbuffer.camera
        if camera is None:
            raise ValueError("the device G-buffer is empty: draw or upload something first")
        self._look(skies, space)
        turn = space.view[:3, :3] @ camera.view[:3, :3].T
        shift = space.view[:3, :3] @ camera.position + space.view[:3, 3]
        values = {
            **rotation_values(turn),
            **dict(zip(("shift_x", "shift_y", "shift_z"), (shift / unit).tolist(), strict=True)),
            "per_unit": 1.0 / unit, "lift": grid.lift, "facing": gbuffer.facing,
            "directions": self._count, "margin_columns": gbuffer.margin[1],
            "margin_rows": gbuffer.margin[0], "layer": gbuffer.front,
        }
        kernel = self.runtime.kernel("sky_light/sky_light.cl", grid.macros, (CAMERA, VPL, SKY))
        with self._raw.over(gbuffer.seen) as (raw, over):
            kernel.run(
                "sky light", self.size, region=over,
                depth=gbuffer.depth, normal=gbuffer.normal, directions=self._directions,
                occupancy=grid.grid, grid_box=grid.box, irradiance=raw,
                camera=gbuffer.camera_struct, sky=SKY.pack(values),
            )
        return self._blur.run(raw, gbuffer, "sky light", region=gbuffer.seen)

    def _look(self, skies: Sequence[Environment], space: Camera) -> None:
        """Bring the directions of environments to the device, unless they are there."""
        given = (*map(id, skies), space.view.tobytes())
        if given == self._given:
            return
        ways, solid, radiance = sky_directions(skies, self.params.directions)
        table = _table(ways @ space.view[:3, :3].T, solid, radiance)
        self._directions = self.runtime.array(table)
        self._count = table.shape[1]
        self._skies, self._given = tuple(skies), given  # keeps their identities


def _table(
    ways: NDArray[np.float64], solid: NDArray[np.float64], radiance: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return [8, n] as kernels/sky_light/sky_light.cl reads it, n a multiple of 16: directions
    without solid angle come last."""
    table = np.zeros((8, -(-len(ways) // 16) * 16), np.float32)
    table[1] = 1.0
    table[:3, : len(ways)], table[3, : len(ways)] = ways.T, solid
    table[4:7, : len(ways)] = np.minimum(radiance, BRIGHTEST).T
    return table
