"""Renderer: the pipeline, prepared for one size, from a scene, a camera and lights to a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any, Unpack

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.keywords import check_names
from ssgi_cl.core.lights import Light
from ssgi_cl.core.params import parameter_fields
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.core.seen_extent import RADIUS_SHARE
from ssgi_cl.core.suns import lights_with_suns
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.progress import Progress, Told, told
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.graph import Graph
from ssgi_cl.frame.history import FrameHistory, Shown, image_size
from ssgi_cl.frame.params import CONTACT, FrameKeywords, FrameParams, cell_size
from ssgi_cl.frame.passes import resources as of
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.tonemap import pixels
from ssgi_cl.frame.pipeline import PIPELINES
from ssgi_cl.frame.record import GraphRecord
from ssgi_cl.frame.result import Frame
from ssgi_cl.rasterize.raster.view import downloaded
from ssgi_cl.rasterize.raster.visible_extent import visible_extent
from ssgi_cl.techniques.ao.slices import SliceParams
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles

MADE_OF = {
    "image": {of.RADIANCE, of.EXPOSURE, of.IMAGE},
    "radiance": {of.RADIANCE, of.EXPOSURE, of.PIXELS},
    "ao": {of.AO},
    "indirect": {of.INDIRECT},
    "gbuffer": {of.GBUFFER},
}
"""Resources that each output is made of."""
PICTURE = frozenset(("image", "radiance"))
"""Outputs of a frame that was asked for none by name; it holds the planes too that were made for them."""
PLANES = frozenset(("ao", "indirect"))
TURNS = 4096
"""Frames of a history after which the slices of ambient occlusion turn as in the first."""


def default_ao_radius(scene: Scene, camera: Camera, runtime: Runtime) -> float:
    """Return the radius of ambient occlusion that suits a view, in scene units.

    It is 5 % of the picture's diagonal where surfaces are seen, and at most 5 % of that of the
    scene's box or of twice that of its subject (see `visible_extent`): neither a backdrop nor a
    long street enlarges it.
    """
    return RADIUS_SHARE * visible_extent(scene, camera, runtime=runtime)


class Renderer:
    """The pipeline of a kind of frame, prepared for one size; call it frame after frame.

    Args:
        runtime: the device.
        size: (rows, columns) of the pictures.
        params: of frames, by default those of `render`.
        history: whether ambient occlusion and light are means over the frames before, see `FrameHistory`.
        **given: fields of `FrameParams`, by the names that `render` has, in place of those in `params`.

    Raises:
        TypeError, ValueError: a parameter of another name, of the wrong type or out of range.

    Attributes:
        params: of the next frame; others of the same `FrameParams.shape` may be set.
        history: the means, or None; `FrameHistory.reset` it after a cut.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: FrameParams | None = None,
        *,
        history: bool = False,
        **given: Unpack[FrameKeywords],
    ) -> None:
        self.runtime = runtime
        self.size = size
        check_names("Renderer()", given, parameter_fields(FrameParams))
        values: Any = given
        self._params = params = FrameParams(**values) if params is None else replace(params, **values)
        checks.switch("history", history)
        self.history = FrameHistory() if history else None
        self._build = build = Build(runtime, image_size(size) if history else size, params, history=history)
        self._target = build.rasterizer.target
        self._graph = Graph(runtime, PIPELINES[params.kind](build), keep="unchanged" in params.skips)
        self._record: GraphRecord | None = None
        self._latest: tuple[FrameParams, dict[str, Any], FrameParams] = params, {}, params

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

    def __call__(
        self,
        scene: Scene,
        camera: Camera,
        lights: Sequence[Light],
        *,
        progress: Progress = None,
        history: FrameHistory | None = None,
        **changes: Unpack[FrameKeywords],
    ) -> Frame:
        """Render one frame; see `render`.

        Args:
            scene, camera, lights, progress: as of `render`.
            history: of another sequence than that of `self.history`, of a renderer that has one.
            **changes: other values of parameters for this frame alone.
        """
        params = self._changed(changes) if changes else self._params
        if history is not None and self.history is None:
            raise ValueError("history is given: expected None, or a Renderer that was made with history=True")
        taken = history or self.history
        with told(progress, "rendering") as tell:
            return self.runtime.exclusively(lambda: self._frame(scene, camera, tuple(lights), params, tell, taken))

    def _changed(self, changes: Mapping[str, Any]) -> FrameParams:
        """Return the parameters with other values, checked once for frames with the same changes."""
        of, latest, found = self._latest
        if of is not self._params or latest != changes:
            found = replace(self._params, **changes)
            if found.shape() != self._params.shape():
                raise ValueError(f"{', '.join(changes)}: expected values that a renderer need not be prepared for anew")
            self._latest = self._params, dict(changes), found
        return found

    def graph(self) -> GraphRecord:
        """Return the frame graph: that of the latest frame, or what a first one would run."""
        if self._record is not None:
            return self._record
        given = [of.SCENE, of.CASTING, of.CAMERA, of.LIGHTS, of.SKY, of.MULTI_BOUNCE, of.AO_PARAMS, of.INDIRECT_PARAMS]
        if self.history is not None:
            given += [of.HISTORY, of.SURFEL_HISTORY, of.CROPS]
        return self._graph.planned(given, self._wanted(PICTURE))

    def _wanted(self, outputs: frozenset[str]) -> set[str]:
        """Return the resources that outputs are made of, as far as frames of this kind have them."""
        names = outputs if "outputs" in self._params.skips else outputs | {"image"}
        made = {name for stage in self._graph.stages for name in stage.writes}
        needed = {of.GBUFFER}.union(*(MADE_OF[name] for name in names))
        return set(map(self._build.steady, needed)) & made

    def _radius(self, scene: Scene, camera: Camera, params: FrameParams) -> float:
        """Return the radius of ambient occlusion and SSDO where none is given."""
        if not params.needs_radius:
            return 1.0
        if params.kind == "whole":
            return CONTACT * cell_size(scene)
        return default_ao_radius(scene, camera, self.runtime)

    def _given(
        self, scene: Scene, camera: Camera, lights: tuple[Light, ...], params: FrameParams, radius: float
    ) -> dict[str, Any]:
        """Return the resources that are given; note suns that are split off environments, and why rays of bounces go
        through the occupancy grid."""
        split, casting = lights, scene_parts(scene).casting
        if params.kind == "whole":
            split, suns = lights_with_suns(lights)
            if suns:
                self.runtime.skip("suns", suns, 0.0)
            if not rays_meet_triangles(casting):
                why = "a texture's alpha cuts holes into the scene: rays of bounces go through the occupancy grid"
                self.runtime.skip("rays against triangles", why, 0.0)
        occlusion, bounce = params.techniques(radius)
        return {
            of.SCENE: scene,
            of.CASTING: casting,
            of.CAMERA: camera,
            of.LIGHTS: split,
            of.SKY: lights,
            of.MULTI_BOUNCE: params.multi_bounce,
            of.EXPOSURE: params.exposure,
            of.AO_PARAMS: occlusion,
            of.INDIRECT_PARAMS: bounce,
        }

    def _frame(
        self,
        scene: Scene,
        camera: Camera,
        lights: tuple[Light, ...],
        params: FrameParams,
        tell: Told | None,
        history: FrameHistory | None,
    ) -> Frame:
        start = perf_counter()
        shown, picture = Shown(0, 0, self.size), camera
        if history is not None:
            if camera.size != self.size:
                raise ValueError(f"camera has size {camera.size} (rows, columns): expected {self.size}")
            shown = history.shown(self.size, scene, lights)
            camera = shown.camera(camera)
        names = PICTURE if params.outputs is None else frozenset(params.outputs)
        planes = names & PLANES if params.outputs is not None else PLANES
        occlusion, reflected = self._build.steady(of.AO), self._build.steady(of.INDIRECT)
        also = {{"ao": occlusion, "indirect": reflected}[output] for output in planes}
        holds = params.gbuffer or "gbuffer" in names
        if holds:  # normals stay in world space, and are drawn anew if they did not
            self._target.world = "kept"
            if not self._target.has_world:
                self._graph.forget("G-buffer")
        radius = self._radius(scene, picture, params)  # queues passes of its own
        with self.runtime.frame(self._graph.costs):
            given = self._given(scene, camera, lights, params, radius)
            if history is not None:
                given |= {of.HISTORY: history, of.SURFEL_HISTORY: history.surfels, of.CROPS: history.crops}
                if isinstance(given[of.AO_PARAMS], SliceParams):  # slices turn on from frame to frame
                    given[of.AO_PARAMS] = replace(given[of.AO_PARAMS], frame=history.pattern % TURNS)
            run = self._graph.run(given, self._wanted(names), also, tell)
            self._record, made, seen = run.record, run.values, run.values[of.GBUFFER]
            visibility, irradiance = (made.get(name) if name in also else None for name in (occlusion, reflected))
            levels = made.get(of.LEVELS) if holds else None
            counts = history.counts() if history is not None else None
            frame = Frame(
                _image=shown.part(made[of.IMAGE]).copy() if "image" in names else None,
                ao=None if visibility is None else shown.part(visibility.download(region=seen.seen)[0]),
                indirect=None if irradiance is None else shown.part(pixels(irradiance)),
                gbuffer=shown.gbuffer(downloaded(seen), picture, params.margin(self.size)) if holds else None,
                levels=None if levels is None else shown.part(levels()),
                counts=None if counts is None else counts[0],
                resets=None if counts is None else counts[1],
                exposure=made.get(of.EXPOSURE, 1.0),
                passes=run.passes,
                wall_ms=(perf_counter() - start) * 1e3,
                _radiance=shown.part(made[of.PIXELS]) if "radiance" in names else None,
                graph=run.record,
            )
        if tell is not None:
            tell(1.0)
        return frame
