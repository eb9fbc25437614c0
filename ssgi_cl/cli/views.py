"""`ssgi render --cameras`: a picture of a scene for each camera of a file or animation, resumable, on one machine or
many."""

from __future__ import annotations

import json
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
from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import SceneError
from ssgi_cl.frame.history import FrameHistory
from ssgi_cl.frame.render import render
from ssgi_cl.io import video
from ssgi_cl.io.console import checked_output, printable, progress
from ssgi_cl.rasterize.files.gltf_animation import animated_cameras, is_gltf
from ssgi_cl.sequences.frame_names import FrameNames, frame_range
from ssgi_cl.sequences.frame_result import FrameFile
from ssgi_cl.sequences.keys import hashed, key_of
from ssgi_cl.truth.digests import light_description, scene_digest

if TYPE_CHECKING:
    from ssgi_cl.core.lights import Light
    from ssgi_cl.core.scene import Scene

_OF_ONE = ("views", "explain", "max_memory", "eye", "target", "up", "fov", "camera")
"""Options of a single picture."""


class Shot(NamedTuple):
    """Which pictures there are.

    Attributes:
        cameras: file of cameras.
        frames: range of their numbers, or None for all.
        fps: frames a second.
        history: whether frames reuse light of those before.
        video: file of the pictures in a row, or None.
    """

    cameras: Path
    frames: str | None
    fps: float
    history: bool
    video: Path | None


class _Ready(NamedTuple):
    """What all pictures share; see `frame_arguments`."""

    scene: Scene
    lights: tuple[Light, ...]
    arguments: dict[str, Any]


@dataclass
class _Sequence:
    """How far the frames of a sequence are.

    Attributes:
        history: of them.
        latest: place of the latest one among all cameras, or None.
    """

    history: FrameHistory
    latest: int | None = None


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
        return self._rendered(camera)

    def _rendered(self, camera: Camera, history: FrameHistory | None = None) -> FrameFile | NDArray[np.uint8]:
        scene, lights, arguments = self._ready()
        outputs = None if self.as_exr else ("image",)
        skips = not self.options["no_skips"]
        frame = render(
            scene, camera, lights, gbuffer=self.as_exr, outputs=outputs, skips=skips, history=history, **arguments
        )
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


@dataclass(frozen=True, kw_only=True)
class RenderSequence(RenderView):
    """Renders frames of one shot, each with the history of those before; a function for `map_frames`.

    Attributes:
        path: the cameras of all frames.
    """

    path: tuple[Camera, ...]

    def __call__(self, place: int) -> FrameFile | NDArray[np.uint8]:  # type: ignore[override]
        """Return the picture of the frame at a place in the path, from 0 on.

        Where the one before was not the latest, as many frames before it are rendered as a mean stands for.
        """
        name = hashed(vars(self))
        if name not in _sequences:
            _sequences.clear()
            _sequences[name] = _Sequence(FrameHistory())
        sequence = _sequences[name]
        before, sequence.latest = sequence.latest, None  # should it fail, the next one begins anew
        if before is None or before + 1 != place:
            sequence.history.reset()
            for number in range(max(place - sequence.history.limit, 0), place):
                self._rendered(self.path[number], sequence.history)
        picture = self._rendered(self.path[place], sequence.history)
        sequence.latest = place
        return picture


_kept: dict[str, _Ready] = {}
_sequences: dict[str, _Sequence] = {}
_lock = Lock()


def render_views(
    scene: str, shot: Shot, output: Path, options: dict[str, Any], *, again: bool, scheduler: str | None, as_json: bool
) -> None:
    """Render a picture for each camera of a file and report them; exit with status 1 if any failed.

    Raises:
        click.UsageError: an option is for a single picture, or the output has no place for a number.
        ValueError, SceneError: the scene, the cameras or the frames are wrong.
        SequenceError: the cluster fails.
        MissingExtraError: a video is asked for, and there is no ffmpeg.
    """
    from ssgi_cl.rasterize.scenes import is_scene, make_scene

    into, views, numbers = _checked(shot, output, options, scheduler)
    check_scene(scene)
    with progress(as_json) as step:
        step(f"loading {scene}")
        loaded = make_scene(scene).scene if is_scene(scene) else scene_of_file(Path(scene), options)
        content = content_of(loaded, options)
    if not as_json:
        for note in loaded.notes:
            click.echo(printable(f"note: {note}"), err=True)
    del loaded  # each process loads it for itself, this one if the work is its own
    given: dict[str, Any] = {
        "scene": scene,
        "options": {name: value for name, value in options.items() if name not in _OF_ONE} | _NOTHING,
        "first": views[0],
        "content": content,
        "as_exr": output.suffix.lower() == ".exr",
    }
    work = RenderSequence(**given, path=tuple(views)) if shot.history else RenderView(**given)
    inputs = [number - 1 if shot.history else views[number - 1] for number in numbers]
    files = [into.path(number) for number in numbers]
    report_frames(work, inputs, files, again=again, scheduler=scheduler, as_json=as_json)
    if shot.video is not None:
        count = video.write(shot.video, files, shot.fps)
        told = {"video": str(shot.video), "frames": count}
        click.echo(json.dumps(told) if as_json else f"{shot.video}: {count} frames, {count / shot.fps:.2f} s")


def _checked(
    shot: Shot, output: Path, options: dict[str, Any], scheduler: str | None
) -> tuple[FrameNames, list[Camera], list[int]]:
    """Return the names of the files, all cameras, and the numbers of those that are asked for."""
    moves = is_gltf(shot.cameras)
    given = [name for name in _OF_ONE if options[name] not in (None, False) and not (moves and name == "camera")]
    if given:
        raise click.UsageError(f"--{given[0].replace('_', '-')} is for one picture: it does not go with --cameras")
    if shot.history and scheduler is not None:
        raise click.UsageError("--history is for frames in their order: it does not go with --scheduler")
    if shot.history and options["samples"] != 1:
        raise click.UsageError("--history takes the mean over frames: it does not go with --samples")
    checks.number("--fps", shot.fps, low=0.0, high=1e3, above=True, unit="frames a second")
    if shot.video is not None:
        if output.suffix.lower() != ".png":
            raise click.UsageError(f"--output is {output}: expected .png with --video, which is made of them")
        checked_output(shot.video, (video.SUFFIX,))
        video.encoder()
    into = numbered(output, (".png", ".exr"), "view.####.png")
    views = _cameras(shot, options)
    numbers = list(range(1, len(views) + 1)) if shot.frames is None else frame_range(shot.frames)
    wrong = [number for number in numbers if not 1 <= number <= len(views)]
    if wrong:
        raise ValueError(
            f"--frames is {shot.frames}: there is no camera {wrong[0]}; {shot.cameras} has 1 to {len(views)}"
        )
    if shot.video is not None and len({views[number - 1].size for number in numbers}) > 1:
        raise ValueError(f"--video is {shot.video}: expected cameras of one size in {shot.cameras}")
    return into, views, numbers


def _cameras(shot: Shot, options: Mapping[str, Any]) -> list[Camera]:
    """Return the cameras of a file."""
    from ssgi_cl.rasterize.raster.default_camera import cameras_from_json

    width, height = options["width"], options["height"]
    if not is_gltf(shot.cameras):
        return cameras_from_json(shot.cameras, width, height)
    if not shot.cameras.is_file():
        raise ValueError(f"--cameras is {shot.cameras}: there is no such file")
    size = 800 if width is None else width, 600 if height is None else height
    return [each.sized(*size) for each in animated_cameras(shot.cameras, shot.fps, options["camera"])]


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
