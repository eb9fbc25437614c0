"""Light of environments with visibility by rays against the triangles of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.environment_samples import Strata, environment_strata
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.hilbert_curve import curve_numbers
from ssgi_cl.core.lights import Environment, Light, are_same, environments_of
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import LUMINANCE
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.constants import SKY_CELL, SKY_NOISE, SKY_ROWS, SKY_STRATUM
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.device.transient import Target, TransientPlane
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.bands import banded, fixed_plan
from ssgi_cl.techniques.environment_light import lit_by_environments
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.technique import Technique

SKY = Struct(
    "SkyParams",
    (
        *floats(*ROTATION, "eye_x", "eye_y", "eye_z", "lift", "far", "depth_scale", "normal_scale"),
        *ints("margin_columns", "margin_rows", "step", "each"),
    ),
)
LIFT = 1e-4
"""Height above its surface at which a ray starts, relative to the diagonal of the scene's box."""
FAR = 2.0
"""Length of a ray, likewise."""
MOST_BLUR = 16
"""Radius of the blur at most, px."""
LARGE = 512
"""Columns of an image of whose rows every fourth finds out where light comes from, and not every one."""
APART = 1.3
"""Times the sum of their half widths: distance of strata that are neighbours."""
WORD = 8
"""Strata of a word of bits, each of whose quarters has one."""


@dataclass(frozen=True, kw_only=True)
class SkyRaysParams(Params):
    """Parameters of the light of environments by rays."""

    strata: int = param(128, "parts of the sphere, of equal flux; rounded up to a multiple of 32", low=32, high=256)
    rays: int = param(1, "rays of a pixel of every second row", low=1, high=16)
    blur: int = param(16, "radius of the blur of penumbrae at most", low=1, high=MOST_BLUR, unit="px")

    @property
    def count(self) -> int:
        """Strata, a multiple of 32."""
        return -(-self.strata // 32) * 32


class SkyRaysKeywords(TypedDict, total=False):
    """The parameters of `sky_rays`."""

    strata: int
    rays: int
    blur: int


class SkyRays(Prepared[SkyRaysParams]):
    """Light of environments by rays, prepared for images of one size.

    Heitz et al. 2018. Departs: see `sky_rays`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: of the technique.
    """

    def __init__(self, runtime: Runtime, size: Size, params: SkyRaysParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or SkyRaysParams()
        self._irradiance = Target(runtime, 3, size)
        self._strata = runtime.empty(params.count * SKY_STRATUM, np.float32)
        self._points = runtime.empty(params.count * SKY_STRATUM, np.float32)
        self._noise = runtime.array(_noise())
        self._environments: tuple[Environment, ...] = ()
        self._colour: list[float] | None = None  # of all strata, if it is one
        self._shines = False

    def run(self, gbuffer: DeviceGBuffer, lights: Sequence[Light], *, scene: Scene) -> Plane | None:
        """Queue the passes; return irradiance by all environments, None if there is no light.

        3 images, W/m^2; 0 where nothing is. Other lights are passed over.
        """
        runtime, params = self.runtime, self.params
        self._sample(lights)
        if not self._shines:
            runtime.skip("sky_rays", "no environment sends light")
            return None
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        bvh = scene_bvh(scene, runtime)
        eye = camera.position - scene.origin
        diagonal = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
        rows, columns = self.size
        step = 4 if columns >= LARGE else 1
        # Half as many again as there are strata above a surface, of what nine cells have: of a band as of the image.
        sent = -(-min(rows, 2 * SKY_CELL) // step) * min(-(-columns // 16), 3 * SKY_CELL // 16)
        each = -(-3 * params.count // (4 * sent))
        values = SKY.pack({
            **rotation_values(camera.view[:3, :3]),
            "eye_x": float(eye[0]), "eye_y": float(eye[1]), "eye_z": float(eye[2]),
            "lift": LIFT * diagonal, "far": FAR * diagonal, **BilateralParams().scales(),
            "margin_columns": gbuffer.margin[1], "margin_rows": gbuffer.margin[0], "step": step, "each": each,
        })  # fmt: skip
        channels = 3 if self._colour is None else 1
        half, lanes = (-(-rows // SKY_ROWS), columns), runtime.variant.lanes
        words = params.count // WORD
        grid = -(-rows // SKY_CELL), -(-columns // SKY_CELL)
        cells = runtime.transient.array(grid[0] * grid[1] * words, np.int32)
        cells.fill(0)
        sought = runtime.transient.array(grid[0] * grid[1] * (words + words // 4), np.int32)
        sampled, smooth = (runtime.transient.plane(channels + 2, half) for _ in range(2))
        given = {
            "depth": gbuffer.depth, "normal": gbuffer.normal, "points": self._points,
            "nodes": bvh.nodes, "triangles": bvh.triangles, "camera": gbuffer.camera_struct,
            "params": values, **bvh.cutouts,
        }  # fmt: skip
        macros = {"SKY_WORDS": words, "SKY_HOLES": int(bool(bvh.cutouts))}
        pieces = -(-columns // lanes)
        with self._irradiance.over(gbuffer.seen) as (irradiance, region):
            if region is not None:
                for plane in (sampled, smooth):
                    if isinstance(plane, TransientPlane):
                        plane.clear()
            runtime.kernel("sky_rays/sky_probe.cl", macros, (CAMERA, SKY)).run(
                self.size, grid=(-(-rows // step), pieces), region=region, cell=(step, lanes), cells=cells, **given
            )
            runtime.kernel("sky_rays/sky_spread.cl", {"SKY_WORDS": words}).run(
                grid, grid=grid, cells=cells, next=self._next, sought=sought
            )
            runtime.kernel(
                "sky_rays/sky_rays.cl", {**macros, "SKY_RAYS": params.rays, "SKY_CHANNELS": channels}, (CAMERA, SKY)
            ).run(
                self.size,
                grid=(half[0], pieces),
                region=region,
                cell=(SKY_ROWS, lanes),
                strata=self._strata,
                noise=self._noise,
                sought=sought,
                sampled=sampled,
                **given,
            )
            seen = {
                "linear": gbuffer.linear, "normal": gbuffer.normal, "camera": gbuffer.camera_struct, "params": values
            }  # fmt: skip
            macros = {"SKY_CHANNELS": channels, "SKY_REACH": params.blur}
            runtime.kernel("sky_rays/sky_blur.cl", {**macros, "SKY_SHAPE": 0}, (CAMERA, SKY)).run(
                self.size,
                grid=(half[0], pieces),
                region=region,
                cell=(SKY_ROWS, lanes),
                value=sampled,
                blurred=smooth,
                **seen,
            )
            red, green, blue = self._colour or (1.0, 1.0, 1.0)
            runtime.kernel("sky_rays/sky_blur.cl", {**macros, "SKY_SHAPE": 1}, (CAMERA, SKY)).run(
                self.size, region=region, value=smooth, blurred=irradiance, red=red, green=green, blue=blue, **seen
            )
        return irradiance

    def _sample(self, lights: Sequence[Light]) -> None:
        now = environments_of(lights)
        if are_same(now, self._environments):
            return
        strata = environment_strata(now, self.params.count)
        self._shines = bool(len(strata.flux))
        if self._shines:
            bright = strata.flux @ LUMINANCE
            colours = strata.flux / bright[:, None]
            same = np.allclose(colours, colours[0], rtol=1e-4, atol=1e-6)
            self._colour = colours[0].tolist() if same else None
            spread = np.maximum(strata.spread, 1e-4)
            table = np.column_stack(
                [strata.vectors, bright, colours, spread, 0.25 / spread, strata.solid_angle, strata.reach]
            )
            self._strata.upload(table.astype(np.float32))
            self._points = self.runtime.array(strata.points.astype(np.float32))
            self._next = self.runtime.array(_next(strata))
        self._environments = now


@banded(fixed_plan(2 * SKY_NOISE))
@with_fields_described(SkyRaysParams)
@serialised
def sky_rays(
    gbuffer: GBuffer | DeviceGBuffer,
    lights: Sequence[Light],
    *,
    scene: Scene,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[SkyRaysKeywords],
) -> NDArray[np.float32]:
    """Compute irradiance by environments, shadowed by all triangles of a scene.

    Parts of the sphere of equal flux stand for the environments. Some pixels of each part of the image find out
    which of these send light; the others send rays to those alone, so that light through a small opening has
    as many as an open sky. Estimates are blurred along surfaces, no wider than half a penumbra.

    Heitz, Hill and McGuire 2018, "Combining Analytic Direct Illumination and Stochastic Shadows", with the parts
    of Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling". Departs: what parts of the sphere would
    give is summed over those that send light.

    Args:
        gbuffer: the receivers.
        lights: environments among them are sampled; others are passed over.
        scene: what casts shadows. What rays need is kept for the next call with the same scene.
        max_memory: as of `gtao`.
        runtime: the device; by default the fastest found.
        **params: the fields of `SkyRaysParams`.

    Returns:
        Irradiance in W/m^2, [rows, columns, 3] float32; 0 where nothing is.

    Raises:
        TypeError, ValueError: an argument of the wrong type, or a parameter out of range.
    """
    return lit_by_environments(SkyRays, SkyRaysParams(**params), gbuffer, lights, scene, runtime)


DESCRIPTOR = Technique(
    name="sky_rays",
    kind="shading",
    paper="Heitz et al. 2018",
    function=sky_rays,
    params=SkyRaysParams,
    technique=SkyRays,
    reference="ssgi_cl.reference.sky_rays.sky_rays",
    reads=("depth", "normal", "lights", "scene"),
    writes=("irradiance",),
)


def _next(strata: Strata) -> NDArray[np.int32]:
    """Return [n, n / 32] bits of the strata next to each: those about as near as their widths say."""
    unit = strata.vectors / np.linalg.norm(strata.vectors, axis=1)[:, None]
    apart = np.arccos(np.clip(unit @ unit.T, -1.0, 1.0))
    near = apart < APART * (strata.spread[:, None] + strata.spread)
    bits = np.packbits(near, axis=1, bitorder="little")
    return np.ascontiguousarray(bits).view(np.int32)


def _noise() -> NDArray[np.float32]:
    """Return [SKY_NOISE rows, SKY_NOISE columns and 16 more] numbers in [0, 1): van der Corput's along a Hilbert curve,
    so that those of any neighbours are spread evenly."""
    side = SKY_NOISE
    row, column = np.divmod(np.arange(side * side), side)
    places = np.stack([column, row, np.zeros_like(row)], axis=1).astype(np.float64)
    number = np.argsort(np.argsort(curve_numbers(places, places.min(axis=0), places.max(axis=0))))
    bits = (side * side - 1).bit_length()
    turned = np.zeros(side * side, np.int64)
    for k in range(bits):
        turned |= (number >> k & 1) << bits - 1 - k
    tile = ((turned + 0.5) / (side * side)).astype(np.float32).reshape(side, side)
    return np.ascontiguousarray(np.concatenate([tile, tile[:, :16]], axis=1))
