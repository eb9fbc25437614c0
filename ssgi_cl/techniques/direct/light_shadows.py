"""Screen-space shadows: soft, of any number of lights, without shadow maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import SpotLight, light_extent
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.core.sampling import DEPTH_BIAS, TILE_ORDER
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.direct.light_data import (
    KINDS,
    LIGHT,
    PunctualLight,
    PunctualLights,
    ShadowMap,
    kind_name,
    light_values,
)
from ssgi_cl.techniques.source import camera_of

LIGHT_SHADOW = Struct("LightShadowParams", floats("radius", "extent", "thickness", "bias", "depth_bias"))


@dataclass(frozen=True, kw_only=True)
class LightShadowParams(Params):
    """Parameters of screen-space shadows."""

    radius: float = param(
        0.5, "distance up to which surfaces cast shadows", low=0.0, high=1e30, above=True, unit="scene units"
    )
    taps: int = param(12, "depths read on the way to a light", low=1, high=256)
    thickness: float = param(
        0.5,
        "of surfaces, along the view ray; that of each pixel where the G-buffer has it; "
        "the next depth layer ends them if it is nearer",
        low=0.0,
        high=1e30,
        unit="radii",
    )
    bias: float = param(
        0.01, "height above the tangent plane up to which nothing casts a shadow", low=0.0, high=1.0, unit="radii"
    )


class LightShadows(PunctualLights, Prepared[LightShadowParams]):
    """Direct light of punctual lights with shadows of their maps or, without one, in screen space.

    A light's `radius` or `angle` makes its shadows soft. See `PunctualLights` for the arguments of
    `run`.
    """

    def __init__(
        self, runtime: Runtime, size: Size, params: LightShadowParams | None = None, *, kept: bool = True
    ) -> None:
        super().__init__(runtime, size, kept=kept)
        self._params = params or LightShadowParams()
        self._tile = runtime.array(tile_table())

    def light(
        self,
        target: Plane,
        gbuffer: DeviceGBuffer,
        light: PunctualLight,
        shadow: ShadowMap | None,
        *,
        add: bool,
        region: Region | None,
        lobe: bool = False,
    ) -> None:
        """Queue the pass of one light, which sets `target` or adds to it."""
        if shadow is not None or lobe:
            super().light(target, gbuffer, light, shadow, add=add, region=region, lobe=lobe)
            return
        params = self.params
        kernel = self.runtime.kernel(
            "direct/light_shadows.cl",
            {
                "SHADE_KIND": KINDS.index(type(light)),
                "SHADE_ADD": int(add),
                "LIGHT_TAPS": params.taps,
                "LIGHT_LAYERS": gbuffer.layers,
                "LIGHT_THICKNESS": int(gbuffer.thickness is not None),
                "SHADE_SMOOTH": 0,
            },
            (CAMERA, LIGHT, LIGHT_SHADOW),
        )
        camera = camera_of(gbuffer)
        packed = LIGHT_SHADOW.pack(
            {
                "radius": params.radius,
                "extent": light_extent(light),
                "thickness": params.thickness * params.radius,
                "bias": params.bias,
                "depth_bias": DEPTH_BIAS,
            }
        )
        kernel.run(
            self.size,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            thickness=gbuffer.thickness,
            tile=self._tile,
            irradiance=target,
            camera=gbuffer.camera_struct,
            light=LIGHT.pack(light_values(light, camera, camera, gbuffer)),
            params=packed,
        )

    def _lights(self, gbuffer: DeviceGBuffer, light: PunctualLight) -> bool:
        if isinstance(light, SpotLight) and cone_misses(gbuffer, light):
            self.runtime.skip(f"light {kind_name(light)}", "its cone misses all that is seen")
            return False
        return super()._lights(gbuffer, light)


def cone_misses(gbuffer: DeviceGBuffer, light: SpotLight) -> bool:
    """Return whether a spot light's cone lies outside one of the planes of the view frustum."""
    camera = camera_of(gbuffer)
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    rows, columns = gbuffer.margin
    apex = camera.view[:3, :3] @ np.asarray(light.position) + camera.view[:3, 3]
    axis = camera.view[:3, :3] @ np.asarray(light.direction)
    planes = [(np.array([0.0, 0.0, -1.0]), 0.0)]
    for number, to, at, low, high in (
        (0, to_x, at_x, -columns, camera.width + columns),
        (1, to_y, at_y, -rows, camera.height + rows),
    ):
        ends = sorted((to * low + at, to * high + at))
        for end, sign in zip(ends, (1.0, -1.0), strict=True):
            # sign (position - end k) >= 0 inside, with k the depth or 1.
            inward = np.zeros(3)
            inward[number] = sign
            inward[2] = 0.0 if camera.is_orthographic else sign * end
            planes.append((inward, -sign * end if camera.is_orthographic else 0.0))
    for inward, offset in planes:
        length = float(np.linalg.norm(inward))
        turned = math.acos(float(np.clip(inward @ axis / length, -1.0, 1.0)))
        if inward @ apex + offset < 0.0 and turned - light.cone_angle >= 0.5 * math.pi:
            return True
    return False


def tile_pattern() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return [4, 4, 2] points of the unit disc and [4, 4] shifts of the taps, for each pixel.

    Points follow Vogel's spiral in Bayer's order, so that each 2 x 2 pixels have the whole disc.
    """
    reach = np.sqrt((TILE_ORDER + 0.5) / 16.0)
    angle = TILE_ORDER * (math.pi * (3.0 - math.sqrt(5.0)))
    points = np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=-1)
    bits = [((TILE_ORDER >> bit) & 1) << (3 - bit) for bit in range(4)]
    return points, (np.sum(bits, axis=0) + 0.5) / 16.0


def tile_table() -> NDArray[np.float32]:
    """Return [4 rows, 3, 16 columns] as kernels/direct/light_shadows.cl reads it."""
    points, shift = tile_pattern()
    fields = np.concatenate([points, shift[..., None]], axis=-1).transpose(0, 2, 1)
    return np.ascontiguousarray(np.tile(fields, 4), np.float32)
