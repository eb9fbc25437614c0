"""What glossy surfaces reflect: lights, and what rays within their lobes meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ssgi_cl.core.lights import Light, environments_of
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, rotation_values
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.direct.light_data import BRIGHTEST, PunctualLights, ShadowMap
from ssgi_cl.techniques.occupancy.occupancy_grid import Occupancy
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, LightVolume
from ssgi_cl.techniques.reflections.sky_levels import SkyLevels
from ssgi_cl.techniques.vpl_struct import VPL

REFLECT = Struct(
    "ReflectParams",
    (
        *floats(*ROTATION, "reach", "thick", "texels_per_angle"),
        *floats("per_cell", "cell_x", "cell_y", "cell_z"),
        *((n, "int") for n in ("levels", "margin_columns", "margin_rows")),
    ),
)

RAYS = 1
"""Of a pixel: of 4 x 4 pixels, whose mean is taken, 16. Twice as many change no view's FLIP by more
than .001 and take twice the time."""
STRIDE = 4
"""Pixels between those whose means the second pass takes."""
STEPS = 64
"""Of a ray on the screen, at most."""
THICK_CELLS = 2.0
"""What surfaces that the image shows are taken to be thick, in cells of the occupancy grid."""


class Reflections:
    """Light that surfaces reflect by their Phong lobes, prepared for images of one size.

    Rays are followed on the screen (McGuire and Mara 2014, "Efficient GPU Screen-Space Ray
    Tracing"), from there through the occupancy grid, and environments are looked up over the solid
    angle of a ray (Krivanek and Colbert 2008, "Real-time Shading with Filtered Importance
    Sampling"). Departs: where a ray is blocked by what the image does not show, a coarse volume
    of what surfaces send has its radiance, the same to all sides.
    """

    def __init__(self, runtime: Runtime, size: Size) -> None:
        self.runtime = runtime
        self.size = size
        self._sky = SkyLevels(runtime)
        self._lights = PunctualLights(runtime, size, kept=False)
        self._reflected = Target(runtime, 3, size, kept=False)
        self._volume: LightVolume | None = None
        self._sent = runtime.array(np.zeros(CELLS**3 * FACES * 4, np.float32))

    def run(
        self,
        gbuffer: DeviceGBuffer,
        radiance: Plane,
        *,
        light: Plane,
        lights: Sequence[Light],
        shadows: Sequence[ShadowMap | None],
        occupancy: Occupancy,
        volume: LightVolume,
    ) -> None:
        """Queue the passes that add what lobes reflect to the plane of radiance.

        Args:
            gbuffer: what the camera sees; it mirrors.
            radiance: without lobes, W m^-2 sr^-1.
            light: irradiance by all light over pi.
            lights: any; environments without suns.
            shadows: an entry for each light, see `PunctualLights`.
            occupancy: what blocks rays that leave the image, in the camera's view space.
            volume: what surfaces of the scene send.
        """
        # Before the lights' highlights are added, which rays would find once in a thousand pixels.
        self._trace(gbuffer, radiance, light, lights, occupancy, volume)
        self._lights.add_lobes(radiance, gbuffer, lights, shadows=shadows)

    def _trace(
        self,
        gbuffer: DeviceGBuffer,
        radiance: Plane,
        light: Plane,
        lights: Sequence[Light],
        occupancy: Occupancy,
        volume: LightVolume,
    ) -> None:
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        self._sky.set(environments_of(lights))
        if volume is not self._volume:
            self._volume = volume
            sent = np.minimum(volume.radiance, BRIGHTEST)
            packed = np.concatenate([sent, volume.area[..., None]], axis=-1)
            self._sent.upload(packed.astype(np.float32).ravel())
        reach = volume.side * CELLS
        x, y, z = ((camera.position - volume.low) / volume.side).tolist()
        params = REFLECT.pack(
            {
                "cell_x": x,
                "cell_y": y,
                "cell_z": z,
                "per_cell": 1.0 / (float(occupancy.rays["per_unit"]) * volume.side),
                **rotation_values(camera.view[:3, :3].T),
                "reach": reach,
                "thick": THICK_CELLS * reach / occupancy.cells,
                "texels_per_angle": self._sky.texels_per_angle,
                "levels": self._sky.count,
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
            }
        )
        seen: dict[str, Any] = {
            "linear": gbuffer.linear,
            "normal": gbuffer.normal,
            "albedo": gbuffer.albedo,
            "specular": gbuffer.specular,
            "gloss": gbuffer.gloss,
        }
        macros = {"REFLECT_RAYS": RAYS, "REFLECT_STEPS": STEPS, "REFLECT_CELLS": CELLS, **occupancy.macros}
        with self._reflected.over(gbuffer.seen) as (reflected, over):
            self.runtime.kernel("reflections/reflect_trace.cl", macros, (CAMERA, VPL, REFLECT)).run(
                self.size,
                region=over,
                **seen,
                radiance=radiance,
                light=light,
                sky=self._sky.texels,
                places=self._sky.places,
                volume=self._sent,
                occupancy=occupancy.grid,
                grid_box=occupancy.box,
                reflected=reflected,
                camera=gbuffer.camera_struct,
                rays=occupancy.rays,
                params=params,
            )
            mean = self.runtime.transient.plane(3, self.size)
            passes = ((reflected, mean, 1), (mean, radiance, STRIDE))
            for source, target, stride in passes:
                self.runtime.kernel(
                    "reflections/reflect_add.cl",
                    {"REFLECT_STRIDE": stride, "REFLECT_LAST": int(target is radiance)},
                    (CAMERA, REFLECT),
                ).run(
                    self.size,
                    region=over,
                    **seen,
                    reflected=source,
                    radiance=target,
                    camera=gbuffer.camera_struct,
                    params=params,
                )
