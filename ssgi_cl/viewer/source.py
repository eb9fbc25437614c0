"""What a window shows: a scene with lights and cameras, or a G-buffer with its one camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import CONTACT, cell_size
from ssgi_cl.rasterize import load_scene
from ssgi_cl.rasterize.raster.default_camera import default_lights
from ssgi_cl.rasterize.raster.default_view import file_camera
from ssgi_cl.rasterize.raster.visible_extent import visible_extent
from ssgi_cl.rasterize.scenes import is_scene, make_scene
from ssgi_cl.viewer.gbuffer_file import ENDINGS, load_gbuffer
from ssgi_cl.viewer.pose import Pose

WIDTH, HEIGHT = 640, 400
"""Of cameras that are asked for a field of view alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """What is shown.

    Attributes:
        name: for the page's title.
        scene: surfaces, or None of a G-buffer.
        gbuffer: of a source without a scene.
        pose: the first camera.
        cameras: others by name, the first among them.
        lights: the first lights.
        environments: files of environments that may be chosen, and no others.
        radius: of ambient occlusion, scene units, which ranges of controls are made from.
        extent: diagonal of what is seen, scene units.
        code: lines of Python that make `scene` or `gbuffer`, and `lights`.
        reload: reads it again, or None of what is in memory.
    """

    name: str
    scene: Scene | None = None
    gbuffer: GBuffer | None = None
    pose: Pose
    cameras: Mapping[str, Pose] = field(default_factory=dict)
    lights: tuple[Light, ...]
    environments: tuple[Path, ...] = ()
    radius: float
    extent: float
    code: tuple[str, ...]
    reload: Callable[[], Source] | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed or is not drawn."""
        shown = self.scene if self.gbuffer is None else self.gbuffer
        return () if shown is None else shown.notes


def scene_source(
    name: str,
    scene: Scene,
    camera: Camera,
    lights: tuple[Light, ...],
    runtime: Runtime,
    *,
    environments: tuple[Path, ...] = (),
    code: tuple[str, ...] = (),
    reload: Callable[[], Source] | None = None,
) -> Source:
    """Return a scene as a source, seen first by `camera`."""
    extent = float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) or 1.0
    distance = _distance(scene, camera, runtime, extent)
    first = Pose.of(camera, distance)
    cameras = {"start": first}
    for title, each in scene.cameras.items():
        cameras[title] = Pose.of(each.sized(WIDTH, HEIGHT), distance)
    return Source(
        name=name,
        scene=scene,
        pose=first,
        cameras=cameras,
        lights=lights,
        environments=environments,
        radius=CONTACT * cell_size(scene),
        extent=extent,
        code=code,
        reload=reload,
    )


def gbuffer_source(
    name: str, gbuffer: GBuffer, *, code: tuple[str, ...] = (), reload: Callable[[], Source] | None = None
) -> Source:
    """Return a G-buffer as a source: seen by its own camera, in light from all around."""
    depth = gbuffer.first("depth")
    seen = np.asarray(depth)[np.isfinite(depth)] if depth is not None else np.zeros(0)
    middle = float(np.median(seen)) if seen.size else 1.0
    height = gbuffer.camera.view_height * (1.0 if gbuffer.camera.is_orthographic else middle)
    return Source(
        name=name,
        gbuffer=gbuffer,
        pose=Pose.of(gbuffer.camera, abs(middle) or 1.0),
        lights=(Environment(1.0),),
        radius=0.1 * height,
        extent=height,
        code=code or ("gbuffer = ...  # your gi.GBuffer", "lights = [gi.Environment(1.0)]"),
        reload=reload,
    )


def open_source(name: str, runtime: Runtime, *, environments: tuple[Path, ...] = ()) -> Source:
    """Return the source of a scene's file or name, or of a G-buffer in an .exr or .npz file.

    Raises:
        ValueError, OSError: the file is not there, damaged, or of another kind.
    """

    def again() -> Source:
        return open_source(name, runtime, environments=environments)

    path = Path(name)
    if path.suffix.lower() in ENDINGS:
        load = f"gbuffer = gi.GBuffer.from_exr({name!r})" if path.suffix.lower() == ".exr" else ""
        code = (load or f"gbuffer = ...  # of the arrays of {name}", "lights = [gi.Environment(1.0)]")
        return gbuffer_source(path.name, load_gbuffer(path), code=code, reload=again)
    if is_scene(name):
        built = make_scene(name)
        return scene_source(
            name,
            built.scene,
            built.camera(WIDTH, HEIGHT),
            built.own_lights,
            runtime,
            environments=environments,
            code=(
                "from ssgi_cl.rasterize.scenes import make_scene",
                f"built = make_scene({name!r})",
                "scene, lights = built.scene, built.own_lights",
            ),
        )
    scene = load_scene(path)
    camera = file_camera(scene, path, WIDTH, HEIGHT, None, runtime)
    lights = scene.lights or default_lights(scene, camera, runtime)
    own = "lights = scene.lights" if scene.lights else "lights = gi.default_lights(scene, camera)"
    return scene_source(
        path.name,
        scene,
        camera,
        tuple(lights),
        runtime,
        environments=environments,
        code=(f"scene = gi.rasterize.load_scene({name!r})", own),
        reload=again,
    )


def _distance(scene: Scene, camera: Camera, runtime: Runtime, extent: float) -> float:
    """Return how far ahead the point lies that a camera turns about, scene units: within what is seen."""
    seen = visible_extent(scene, camera, runtime=runtime)
    return float(np.clip(0.5 * seen, 1e-3 * extent, extent)) if np.isfinite(seen) and seen > 0.0 else 0.5 * extent
