"""`ssgi render --cameras`: a picture of a scene for each camera of a file, resumable, on one machine or many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.cli.frame_arguments import check_scene, frame_arguments, scene_of_file
from ssgi_cl.cli.frames import numbered, report_frames
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import SceneError
from ssgi_cl.frame.render import render
from ssgi_cl.io.console import printable, progress
from ssgi_cl.sequences.frame_names import frame_range
from ssgi_cl.sequences.frame_result import FrameFile
from ssgi_cl.sequences.keys import hashed, key_of
from ssgi_cl.truth.digests import light_description, scene_digest

if TYPE_CHECKING:
    from ssgi_cl.core.lights import Light
    from ssgi_cl.core.scene import Scene

_OF_ONE = ("views", "explain", "max_memory", "eye", "target", "up", "fov", "camera")
"""Options of a single picture."""


class _Ready(NamedTuple):
    """What all pictures share; see `frame_arguments`."""

    scene: Scene
    lights: tuple[Light, ...]
    arguments: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class RenderView:
    """Renders what a camera sees; a function for `map_frames`.

    Attributes:
        scene: as given on the command line.
        options: of `ssgi render` that shape a frame.
        first: the first camera of all, which lights suit if the scene has none.
        content: what `content_of` returned where the run began.
        as_exr: whether the files are OpenEXR files, with AO and the G-buffer.
    """

    scene: str
    options: Mapping[str, Any]
    first: Camera
    content: str
    as_exr: bool

    def __call__(self, camera: Camera) -> FrameFile | NDArray[np.uint8]:
        """Return the picture, [rows, columns, 3] uint8, or the channels of an OpenEXR file."""
        scene, lights, arguments = self._ready()
        outputs = None if self.as_exr else ("image",)
        skips = not self.options["no_skips"]
        frame = render(scene, camera, lights, gbuffer=self.as_exr, outputs=outputs, skips=skips, **arguments)
        return FrameFile(frame.arrays(), camera=camera) if self.as_exr else frame.image

    def _ready(self) -> _Ready:
        """Return the scene and all else but the camera: loaded by the first picture of a process."""
        name = hashed(vars(self))
        with _lock:
            if name not in _kept:
                _kept.clear()
                _kept[name] = self._loaded()
            return _kept[name]

    def _loaded(self) -> _Ready:
        scene, _, lights, arguments = frame_arguments(self.scene, dict(self.options), _silent, self.first)
        if content_of(scene, self.options) != self.content:
            raise SceneError(f"{self.scene} has changed since the run began, or is another file on this machine")
        return _Ready(scene, lights, arguments)


_kept: dict[str, _Ready] = {}
_lock = Lock()


def render_views(
    scene: str,
    cameras: Path,
    output: Path,
    options: dict[str, Any],
    frames: str | None,
    *,
    again: bool,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Render a picture for each camera of a file and report them; exit with status 1 if any failed.

    Raises:
        click.UsageError: an option is for a single picture, or the output has no place for a number.
        ValueError, SceneError: the scene, the cameras or the frames are wrong.
        SequenceError: the cluster fails.
    """
    from ssgi_cl.rasterize.raster.default_camera import cameras_from_json
    from ssgi_cl.rasterize.scenes import is_scene, make_scene

    given = [name for name in _OF_ONE if options[name] not in (None, False)]
    if given:
        raise click.UsageError(f"--{given[0]} is for one picture: it does not go with --cameras")
    into = numbered(output, (".png", ".exr"), "view.####.png")
    views = cameras_from_json(cameras, options["width"], options["height"])
    numbers = list(range(1, len(views) + 1)) if frames is None else frame_range(frames)
    wrong = [number for number in numbers if not 1 <= number <= len(views)]
    if wrong:
        raise ValueError(f"--frames is {frames}: there is no camera {wrong[0]}; {cameras} has 1 to {len(views)}")
    check_scene(scene)
    with progress(as_json) as step:
        step(f"loading {scene}")
        loaded = make_scene(scene).scene if is_scene(scene) else scene_of_file(Path(scene), options)
        content = content_of(loaded, options)
    if not as_json:
        for note in loaded.notes:
            click.echo(printable(f"note: {note}"), err=True)
    del loaded  # each process loads it for itself, this one if the work is its own
    work = RenderView(
        scene=scene,
        options={name: value for name, value in options.items() if name not in _OF_ONE} | _NOTHING,
        first=views[0],
        content=content,
        as_exr=output.suffix.lower() == ".exr",
    )
    inputs, files = [views[number - 1] for number in numbers], [into.path(number) for number in numbers]
    report_frames(work, inputs, files, again=again, scheduler=scheduler, as_json=as_json)


_NOTHING: dict[str, Any] = dict.fromkeys(("eye", "target", "up", "fov", "camera"))


def content_of(scene: Scene, options: Mapping[str, Any]) -> str:
    """Return the hash of all that is read of files: the scene, its textures and lights, and the environment.

    It is that of what was read: files with other bytes and the same content give the same pictures.
    """
    lights = [light_description(light) for light in scene.lights or ()]
    around = options["environment"]
    image = key_of("environment", around) if around is not None and Path(around).is_file() else around
    return hashed(scene_digest(scene), lights, image)


def _silent(text: str) -> None:
    """Name no step."""
