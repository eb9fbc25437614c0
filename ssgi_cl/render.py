"""The whole pipeline: a scene, a camera and lights to a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import check
from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.device_rsm import DeviceRsm
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.light_maps import LightMaps
from ssgi_cl.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.memory import Plane, Size
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.view import MOST_LAYERS, device_scene, downloaded, margin_of
from ssgi_cl.runtime import PassTime, Runtime
from ssgi_cl.techniques.bitmask_ao import BitmaskAo, BitmaskParams
from ssgi_cl.techniques.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.hbao import Hbao, HbaoParams
from ssgi_cl.techniques.rsm_gather import RsmGather, RsmGatherParams
from ssgi_cl.techniques.shade import Shade
from ssgi_cl.techniques.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.tonemap import CURVES, Tonemap, auto_exposure, picture
from ssgi_cl.techniques.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.vpls import choose_vpls

AO_RADIUS_SHARE = 0.05
"""Default radius of ambient occlusion, as a share of the diagonal of the scene's box."""
AO_DEFAULT = "gtao"
AO_PARAMS = {
    "ssao": SsaoParams, "hbao": HbaoParams, "gtao": GtaoParams, "bitmask_ao": BitmaskParams
}
BOUNCES = ("vpl", "gather")

AoParams = SsaoParams | HbaoParams | GtaoParams | BitmaskParams
BounceParams = VplSplatParams | RsmGatherParams


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture and what it was made from.

    Attributes:
        image: [rows, columns, 3] uint8, sRGB encoding.
        radiance: [rows, columns, 3] float32 in W m^-2 sr^-1, not clamped.
        ao: A [rows, columns] float32 in [0, 1], or None if it was not needed.
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
        indirect: parameters of one bounce of light, likewise, or None for none.
        layers, overscan: of the G-buffer; see `rasterize.gbuffer`.
        shadow_size: texels along a shadow map's side.
        curve: see `tonemap`.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        *,
        ao: AoParams | None = None,
        indirect: BounceParams | None = None,
        layers: int = 1,
        margin: Size = (0, 0),
        shadow_size: int = 1024,
        curve: str = "filmic",
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.rasterizer = Rasterizer(runtime, size, layers=layers, margin=margin)
        self._maps = LightMaps(runtime, shadow_size, flux=indirect is not None)
        self._ao = _ao_technique(runtime, size, ao, margin, layers) if ao else None
        self._ao_name = next((n for n, kind in AO_PARAMS.items() if isinstance(ao, kind)), "")
        self._bounce: VplSplat | RsmGather | None = None
        if isinstance(indirect, VplSplatParams):
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
            openness = None
            if self._ao is not None:
                if any(_is_ambient(light) for light in lights):
                    openness = self._ao.run(seen)
                else:
                    runtime.skip(self._ao_name, "no ambient light for it to dim")
            bounced = self._bounced(seen, rsm)
            radiance = self._shade.run(
                seen, lights, shadows=shadows, openness=openness, indirect=bounced,
                multi_bounce=multi_bounce,
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

    def _bounced(self, seen: DeviceGBuffer, rsm: DeviceRsm | None) -> Plane | None:
        """Queue the passes of one bounce; return its plane of irradiance, or None if it is dark."""
        bounce = self._bounce
        if bounce is None:
            return None
        if rsm is None:
            name = "vpl splat" if isinstance(bounce, VplSplat) else "rsm gather"
            self.runtime.skip(name, "no light that a map could be made of")
            return None
        if isinstance(bounce, RsmGather):
            return bounce.run(seen, rsm)
        return bounce.run(seen, choose_vpls(rsm, bounce.params.vpls), [rsm])


def render(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    *,
    ao: bool | str = True,
    ao_radius: float | None = None,
    ao_samples: int | None = None,
    multi_bounce: bool = False,
    indirect: str | None = None,
    vpls: int = 1024,
    layers: int = 1,
    overscan: float = 0.0,
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
        ao_radius: its radius in scene units; by default 5 % of the diagonal of the scene's box.
        ao_samples: points per pixel of "ssao", and of no other, 1 to 256; by default 16.
        multi_bounce: whether AO is brightened by what surfaces reflect, see `multi_bounce`.
        indirect: how the light of all lamps is reflected once: "vpl" (`vpl_splat`; with two layers
            or more, walls that camera and lamps see block it), "gather" (`rsm_gather`; nothing
            blocks it), or None.
        vpls: virtual point lights of "vpl" in all, 1 to 2^24.
        layers: depth layers of the G-buffer, 1 to 16.
        overscan: share of the image by which the G-buffer exceeds it on every side, in [0, 1].
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
    bounce = _bounce_params(indirect, vpls, layers)
    dims = _ao_name(ao, ao_samples)
    if exposure is not None:
        exposure = check.number("exposure", exposure, low=0.0, above=True)
    margin = margin_of(camera, overscan)
    runtime = runtime or Runtime.open()
    device_scene(scene, runtime)
    params: AoParams | None = None
    if dims is not None:
        if ao_radius is None:
            extent = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
            ao_radius = AO_RADIUS_SHARE * (extent or 1.0)
        samples = {} if ao_samples is None else {"samples": ao_samples}
        params = AO_PARAMS[dims](radius=ao_radius, **samples)
    key = (Renderer, camera.size, params, bounce, layers, margin, shadow_size, curve)
    renderer: Renderer = runtime.prepared(
        key,
        lambda: Renderer(
            runtime, camera.size, ao=params, indirect=bounce, layers=layers, margin=margin,
            shadow_size=shadow_size, curve=curve,
        ),
    )
    return renderer(
        scene, camera, lights, exposure=exposure, gbuffer=gbuffer, multi_bounce=multi_bounce
    )


def _is_ambient(light: Light) -> bool:
    return isinstance(light, Environment) and bool(np.any(np.asarray(light.radiance)))


def _ao_name(ao: object, samples: int | None) -> str | None:
    """Return the name of the technique that dims ambient light, or None."""
    if not isinstance(ao, (bool, str)):
        raise TypeError(f"ao is {ao!r}: expected True, False or the name of a technique")
    name = AO_DEFAULT if ao is True else ao
    if isinstance(name, str):
        check.choice("ao", name, tuple(AO_PARAMS))
    if samples is not None and name != "ssao":
        raise ValueError(f"ao_samples is {samples}: expected None with ao={ao!r}, it is of 'ssao'")
    return name or None


def _ao_technique(
    runtime: Runtime, size: Size, params: AoParams, margin: Size, layers: int
) -> Ssao | Hbao | Gtao | BitmaskAo:
    if isinstance(params, SsaoParams):
        return Ssao(runtime, size, params, margin)
    if isinstance(params, HbaoParams):
        return Hbao(runtime, size, params, margin, layers)
    if isinstance(params, GtaoParams):
        return Gtao(runtime, size, params, margin, layers)
    return BitmaskAo(runtime, size, params, margin, layers)


def _bounce_params(indirect: str | None, vpls: int, layers: int) -> BounceParams | None:
    if indirect is None:
        return None
    if check.choice("indirect", indirect, BOUNCES) == "gather":
        return RsmGatherParams(resolution="quarter")
    return VplSplatParams(vpls=vpls, cutoff=0.0, interleave=True, visibility=layers >= 2)
