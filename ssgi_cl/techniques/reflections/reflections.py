"""Reflections of glossy surfaces: lights, and rays within the lobes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Light, environments_of
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene, box_corners, mean_emission
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.constants import REFLECT_SMOOTH
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.device.transient import Target
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.bands import Plan, banded
from ssgi_cl.techniques.direct.light_data import BRIGHTEST, PunctualLights, ShadowMap
from ssgi_cl.techniques.direct.shadow_maps import checked_lights, uploaded_maps
from ssgi_cl.techniques.occupancy.occupancy_grid import Occupancy, OccupancyGrid
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles
from ssgi_cl.techniques.radiosity.light_volume import LightVolume, device_volume
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.sky_levels import SkyLevels
from ssgi_cl.techniques.technique import Bench, Technique
from ssgi_cl.techniques.vpl.vpl_choice import on_device_rsms
from ssgi_cl.techniques.vpl.vpl_light import camera_of

REFLECT = Struct(
    "ReflectParams",
    (
        *floats(*ROTATION, "reach", "thick", "texels_per_angle"),
        *floats("per_unit", "per_cell", "cell_x", "cell_y", "cell_z"),
        *floats("eye_x", "eye_y", "eye_z", "perfect"),
        *ints("levels", "margin_columns", "margin_rows"),
    ),
)

STRIDE = 4
"""Pixels between those whose means the second pass takes."""
PERFECT = 1e5
"""Gloss from which on a pixel takes what its own mirrored ray meets, and no mean."""


class _Surfaces:
    """The triangles of a scene without holes, and what each emits and mirrors."""

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        self.bvh = scene_bvh(scene, runtime)
        emission = np.array([mean_emission(scene, material) for material in scene.materials])
        albedo = np.array([material.albedo for material in scene.materials])
        specular = np.minimum([material.specular for material in scene.materials], 1.0 - albedo)
        matt = albedo.sum(axis=1) / np.maximum((albedo + specular).sum(axis=1), 1e-9)
        smooth = np.array([material.gloss >= REFLECT_SMOOTH for material in scene.materials])
        surfaces = np.column_stack(
            [np.minimum(emission, BRIGHTEST), emission.any(axis=1), specular * smooth[:, None], matt]
        )
        self.surfaces = runtime.array(surfaces[scene.material_ids].astype(np.float32).ravel())


@dataclass(frozen=True, kw_only=True)
class ReflectionsParams(Params):
    """Parameters of reflections.

    Twice as many rays change no view's FLIP by more than .001 and take twice the time.
    """

    rays: int = param(1, "rays of a pixel; the mean of 256 pixels is taken, of sharp lobes of 16", low=1, high=64)
    steps: int = param(64, "steps of a ray on the screen, at most; in scenes with holes", low=1, high=1024, unit="px")
    thickness: float = param(
        2.0,
        "what surfaces that the image shows are taken to be thick, in scenes with holes",
        low=0.0,
        high=256.0,
        unit="cells of the occupancy grid",
    )


class ReflectionsKeywords(TypedDict, total=False):
    """The parameters of `reflections`."""

    rays: int
    steps: int
    thickness: float


class Reflections(Prepared[ReflectionsParams]):
    """Light that surfaces reflect by their Phong lobes, prepared for images of one size.

    Rays meet the triangles of the scene, in scenes with holes what the image shows (McGuire and Mara 2014,
    "Efficient GPU Screen-Space Ray Tracing") and the occupancy grid. Environments are looked up over the solid
    angle of a ray (Krivanek and Colbert 2008, "Real-time Shading with Filtered Importance
    Sampling"). Departs: where a ray is blocked by what the image does not show, a coarse volume
    of what surfaces send has its radiance, the same to all sides.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: see `ReflectionsParams`.
    """

    def __init__(self, runtime: Runtime, size: Size, params: ReflectionsParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params or ReflectionsParams()
        self._sky = SkyLevels(runtime)
        self._lights = PunctualLights(runtime, size, kept=False)
        self._reflected = Target(runtime, 3, size, kept=False)
        self._volume: LightVolume | None = None
        self._cells = self._records = runtime.array(np.zeros(1, np.float32))

    def run(
        self,
        gbuffer: DeviceGBuffer,
        radiance: Plane,
        *,
        light: Plane,
        lights: Sequence[Light],
        shadows: Sequence[ShadowMap | None],
        volume: LightVolume,
        occupancy: Occupancy | None = None,
        scene: Scene | None = None,
    ) -> None:
        """Queue the passes that add what lobes reflect to the plane of radiance.

        Args:
            gbuffer: what the camera sees; it mirrors.
            radiance: without lobes, W m^-2 sr^-1.
            light: irradiance by all light over pi.
            lights: any; environments without suns.
            shadows: an entry for each light, see `PunctualLights`.
            volume: what surfaces of the scene send.
            occupancy: what blocks rays that leave the image, in the camera's view space.
            scene: without holes, whose triangles rays meet where no `occupancy` is given.
        """
        self._sky.set(environments_of(lights))
        params = self._packed(gbuffer, occupancy, volume, scene)
        seen: dict[str, Any] = {
            "linear": gbuffer.linear,
            "normal": gbuffer.normal,
            "albedo": gbuffer.albedo,
            "specular": gbuffer.specular,
            "gloss": gbuffer.gloss,
        }
        with self._reflected.over(gbuffer.seen) as (reflected, over):
            arriving: dict[str, Any] = {
                **seen,
                "radiance": radiance,
                "light": light,
                "sky": self._sky.texels,
                "places": self._sky.places,
                "cells": self._cells,
                "volume": self._records,
                "reflected": reflected,
                "camera": gbuffer.camera_struct,
                "params": params,
            }
            name, macros, blocking = self._blocking(occupancy, scene)
            self.runtime.kernel(name, {"REFLECT_RAYS": self.params.rays, **macros}, (CAMERA, REFLECT)).run(
                self.size, region=over, **arriving, **blocking
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
        # Last, as rays would find the lights' highlights once in a thousand pixels.
        self._lights.add_lobes(radiance, gbuffer, lights, shadows=shadows)

    def _blocking(self, occupancy: Occupancy | None, scene: Scene | None) -> tuple[str, dict[str, int], dict[str, Any]]:
        """Return the kernel that follows rays, its macros, and what blocks them."""
        runtime = self.runtime
        if occupancy is not None:
            macros = {"REFLECT_STEPS": self.params.steps, **occupancy.macros}
            return "reflections/reflect_trace.cl", macros, occupancy.arguments
        assert scene is not None  # noqa: S101  one of the two is given
        kept: _Surfaces = runtime.prepared((_Surfaces, scene.key), lambda: _Surfaces(runtime, scene), of=scene)
        met = {**kept.bvh.first, "surfaces": kept.surfaces}
        return "reflections/reflect_mirror.cl", kept.bvh.first_macros, met

    def _packed(
        self, gbuffer: DeviceGBuffer, occupancy: Occupancy | None, volume: LightVolume, scene: Scene | None
    ) -> Any:
        """Upload the volume unless it is that of the latest run; return the struct `REFLECT`."""
        camera = camera_of(gbuffer, self.size)
        if volume is not self._volume:
            self._volume = volume
            self._cells, self._records = device_volume(self.runtime, volume)
        reach = volume.extent
        per_unit = 1.0 if occupancy is None else float(np.float32(1.0 / occupancy.unit))  # as kernels round it
        x, y, z = ((camera.position - volume.low) / volume.side).tolist()
        eye = np.zeros(3) if scene is None else camera.position - scene.origin
        return REFLECT.pack(
            {
                "eye_x": eye[0],
                "eye_y": eye[1],
                "eye_z": eye[2],
                "perfect": PERFECT if occupancy is None else np.inf,
                "cell_x": x,
                "cell_y": y,
                "cell_z": z,
                "per_unit": per_unit,
                "per_cell": 1.0 / (per_unit * volume.side),
                **rotation_values(camera.view[:3, :3].T),
                "reach": reach,
                "thick": 0.0 if occupancy is None else self.params.thickness * reach / occupancy.cells,
                "texels_per_angle": self._sky.texels_per_angle,
                "levels": self._sky.count,
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
            }
        )


def _plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
    # The rays of a pixel, and of those whose mean it has.
    rows = arguments.get("steps", ReflectionsParams().steps) + 4 * STRIDE
    return Plan(arguments, rows, images={"radiance": 1, "irradiance": 1})


@banded(_plan)
@with_fields_described(ReflectionsParams)
@serialised
def reflections(
    gbuffer: GBuffer | DeviceGBuffer,
    radiance: ArrayLike,
    lights: Sequence[Light],
    *,
    scene: Scene,
    shadow_maps: Sequence[ReflectiveShadowMap | None] | None = None,
    irradiance: ArrayLike | None = None,
    radiosity: RadiosityParams | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[ReflectionsKeywords],
) -> NDArray[np.float32]:
    """Compute what glossy surfaces reflect of lights, environments and other surfaces.

    McGuire and Mara 2014, "Efficient GPU Screen-Space Ray Tracing". Departs: rays are distributed
    as the lobe, see `Reflections`.

    Args:
        gbuffer: what the camera sees; without `specular` and `gloss` nothing is reflected.
        radiance: [rows, columns, 3] in W m^-2 sr^-1, >= 0, of the same surfaces without their lobes, as
            `shade` returns it for a G-buffer without `specular` and `gloss`.
        lights: lights and environments.
        scene: what blocks rays, and what they meet where the image does not show it.
        shadow_maps: for each light its reflective shadow map or None, as in `shade`.
        irradiance: [rows, columns, 3] in W/m^2, >= 0, by all light: what mirrors send that are seen
            in mirrors. None: nothing.
        radiosity: parameters of the light that surfaces send which the image does not show; its
            `grid` is that of the rays too.
        max_memory: as of `gtao`; rays are followed in their band of the screen alone.
        runtime: the device; by default the fastest found.
        **params: the fields of `ReflectionsParams`.

    Returns:
        [rows, columns, 3] float32 radiance in W m^-2 sr^-1: that given, and what lobes reflect.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    lights = checked_lights(lights, shadow_maps)
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene")
    chosen, sent = ReflectionsParams(**params), radiosity or RadiosityParams()
    device = on_device(gbuffer, runtime)
    runtime, size = device.runtime, device.size
    camera = camera_of(device, size)
    given = {"radiance": (radiance, "W m^-2 sr^-1", 1.0), "irradiance": (irradiance, "W/m^2", 1.0 / np.pi)}
    planes = {}
    for name, (array, unit, scale) in given.items():
        values = checks.plane(name, np.zeros((*size, 3)) if array is None else array, channels=3, low=0.0, unit=unit)
        if values.shape[:2] != size:
            raise ValueError(f"{name} has shape {values.shape[:2]}: expected {size} as the G-buffer")
        planes[name] = runtime.prepared((reflections, name, size), lambda: runtime.plane(3, size))
        planes[name].upload(np.moveaxis(values, -1, 0) * np.float32(scale))
    if not device.mirrors:
        return np.array(radiance, np.float32)
    surfaces: Radiosity = runtime.prepared((Radiosity, sent.shape()), lambda: Radiosity(runtime, sent))
    blocked = None
    technique: Reflections = runtime.prepared(
        (Reflections, size, chosen.shape()), lambda: Reflections(runtime, size, chosen)
    )
    technique.params = chosen
    shadows = uploaded_maps(lights, shadow_maps, runtime)
    maps = on_device_rsms([rsm for rsm in shadow_maps or () if rsm is not None], runtime)
    half = float(np.abs(box_corners(scene.bounds) @ camera.view[:3, :3].T + camera.view[:3, 3]).max())
    with runtime.frame():
        if not rays_meet_triangles(scene):
            grid: OccupancyGrid = runtime.prepared(
                (OccupancyGrid, sent.grid), lambda: OccupancyGrid(runtime, sent.grid, size)
            )
            blocked = grid.fill_scene(device_scene(scene, runtime), camera.view, half, -half, half)
        technique.run(
            device,
            planes["radiance"],
            light=planes["irradiance"],
            lights=lights,
            shadows=shadows,
            volume=surfaces.run(scene, lights, rsms=maps).volume(),
            occupancy=blocked,
            scene=scene,
        )
        return np.ascontiguousarray(np.moveaxis(planes["radiance"].download(), 0, -1))


DESCRIPTOR = Technique(
    name="reflections",
    kind="indirect",
    paper="McGuire and Mara 2014",
    function=reflections,
    params=ReflectionsParams,
    technique=Reflections,
    reference="ssgi_cl.reference.reflections.reflections",
    reads=("depth", "normal", "albedo", "specular", "gloss", "lights", "shadow_maps", "scene", "image"),
    writes=("radiance",),
    bench=Bench(rows={"reflections": ("what glossy surfaces reflect", (("one ray a pixel", "reflections.1"),))}),
)
