"""The whole pipeline: a scene, a camera and lights to a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import check
from ssgi_cl.camera import Camera
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.memory import Plane, Size
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.shadow_map import RsmRenderer, light_cameras
from ssgi_cl.rasterize.view import MOST_LAYERS, device_scene, downloaded, margin_of
from ssgi_cl.runtime import PassTime, Runtime
from ssgi_cl.techniques.shade import Shade, ShadowMap, power
from ssgi_cl.techniques.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.tonemap import CURVES, Tonemap, auto_exposure, picture

AO_RADIUS_SHARE = 0.05
"""Default radius of ambient occlusion, as a share of the diagonal of the scene's box."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture and what it was made from.

    Attributes:
        image: [rows, columns, 3] uint8, sRGB encoding.
        radiance: [rows, columns, 3] float32 in W m^-2 sr^-1, not clamped.
        ao: A [rows, columns] float32 in [0, 1], or None if it was not needed.
        gbuffer: what the camera sees, or None if it was not asked for.
        exposure: the factor before the tone curve.
        passes: name and milliseconds of every pass, or why it was skipped.
        wall_ms: milliseconds from the call to the finished arrays.
    """

    image: NDArray[np.uint8]
    radiance: NDArray[np.float32]
    ao: NDArray[np.float32] | None
    gbuffer: GBuffer | None
    exposure: float
    passes: tuple[PassTime, ...]
    wall_ms: float


class Renderer:
    """The pipeline, prepared for one size; call it frame after frame.

    Args:
        runtime: the device.
        size: (rows, columns) of the pictures.
        ao: parameters of ambient occlusion, or None for none.
        layers, overscan: of the G-buffer; see `rasterize.gbuffer`.
        shadow_size: texels along a shadow map's side.
        curve: see `tonemap`.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        *,
        ao: SsaoParams | None = None,
        layers: int = 1,
        margin: Size = (0, 0),
        shadow_size: int = 1024,
        curve: str = "filmic",
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.rasterizer = Rasterizer(runtime, size, layers=layers, margin=margin)
        self._shadows = RsmRenderer(runtime, shadow_size, shaded=False)
        self._maps: list[Plane] = []
        self._ssao = Ssao(runtime, size, ao, margin) if ao else None
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
    ) -> Frame:
        """Render one frame; see `render`."""
        start = perf_counter()
        runtime = self.runtime
        kept = device_scene(scene, runtime)
        with runtime.frame():
            seen = self.rasterizer.render(kept, camera)
            seen.derive()
            shadows = self._shadow_maps(scene, lights)
            openness = None
            if self._ssao is not None:
                if any(_is_ambient(light) for light in lights):
                    openness = self._ssao.run(seen)
                else:
                    runtime.skip("ssao", "no ambient light for it to dim")
            radiance = self._shade.run(seen, lights, shadows=shadows, openness=openness)
            values = radiance.download()
            factor = auto_exposure(np.moveaxis(values, 0, -1)) if exposure is None else exposure
            image = picture(self._tonemap.run(radiance, factor))
            passes = tuple(runtime.times())
            ao = None if openness is None else openness.download()[0]
            kept_gbuffer = downloaded(seen) if gbuffer else None
        return Frame(
            image=image,
            radiance=np.ascontiguousarray(np.moveaxis(values, 0, -1)),
            ao=ao,
            gbuffer=kept_gbuffer,
            exposure=factor,
            passes=passes,
            wall_ms=(perf_counter() - start) * 1e3,
        )

    def _shadow_maps(self, scene: Scene, lights: Sequence[Light]) -> list[ShadowMap | None]:
        runtime, size = self.runtime, self._shadows.size
        kept = device_scene(scene, runtime)
        shadows: list[ShadowMap | None] = []
        for index, light in enumerate(lights):
            if isinstance(light, Environment) or not power(light).any():
                shadows.append(None)
                continue
            cameras = light_cameras(light, scene.bounds, size)
            while len(self._maps) <= index:
                self._maps.append(runtime.plane(1, (1, 1)))
            if (self._maps[index].count, self._maps[index].size) != (len(cameras), (size, size)):
                self._maps[index] = runtime.plane(len(cameras), (size, size), math.inf)
            for face, light_camera in enumerate(cameras):
                self._shadows.render(kept, light, light_camera, flux=False)
                self._maps[index].copy_image(face, self._shadows.target.depth)
            shadows.append(ShadowMap(self._maps[index], cameras))
        return shadows


def render(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    *,
    ao: bool = True,
    ao_radius: float | None = None,
    ao_samples: int = 16,
    layers: int = 1,
    overscan: float = 0.0,
    shadow_size: int = 1024,
    exposure: float | None = None,
    curve: str = "filmic",
    gbuffer: bool = False,
    runtime: Runtime | None = None,
) -> Frame:
    """Render a scene: direct light with shadows, ambient light with occlusion, emission.

    Args:
        scene: what `rasterize.load_scene` returns, or one of your own making.
        camera: gives the size of the picture too.
        lights: any number of lights.
        ao: whether SSAO dims ambient light.
        ao_radius: its radius in scene units; by default 5 % of the diagonal of the scene's box.
        ao_samples: its points per pixel, 1 to 256.
        layers: depth layers of the G-buffer, 1 to 16.
        overscan: share of the image by which the G-buffer exceeds it on every side, in [0, 1].
        shadow_size: texels along the side of each shadow map, 16 to 8192.
        exposure: factor before the tone curve; by default the log-average luminance becomes 0.18.
        curve: "filmic" or "clip".
        gbuffer: whether the frame holds the G-buffer too.
        runtime: the device; by default the fastest found.

    Returns:
        The picture, its radiance, AO and G-buffer if asked for, and the table of passes.

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
    for name, switch in (("ao", ao), ("gbuffer", gbuffer)):
        if not isinstance(switch, bool):
            raise TypeError(f"{name} is {switch!r}: expected True or False")
    if exposure is not None:
        exposure = check.number("exposure", exposure, low=0.0, above=True)
    margin = margin_of(camera, overscan)
    runtime = runtime or Runtime.open()
    device_scene(scene, runtime)
    params = None
    if ao:
        if ao_radius is None:
            extent = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
            ao_radius = AO_RADIUS_SHARE * (extent or 1.0)
        params = SsaoParams(radius=(ao_radius,), samples=ao_samples)
    key = (Renderer, camera.size, params, layers, margin, shadow_size, curve)
    renderer: Renderer = runtime.prepared(
        key,
        lambda: Renderer(
            runtime, camera.size, ao=params, layers=layers, margin=margin,
            shadow_size=shadow_size, curve=curve,
        ),
    )
    return renderer(scene, camera, lights, exposure=exposure, gbuffer=gbuffer)


def _is_ambient(light: Light) -> bool:
    return isinstance(light, Environment) and bool(np.any(np.asarray(light.radiance)))
