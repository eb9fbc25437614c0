"""What is read of an OpenEXR file of passes, and how: its camera, its depth and its normals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer_exr import interpret
from ssgi_cl.core.normal_space import SAME
from ssgi_cl.io import exr
from ssgi_cl.io.console import DEFAULT_FOV
from ssgi_cl.io.exr_header import ExrHeader, read_headers
from ssgi_cl.rasterize.raster.default_camera import camera_from_json


@dataclass(frozen=True, kw_only=True)
class Passes:
    """What is read of a file, and how.

    Attributes:
        yfov: vertical field of view of the display window, radians; None for the camera of the header, or 50
            degrees.
        view_height: of an orthographic camera, scene units.
        intrinsics: fx, fy, cx, cy of the display window, pixels.
        camera_file: a camera in JSON.
        channels, layer, part, layout, normal_space, depth_kind, depth_range: as of `GBuffer.from_exr`.
        invalid: depths that stand for nothing.
        nan: as of `GBuffer`.
        normals: whether normals are read.
    """

    yfov: float | None = None
    view_height: float | None = None
    intrinsics: tuple[float, ...] | None = None
    camera_file: Path | None = None
    channels: Mapping[str, str | tuple[str, ...]] = field(default_factory=dict)
    layer: str | None = None
    part: str | None = None
    layout: str | None = None
    normal_space: str | None = None
    depth_kind: str | None = None
    depth_range: tuple[float, float] | None = None
    invalid: tuple[float, ...] = ()
    nan: str = "refuse"
    normals: bool = True


def interpreted(
    arrays: dict[str, Any],
    source: Path,
    camera: Camera,
    expected: str,
    axes: NDArray[np.float64] | None,
    passes: Passes,
    normal_space: str | None,
    depth_kind: str | None,
) -> list[str]:
    """Make depth planar and normals those of the world, see `interpret`; errors name options of `ssgi apply`."""
    try:
        return interpret(arrays, camera, expected, axes, normal_space, depth_kind, passes.depth_range)
    except ValueError as error:
        words = str(error).replace("normal_space", "--normals")
        words = words.replace("depth_kind=", "--depth ").replace("depth_range=", "--depth-range ")
        raise ValueError(f"{source}: {words}") from None


def camera_of(source: Path, passes: Passes) -> tuple[NDArray[np.float64] | None, Camera, str]:
    """Return [3, 3] from the file's world to the camera's (None if unknown), the camera of the data window, and a note.

    Options are of the display window; without any it is the one in the file's header.
    """
    header = read_headers(source)[0]
    left, top, right, bottom = header.display
    rows, columns = header.size
    window = header.data[0] - left, header.data[1] - top, columns, rows
    file = passes.camera_file
    if file is not None:
        return SAME, camera_from_json(file, right - left + 1, bottom - top + 1).cropped(*window), f"camera: {file}"
    if (passes.yfov, passes.view_height, passes.intrinsics) == (None, None, None):
        found = exr.read_camera(source)
        if found.camera is not None:
            camera, size = found.camera, header.size
            return found.axes, camera if camera.size == size else camera.cropped(*window), found.note
        said = f"camera: {DEFAULT_FOV:g} degrees high are assumed, see --fov" + (
            f" ({found.note})" if found.note else ""
        )
        return None, _given_camera(header, passes), said
    return None, _given_camera(header, passes), "camera: as the options say"


def _given_camera(header: ExrHeader, passes: Passes) -> Camera:
    """Return the camera of the data window, from values of the display window."""
    left, top, right, bottom = header.display
    size: dict[str, Any] = {"width": right - left + 1, "height": bottom - top + 1}
    eye, target = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    if passes.intrinsics is not None:
        camera = Camera.from_intrinsics(*passes.intrinsics, **size)
    elif passes.view_height is not None:
        camera = Camera.orthographic(eye, target, view_height=passes.view_height, **size)
    else:
        yfov = math.radians(DEFAULT_FOV) if passes.yfov is None else passes.yfov
        camera = Camera.look_at(eye, target, yfov=yfov, **size)
    if header.pixel_aspect != 1.0 and passes.intrinsics is None:
        stretched = np.diag([1.0 / header.pixel_aspect, 1.0, 1.0, 1.0]) @ camera.projection
        camera = replace(camera, projection=stretched)
    rows, columns = header.size
    return camera.cropped(header.data[0] - left, header.data[1] - top, columns, rows)
