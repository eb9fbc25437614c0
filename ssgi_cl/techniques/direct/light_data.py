"""Direct light of spot, point and directional lights, with the shadows of their maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight, light_extent
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_bytes
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, camera_values, floats, ints, rotation_values
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.direct.shadow_fit import CROP_VALUES, Crop
from ssgi_cl.techniques.source import camera_of, margin_values

PunctualLight = SpotLight | PointLight | DirectionalLight

KINDS = (SpotLight, PointLight, DirectionalLight)
"""By their number in kernels, SHADE_KIND."""

BRIGHTEST = 1e30
"""W/sr or W/m^2 (times sr^-1): upper limit of the power of lights, so that float32 holds all sums."""
LIGHT = Struct(
    "LightParams",
    (
        *floats("position_x", "position_y", "position_z"),
        *floats("direction_x", "direction_y", "direction_z"),
        *floats("least_cosine", "facing", "red", "green", "blue", "extent"),
        *floats(*ROTATION, "shift_x", "shift_y", "shift_z"),
        *ints("map_size", "margin_columns", "margin_rows", "layer", "blocks", "crops", "facets"),
    ),
)


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """Depth from a light, in device memory.

    Attributes:
        depth: its images; some may be unused.
        cameras: of the light's faces.
        crops: parts of the faces.
        images: of `depth`, one for each crop.
        table: crops and images on the device.
        blocks: its `ShadowBlocks`; None without them.
        is_fitted: whether it is fitted to the pixels of one frame.
    """

    depth: Plane
    cameras: tuple[Camera, ...]
    crops: tuple[Crop, ...]
    images: tuple[int, ...]
    table: DeviceArray
    blocks: Plane | None = None
    is_fitted: bool = False

    @classmethod
    def of(
        cls,
        depth: Plane,
        cameras: tuple[Camera, ...],
        crops: tuple[Crop, ...],
        images: tuple[int, ...],
        table: DeviceArray,
        *,
        is_fitted: bool = False,
    ) -> ShadowMap:
        """Return the map; send the numbers that kernels read of its crops to `table`."""
        values = [crop.values(image, depth.size[0]) for crop, image in zip(crops, images, strict=True)]
        table.send(np.array(values, np.float32))
        return cls(depth, cameras, crops, images, table, is_fitted=is_fitted)

    @staticmethod
    def new_table(runtime: Runtime, count: int) -> DeviceArray:
        """Return memory for so many crops."""
        return runtime.array(np.zeros((count, CROP_VALUES), np.float32))


class PunctualLights:
    """Direct light of punctual lights, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        kept: whether results are in memory of its own; else each lives as long as somebody refers
            to it.
        smooth: whether a pixel at the edge of a spot light's cone has the share of its light that
            falls onto the pixel's square; else its centre tells.
    """

    def __init__(self, runtime: Runtime, size: Size, *, kept: bool = True, smooth: bool = False) -> None:
        self.runtime = runtime
        self.size = size
        self.smooth = smooth
        self._irradiance = Target(runtime, 3, size, kept=kept)
        if not kept:
            runtime.transient.reserve(plane_bytes(3, size))

    def run(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], *, shadows: Sequence[ShadowMap | None] | None = None
    ) -> Plane | None:
        """Queue the passes; return the sum of all lights, or None if none shines.

        3 images, W/m^2; 0 where nothing is. `shadows` has one entry for each light (None: it casts
        no shadow); environments are passed over.
        """
        lit = [pair for pair in with_shadows(lights, shadows) if self._lights(gbuffer, pair[0])]
        if not lit:
            return None
        with self._irradiance.over(gbuffer.seen) as (irradiance, region):
            for number, (light, shadow) in enumerate(lit):
                self.light(irradiance, gbuffer, light, shadow, add=number > 0, region=region)
        return irradiance

    def add_lobes(
        self,
        radiance: Plane,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        *,
        shadows: Sequence[ShadowMap | None] | None = None,
    ) -> None:
        """Queue the passes that add the reflection of lights by the lobes of a G-buffer to radiance.

        The arguments are as in `run`.
        """
        for light, shadow in with_shadows(lights, shadows):
            if power(light).any():
                self.light(radiance, gbuffer, light, shadow, add=True, region=gbuffer.seen, lobe=True)

    def _lights(self, gbuffer: DeviceGBuffer, light: PunctualLight) -> bool:
        """Return whether a light may reach a surface; note in the frame why not."""
        if power(light).any():
            return True
        self.runtime.skip(f"light {kind_name(light)}", "it emits nothing")
        return False

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
        """Queue the pass of one light, which sets `target` or adds to it.

        The plane is irradiance or, with `lobe`, the radiance that the lobes of surfaces reflect.
        """
        blocks = shadow.blocks if shadow else None
        kernel = self.runtime.kernel(
            "direct/shade_light.cl",
            {
                "SHADE_KIND": KINDS.index(type(light)),
                "SHADE_SHADOW": int(shadow is not None),
                "SHADE_ADD": int(add),
                "SHADE_LOBE": int(lobe),
                "SHADE_SOFT": int(shadow is not None and light_extent(light) > 0.0),
                "SHADE_SMOOTH": int(self.smooth and isinstance(light, SpotLight)),
            },
            (CAMERA, LIGHT),
        )
        camera = camera_of(gbuffer)
        light_camera = shadow.cameras[0] if shadow else camera
        map_ = shadow.depth if shadow else None
        kernel.run(
            self.size,
            region=region,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            map=map_,
            blocks=blocks or map_,
            crops=shadow.table if shadow else None,
            irradiance=target,
            albedo=gbuffer.albedo if lobe else None,
            specular=gbuffer.specular if lobe else None,
            gloss=gbuffer.gloss if lobe else None,
            camera=gbuffer.camera_struct,
            light_camera=CAMERA.pack(camera_values(light_camera)),
            light=LIGHT.pack(
                {
                    **light_values(light, camera, light_camera, gbuffer),
                    "blocks": int(blocks is not None),
                    "crops": len(shadow.crops) if shadow else 0,
                    "facets": int(shadow is not None and shadow.is_fitted and gbuffer.has_facets),
                }
            ),
        )


def with_shadows(
    lights: Sequence[Light], shadows: Sequence[ShadowMap | None] | None
) -> list[tuple[PunctualLight, ShadowMap | None]]:
    """Return the punctual lights among `lights`, each with its shadow map or None."""
    maps = [None] * len(lights) if shadows is None else shadows
    return [(light, map_) for light, map_ in zip(lights, maps, strict=True) if not isinstance(light, Environment)]


def power(light: PunctualLight) -> NDArray[np.float64]:
    """Return RGB intensity in W/sr, or irradiance in W/m^2 of a directional light."""
    value = light.irradiance if isinstance(light, DirectionalLight) else light.intensity
    return np.asarray(value)


def kind_name(light: PunctualLight) -> str:
    """Return "spot", "point" or "directional"."""
    return type(light).__name__.removesuffix("Light").lower()


def face_count(light: Light) -> int:
    """Return the number of faces of a light's maps."""
    return 6 if isinstance(light, PointLight) else 1


def light_values(light: PunctualLight, camera: Camera, light_camera: Camera, gbuffer: DeviceGBuffer) -> dict[str, Any]:
    """Return the members of the kernels' light, in view space, but those of its shadow map."""
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    position = direction = np.zeros(3)
    least = -2.0
    if isinstance(light, (SpotLight, PointLight)):
        # In float64: both may be far from the world's origin and near each other.
        position = turn @ np.asarray(light.position) + shift
    if isinstance(light, (SpotLight, DirectionalLight)):
        direction = turn @ np.asarray(light.direction)
    if isinstance(light, SpotLight):
        least = float(np.cos(light.cone_angle))
    if isinstance(light, PointLight):
        to_light = turn.T
        offset = -to_light @ position
    else:
        to_light = light_camera.view[:3, :3] @ turn.T
        offset = light_camera.view[:3, :3] @ camera.position + light_camera.view[:3, 3]
    red, green, blue = np.minimum(power(light), BRIGHTEST).tolist()
    return {
        **dict(zip(("position_x", "position_y", "position_z"), position, strict=True)),
        **dict(zip(("direction_x", "direction_y", "direction_z"), direction, strict=True)),
        "least_cosine": least,
        "facing": gbuffer.facing,
        "red": red,
        "green": green,
        "blue": blue,
        "extent": light_extent(light),
        **rotation_values(to_light),
        **dict(zip(("shift_x", "shift_y", "shift_z"), offset, strict=True)),
        "map_size": light_camera.height,
        **margin_values(gbuffer.margin),
        "layer": gbuffer.front,
        "blocks": 0,
        "crops": 0,
        "facets": 0,
    }
