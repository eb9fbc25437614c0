"""The pipeline, prepared for one size: a scene, a camera and lights to a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.core.suns import lights_with_suns
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.graph import Graph, GraphRun
from ssgi_cl.frame.params import CONTACT, FrameParams, cell_size
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import (
    AO,
    AO_PARAMS,
    CAMERA,
    CASTING,
    EXPOSURE,
    GBUFFER,
    IMAGE,
    INDIRECT,
    INDIRECT_PARAMS,
    LEVELS,
    LIGHTS,
    MULTI_BOUNCE,
    PIXELS,
    RADIANCE,
    RESOURCES,
    SCENE,
    SKY,
)
from ssgi_cl.frame.passes.tonemap import pixels
from ssgi_cl.frame.pipeline import PIPELINES
from ssgi_cl.frame.record import GraphLog, GraphRecord
from ssgi_cl.frame.result import Frame
from ssgi_cl.frame.skips import Needs
from ssgi_cl.rasterize.raster.view import downloaded
from ssgi_cl.rasterize.raster.visible_extent import visible_extent

AO_RADIUS_SHARE = 0.05
"""Default radius of ambient occlusion, as a fraction of the picture's diagonal at what is seen."""

_PLANES = {AO: "ao", INDIRECT: "indirect"}
"""Resources that a frame holds where they are there -> its outputs."""


def default_ao_radius(scene: Scene, camera: Camera, runtime: Runtime) -> float:
    """Return the radius of ambient occlusion that suits a view, in scene units.

    It is 5 % of the diagonal of the picture where surfaces are seen, and no more than that of the
    scene's box, or twice that of its subject (see `visible_extent`): neither a backdrop nor a long
    street enlarges it.
    """
    return AO_RADIUS_SHARE * visible_extent(scene, camera, runtime=runtime)


class Renderer:
    """The pipeline, prepared for one size; call it frame after frame.

    Args:
        runtime: the device.
        size: (rows, columns) of the pictures.
        params: of frames, by default those of `render`.

    Attributes:
        params: of the next frame; others of the same `FrameParams.shape` may be set.
    """

    def __init__(self, runtime: Runtime, size: Size, params: FrameParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or FrameParams()
        build = Build(runtime, size, params)
        stages = PIPELINES[params.kind](build)
        self._target = build.rasterizer.target
        self._graph = Graph(runtime, stages, RESOURCES, keep="unchanged" in params.skips)
        self._made = frozenset(name for stage in stages for name in stage.writes)
        self._log: GraphLog | None = None

    @property
    def params(self) -> FrameParams:
        """Parameters of the next frame. ValueError: set to some of another shape."""
        return self._params

    @params.setter
    def params(self, params: FrameParams) -> None:
        if params.shape() != self._params.shape():
            raise ValueError(
                f"Renderer was prepared for {self._params}: expected parameters that differ in values "
                f"alone, got {params}"
            )
        self._params = params

    def __call__(self, scene: Scene, camera: Camera, lights: Sequence[Light], **changes: Any) -> Frame:
        """Render one frame; see `render`. `changes` are other values of parameters for it alone."""
        params = replace(self._params, **changes) if changes else self._params
        if changes and params.shape() != self._params.shape():
            raise ValueError(f"{', '.join(changes)}: expected values that a renderer need not be prepared for anew")
        return self.runtime.exclusively(lambda: self._frame(scene, camera, tuple(lights), params))

    def graph(self) -> GraphRecord:
        """Return the frame graph: that of the latest frame, or what a first one would run."""
        if self._log is not None:
            return self._log.record()
        given = (SCENE, CASTING, CAMERA, LIGHTS, SKY, MULTI_BOUNCE, AO_PARAMS, INDIRECT_PARAMS)
        return self._graph.planned(given, self._wanted(Needs.of(None, self._params.skips))).record()

    def _wanted(self, needs: Needs) -> set[str]:
        """Return the resources that the outputs of a frame are made of."""
        light = {RADIANCE, EXPOSURE} if needs.light else set()
        found = {PIXELS} if "radiance" in needs.outputs else set()
        planes = {name for name, output in _PLANES.items() if output in needs.outputs and (name != AO or needs.ao)}
        picture = {IMAGE} if needs.picture else set()
        return {GBUFFER} | light | found | picture | (planes & self._light)

    @property
    def _light(self) -> set[str]:
        """The planes that frames of this kind have."""
        return set(_PLANES) & self._made - ({AO} if self._params.kind == "ssdo" else set())

    def _radius(self, scene: Scene, camera: Camera, params: FrameParams) -> float:
        if not params.needs_radius:
            return 1.0
        if params.kind == "whole":
            return CONTACT * cell_size(scene)
        return default_ao_radius(scene, camera, self.runtime)

    def _given(self, scene: Scene, camera: Camera, lights: tuple[Light, ...], params: FrameParams) -> dict[str, Any]:
        """Return the resources that are given; note suns that are split off environments."""
        split = lights
        if params.kind == "whole":
            split, suns = lights_with_suns(lights)
            if suns:
                self.runtime.skip("suns", suns, 0.0)
        occlusion, bounce = params.techniques(self._radius(scene, camera, params))
        return {
            SCENE: scene,
            CASTING: scene_parts(scene).casting,
            CAMERA: camera,
            LIGHTS: split,
            SKY: lights,
            MULTI_BOUNCE: params.multi_bounce,
            EXPOSURE: params.exposure,
            AO_PARAMS: occlusion,
            INDIRECT_PARAMS: bounce,
        }

    def _frame(self, scene: Scene, camera: Camera, lights: tuple[Light, ...], params: FrameParams) -> Frame:
        start = perf_counter()
        needs = Needs.of(params.outputs, params.skips)
        holds = params.gbuffer or "gbuffer" in needs.outputs
        if holds:  # normals stay in world space, and are drawn anew if they did not
            self._target.world = "kept"
            if not self._target.has_world:
                self._graph.forget("G-buffer")
        radius = self._radius(scene, camera, params)  # queues passes of its own
        params = params if params.ao_radius is not None else replace(params, ao_radius=radius)
        with self.runtime.frame(self._graph.costs):
            also = {name for name, output in _PLANES.items() if output in needs.given}
            given = self._given(scene, camera, lights, params)
            run = self._graph.run(given, self._wanted(needs), also)
            return self._held(run, needs, also, start, holds)

    def _held(self, run: GraphRun, needs: Needs, also: set[str], start: float, holds: bool) -> Frame:
        """Return what a frame holds of a run."""
        made, seen, self._log = run.values, run.values[GBUFFER], run.log
        image, levels = made.get(IMAGE), made.get(LEVELS)
        visibility, reflected = (made.get(n) if n in also else None for n in (AO, INDIRECT))
        return Frame(
            _image=image.copy() if image is not None and "image" in needs.outputs else None,
            ao=None if visibility is None else visibility.download(region=seen.seen)[0],
            indirect=None if reflected is None else pixels(reflected),
            gbuffer=downloaded(seen) if holds else None,
            levels=levels() if holds and levels is not None else None,
            exposure=made.get(EXPOSURE, 1.0),
            passes=run.log.passes,
            wall_ms=(perf_counter() - start) * 1e3,
            _radiance=made[PIXELS] if "radiance" in needs.outputs else None,
            _log=run.log,
        )
