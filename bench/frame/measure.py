"""Time and error of frames, ours and a path tracer's, on one scene."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import truth
from ssgi_cl.bench.peers import mitsuba_frame
from ssgi_cl.bench.peers.mitsuba_frame import PathFrames
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.truth import Truth

from .error import FrameError, frame_error
from .modes import MODES, Mode

Floats = NDArray[np.float32]
Progress = Callable[[str, float], object]

STEP = 1e-3
"""Way of the camera between frames, in distances from eye to target."""


FIRSTS = 3
"""Frames with nothing kept, each after all that was kept is let go."""


@dataclass(frozen=True, eq=False)
class Row:
    """A way to make frames, measured.

    Attributes:
        name: of the mode, or "path N" and "path N + OIDN" with N samples a pixel.
        own: whether it is this library's.
        first_ms: median wall time of `FIRSTS` frames with nothing kept but compiled programs.
        kept_ms: median of frames while scene and lights stay and the camera moves.
        error: of the frame from the view's own camera.
        radiance: that frame, [rows, columns, 3].
    """

    name: str
    own: bool
    first_ms: float
    kept_ms: float
    error: FrameError
    radiance: Floats


def variants(view: BuiltinScene) -> Iterator[BuiltinScene]:
    """Return the view, or it by emission and by punctual lights where it has both for one light."""
    if not view.lights_stand_in:
        yield view
        return
    yield replace(view, lights=view.own_lights)
    yield replace(view, name=f"{view.name}-spot", scene=without_emission(view.scene))


def without_emission(scene: Scene) -> Scene:
    """Return the scene with materials that don't emit."""
    materials = tuple(replace(m, emission=(0.0, 0.0, 0.0)) for m in scene.materials)
    return replace(scene, materials=materials)


def reference(view: BuiltinScene, size: Size, paths: int, progress: Progress = lambda text, share: None) -> Truth:
    """Return the radiance that frames of a view are held to: pixels as boxes, all bounces."""
    return truth.radiance(
        view.scene,
        view.camera(size[1], size[0]),
        view.lights,
        paths,
        box_filter=True,
        progress=lambda share: progress(f"reference of {view.name}", share),
    )


def measure(
    view: BuiltinScene,
    size: Size,
    runtime: Runtime,
    expected: Floats,
    *,
    frames: int = 5,
    modes: Mapping[str, Mode] = MODES,
    samples: Sequence[int] = mitsuba_frame.SAMPLES,
    progress: Progress = lambda text, share: None,
) -> tuple[list[Row], list[str]]:
    """Return the rows of a view, and why others are missing.

    Args:
        view: scene, lights and camera.
        size: rows and columns.
        runtime: the device.
        expected: the reference, [rows, columns, 3].
        frames: with a moving camera, of which the median time is taken.
        modes: of this library.
        samples: a pixel of the path tracer; none leaves it out.
        progress: called with what is under way and the share done.
    """
    rows, skipped = [], []
    for number, (name, mode) in enumerate(modes.items()):
        progress(f"{name}, {view.name}", number / (len(modes) + 2 * len(samples)))
        try:
            rows.append(_row(name, True, _Own(view, runtime, mode), view, size, expected, frames))
        except (TypeError, ValueError) as error:
            skipped.append(f"{name}: {' '.join(str(error).split())}")
    for denoised in (False, True):
        why = mitsuba_frame.missing(denoised=denoised) if samples else ""
        if why:
            skipped.append(f"path{' + OIDN' if denoised else ''}: {why}")
            continue
        for number, count in enumerate(samples):
            name = peer_name(count, denoised)
            progress(f"{name}, {view.name}", (len(modes) + number + len(samples) * denoised)
                     / (len(modes) + 2 * len(samples)))  # fmt: skip
            maker = _Path(view, count, denoised)
            rows.append(_row(name, False, maker, view, size, expected, frames))
    return rows, skipped


def peer_name(samples: int, denoised: bool) -> str:
    """Return how a row of the path tracer is called."""
    return f"path {samples}{' + OIDN' if denoised else ''}"


class _Own:
    """Frames of this library."""

    def __init__(self, view: BuiltinScene, runtime: Runtime, mode: Mode) -> None:
        self._view, self._runtime, self._mode = view, runtime, mode
        self._scene = view.scene

    def forget(self) -> None:
        # Another scene as far as what is kept goes; and all prepared buffers are let go.
        self._scene = replace(self._view.scene)
        memory, keep = self._runtime.memory, self._runtime.memory.keep
        memory.keep = 0
        self._runtime.prepared(object(), object)
        memory.keep = keep

    def frame(self, camera: Camera) -> Floats:
        found = render(
            self._scene, camera, self._view.lights, outputs=("radiance",), runtime=self._runtime, **self._mode.options
        )
        return found.radiance


class _Path:
    """Frames of the path tracer."""

    def __init__(self, view: BuiltinScene, samples: int, denoised: bool) -> None:
        self._view, self._samples, self._denoised = view, samples, denoised
        self._made: PathFrames | None = None

    def forget(self) -> None:
        self._made = None
        gc.collect()

    def frame(self, camera: Camera) -> Floats:
        if self._made is None:
            self._made = PathFrames(self._view.scene, self._view.lights, self._samples, denoised=self._denoised)
        return self._made.frame(camera)


def _row(name: str, own: bool, maker: Any, view: BuiltinScene, size: Size, expected: Floats, frames: int) -> Row:
    def timed(step: int) -> tuple[float, Floats]:
        camera = _moved(view, step).camera(size[1], size[0])
        start = time.perf_counter()
        image = maker.frame(camera)
        return 1e3 * (time.perf_counter() - start), image

    for step in range(2):  # compiles
        timed(step)
    firsts = []
    for _ in range(FIRSTS):
        maker.forget()
        first, image = timed(0)
        firsts.append(first)
    kept = statistics.median(timed(step)[0] for step in range(1, frames + 1))
    return Row(name, own, statistics.median(firsts), kept, frame_error(image, expected), image)


def _moved(view: BuiltinScene, step: int) -> BuiltinScene:
    """Return the view some steps to the side."""
    eye, target, up = (np.asarray(v, np.float64) for v in (view.eye, view.target, view.up))
    side = np.cross(target - eye, up)
    length = float(np.linalg.norm(side))
    if step == 0 or length == 0.0:
        return view
    shift = side / length * (STEP * step * float(np.linalg.norm(target - eye)))
    x, y, z = (eye + shift).tolist()
    return replace(view, eye=(x, y, z))
