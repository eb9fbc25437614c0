"""The camera that a scene's file is seen by where none is asked for."""

from __future__ import annotations

from pathlib import Path

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.default_camera import DEFAULT_YFOV, camera_from_json, default_camera


def file_camera(
    scene: Scene, path: Path, width: int | None, height: int | None, yfov: float | None, runtime: Runtime
) -> Camera:
    """Return the camera of a scene that was read from `path`.

    It is that of the file named like it with .scene.json at its end, else the scene's first camera, else one that
    shows the scene well. With a field of view it is always the latter.

    Args:
        scene: y is up.
        path: its file.
        width, height: pixels; None for those of the file beside the scene, and 800 x 600 without one.
        yfov: vertical field of view in radians, or None.
        runtime: the device that looks round.

    Raises:
        ValueError: the file beside the scene is damaged.
    """
    if yfov is None:
        beside = path.with_name(path.stem + ".scene.json")
        if beside.is_file():
            return camera_from_json(beside, width, height)
    width, height = 800 if width is None else width, 600 if height is None else height
    if yfov is None and scene.cameras:
        return next(iter(scene.cameras.values())).sized(width, height)
    return default_camera(scene, width, height, DEFAULT_YFOV if yfov is None else yfov, runtime)
