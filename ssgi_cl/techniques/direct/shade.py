"""Deferred shading: radiance from a G-buffer, lights, their shadow maps and ambient occlusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.environment_samples import BRIGHTEST, summed
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, Light, are_same, environments_of
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.active_region import PreviousRegion, Region
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.techniques.bands import banded, fixed_plan
from ssgi_cl.techniques.direct.ambient import Ambient
from ssgi_cl.techniques.direct.light_data import PunctualLights, ShadowMap
from ssgi_cl.techniques.direct.shadow_maps import checked_lights, uploaded_maps
from ssgi_cl.techniques.source import camera_of, margin_values
from ssgi_cl.techniques.technique import Bench, Technique

COMBINE = Struct(
    "CombineParams", (*floats(*ROTATION), *ints("sky_columns", "sky_rows", "margin_columns", "margin_rows"))
)


LOBE_ROWS = 4
"""Rows on either side of a pixel that facets and widened lobes look at, at most."""


@dataclass(frozen=True, kw_only=True)
class ShadeParams(Params):
    """Parameters of deferred shading."""

    multi_bounce: bool = param(False, "brighten A by the surface's albedo, see `multi_bounce`")
    indirect_ao: bool = param(False, "A dims indirect light too, which has no visibility of its own")


class Shade(Prepared[ShadeParams]):
    """Deferred shading, prepared for images of one size.

    Reeves, Salesin and Cook 1987. Departs: see `shade`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: see `ShadeParams`.
        punctual_lights: whether `light` will be called.
        smooth, kept: see `PunctualLights`.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: ShadeParams | None = None,
        *,
        punctual_lights: bool = True,
        smooth: bool = False,
        kept: bool = True,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params or ShadeParams()
        self._new_lights = partial(PunctualLights, runtime, size, kept=kept, smooth=smooth)
        self._punctual_lights = self._new_lights() if punctual_lights else None
        self._radiance = runtime.plane(3, size)
        self._ambient = Ambient(runtime)
        self._sky = runtime.array(np.zeros(3, np.float32))
        self._sky_size = (1, 1)
        self._environments: tuple[Environment, ...] = ()
        self._background: tuple[float, ...] | None = (0.0, 0.0, 0.0)
        self._previous = PreviousRegion()

    def run(
        self,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        *,
        shadows: Sequence[ShadowMap | None] | None = None,
        visibility: Plane | None = None,
        indirect: Plane | None = None,
        multi_bounce: bool | None = None,
        direct: Plane | None = None,
        indirect_ao: bool | None = None,
    ) -> Plane:
        """Queue the passes; return the plane of radiance.

        `shadows` has one entry for each light (None: it casts no shadow), `visibility` is A;
        `multi_bounce` and `indirect_ao` are those of the parameters by default.
        `direct` is the irradiance of all lights, if that is known already; environments are then
        the background alone.
        """
        lit = self.light(gbuffer, lights, shadows=shadows) if direct is None else direct
        radiance = self.combine(
            gbuffer,
            lights,
            lit,
            ambient=direct is None,
            visibility=visibility,
            indirect=indirect,
            multi_bounce=multi_bounce,
            indirect_ao=indirect_ao,
        )
        if gbuffer.mirrors and self._punctual_lights is not None:
            self._punctual_lights.add_lobes(radiance, gbuffer, lights, shadows=shadows)
        return radiance

    def light(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], *, shadows: Sequence[ShadowMap | None] | None = None
    ) -> Plane | None:
        """Queue the passes of lights; return the plane of their irradiance, None if none shines."""
        self._punctual_lights = self._punctual_lights or self._new_lights()
        return self._punctual_lights.run(gbuffer, lights, shadows=shadows)

    def combine(
        self,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        lit: Plane | None,
        *,
        ambient: bool = True,
        visibility: Plane | None = None,
        indirect: Plane | None = None,
        multi_bounce: bool | None = None,
        indirect_ao: bool | None = None,
        gaps: bool = False,
        sky_light: Plane | None = None,
        light: Plane | None = None,
    ) -> Plane:
        """Queue the pass that sums up all light; return the plane of radiance.

        `lit` is the irradiance of punctual lights, and of environments too unless `ambient`. With
        `gaps`, A dims `indirect` only below 1/2, for light whose visibility rays miss near
        occluders. `sky_light` is the irradiance of environments alone; A dims it. `light` receives
        the irradiance of all light over pi. The rest is as in `run`.
        """
        if multi_bounce is None:
            multi_bounce = self.params.multi_bounce
        if indirect_ao is None:
            indirect_ao = self.params.indirect_ao
        self._set_sky(environments_of(lights))
        if ambient:
            self._ambient.set(lights)
        shines = ambient and self._ambient.shines
        sky_rows, sky_columns = self._sky_size
        kernel = self.runtime.kernel(
            "direct/shade_combine.cl",
            {
                "SHADE_DIRECT": int(lit is not None),
                "SHADE_AO": int(visibility is not None),
                "SHADE_BOUNCES": int(multi_bounce and visibility is not None),
                "SHADE_INDIRECT": (
                    0 if indirect is None else 1 if visibility is None else 2 if indirect_ao else 3 if gaps else 1
                ),
                "SHADE_EMISSION": int(gbuffer.emits),
                "SHADE_SKY_LIGHT": (0 if sky_light is None else 1 if visibility is None else 2),
                "SHADE_AMBIENT": int(shines),
                "SHADE_SKY": int(sky_rows * sky_columns > 1),
                "SHADE_LIGHT": int(light is not None),
                **(self._ambient.macros if shines else {"AMBIENT_SIZE": 0}),
            },
            (CAMERA, COMBINE),
        )
        values = {
            **rotation_values(camera_of(gbuffer).view[:3, :3].T),
            "sky_columns": sky_columns,
            "sky_rows": sky_rows,
            **margin_values(gbuffer.margin),
        }
        with self._previous.over(self.seen(gbuffer), self._background) as over:
            kernel.run(
                self.size,
                region=over,
                linear=gbuffer.linear,
                normal=gbuffer.normal,
                albedo=gbuffer.albedo,
                emission=gbuffer.emission if gbuffer.emits else None,
                direct=lit,
                visibility=visibility,
                indirect=indirect,
                sky_light=sky_light,
                ambient=self._ambient.irradiance if shines else None,
                sky=self._sky,
                radiance=self._radiance,
                light_over_pi=light,
                camera=gbuffer.camera_struct,
                params=COMBINE.pack(values),
            )
        return self._radiance

    def seen(self, gbuffer: DeviceGBuffer) -> Region | None:
        """Return the pixels outside of which radiance is constant; None if it varies everywhere."""
        return None if self._background is None else gbuffer.seen

    def _set_sky(self, environments: tuple[Environment, ...]) -> None:
        """Upload the radiance of the environments, unless they are those of last time."""
        if are_same(environments, self._environments):
            return
        sky = sky_image(environments)
        if sky.size > self._sky.count:
            self._sky = DeviceArray(self.runtime, sky)
        self._sky.upload(sky)
        self._sky_size = (sky.shape[0], sky.shape[1])
        self._background = tuple(sky.ravel().tolist()) if sky.size == 3 else None
        self._environments = environments


@banded(fixed_plan(LOBE_ROWS, images={"ao": 1, "indirect": 1}))
@serialised
def shade(
    gbuffer: GBuffer | DeviceGBuffer,
    lights: Sequence[Light],
    *,
    shadow_maps: Sequence[ReflectiveShadowMap | None] | None = None,
    ao: ArrayLike | None = None,
    indirect: ArrayLike | None = None,
    multi_bounce: bool = False,
    indirect_ao: bool = False,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
) -> NDArray[np.float32]:
    """Compute radiance from a G-buffer: direct light with shadows, ambient light, emission.

    Where the G-buffer has `specular` and `gloss`, lights other than environments are reflected by
    a Phong lobe too (Phong 1975, normalised as in Lewis 1994), which is widened where the surface
    bends within a pixel (after Kaplanyan et al. 2016).

    Shadows are percentage-closer filtered (Reeves, Salesin and Cook 1987, "Rendering Antialiased
    Shadows with Depth Maps"). Departs: each of 3 x 3 bilinearly weighted texels is compared with
    the receiver's tangent plane. Those of lights with a radius or angle have penumbrae (Fernando
    2005, "Percentage-Closer Soft Shadows").

    Args:
        gbuffer: what the camera sees.
        lights: any number of lights; environments add up.
        shadow_maps: for each light its reflective shadow map, whose depth casts its shadow, or None for
            no shadow. None for all lights by default.
        ao: A [rows, columns] in [0, 1]; dims the light of environments, never that of lights.
        indirect: irradiance [rows, columns, 3] in W/m^2 to add, >= 0.
        multi_bounce: whether A is brightened by the surface's albedo, see `multi_bounce`.
        indirect_ao: whether A, as it is, dims `indirect` too: a stand-in for walls that bounced
            light doesn't know of. Where it does know of them, they would count twice.
        max_memory: as of `gtao`.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns, 3] float32 radiance in W m^-2 sr^-1, not clamped; where nothing is there,
        the radiance of the environments (0 without any).

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    lights = checked_lights(lights, shadow_maps)
    params = ShadeParams(multi_bounce=multi_bounce, indirect_ao=indirect_ao)
    device = on_device(gbuffer, runtime)
    camera_of(device)
    runtime = device.runtime
    technique: Shade = runtime.prepared((Shade, device.size), lambda: Shade(runtime, device.size))
    visibility = None if ao is None else _uploaded("ao", checks.plane("ao", ao, low=0.0, high=1.0), device, 1.0)
    added = None
    if indirect is not None:
        added = _uploaded("indirect", checks.plane("indirect", indirect, channels=3, low=0.0, unit="W/m^2"), device)
    shadows = uploaded_maps(lights, shadow_maps, runtime)
    with runtime.frame():
        result = technique.run(
            device,
            lights,
            shadows=shadows,
            visibility=visibility,
            indirect=added,
            multi_bounce=params.multi_bounce,
            indirect_ao=params.indirect_ao,
        ).download()
    return np.ascontiguousarray(np.moveaxis(result, 0, -1))


def _uploaded(name: str, image: NDArray[np.float32], gbuffer: DeviceGBuffer, outside: float = 0.0) -> Plane:
    """Return an argument of `shade` on the device; raise ValueError if its size is not the G-buffer's."""
    runtime, size = gbuffer.runtime, gbuffer.size
    if image.shape[:2] != size:
        raise ValueError(f"{name} has shape {image.shape[:2]}: expected {size} as the G-buffer")
    planes = np.moveaxis(np.atleast_3d(image), -1, 0)
    plane: Plane = runtime.prepared((shade, name, size), lambda: runtime.plane(len(planes), size, outside))
    plane.upload(planes)
    return plane


def sky_image(environments: Sequence[Environment]) -> NDArray[np.float32]:
    """Return [rows, columns, 3]: the sum of the environments, one texel if all are constant."""
    radiance = [np.asarray(environment.radiance) for environment in environments]
    sky = summed([each.reshape(1, 1, 3) if each.ndim == 1 else each for each in radiance])
    return np.minimum(sky, BRIGHTEST).astype(np.float32)


DESCRIPTOR = Technique(
    name="shade",
    kind="shading",
    paper="Reeves, Salesin and Cook 1987",
    function=shade,
    params=ShadeParams,
    technique=Shade,
    reference="ssgi_cl.reference.direct.shade",
    reads=("depth", "normal", "albedo", "emission", "specular", "gloss", "lights", "shadow_maps"),
    writes=("radiance",),
    quantity="direct",
    bench=Bench(
        families=("direct",),
        rows={
            "shade": (
                "direct light with filtered shadows, ambient light times AO, emission",
                (("direct light, maps of 1024", "direct.1024"),),
            )
        },
    ),
)
