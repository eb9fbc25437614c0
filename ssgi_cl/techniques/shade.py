"""Deferred shading: radiance from a G-buffer, lights, their shadow maps and ambient occlusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl import check
from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer, on_device
from ssgi_cl.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.memory import DeviceArray, Plane, Size
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import (
    CAMERA,
    ROTATION,
    Struct,
    camera_values,
    floats,
    rotation_values,
)

Lamp = SpotLight | PointLight | DirectionalLight

BRIGHTEST = 1e30
"""W/sr or W/m^2 (times sr^-1): brighter light counts as this, so that float32 holds all sums."""
LIGHT = Struct(
    "LightParams",
    (
        *floats("position_x", "position_y", "position_z"),
        *floats("direction_x", "direction_y", "direction_z"),
        *floats("least_cosine", "red", "green", "blue"),
        *floats(*ROTATION, "shift_x", "shift_y", "shift_z"),
        ("map_size", "int"),
        ("margin_columns", "int"),
        ("margin_rows", "int"),
    ),
)
COMBINE = Struct(
    "CombineParams",
    (
        *floats(*ROTATION),
        *((n, "int") for n in ("sky_columns", "sky_rows", "margin_columns", "margin_rows")),
    ),
)


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """The depth that a light sees, in device memory: one image for each of its cameras."""

    depth: Plane
    cameras: tuple[Camera, ...]


class Shade:
    """Deferred shading, prepared for images of one size."""

    def __init__(self, runtime: Runtime, size: Size) -> None:
        self.runtime = runtime
        self.size = size
        self._direct = runtime.plane(3, size)
        self._radiance = runtime.plane(3, size)
        self._nothing = runtime.plane(1, (1, 1))
        self._ambient = runtime.array(np.zeros(27, np.float32))
        self._sky = runtime.array(np.zeros(3, np.float32))
        self._sky_size = (1, 1)
        self._has_ambient = False
        self._environments: list[Environment] | None = None

    def run(
        self,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        *,
        shadows: Sequence[ShadowMap | None] | None = None,
        openness: Plane | None = None,
        indirect: Plane | None = None,
        multi_bounce: bool = False,
    ) -> Plane:
        """Queue the passes; return the plane of radiance.

        `shadows` has one entry for each light (None: it casts no shadow), `openness` is A;
        `multi_bounce` brightens A, see `shade`.
        """
        maps = list(shadows) if shadows is not None else [None] * len(lights)
        lit = False
        for light, shadow in zip(lights, maps, strict=True):
            if isinstance(light, Environment):
                continue
            if not power(light).any():
                self.runtime.skip(f"light {kind_name(light)}", "it emits nothing")
                continue
            self._light(gbuffer, light, shadow, add=lit)
            lit = True
        return self._combine(gbuffer, lights, lit, openness, indirect, multi_bounce)

    def _light(
        self, gbuffer: DeviceGBuffer, light: Lamp, shadow: ShadowMap | None, *, add: bool
    ) -> None:
        kernel = self.runtime.kernel(
            "shade/shade_light.cl",
            {
                "SHADE_KIND": (SpotLight, PointLight, DirectionalLight).index(type(light)),
                "SHADE_SHADOW": int(shadow is not None),
                "SHADE_ADD": int(add),
            },
            (CAMERA, LIGHT),
        )
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        light_camera = shadow.cameras[0] if shadow else camera
        kernel.run(
            f"light {kind_name(light)}",
            self.size,
            reads=[gbuffer.depth, gbuffer.normal, shadow.depth if shadow else self._nothing],
            writes=[self._direct],
            values=[
                gbuffer.camera_struct,
                CAMERA.pack(camera_values(light_camera)),
                LIGHT.pack(_light_values(light, camera, light_camera, gbuffer.margin)),
            ],
        )

    def _combine(
        self,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        lit: bool,
        openness: Plane | None,
        indirect: Plane | None,
        multi_bounce: bool,
    ) -> Plane:
        self._set_environments([light for light in lights if isinstance(light, Environment)])
        sky_rows, sky_columns = self._sky_size
        kernel = self.runtime.kernel(
            "shade/shade_combine.cl",
            {
                "SHADE_DIRECT": int(lit),
                "SHADE_AO": int(openness is not None),
                "SHADE_BOUNCES": int(multi_bounce and openness is not None),
                "SHADE_INDIRECT": int(indirect is not None),
                "SHADE_EMISSION": int(gbuffer.emits),
                "SHADE_AMBIENT": int(self._has_ambient),
                "SHADE_SKY": int(sky_rows * sky_columns > 1),
            },
            (CAMERA, COMBINE),
        )
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        to_world = camera.view[:3, :3].T
        values = {
            **rotation_values(to_world),
            "sky_columns": sky_columns,
            "sky_rows": sky_rows,
            "margin_columns": gbuffer.margin[1],
            "margin_rows": gbuffer.margin[0],
        }
        kernel.run(
            "combine",
            self.size,
            reads=[
                gbuffer.linear, gbuffer.normal, gbuffer.albedo, gbuffer.emission,
                self._direct, openness or self._nothing, indirect or self._nothing,
                self._ambient, self._sky,
            ],
            writes=[self._radiance],
            values=[gbuffer.camera_struct, COMBINE.pack(values)],
        )
        return self._radiance

    def _set_environments(self, environments: list[Environment]) -> None:
        """Bring ambient coefficients and sky to the device, unless they are those of last time."""
        before = self._environments
        same = before is not None and len(before) == len(environments)
        if same and all(a is b for a, b in zip(before or (), environments, strict=True)):
            return  # an environment never changes
        coefficients = sum((e.irradiance_coefficients() for e in environments), np.zeros((9, 3)))
        self._has_ambient = bool(coefficients.any())
        self._ambient.upload(np.clip(coefficients, -BRIGHTEST, BRIGHTEST).astype(np.float32))
        sky = _sky_image(environments)
        if sky.size > self._sky.count:
            self._sky = DeviceArray(self.runtime, sky)
        self._sky.upload(sky)
        self._sky_size = (sky.shape[0], sky.shape[1])
        self._environments = environments


def shade(
    gbuffer: GBuffer | DeviceGBuffer,
    lights: Sequence[Light],
    *,
    rsms: Sequence[ReflectiveShadowMap | None] | None = None,
    ao: ArrayLike | None = None,
    indirect: ArrayLike | None = None,
    multi_bounce: bool = False,
    runtime: Runtime | None = None,
) -> NDArray[np.float32]:
    """Compute radiance from a G-buffer: direct light with shadows, ambient light, emission.

    Args:
        gbuffer: what the camera sees.
        lights: any number of lights; environments add up.
        rsms: for each light its reflective shadow map, whose depth casts its shadow, or None for
            no shadow. None for all lights by default.
        ao: A [rows, columns] in [0, 1]; dims the light of environments, never that of lamps.
        indirect: irradiance [rows, columns, 3] in W/m^2 to add, >= 0.
        multi_bounce: whether A is brightened by the surface's albedo, see `multi_bounce`.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns, 3] float32 radiance in W m^-2 sr^-1, not clamped; where nothing is there,
        the radiance of the environments (0 without any).

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    lights = tuple(lights)
    for index, light in enumerate(lights):
        if not isinstance(light, (SpotLight, PointLight, DirectionalLight, Environment)):
            raise TypeError(f"lights[{index}] is {type(light).__name__}: expected a light")
    if rsms is not None and len(rsms) != len(lights):
        raise ValueError(
            f"rsms has {len(rsms)} entries: expected {len(lights)}, one for each light"
        )
    check.switch("multi_bounce", multi_bounce)
    for index, rsm in enumerate(rsms or ()):
        if rsm is not None and not isinstance(lights[index], Environment):
            _checked(rsm, lights[index], index)
    device = on_device(gbuffer, runtime)
    if device.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    runtime = device.runtime
    size = device.size
    technique: Shade = runtime.prepared((Shade, size), lambda: Shade(runtime, size))
    openness = None
    if ao is not None:
        values = check.plane("ao", ao, low=0.0, high=1.0)
        _same_size("ao", values.shape, size)
        openness = runtime.prepared((shade, "ao", size), lambda: runtime.plane(1, size, 1.0))
        openness.upload(values[None])
    added = None
    if indirect is not None:
        values = check.plane("indirect", indirect, channels=3, low=0.0, unit="W/m^2")
        _same_size("indirect", values.shape[:2], size)
        added = runtime.prepared((shade, "indirect", size), lambda: runtime.plane(3, size))
        added.upload(np.moveaxis(values, -1, 0))
    shadows: list[ShadowMap | None] = [None] * len(lights)
    for index, rsm in enumerate(rsms or ()):
        if rsm is not None and not isinstance(lights[index], Environment):
            shadows[index] = _uploaded(rsm, runtime, index)
    with runtime.frame():
        result = technique.run(
            device, lights, shadows=shadows, openness=openness, indirect=added,
            multi_bounce=multi_bounce,
        ).download()
    return np.ascontiguousarray(np.moveaxis(result, 0, -1))


def _checked(rsm: object, light: Light, index: int) -> None:
    if not isinstance(rsm, ReflectiveShadowMap):
        raise TypeError(
            f"rsms[{index}] is {type(rsm).__name__}: expected a ReflectiveShadowMap or None"
        )
    if type(rsm.light) is not type(light):
        raise ValueError(
            f"rsms[{index}] is that of a {type(rsm.light).__name__}: expected one of "
            f"lights[{index}], a {type(light).__name__}"
        )
    sizes = {camera.size for camera in rsm.cameras}
    count = 6 if isinstance(light, PointLight) else 1
    if len(rsm.cameras) != count or len(sizes) != 1 or len(set(*sizes)) != 1:
        raise ValueError(
            f"rsms[{index}] has {len(rsm.cameras)} cameras of {sorted(sizes)} texels: expected "
            f"{count}, square and of one size"
        )


def _uploaded(rsm: ReflectiveShadowMap, runtime: Runtime, index: int) -> ShadowMap:
    size = rsm.cameras[0].size
    count = len(rsm.cameras)
    plane: Plane = runtime.prepared(
        (shade, "shadow", index, count, size), lambda: runtime.plane(count, size, np.inf)
    )
    plane.upload(np.asarray(rsm.depth).reshape(count, *size))
    return ShadowMap(plane, rsm.cameras)


def _same_size(name: str, shape: tuple[int, ...], size: Size) -> None:
    if tuple(shape) != size:
        raise ValueError(f"{name} has shape {tuple(shape)}: expected {size} as the G-buffer")


def power(light: Lamp) -> NDArray[np.float64]:
    """Return RGB intensity in W/sr, or irradiance in W/m^2 of a directional light."""
    value = light.irradiance if isinstance(light, DirectionalLight) else light.intensity
    return np.asarray(value)


def kind_name(light: Lamp) -> str:
    """Return "spot", "point" or "directional"."""
    return type(light).__name__.removesuffix("Light").lower()


def _light_values(
    light: Lamp, camera: Camera, light_camera: Camera, margin: Size
) -> dict[str, Any]:
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
        "red": red, "green": green, "blue": blue,
        **rotation_values(to_light),
        **dict(zip(("shift_x", "shift_y", "shift_z"), offset, strict=True)),
        "map_size": light_camera.height,
        "margin_columns": margin[1],
        "margin_rows": margin[0],
    }


def _sky_image(environments: Sequence[Environment]) -> NDArray[np.float32]:
    """Return [rows, columns, 3]: the sum of the environments, one texel if all are constant."""
    images = [np.atleast_3d(np.asarray(e.radiance).reshape(1, 1, 3))
              if np.asarray(e.radiance).ndim == 1 else np.asarray(e.radiance)
              for e in environments]
    rows = max((image.shape[0] for image in images), default=1)
    columns = max((image.shape[1] for image in images), default=1)
    sky = np.zeros((rows, columns, 3))
    for image in images:
        row = np.arange(rows) * image.shape[0] // rows
        column = np.arange(columns) * image.shape[1] // columns
        sky += image[row[:, None], column[None, :]]
    return np.minimum(sky, BRIGHTEST).astype(np.float32)
