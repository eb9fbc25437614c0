"""The pipeline, prepared for one size: a scene, a camera and lights to a frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.active_region import Window
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.auxiliary_views import FurtherViews
from ssgi_cl.frame.plan import Needs, Stages, chosen_skips
from ssgi_cl.frame.render_params import BounceParams, LampBounce, lamp_bounce
from ssgi_cl.frame.result import Frame
from ssgi_cl.frame.tile_classifier import Occluder, Opener
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.view import device_scene, downloaded
from ssgi_cl.techniques.ao.occlusion import OcclusionParams
from ssgi_cl.techniques.indirect.multires_published import MultiresPublished
from ssgi_cl.techniques.indirect.multires_splat import MultiresSplat
from ssgi_cl.techniques.indirect.rsm_gather import RsmGather
from ssgi_cl.techniques.indirect.rsm_published import RsmPublished
from ssgi_cl.techniques.indirect.ssdo import Ssdo
from ssgi_cl.techniques.indirect.ssdo_params import SsdoParams
from ssgi_cl.techniques.indirect.vpl_splat import VplSplatParams
from ssgi_cl.techniques.shading.light_data import kind_name, power
from ssgi_cl.techniques.shading.light_maps import LightMaps
from ssgi_cl.techniques.shading.light_reach import reaching
from ssgi_cl.techniques.shading.shade import Shade
from ssgi_cl.techniques.shading.tonemap import Tonemap, TonemapParams, auto_exposure
from ssgi_cl.techniques.tiles import TileFacts, Tiles

REST = 7
"""Frames that don't look at the tiles after one where that brought nothing: a look costs up to a
twentieth of a frame."""


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
        shadow_size, rsm_size: texels along a shadow map's side, and at most so many of them of
            which each may reflect light.
        curve: see `tonemap`.
        indirect_ao: whether ambient occlusion dims the bounce of lamps too.
        skips: what may be left out: True for all of `plan.SKIPS`, False for none, or their names.
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
        rsm_size: int = 512,
        curve: str = "filmic",
        indirect_ao: bool = False,
        skips: bool | Iterable[str] = True,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.skips = chosen_skips(skips)
        near = isinstance(indirect, SsdoParams)
        attributes = layers if near else 1
        self.rasterizer = Rasterizer(
            runtime, size, layers=layers, margin=margin, attributes=attributes,
            windows="window" in self.skips,
        )
        glossy = isinstance(indirect, VplSplatParams) and indirect.glossy_vpls > 0
        self._maps = LightMaps(
            runtime, shadow_size, flux=indirect is not None and not near, glossy=glossy,
            rsm_size=rsm_size,
        )
        self._ao: Occluder | None = None
        if ao is not None and not near:
            self._ao = Occluder(runtime, size, ao, margin, layers, self.skips)
        self._bounce: LampBounce | None = None
        self._ssdo: Ssdo | None = None
        self._views: FurtherViews | None = None
        if isinstance(indirect, SsdoParams):
            near_params = replace(indirect, bent_normals=False)  # a picture has none
            self._ssdo = Ssdo(runtime, size, near_params, margin, layers, attributes)
            self._views = FurtherViews(runtime, views) if views else None
        elif indirect is not None:
            self._bounce = lamp_bounce(runtime, size, indirect, margin)
        self._tiles: Tiles | None = None
        if self.skips & ({"tiles"} if near else {"tiles", "lights", "layers"}):
            self._tiles = Tiles(runtime, size, margin, layers, pieces=near)
        self._near = Opener(runtime, "ssdo", "ssdo_bitmask")
        self._indirect_ao = indirect_ao and self._bounce is not None
        self._shade = Shade(runtime, size)
        self._tonemap = Tonemap(runtime, size, TonemapParams(curve=curve))
        self._stages = Stages(runtime, keep="unchanged" in self.skips)
        self._costs: dict[str, float] = {}
        self._found_idle = False
        self._rest = 0  # frames that don't look at the tiles of this scene with so many lights
        self._rest_of: tuple[object, int] = (None, 0)

    def set_params(self, ao: OcclusionParams | None, indirect: BounceParams | None) -> None:
        """Take other values of the parameters that this was made with, before the next frame.

        Nothing is compiled or allocated for them. ValueError: they differ in more than values.
        """
        for stage, technique, params in (
            ("" if self._ao is None else self._ao.name, self._ao, ao),
            ("bounce", self._bounce, indirect),
            ("ssdo", self._ssdo, indirect),
        ):
            if technique is None or params is None:
                continue
            if isinstance(params, SsdoParams):
                params = replace(params, bent_normals=False)  # a picture has none
            if params != technique.params:
                self._stages.forget(stage)
            technique.params = params

    def __call__(
        self,
        scene: Scene,
        camera: Camera,
        lights: Sequence[Light],
        *,
        exposure: float | None = None,
        gbuffer: bool = False,
        multi_bounce: bool = False,
        outputs: Iterable[str] | None = None,
    ) -> Frame:
        """Render one frame; see `render`."""
        return self.runtime.exclusively(
            lambda: self._frame(
                scene, camera, lights, exposure=exposure, gbuffer=gbuffer,
                multi_bounce=multi_bounce, outputs=outputs,
            )
        )

    def _frame(
        self, scene: Scene, camera: Camera, lights: Sequence[Light], *, exposure: float | None,
        gbuffer: bool, multi_bounce: bool, outputs: Iterable[str] | None,
    ) -> Frame:
        start = perf_counter()
        lights = tuple(lights)
        needs = Needs.of(outputs, self.skips)
        factor, image, values = 1.0 if exposure is None else exposure, None, None
        with self.runtime.frame(self._costs):
            seen = self._stages.make(
                "G-buffer", (scene.key, camera), lambda: self._see(scene, camera)
            )
            facts = self._look(scene, seen, lights, needs)
            openness = self._openness(seen, facts, lights, needs)
            direct = bounced = None
            if self._ssdo is not None and (needs.light or needs.bounce):
                direct, bounced = self._near_light(
                    self._ssdo, scene, camera, lights, seen, facts
                )
            elif needs.light or needs.bounce:
                direct, bounced = self._light(scene, camera, lights, seen, facts, needs)
            if needs.light:
                radiance = self._stages.make(
                    "combine",
                    (lights, multi_bounce, openness is None, self._stages.versions(
                        "G-buffer", *self._ao_name, "direct light", "bounce", "ssdo")),
                    lambda: self._shade.combine(
                        seen, lights, direct, ambient=self._ssdo is None, openness=openness,
                        indirect=bounced, multi_bounce=multi_bounce,
                        indirect_ao=self._indirect_ao,
                    ),
                )
                summed = self._stages.versions("combine")
                window = self._shade.seen(seen)
                if "radiance" in needs.outputs:
                    values = _pixels(radiance, window)
                if exposure is None:
                    factor = self._stages.make(
                        "exposure", summed,
                        lambda: auto_exposure(
                            _pixels(radiance, window) if values is None else values, window
                        ),
                    )
                if needs.picture:
                    encoded = self._stages.make(
                        "picture", (*summed, factor),
                        lambda: self._tonemap.run(radiance, factor, window),
                    )
                    image = encoded.copy()
            passes = tuple(self.runtime.times())
            ao = None if openness is None else openness.download(window=seen.seen)[0]
            indirect = None if bounced is None else _pixels(bounced)
            kept = downloaded(seen) if gbuffer or "gbuffer" in needs.outputs else None
            levels = None
            if kept and bounced is not None and isinstance(self._bounce, MultiresSplat):
                levels = self._bounce.grid.computed()
        if self._ao is not None:
            self._ao.learn(self._costs)
        self._near.learn(self._costs)
        if facts is not None:
            pays = self._found_idle or self._near.pays or (
                self._ao is not None and self._ao.pays
            )
            self._rest = 0 if pays else REST
        return Frame(
            ao=ao if "ao" in needs.given else None,
            indirect=indirect if "indirect" in needs.given else None,
            gbuffer=kept,
            levels=levels,
            exposure=factor,
            passes=passes,
            wall_ms=(perf_counter() - start) * 1e3,
            _image=image if "image" in needs.outputs else None,
            _radiance=values,
        )

    def _see(self, scene: Scene, camera: Camera) -> DeviceGBuffer:
        """Queue the passes that draw the G-buffer."""
        seen: DeviceGBuffer = self.rasterizer.render(device_scene(scene, self.runtime), camera)
        if seen.window is not None:
            rows, columns = seen.window.rows, seen.window.columns
            why = f"nothing is seen outside of {columns} x {rows} pixels"
            self.runtime.skip("window", why, 0.0)
        seen.derive()
        return seen

    def _look(
        self, scene: Scene, seen: DeviceGBuffer, lights: Sequence[Light], needs: Needs
    ) -> TileFacts | None:
        """Find out about the tiles, if anything may be left out for it."""
        tiles = self._tiles
        if self._rest_of[0] is not scene.key or self._rest_of[1] != len(lights):
            self._rest, self._rest_of = 0, (scene.key, len(lights))
        if self._rest > 0:
            self._rest -= 1
            return None
        occlusion = self._ao is not None and self._dims(lights, needs)
        lamps = "lights" in self.skips and any(not isinstance(x, Environment) for x in lights)
        useful = (occlusion and self.skips & {"tiles", "layers"}) or (needs.light and lamps)
        if self._ssdo is not None:
            useful = (needs.light or needs.bounce) and self._ssdo.reach(seen) is not None
        if tiles is None or not useful:
            return None
        facts: TileFacts = self._stages.make(
            "tile facts", self._stages.versions("G-buffer"), lambda: tiles.look(seen)
        )
        return facts

    @property
    def _ao_name(self) -> tuple[str, ...]:
        return () if self._ao is None else (self._ao.name,)

    def _dims(self, lights: Sequence[Light], needs: Needs) -> bool:
        """Return whether ambient occlusion changes any output."""
        ambient = any(_is_ambient(light) for light in lights) or "dark" not in self.skips
        return needs.ao or (needs.light and (ambient or self._indirect_ao))

    def _openness(
        self, seen: DeviceGBuffer, facts: TileFacts | None, lights: Sequence[Light], needs: Needs
    ) -> Plane | None:
        """Queue the passes of ambient occlusion; return A, or None if nothing needs it."""
        ao = self._ao
        if ao is None:
            return None
        if not self._dims(lights, needs):
            why = "no ambient light for it to dim" if needs.light else "no output that it changes"
            self.runtime.skip(ao.name, why)
            return None
        openness: Plane = self._stages.make(
            ao.name, self._stages.versions("G-buffer"), lambda: ao.run(seen, self._tiles, facts)
        )
        return openness

    def _near_light(
        self, ssdo: Ssdo, scene: Scene, camera: Camera, lights: Sequence[Light],
        seen: DeviceGBuffer, facts: TileFacts | None,
    ) -> tuple[Plane | None, Plane | None]:
        """Queue the passes of SSDO; return the planes of direct and reflected irradiance."""
        self.runtime.skip("ambient occlusion", "ssdo hides ambient light by itself")

        def gathered() -> tuple[Plane | None, Plane | None]:
            shadows, _ = self._maps.draw(scene, lights, keep="maps" in self.skips)
            views = self._views.drawn(scene, camera, seen, lights) if self._views else ()
            looked_at = None if facts is None else self._tiles
            tiles = self._near.find(seen, looked_at, ssdo.reach(seen))
            found = ssdo.run(seen, lights, shadows=shadows, views=views, tiles=tiles)
            return found.direct, found.bounce

        planes: tuple[Plane | None, Plane | None] = self._stages.make(
            "ssdo", (lights, self._stages.versions("G-buffer")), gathered
        )
        return planes

    def _light(
        self, scene: Scene, camera: Camera, lights: tuple[Light, ...], seen: DeviceGBuffer,
        facts: TileFacts | None, needs: Needs,
    ) -> tuple[Plane | None, Plane | None]:
        """Queue the passes of lamps, and of the light that surfaces reflect, where needed."""
        idle = self._idle(lights, camera, facts)
        bounce = self._bounce if needs.bounce else None
        inputs = lights, scene.key, self._stages.versions("G-buffer")
        stay = [self._stages.stays(name, inputs) for name in ("direct light", "bounce")]
        shadows, rsm = None, None
        if not (stay[0] or not needs.light) or not (stay[1] or bounce is None):
            # What reflects light is in one map of all lamps, idle or not.
            without = () if bounce is not None else idle
            keep = "maps" in self.skips
            shadows, rsm = self._maps.draw(scene, lights, idle=without, keep=keep)
        lit = [i for i in range(len(lights)) if i not in idle]
        direct = None
        if needs.light:
            direct = self._stages.make(
                "direct light", inputs,
                lambda: self._shade.light(
                    seen, [lights[i] for i in lit], shadows and [shadows[i] for i in lit]
                ),
            )
        bounced = None
        if bounce is not None:
            bounced = self._stages.make(
                "bounce", inputs, lambda: self._reflected(bounce, scene, seen, rsm)
            )
        return direct, bounced

    def _idle(
        self, lights: Sequence[Light], camera: Camera, facts: TileFacts | None
    ) -> set[int]:
        """Return which lamps light nothing that is seen."""
        if facts is None or "lights" not in self.skips:
            return set()
        lamps = {
            index: light for index, light in enumerate(lights)
            if not isinstance(light, Environment) and power(light).any()
        }
        reach = reaching(list(lamps.values()), facts.boxes, camera)
        idle = {
            index: light for (index, light), reaches in zip(lamps.items(), reach, strict=True)
            if not reaches
        }
        for light in idle.values():
            kind = kind_name(light)
            why = "all that is seen is turned away from it or outside its cone"
            # Its light would be found to be none soon, but not before its map is drawn.
            self.runtime.skip(f"light {kind}", why, self._costs.get(f"map {kind}", 0.0))
        self._found_idle = bool(idle)
        return set(idle)

    def _reflected(
        self, bounce: LampBounce, scene: Scene, seen: DeviceGBuffer,
        rsm: DeviceRsm | None,
    ) -> Plane | None:
        """Queue the passes of one bounce; return its plane of irradiance, or None if it is dark."""
        if rsm is None:
            self.runtime.skip(bounce.name, "no light that a map could be made of")
            return None
        if isinstance(bounce, (RsmGather, RsmPublished)):
            return bounce.run(seen, rsm)
        if isinstance(bounce, MultiresPublished):
            return bounce.run(seen, None, [rsm])
        return bounce.run(seen, None, [rsm], scene=device_scene(scene, self.runtime))


def _is_ambient(light: Light) -> bool:
    return isinstance(light, Environment) and bool(np.any(np.asarray(light.radiance)))


def _pixels(plane: Plane, window: Window | None = None) -> NDArray[np.float32]:
    """Return [rows, columns, channels] of a plane, whose pixels outside a window are the same."""
    pixels = np.empty((*plane.size, plane.count), np.float32)
    plane.download(np.moveaxis(pixels, -1, 0), window)
    return pixels
