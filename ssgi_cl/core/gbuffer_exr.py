"""G-buffers of OpenEXR files: planar depth and normals in world space of what a file stores."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_kind import planar_of
from ssgi_cl.core.depth_maps import world_normals
from ssgi_cl.core.formats import files
from ssgi_cl.core.normal_space import SAME, UnclearSpaceError


def exr_arrays(
    path: str | os.PathLike[str],
    camera: Camera | None,
    channels: Mapping[str, str | tuple[str, ...]] | None,
    *,
    layer: str | None,
    part: str | None,
    layout: str | None,
    normal_space: str | None,
    depth_kind: str | None,
    depth_range: tuple[float, float] | None,
) -> dict[str, Any]:
    """Return the arguments of `GBuffer` that a file holds; all as of `GBuffer.from_exr`."""
    name, said, axes = os.fspath(path), "", SAME
    if camera is None:
        camera, said, axes = files().read_camera(path)
        if camera is None:
            raise ValueError(
                f"{name}: camera is None, and the header has none ({said or 'no attribute of one'}): expected "
                "camera=, such as Camera.look_at((0, 0, 0), (0, 0, -1), yfov=..., width=..., height=...)"
            )
    arrays, expected = files().read_with_kind(path, channels, size=camera.size, layer=layer, part=part, layout=layout)
    try:
        found = interpret(arrays, camera, expected, axes, normal_space, depth_kind, depth_range)
    except ValueError as error:
        raise type(error)(f"{name}: {error}") from None
    arrays["notes"] = (*filter(None, [said]), *arrays["notes"], *found)
    return {**arrays, "camera": camera}


def interpret(
    arrays: dict[str, Any],
    camera: Camera,
    expected: str,
    axes: NDArray[np.float64] | None,
    normal_space: str | None,
    depth_kind: str | None,
    depth_range: tuple[float, float] | None,
) -> list[str]:
    """Make the depth of a file's arrays planar, and its normals those of the camera's world; return notes on both.

    Args:
        arrays: "depth", +inf where nothing is, and "normal" if there is one, as the file has them.
        camera: saw them.
        expected: kind of depth where planes do not tell, see `planar_of`.
        axes: from the file's world to that of the camera; None where it is not known.
        normal_space, depth_kind, depth_range: as of `GBuffer.from_exr`.

    Raises:
        ValueError: as of `planar_of` and `world_normals`; UnclearSpaceError: normals fit no space.
    """
    arrays["depth"], note = planar_of(arrays["depth"], camera, depth_kind, expected=expected, depth_range=depth_range)
    notes = [note]
    if "normal" in arrays:
        with np.errstate(invalid="ignore"):
            depth = np.where(arrays["depth"] > 0.0, arrays["depth"], np.inf)  # holes and NaN tell nothing
        placed = axes is not None
        try:
            arrays["normal"], note = world_normals(
                arrays["normal"], depth, camera, normal_space, known=placed, axes=axes if axes is not None else SAME
            )
            notes.append(note)
        except UnclearSpaceError as error:
            if not error.few:
                raise
            if not placed:
                notes.append("normals are taken for camera space: too few surfaces tell theirs")
    return notes
