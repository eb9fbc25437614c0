"""The whole pipeline: a scene, a camera and lights to a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import check
from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.device_rsm import DeviceRsm
from ssgi_cl.further_views import FurtherViews
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.light_maps import LightMaps
from ssgi_cl.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.memory import Plane, Size
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.view import MOST_LAYERS, device_scene, downloaded, margin_of
from ssgi_cl.render_params import (
    BounceParams,
    ao_name,
    ao_technique,
    bounce_name,
    bounce_params,
)
from ssgi_cl.runtime import PassTime, Runtime
from ssgi_cl.techniques import TECHNIQUES
from ssgi_cl.techniques.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.occlusion import OcclusionParams, OcclusionTechnique
from ssgi_cl.techniques.rsm_gather import RsmGather
from ssgi_cl.techniques.shade import Shade
from ssgi_cl.techniques.ssdo import Ssdo
from ssgi_cl.techniques.ssdo_params import SsdoParams
from ssgi_cl.techniques.tonemap import CURVES, Tonemap, auto_exposure, picture
from ssgi_cl.techniques.vpl_splat import VplSplat, VplSplatParams

AO_RADIUS_SHARE = 0.05
"""Default radius of ambient occlusion, as a share of the diagonal of the scene's box."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture and what it was made from.

    Attributes:
        image: [rows, columns, 3] uint8, sRGB encoding.
        radiance: [rows, columns, 3] float32 in W m^-2 sr^-1, not clamped.
        ao: A [rows, columns] float32 in [0, 1], or None if it was not needed, as with SSDO.
        indirect: irradiance by light that surfaces reflect, [rows, columns, 3] float32 in W/m^2, or
            None if it was not computed.
        gbuffer: what the camera sees, or None if it was not asked for.
        exposure: the factor before the tone curve.
        passes: name and milliseconds of every pass, or why it was skipped.
        wall_ms: milliseconds from the call to the finished arrays.
    """

    image: NDArray[np.uint8]
    radiance: NDArray[np.float32]
    ao: NDArray[np.float32] | None
    indirect: NDArray[np.float32] | None
    gbuffer: GBuffer | None
    exposure: float
    passes: tuple[PassTime, ...]
    wall_ms: float


class Renderer:
    """The pipeline, prepared for one size; call it frame after frame.

    Args:
        runtime: the device.
        size: (rows, columns) of the pictures.
        ao: parameters of ambient occlusion, which say its technique too, or None for none.
        indirect: parameters of one bounce of light, likewise, or None for none. SSDO hides ambient
            light too: then `ao` is not looked at.
        layers, margin: of the G-buffer.
        views: further cameras of SSDO, which `extra_cameras` places.
        shadow_size: texels along a shadow map's side.
        curve: see `tonemap`.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        *,
        ao: OcclusionParams | None = None,
        indirect: BounceParams | None = None,
        layers: int = 1,
        margin: Size = (0, 0),
        views: int = 0,
        shadow_size: int = 1024,
        curve: str = "filmic",
    ) -> None:
        self.runtime = runtime
        self.size = size
        near = isinstance(indirect, SsdoParams)
        attributes = layers if near else 1
        self.rasterizer = Rasterizer(
            runtime, size, layers=layers, margin=margin, attributes=attributes
        )
        self._maps = LightMaps(runtime, shadow_size, flux=indirect is not None and not near)
        self._ao_name = "ambient occlusion"
        self._ao: OcclusionTechnique | None = None
        if ao is not None and not near:
            self._ao_name, self._ao = ao_technique(runtime, size, ao, margin, layers)
        self._bounce: MultiresSplat | VplSplat | RsmGather | None = None
        self._ssdo: Ssdo | None = None
        self._views: FurtherViews | None = None
        if isinstance(indirect, SsdoParams):
            self._ssdo = Ssdo(runtime, size, indirect, margin, layers, attributes)
            self._views = FurtherViews(runtime, views) if views else None
        elif isinstance(indirect, MultiresSplatParams):
            self._bounce = MultiresSplat(runtime, size, indirect)
        elif isinstance(indirect, VplSplatParams):
            self._bounce = VplSplat(runtime, size, indirect)
        elif indirect is not None:
            self._bounce = RsmGather(runtime, size, indirect, margin)
        self._shade = Shade(runtime, size)
        self._tonemap = Tonemap(runtime, size, curve)

    def __call__(
        self,
        scene: Scene,
        camera: Camera,
        lights: Sequence[Light],
        *,
        exposure: float | None = None,
        gbuffer: bool = False,
        multi_bounce: bool = False,
    ) -> Frame:
        """Render one frame; see `render`."""
        start = perf_counter()
        runtime = self.runtime
        kept = device_scene(scene, runtime)
        with runtime.frame():
            seen = self.rasterizer.render(kept, camera)
            seen.derive()
            shadows, rsm = self._maps.draw(scene, lights)
            openness = direct = None
            if self._ssdo is not None:
                runtime.skip(self._ao_name, "ssdo hides ambient light by itself")
                views = self._views.drawn(scene, camera, seen) if self._views else ()
                found = self._ssdo.run(seen, lights, shadows=shadows, views=views)
                direct, bounced = found.direct, found.bounce
            else:
                openness = self._openness(seen, lights)
                bounced = self._bounced(seen, rsm)
            radiance = self._shade.run(
                seen, lights, shadows=shadows, openness=openness, indirect=bounced,
                multi_bounce=multi_bounce, direct=direct,
            )
            values = radiance.download()
            factor = auto_exposure(np.moveaxis(values, 0, -1)) if exposure is None else exposure
            image = picture(self._tonemap.run(radiance, factor))
            passes = tuple(runtime.times())
            ao = None if openness is None else openness.download()[0]
            irradiance = None if bounced is None else bounced.download()
            kept_gbuffer = downloaded(seen) if gbuffer else None
        return Frame(
            image=image,
            radiance=np.ascontiguousarray(np.moveaxis(values, 0, -1)),
            ao=ao,
            indirect=None if irradiance is None
            else np.ascontiguousarray(np.moveaxis(irradiance, 0, -1)),
            gbuffer=kept_gbuffer,
            exposure=factor,
            passes=passes,
            wall_ms=(perf_counter() - start) * 1e3,
        )

    def _openness(self, seen: DeviceGBuffer, lights: Sequence[Light]) -> Plane | None:
        """Queue the passes of ambient occlusion; return A, or None if nothing needs it."""
        if self._ao is None:
            return None
        if not any(_is_ambient(light) for light in lights):
            self.runtime.skip(self._ao_name, "no ambient light for it to dim")
            return None
        return self._ao.run(seen)

    def _bounced(self, seen: DeviceGBuffer, rsm: DeviceRsm | None) -> Plane | None:
        """Queue the passes of one bounce; return its plane of irradiance, or None if it is dark."""
        bounce = self._bounce
        if bounce is None:
            return None
        if rsm is None:
            self.runtime.skip(bounce.name, "no light that a map could be made of")
            return None
        if isinstance(bounce, RsmGather):
            return bounce.run(seen, rsm)
        return bounce.run(seen, None, [rsm])


def render(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    *,
    ao: bool | str = True,
    ao_radius: float | None = None,
    ao_samples: int | None = None,
    multi_bounce: bool = False,
    indirect: bool | str | None = None,
    vpls: int = 1024,
    layers: int = 1,
    overscan: float = 0.0,
    extra_cameras: int = 0,
    shadow_size: int = 1024,
    exposure: float | None = None,
    curve: str = "filmic",
    gbuffer: bool = False,
    runtime: Runtime | None = None,
) -> Frame:
    """Render a scene: direct light with shadows, ambient light with occlusion, emission, a bounce.

    Args:
        scene: what `rasterize.load_scene` returns, or one of your own making.
        camera: gives the size of the picture too.
        lights: any number of lights.
        ao: what dims ambient light: "ssao", "hbao", "gtao" or "bitmask_ao"; True for "gtao", False
            for none. All but "ssao" look into all `layers`, all four into the overscan.
        ao_radius: its radius in scene units, and that of "ssdo"; by default 5 % of the diagonal of
            the scene's box.
        ao_samples: points per pixel of "ssao", and of no other, 1 to 256; by default 16.
        multi_bounce: whether AO is brightened by what surfaces reflect, see `multi_bounce`.
        indirect: how light is reflected once. That of all lamps: "multires" (`multires_splat`,
            the fastest; nothing blocks it), "vpl" (`vpl_splat`; with two layers or more, walls that
            camera and lamps see block it), "gather" (`rsm_gather`; nothing blocks it). That of
            lamps and environments by surfaces within `ao_radius`: "ssdo" (`ssdo`, which hides the
            light of environments too, so `ao` is not needed). What surfaces emit is
            seen and lights nothing. True for "multires", None or False for none.
        vpls: virtual point lights of "multires" and "vpl" in all, 1 to 2^24.
        layers: depth layers of the G-buffer, 1 to 16.
        overscan: share of the image by which the G-buffer exceeds it on every side, in [0, 1].
        extra_cameras: cameras of half the size that show "ssdo" what the camera misses, 0 to 64,
            placed by `extra_cameras`.
        shadow_size: texels along the side of each shadow map, 16 to 8192; what reflects light is
            chosen from the same map.
        exposure: factor before the tone curve; by default the log-average luminance becomes 0.18.
        curve: "filmic" or "clip".
        gbuffer: whether the frame holds the G-buffer too.
        runtime: the device; by default the fastest found.

    Returns:
        The picture, its radiance, AO, indirect light and G-buffer if asked for, and the table of
        passes.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
    """
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    lights = tuple(lights)
    for index, light in enumerate(lights):
        if not isinstance(light, (SpotLight, PointLight, DirectionalLight, Environment)):
            raise TypeError(f"lights[{index}] is {type(light).__name__}: expected a light")
    layers = check.integer("layers", layers, low=1, high=MOST_LAYERS)
    shadow_size = check.integer("shadow_size", shadow_size, low=16, high=8192, unit="texels")
    check.choice("curve", curve, CURVES)
    for name, switch in (("multi_bounce", multi_bounce), ("gbuffer", gbuffer)):
        check.switch(name, switch)
    dims, indirect = ao_name(ao, ao_samples), bounce_name(indirect)
    if multi_bounce and indirect == "ssdo":
        raise ValueError("multi_bounce is True: expected False with indirect='ssdo', it is of ao")
    extra_cameras = check.integer("extra_cameras", extra_cameras, low=0, high=64)
    if extra_cameras and indirect != "ssdo":
        raise ValueError(
            f"extra_cameras is {extra_cameras}: expected 0 with indirect={indirect!r}, they are of "
            "'ssdo'"
        )
    if exposure is not None:
        exposure = check.number("exposure", exposure, low=0.0, above=True)
    margin = margin_of(camera, overscan)
    runtime = runtime or Runtime.open()
    device_scene(scene, runtime)
    if ao_radius is None:
        extent = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
        ao_radius = AO_RADIUS_SHARE * (extent or 1.0)
    bounce = bounce_params(indirect, vpls, layers, ao_radius)
    params: Any = None
    if dims is not None and indirect != "ssdo":
        samples = {} if ao_samples is None else {"samples": ao_samples}
        params = TECHNIQUES[dims].params(radius=ao_radius, **samples)  # type: ignore[call-arg]
    key = (
        Renderer, camera.size, params, bounce, layers, margin, extra_cameras, shadow_size, curve
    )
    renderer: Renderer = runtime.prepared(
        key,
        lambda: Renderer(
            runtime, camera.size, ao=params, indirect=bounce, layers=layers, margin=margin,
            views=extra_cameras, shadow_size=shadow_size, curve=curve,
        ),
    )
    return renderer(
        scene, camera, lights, exposure=exposure, gbuffer=gbuffer, multi_bounce=multi_bounce
    )


def _is_ambient(light: Light) -> bool:
    return isinstance(light, Environment) and bool(np.any(np.asarray(light.radiance)))
