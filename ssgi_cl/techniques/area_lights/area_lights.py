"""Light of emissive surfaces: irradiance of polygons, and how much of it arrives, by rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.hilbert_curve import curve_numbers
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.constants import AREA_CELL_COLUMNS, AREA_CELL_ROWS, AREA_NOISE
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.device.transient import Target
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.area_lights.emitters import Emitters
from ssgi_cl.techniques.bands import banded, fixed_plan
from ssgi_cl.techniques.technique import Technique

AREA = Struct(
    "AreaParams",
    (*floats(*ROTATION, "eye_x", "eye_y", "eye_z", "lift", "before"), *ints("count", "margin_columns", "margin_rows")),
)

MOST_BLUR = 16
"""Radius of the blur at most, px: as far again its cells reach, and where it looks for blockers."""
LIFT = 1e-4
"""Height above its surface at which a ray starts, relative to the diagonal of the scene's box."""


@dataclass(frozen=True, kw_only=True)
class AreaLightsParams(Params):
    """Parameters of the light of emissive surfaces."""

    rays: int = param(1, "shadow rays of a pixel", low=1, high=16)
    more_rays: int = param(4, "further ones of a pixel near which some are blocked and some are not", low=0, high=16)
    blur: int = param(8, "radius of the blur of penumbrae at most; 0 for none", low=0, high=MOST_BLUR, unit="px")


class AreaLightsKeywords(TypedDict, total=False):
    """The parameters of `area_lights`."""

    rays: int
    more_rays: int
    blur: int


class _DeviceEmitters:
    """The emissive surfaces of a scene in device memory, see `Emitters`; no arrays where there are none."""

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        emitters = Emitters.of(scene)
        self.count, self.channels = len(emitters), emitters.channels
        if self.count:
            self.table, self.sources = runtime.array(emitters.table), runtime.array(emitters.sources)


class AreaLights(Prepared[AreaLightsParams]):
    """Light of emissive surfaces, prepared for images of one size.

    Heitz et al. 2018. Departs: see `area_lights`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: of the technique.
    """

    def __init__(self, runtime: Runtime, size: Size, params: AreaLightsParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or AreaLightsParams()
        self._irradiance = Target(runtime, 3, size)
        self._steps = [(params.rays, runtime.array(_noise(params.rays, 0)))]
        if params.more_rays:
            self._steps.append((params.more_rays, runtime.array(_noise(params.more_rays, params.rays))))
        rows, columns = -(-size[0] // AREA_CELL_ROWS), -(-size[1] // AREA_CELL_COLUMNS)
        self._cells = rows * columns

    def run(self, gbuffer: DeviceGBuffer, *, scene: Scene, direct: Plane | None = None) -> Plane | None:
        """Queue the passes; return irradiance by emissive surfaces and `direct` together.

        3 images, W/m^2; 0 where nothing is. None if there is neither.
        """
        runtime = self.runtime
        emitters: _DeviceEmitters = runtime.prepared(
            (_DeviceEmitters, scene.key), lambda: _DeviceEmitters(runtime, scene), of=scene
        )
        if not emitters.count:
            runtime.skip("area_lights", "no surface of the scene emits")
            return direct
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        bvh, channels = scene_bvh(scene, runtime), emitters.channels
        eye = camera.position - scene.origin
        values = AREA.pack({
            **rotation_values(camera.view[:3, :3]),
            "eye_x": float(eye[0]), "eye_y": float(eye[1]), "eye_z": float(eye[2]),
            "lift": LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0))),
            "before": self.params.rays / (self.params.rays + self.params.more_rays),
            "count": emitters.count, "margin_columns": gbuffer.margin[1], "margin_rows": gbuffer.margin[0],
        })  # fmt: skip
        light = runtime.transient.plane(3, self.size)
        macros = {"AREA_CHANNELS": channels}
        cells = runtime.transient.array(self._cells, np.int32)
        cells.fill(0)
        with self._irradiance.over(gbuffer.seen) as (irradiance, region):
            sampled = self._around(2 * channels + 2, region)
            for step, (rays, noise) in enumerate(self._steps):
                given: dict[str, Any] = {**bvh.cutouts, **({} if step else {"irradiance": light})}
                runtime.kernel(
                    "area_lights/area_lights.cl",
                    {**macros, "AREA_RAYS": rays, "AREA_STEP": step, "AREA_HOLES": int(bool(bvh.cutouts))},
                    (CAMERA, AREA),
                ).run(
                    self.size, region=region, depth=gbuffer.depth, normal=gbuffer.normal,
                    emitters=emitters.table, sources=emitters.sources, noise=noise,
                    nodes=bvh.nodes, triangles=bvh.triangles, sampled=sampled, cells=cells,
                    camera=gbuffer.camera_struct, params=values, **given,
                )  # fmt: skip
            added: dict[str, Any] = {} if direct is None else {"direct": direct}
            macros = {**macros, "AREA_REACH": self.params.blur}

            def blur(name: str, own: dict[str, int], **planes: Any) -> None:
                runtime.kernel(f"area_lights/{name}.cl", {**macros, **own}, (CAMERA, AREA)).run(
                    self.size, region=region, depth=gbuffer.depth, normal=gbuffer.normal, cells=cells,
                    camera=gbuffer.camera_struct, params=values, **planes,
                )  # fmt: skip

            if self.params.blur:
                means = self._around(2 * channels + 1, region)
                blur("area_rows", {}, sampled=sampled, means=means)
                sampled = means
            blur("area_filter", {"AREA_ADDS": len(added)}, sampled=sampled, light=light, irradiance=irradiance, **added)
        return irradiance

    def _around(self, count: int, region: Region | None) -> Plane:
        """Return images that are 0 outside of the region: the blur reads beyond it."""
        with Target(self.runtime, count, self.size, kept=False).over(region) as (plane, _):
            return plane


@banded(fixed_plan(AREA_NOISE))
@with_fields_described(AreaLightsParams)
@serialised
def area_lights(
    gbuffer: GBuffer | DeviceGBuffer,
    *,
    scene: Scene,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[AreaLightsKeywords],
) -> NDArray[np.float32]:
    """Compute irradiance by the emissive surfaces of a scene, shadowed by all of it.

    What arrives without blockers is that of polygons, exact for up to 16 quadrilaterals; more are put into 16
    groups, each of which is a rectangle. The share of it that arrives is measured along rays to points of the
    surfaces themselves, more of them in penumbrae, and blurred there.

    Heitz, Hill and McGuire 2018, "Combining Analytic Direct Illumination and Stochastic Shadows", with the
    polygons of Lambert 1760 and the penumbra's width of Fernando 2005, "Percentage-Closer Soft Shadows". Departs:
    matt surfaces; the ratio is of sums over pixels of a surface.

    Args:
        gbuffer: the receivers.
        scene: whose surfaces emit and block. Textured emission counts as its mean. What rays need is kept for the
            next call with the same scene.
        max_memory: as of `gtao`.
        runtime: the device; by default the fastest found.
        **params: the fields of `AreaLightsParams`.

    Returns:
        Irradiance in W/m^2, [rows, columns, 3] float32; 0 where nothing is.

    Raises:
        TypeError, ValueError: an argument of the wrong type, or a parameter out of range.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene")
    chosen = AreaLightsParams(**params)
    device = on_device(gbuffer, runtime)
    if device.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    runtime = device.runtime
    technique: AreaLights = runtime.prepared(
        (AreaLights, device.size, chosen.shape()), lambda: AreaLights(runtime, device.size, chosen)
    )
    with runtime.frame():
        plane = technique.run(device, scene=scene)
        if plane is None:
            return np.zeros((*device.size, 3), np.float32)
        return np.ascontiguousarray(np.moveaxis(plane.download(), 0, -1))


DESCRIPTOR = Technique(
    name="area_lights",
    kind="shading",
    paper="Heitz et al. 2018",
    function=area_lights,
    params=AreaLightsParams,
    technique=AreaLights,
    reference="ssgi_cl.reference.area_lights.area_lights",
    reads=("depth", "normal", "scene"),
    writes=("irradiance",),
)


def _noise(rays: int, first: int) -> NDArray[np.float32]:
    """Return [AREA_NOISE rows, 3 rays, AREA_NOISE columns and 16 more] numbers in [0, 1): points of the R sequence
    (Roberts 2018) along a Hilbert curve, so that those of neighbours are spread evenly. `first`: rays before these."""
    side = AREA_NOISE
    row, column = np.divmod(np.arange(side * side), side)
    places = np.stack([column, row, np.zeros_like(row)], axis=1).astype(np.float64)
    number = np.argsort(np.argsort(curve_numbers(places, places.min(axis=0), places.max(axis=0))))
    ends = first * side * side, (first + rays) * side * side
    points = np.concatenate([r_points(*ends, 1), r_points(*ends, 2)], axis=1).astype(np.float32).reshape(-1, rays * 3)
    tile = np.minimum(points[number], np.float32(1.0 - 2.0**-24)).reshape(side, side, 3 * rays).transpose(0, 2, 1)
    return np.ascontiguousarray(np.concatenate([tile, tile[..., :16]], axis=2))
