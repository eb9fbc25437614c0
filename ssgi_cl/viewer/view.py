"""The function `view`: a scene or a G-buffer in the browser."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.lights import Light, light_tuple
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.default_camera import default_camera, default_lights
from ssgi_cl.viewer.server import Viewer, viser
from ssgi_cl.viewer.source import HEIGHT, WIDTH, Source, gbuffer_source, open_source, scene_source


@checked_keywords
def view(
    source: Scene | GBuffer | str | os.PathLike[str],
    camera: Camera | None = None,
    lights: Sequence[Light] | None = None,
    *,
    environments: Sequence[str | os.PathLike[str]] = (),
    host: str = "localhost",
    port: int = 8080,
    runtime: Runtime | None = None,
) -> Viewer:
    """Open a window on a scene or a G-buffer: a page in the browser with controls for every parameter.

    The page shows the picture of `render` or another output, and follows the mouse. The server runs in threads of this
    process until `close` is called or the process ends. In a notebook, the result shows the page.

    Args:
        source: a scene; a G-buffer; the name of a built-in scene; or a file: .glb, .gltf, .obj or .ply, or
            a G-buffer in .exr or .npz.
        camera: the first view of a scene; by default its first camera, else one that shows it well.
        lights: of a scene; by default those of its file, else ones that suit it.
        environments: files of environments to choose from in the page; no other file can be chosen there.
        host: address that the server listens to. Any other than "localhost" lets other machines in.
        port: the first one that is tried, 1 to 65535; the next free one is taken.
        runtime: the device; by default the fastest found.

    Returns:
        The window: `url` is the address of its page, `close` ends it, `wait` returns after Ctrl-C.

    Raises:
        MissingExtraError: viser is not installed; it comes with the extra `viewer`.
        TypeError, ValueError: an argument of the wrong type or out of range.
        OSError: a file cannot be read.
    """
    port = checks.integer("port", port, low=1, high=65535)
    # It takes a third of a second, in which a scene is read and brought to the device; what fails is raised below.
    threading.Thread(target=lambda: _quietly(viser), name="ssgi import", daemon=True).start()
    runtime = runtime or Runtime.open()
    paths = tuple(Path(path) for path in environments)
    return Viewer(_source(source, camera, lights, paths, runtime), runtime, host=host, port=port)


def _quietly(work: Callable[[], object]) -> None:
    """Run what is run again where its errors matter."""
    with suppress(Exception):
        work()


def _source(
    given: object,
    camera: Camera | None,
    lights: Sequence[Light] | None,
    environments: tuple[Path, ...],
    runtime: Runtime,
) -> Source:
    if isinstance(given, (str, os.PathLike)):
        found = open_source(os.fspath(given), runtime, environments=environments)
        if camera is None and lights is None:
            return found
        if found.scene is None:
            raise ValueError(f"source is {os.fspath(given)!r}: expected neither camera nor lights with a G-buffer")
        given, lights = found.scene, found.lights if lights is None else lights
        camera = found.pose.camera(WIDTH, HEIGHT) if camera is None else camera
    if isinstance(given, GBuffer):
        if camera is not None or lights is not None:
            raise ValueError("camera or lights are given: expected None with a G-buffer, which has its camera")
        return gbuffer_source("a G-buffer", given)
    if not isinstance(given, Scene):
        raise TypeError(f"source is {type(given).__name__}: expected a Scene, a GBuffer, or a file's or scene's name")
    camera = camera or default_camera(given, WIDTH, HEIGHT, runtime=runtime)
    lit = given.lights or default_lights(given, camera, runtime) if lights is None else light_tuple(lights)
    return scene_source(
        "a scene",
        given,
        camera,
        tuple(lit),
        runtime,
        environments=environments,
        code=("scene, lights = ..., ...  # yours",),
    )
