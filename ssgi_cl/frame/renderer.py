"""The pipeline, prepared for one size: a scene, a camera and lights to a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.core.suns import lights_with_suns
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.auxiliary_views import AuxiliaryViews
from ssgi_cl.frame.blended import Blended
from ssgi_cl.frame.graph import Graph
from ssgi_cl.frame.graph_record import GraphLog, GraphRecord
from ssgi_cl.frame.lobes import Lobes
from ssgi_cl.frame.one_bounce import OneBounce, one_bounce
from ssgi_cl.frame.plan import Needs, chosen_skips
from ssgi_cl.frame.render_params import BounceParams
from ssgi_cl.frame.result import Frame
from ssgi_cl.frame.stage import Stage, Values
from ssgi_cl.frame.stages import (
    AO,
    AO_PARAMS,
    CAMERA,
    CASTING,
    DIRECT,
    EXPOSURE,
    GBUFFER,
    IDLE_LIGHTS,
    IMAGE,
    INDIRECT,
    INDIRECT_PARAMS,
    LIGHTS,
    MULTI_BOUNCE,
    PIXELS,
    RADIANCE,
    RESOURCES,
    SCENE,
    SKY,
    SKY_LIGHT,
    TILES,
    combine_stage,
    direct_stage,
    gbuffer_stage,
    idle_lights_stage,
    maps_stage,
    occlusion_stage,
    one_bounce_stage,
    picture_stages,
    pixels,
    ssdo_stages,
    ssdo_tiles_condition,
    tiles_stage,
)
from ssgi_cl.frame.tile_classifier import OpenTileFinder, TiledOcclusion, TileRest
from ssgi_cl.frame.whole import WholeParams
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.view import downloaded
from ssgi_cl.techniques.ao.occlusion import OcclusionParams
from ssgi_cl.techniques.indirect.ssdo import Ssdo
from ssgi_cl.techniques.indirect.ssdo_params import SsdoParams
from ssgi_cl.techniques.shading.light_maps import LightMaps
from ssgi_cl.techniques.shading.seen_depths import SeenDepths
from ssgi_cl.techniques.shading.shade import Shade
from ssgi_cl.techniques.shading.tonemap import Tonemap, TonemapParams
from ssgi_cl.techniques.tiles import Tiles

_PLANES = {AO: "ao", INDIRECT: "indirect"}
"""Resources that a frame holds where they are there -> its outputs."""


class Renderer:
    """The pipeline, prepared for one size; call it frame after frame.

    Args:
        runtime: the device.
        size: (rows, columns) of the pictures.
        ao: parameters of ambient occlusion, which say its technique too, or None for none.
        indirect: parameters of one bounce of light, likewise, or None for none. SSDO hides ambient
            light too: then `ao` is not looked at.
        layers, margin: of the G-buffer.
        auxiliary_cameras: auxiliary cameras of SSDO, which `auxiliary_cameras` places.
        shadow_size, rsm_size: texels along a shadow map's side, and at most so many of them of
            which each may reflect light.
        curve: see `tonemap`.
        indirect_ao: whether ambient occlusion dims the bounce of lights too.
        whole: all bounces of all light, with the sky's visibility, in place of `indirect`; or None.
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
        auxiliary_cameras: int = 0,
        shadow_size: int = 1024,
        rsm_size: int = 512,
        curve: str = "filmic",
        indirect_ao: bool = False,
        whole: WholeParams | None = None,
        skips: bool | Iterable[str] = True,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.skips = chosen_skips(skips)
        ssdo = isinstance(indirect, SsdoParams)
        attributes = layers if ssdo else 1
        self.rasterizer = Rasterizer(
            runtime,
            size,
            layers=layers,
            margin=margin,
            attributes=attributes,
            regions="region" in self.skips,
            world="until released" if ssdo else "until derived",
            matt=whole is None,
            lobes=whole is not None,
        )
        maps = LightMaps(
            runtime,
            shadow_size,
            flux=whole is not None or (indirect is not None and not ssdo),
            glossy=getattr(indirect, "glossy_vpls", 0) > 0,
            rsm_size=rsm_size,
        )
        keep = "maps" in self.skips
        tiles: Tiles | None = None
        if self.skips & ({"tiles"} if ssdo else {"tiles", "lights", "layers"}):
            tiles = Tiles(runtime, size, margin, layers, pieces=ssdo)
        shade = Shade(runtime, size, punctual_lights=not ssdo)
        costs: dict[str, float] = {}
        self._rest = TileRest()
        condition: Callable[[Values], str | None] = self._rest.condition
        self._openers: list[OpenTileFinder | TiledOcclusion] = []
        self._bounce: OneBounce | None = None
        self._ao: TiledOcclusion | None = None
        self._indirect: Ssdo | OneBounce | None = None
        near: list[Stage] = []
        lobes: Lobes | None = None
        light = [DIRECT]
        direct = direct_stage(shade)
        of_layers = [direct]
        look: Callable[[DeviceGBuffer], None] | None = None
        if isinstance(indirect, SsdoParams):
            params = replace(indirect, bent_normals=False)  # a picture has none
            technique = Ssdo(runtime, size, params, margin, layers, attributes)
            condition = ssdo_tiles_condition(technique, self.rasterizer.target, condition)
            self._indirect = technique
            look = technique.look
            opener = OpenTileFinder(runtime, "ssdo", "ssdo_bitmask")
            self._openers.append(opener)
            near = [
                maps_stage(maps, None, keep=keep, reflects=False, all_lights=True),
                *ssdo_stages(
                    technique, opener, tiles, AuxiliaryViews(runtime, auxiliary_cameras) if auxiliary_cameras else None
                ),
            ]
            light.append(INDIRECT)
        else:
            if indirect is not None:
                self._bounce = one_bounce(runtime, size, indirect, margin)
            reflects = self._bounce is not None or whole is not None
            indirect_ao = indirect_ao and reflects
            if ao is not None:
                occluder = TiledOcclusion(runtime, size, ao, margin, layers, self.skips)
                self._openers.append(occluder)
                self._ao = occluder
                near.append(
                    occlusion_stage(occluder, tiles, self.skips, dims_indirect=indirect_ao or whole is not None)
                )
                light.append(AO)
            if "lights" in self.skips:
                near.append(idle_lights_stage(runtime, costs))
            # What reflects light is in one map of all lights, idle or not.
            near += [
                maps_stage(maps, SeenDepths(runtime, size), keep=keep, reflects=reflects, all_lights=reflects),
                direct,
            ]
            if whole is not None:
                stages, lobes = whole.stages(runtime, size)
                near += stages
                light += [INDIRECT, SKY_LIGHT]
                of_layers += [stage for stage in stages if GBUFFER in stage.reads]
            elif self._bounce is not None:
                near.append(one_bounce_stage(self._bounce, runtime))
                self._indirect = self._bounce
                light.append(INDIRECT)
        stages = [
            gbuffer_stage(self.rasterizer, look),
            *([] if tiles is None else [tiles_stage(tiles, condition)]),
            *near,
            combine_stage(
                shade,
                light,
                ambient=not ssdo and whole is None,
                indirect_ao=indirect_ao,
                gaps=whole is not None,
                lobes=lobes,
                blended=Blended(runtime, size, matt=whole is None),
                layer_stages=of_layers,
                layer_ambient=whole is None,
            ),
            *picture_stages(shade, Tonemap(runtime, size, TonemapParams(curve=curve))),
        ]
        self._graph = Graph(runtime, stages, RESOURCES, keep="unchanged" in self.skips, costs=costs)
        self._light = frozenset(light)
        self._splits_suns = whole is not None
        self._log: GraphLog | None = None

    def set_params(self, ao: OcclusionParams | None, indirect: BounceParams | None) -> None:
        """Take other values of the parameters that this was made with, before the next frame.

        Nothing is compiled or allocated for them. ValueError: they differ in more than values.
        """
        if self._ao is not None and ao is not None:
            self._ao.params = ao
        technique: Any = self._indirect
        if technique is not None and indirect is not None:
            if isinstance(indirect, SsdoParams):
                indirect = replace(indirect, bent_normals=False)  # a picture has none
            technique.params = indirect

    def _params(self) -> dict[str, Any]:
        """Return the parameters of the next frame as resources of the graph."""
        prepared = {AO_PARAMS: self._ao, INDIRECT_PARAMS: self._indirect}
        return {name: each.params for name, each in prepared.items() if each is not None}

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
                scene, camera, lights, exposure=exposure, gbuffer=gbuffer, multi_bounce=multi_bounce, outputs=outputs
            )
        )

    def _keep_world(self) -> None:
        """See that the G-buffer has its normals in world space, drawn anew if it did not."""
        target = self.rasterizer.target
        target.world = "kept"
        if not target.has_world:
            self._graph.forget("G-buffer")

    def graph(self) -> GraphRecord:
        """Return the frame graph: that of the latest frame, or what a first one would run."""
        if self._log is not None:
            return self._log.record()
        given = (SCENE, CASTING, CAMERA, LIGHTS, SKY, MULTI_BOUNCE, *self._params())
        return self._graph.planned(given, self._resources(Needs.of(None, self.skips))).record()

    def _resources(self, needs: Needs) -> set[str]:
        """Return the resources that the outputs of a frame are made of."""
        wanted = {GBUFFER}
        if needs.ao:
            wanted |= {AO} & self._light
        if "indirect" in needs.outputs:
            wanted |= {INDIRECT} & self._light
        if needs.light:
            wanted |= {RADIANCE, EXPOSURE}
        if "radiance" in needs.outputs:
            wanted.add(PIXELS)
        return wanted | {IMAGE} if needs.picture else wanted

    def _frame(
        self,
        scene: Scene,
        camera: Camera,
        lights: Sequence[Light],
        *,
        exposure: float | None,
        gbuffer: bool,
        multi_bounce: bool,
        outputs: Iterable[str] | None,
    ) -> Frame:
        start = perf_counter()
        needs = Needs.of(outputs, self.skips)
        shown = tuple(lights)
        lights, suns = lights_with_suns(shown) if self._splits_suns else (shown, None)
        given = {
            SCENE: scene,
            CASTING: scene_parts(scene).casting,
            CAMERA: camera,
            LIGHTS: lights,
            SKY: shown,
            MULTI_BOUNCE: multi_bounce,
            EXPOSURE: exposure,
            **self._params(),
        }
        self._rest.begin(scene.key, len(lights))
        if gbuffer or "gbuffer" in needs.outputs:
            self._keep_world()
        with self.runtime.frame(self._graph.costs):
            if suns:
                self.runtime.skip("suns", suns, 0.0)
            also = {name for name, output in _PLANES.items() if output in needs.given}
            run = self._graph.run(given, self._resources(needs), also)
            made, seen = run.values, run.values[GBUFFER]
            image, bounced = made.get(IMAGE), made.get(INDIRECT)
            picture = image.copy() if image is not None and "image" in needs.outputs else None
            visibility, reflected = (made.get(n) if n in also else None for n in (AO, INDIRECT))
            ao = None if visibility is None else visibility.download(region=seen.seen)[0]
            indirect = None if reflected is None else pixels(reflected)
            kept = downloaded(seen) if gbuffer or "gbuffer" in needs.outputs else None
            levels = None
            if kept and bounced is not None and self._bounce is not None:
                levels = self._bounce.levels()
        self._learn(made)
        self._log = run.log
        return Frame(
            ao=ao,
            indirect=indirect,
            gbuffer=kept,
            levels=levels,
            exposure=made.get(EXPOSURE, 1.0),
            passes=run.log.passes,
            wall_ms=(perf_counter() - start) * 1e3,
            _image=picture,
            _radiance=made[PIXELS] if "radiance" in needs.outputs else None,
            _log=run.log,
        )

    def _learn(self, made: Mapping[str, Any]) -> None:
        """Take from what passes took what tiles save, and whether to look at them next time."""
        for opener in self._openers:
            opener.learn(self._graph.costs)
        if made.get(TILES) is not None:
            pays = any(opener.pays for opener in self._openers)
            self._rest.learn(pays or bool(made.get(IDLE_LIGHTS)))
