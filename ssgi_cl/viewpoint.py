"""A camera and lights for a scene that brings none."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from ssgi_cl import check
from ssgi_cl.camera import Camera
from ssgi_cl.lights import DirectionalLight, Environment, Light, PointLight
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.shadow_map import rsm
from ssgi_cl.runtime import Runtime

DEFAULT_LIGHTS: tuple[Light, ...] = (
    DirectionalLight((-0.35, -1.0, -0.5), (10.0, 9.4, 8.4)),
    Environment((0.85, 1.0, 1.25)),
)
"""A high sun and a bluish sky; y is up."""

_HORIZONTAL = {0: (1, 0, 0), 1: (-1, 0, 0), 4: (0, 0, 1), 5: (0, 0, -1)}  # faces of a point RSM


def default_camera(scene: Scene, width: int, height: int, yfov: float, runtime: Runtime) -> Camera:
    """Return a camera that sees a scene well: an object from outside, a room from within.

    A scene whose centre is enclosed on at least five of six sides counts as a room.

    Args:
        scene: y is up.
        width, height: pixels.
        yfov: vertical field of view in radians.
        runtime: the device that looks round from the centre.
    """
    bounds = scene.bounds
    centre, extent = bounds.mean(axis=0), np.ptp(bounds, axis=0)
    diagonal = float(np.linalg.norm(extent)) or 1.0
    look_out = centre - [0.0, 0.2 * extent[1], 0.0]
    faces = np.asarray(rsm(scene, PointLight(look_out, 1.0), size=32, runtime=runtime).depth)
    depths = faces.reshape(6, 32, 32)
    covered = np.isfinite(depths).mean(axis=(1, 2))
    if (covered > 0.9).sum() >= 5:
        middle = {face: float(np.median(np.minimum(depths[face, 12:20, 12:20], diagonal)))
                  for face in _HORIZONTAL}
        face = max(middle, key=lambda f: middle[f] + middle[f ^ 1])
        way = np.array(_HORIZONTAL[face], dtype=np.float64)
        eye = look_out - way * 0.85 * middle[face ^ 1]
        target = eye + way
    else:
        distance = 0.55 * diagonal / math.tan(0.5 * min(yfov, yfov * width / height))
        way = np.array([0.45, 0.35, 1.0])
        eye = centre + way / np.linalg.norm(way) * distance
        target = centre
    return Camera.look_at(
        eye, target, yfov=yfov, width=width, height=height, near=1e-4 * diagonal
    )


def camera_from_json(path: Path, width: int | None, height: int | None) -> Camera:
    """Read a camera from a JSON file.

    The file holds an object with `origin`, `forward`, `up` (three numbers each, world space) and
    `fov_deg` (horizontal field of view in degrees); `width` and `height` in pixels where the
    arguments are None.

    Raises:
        ValueError: the file is missing, not JSON, or lacks a field; the message says which.
    """
    try:
        fields = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"the camera file {path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"the camera file {path} is not JSON: {error}") from error
    fields = fields.get("camera", fields) if isinstance(fields, dict) else {}
    needed = ("origin", "forward", "up", "fov_deg")
    missing = [name for name in needed if name not in fields]
    if missing:
        raise ValueError(f"the camera file {path} lacks {', '.join(missing)}")
    width = width or check.integer("width", fields.get("width", 800), low=1, high=16384, unit="px")
    height = height or check.integer(
        "height", fields.get("height", 600), low=1, high=16384, unit="px"
    )
    xfov = math.radians(check.number("fov_deg", fields["fov_deg"], low=0.1, high=179.0,
                                     unit="degrees"))
    yfov = 2.0 * math.atan(math.tan(0.5 * xfov) * height / width)
    origin = check.vector("origin", fields["origin"], 3)
    forward = check.direction("forward", fields["forward"])
    return Camera.look_at(
        origin, origin + forward, fields["up"], yfov=yfov, width=width, height=height, near=1e-3
    )
