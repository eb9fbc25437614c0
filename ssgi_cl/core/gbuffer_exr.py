"""G-buffers of OpenEXR files: planar depth and normals in world space of what a file stores."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_kind import planar_of
from ssgi_cl.core.depth_maps import world_normals
from ssgi_cl.core.formats import files
from ssgi_cl.core.motion import MOTION_KINDS, converted, verified
from ssgi_cl.core.normal_space import SAME, UnclearSpaceError

if TYPE_CHECKING:
    from ssgi_cl.core.gbuffer import GBuffer


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
    channels = {key: own for key, own in (channels or {}).items() if key != "motion"}
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


def exr_motion(
    path: str,
    gbuffer: GBuffer,
    channels: str | Sequence[str] | None,
    *,
    layer: str | None,
    part: str | None,
    kind: str | None,
    previous: GBuffer | None,
    nan: str,
) -> tuple[NDArray[np.float32], str]:
    """Return the motion of a file in pixels, and a note; all as of `GBuffer.from_exr`."""
    kind = None if kind is None else checks.choice("motion_kind", kind, MOTION_KINDS)
    stored, names = files().read_motion(path, channels, kind=kind, layer=layer, part=part)
    if stored.shape[:2] != np.shape(gbuffer.depth)[-2:]:
        raise ValueError(
            f"{path}: motion has {stored.shape[0]} rows and {stored.shape[1]} columns: expected those of the depth"
        )
    if nan != "hole" and np.isnan(stored).any():
        row, column, index = np.argwhere(np.isnan(stored))[0].tolist()
        raise ValueError(f"{path}: channel {names[index]!r} is nan in row {row}, column {column}: expected numbers")
    said = f"motion from {', '.join(names)}"
    if previous is None:
        assert kind is not None  # noqa: S101  one of the two is given
        return converted(stored, kind, gbuffer.camera), f"{said}: read as {kind!r}, not verified without previous="
    if not isinstance(previous, type(gbuffer)):
        raise TypeError(f"previous is {type(previous).__name__}: expected a GBuffer")
    try:
        motion, note = verified(stored, kind or "", gbuffer, previous)
    except ValueError as error:
        raise ValueError(f"{path}: {said}: {error}") from None
    return motion, f"{said}: {note}"


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
