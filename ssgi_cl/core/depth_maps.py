"""G-buffers from depth maps: predicted or measured, of several kinds, with or without a camera."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from typing import Any, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.array_kinds import LAYOUTS, channels_last, host_array
from ssgi_cl.core.camera import Camera, orthographic_matrix
from ssgi_cl.core.errors import AssumedWarning
from ssgi_cl.core.normal_space import SAME, Space, UnclearSpaceError, detected_space, named_space
from ssgi_cl.core.srgb import srgb_to_linear

KINDS = ("planar", "ray", "inverse", "relative")
"""Meanings of the numbers of a depth map, see `GBuffer.from_depth`."""

INVALID = (0.0, math.nan, math.inf, 1e10)
"""Numbers that stand for no surface, by default. That of Blender is 1e10."""

ASSUMED_YFOV = math.radians(50.0)
"""Vertical field of view in radians where none is given."""
ASSUMED_RANGE = (1.0, 10.0)
"""Nearest and farthest depth of relative depth whose scale is not given, scene units."""
MILLIMETRES = 1e-3
"""Scale of integers, in m, where none is given."""

UNITS = ("pixels", "corner", "image")
"""Units of intrinsics."""


class DepthKeywords(TypedDict, total=False):
    """How a depth map is read, as keyword arguments; see `GBuffer.from_depth`."""

    K: ArrayLike | None
    K_unit: Literal["pixels", "corner", "image"]
    yfov: float | None
    orthographic: float | None
    camera: Camera | Iterable[Camera] | None
    view: ArrayLike | None
    kind: Literal["planar", "ray", "inverse", "relative"]
    scale: float | None
    shift: float | None
    invalid: Iterable[float] | None
    normal: Any
    normal_space: str | None
    layout: Literal["HWC", "CHW"]


class Reading(NamedTuple):
    """How a depth map is read; the fields are as in `GBuffer.from_depth`."""

    kind: str
    scale: float | None
    shift: float | None
    invalid: tuple[float, ...]


def read_depth(
    depth: Any,
    *,
    K: ArrayLike | None,
    K_unit: str,
    yfov: float | None,
    orthographic: float | None,
    camera: Camera | Iterable[Camera] | None,
    view: ArrayLike | None,
    kind: str,
    scale: float | None,
    shift: float | None,
    invalid: Iterable[float] | None,
    normal: Any,
    normal_space: str | None,
    color: Any,
    layout: str,
) -> tuple[list[dict[str, Any]], bool]:
    """Return the fields of the G-buffer of each depth map, and whether it is a batch; see `GBuffer.from_depth`."""
    checks.choice("layout", layout, LAYOUTS)
    checks.choice("kind", kind, KINDS)
    planes = channels_last("depth", checks.as_array("depth", depth), layout, 1)
    if planes.ndim == 4 and planes.shape[-1] == 1:
        planes = planes[..., 0]
    if planes.ndim not in (2, 3) or 0 in planes.shape:
        raise ValueError(f"depth has shape {planes.shape}: expected (rows, columns) or (images, rows, columns)")
    if planes.dtype.kind not in "fiu":
        raise TypeError(f"depth has dtype {planes.dtype}: expected real numbers")
    reading = Reading(kind, _optional("scale", scale), _optional("shift", shift), _invalid(invalid, kind))
    if shift is not None and kind != "relative":
        raise ValueError(f"shift is {shift!r}: expected None with kind={kind!r}, it is of relative depth")
    attributes = {
        name: None if value is None else channels_last(name, checks.as_array(name, value), layout, 3)
        for name, value in (("normal", normal), ("color", color))
    }
    count = None if planes.ndim == 2 else len(planes)
    notes: list[str] = []
    cameras = cameras_of(planes.shape[-2:], count, K, K_unit, yfov, orthographic, camera, view, notes)
    known = camera is not None or view is not None
    made = []
    for number in range(count or 1):
        front = planes if count is None else planes[number]
        parts = {
            name: value if value is None or count is None or value.ndim == 3 else value[number]
            for name, value in attributes.items()
        }
        own = cameras[number], reading, parts["normal"], normal_space, parts["color"], known, tuple(notes)
        made.append(_fields(front, *own))
    return made, count is not None


def _fields(
    values: NDArray[Any],
    camera: Camera,
    reading: Reading,
    normal: NDArray[Any] | None,
    normal_space: str | None,
    color: NDArray[Any] | None,
    known: bool,
    said: tuple[str, ...],
) -> dict[str, Any]:
    """Return the fields of the G-buffer of a depth map."""
    notes = list(said)
    depth = planar_depth(values, camera, reading, notes)
    if normal is not None:
        _like("normal", normal, depth)
        normal, note = world_normals(normal, depth, camera, normal_space, known=known)
        notes.append(note)
    albedo = None
    if color is not None:
        _like("color", color, depth)
        albedo = linear_color(color)
    return {"camera": camera, "depth": depth, "normal": normal, "albedo": albedo, "notes": tuple(notes)}


def planar_depth(
    values: NDArray[Any], camera: Camera, reading: Reading, notes: list[str] | None = None
) -> NDArray[np.float32]:
    """Return linear view depth [rows, columns] of a depth map; +inf where it has no surface.

    What had to be assumed is warned of, and added to `notes`.

    Raises:
        ValueError: a number that is neither a depth nor listed as invalid.
    """
    notes = [] if notes is None else notes
    missing = np.zeros(values.shape, bool)
    for number in reading.invalid:
        missing |= np.isnan(values) if math.isnan(number) else values == number
    given = values.astype(np.float64)
    wrong = ~missing & ~((given >= 0.0 if reading.kind == "relative" else given > 0.0) & np.isfinite(given))
    if reading.kind == "relative":
        wrong = ~missing & ~np.isfinite(given)
    if wrong.any():
        row, column = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(
            f"depth[{row}, {column}] is {values[row, column]}: expected a number > 0, or one of invalid, "
            f"which is {reading.invalid}; add it there if it stands for no surface"
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        if reading.kind == "relative":
            depth = 1.0 / _affine(given, missing, reading, notes)
        else:
            depth = _scale(values, reading, notes) * (1.0 / given if reading.kind == "inverse" else given)
        if reading.kind == "ray" and not camera.is_orthographic:
            depth = depth / ray_lengths(camera)
    return np.where(missing, np.inf, np.minimum(depth, checks.MOST_DEPTH)).astype(np.float32)


def ray_lengths(camera: Camera) -> NDArray[np.float64]:
    """Return [rows, columns] the distance along the ray through each pixel's centre at a view depth of 1."""
    sx, sy, ox, oy = camera.pixel_to_view
    x = sx * (np.arange(camera.width) + 0.5) + ox
    y = sy * (np.arange(camera.height) + 0.5) + oy
    lengths: NDArray[np.float64] = np.sqrt(1.0 + x[None, :] ** 2 + y[:, None] ** 2)
    return lengths


def world_normals(
    normal: NDArray[Any],
    depth: NDArray[np.float32],
    camera: Camera,
    normal_space: str | None,
    *,
    known: bool,
    axes: NDArray[np.float64] = SAME,
) -> tuple[NDArray[np.float32], str]:
    """Return unit normals [rows, columns, 3] in world space, 0 where there are none, and a note on their space.

    Args:
        normal, normal_space: as of `GBuffer.from_depth`.
        depth: linear view depth; +inf where nothing is.
        camera: saw both.
        known: whether its rotation is known; without, or if it does not fit, axes of a world are found.
        axes: as of `detected_space`.

    Raises:
        ValueError: as `GBuffer.from_depth`.
    """
    if normal_space is None:
        try:
            space = detected_space(normal, depth, camera, world=known, axes=axes)
        except UnclearSpaceError:
            if not known:
                raise
            space = detected_space(normal, depth, camera, world=False)  # a world with other axes, such as z up
    else:
        space = named_space(normal_space, camera, axes)
    if space.name == "world" and not space.found and np.array_equal(axes, SAME):
        return normal.astype(np.float32, copy=False), _said(space)
    signed = space.decoded(normal.astype(np.float64))
    length = np.linalg.norm(signed, axis=-1, keepdims=True)
    found = np.isfinite(depth) & np.isfinite(length[..., 0]) & (length[..., 0] > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        world = (signed / length) @ (camera.view[:3, :3].T @ space.to_view).T
    return np.where(found[..., None], world, 0.0).astype(np.float32), _said(space)


def linear_color(color: NDArray[Any]) -> NDArray[np.float32]:
    """Return reflectance in [0, 1] of a picture: integers are decoded as sRGB, floats are linear already."""
    if color.dtype.kind in "iu":
        color = srgb_to_linear(color / np.iinfo(color.dtype).max)
    linear: NDArray[np.float32] = np.clip(np.nan_to_num(color), 0.0, 1.0).astype(np.float32)
    return linear


def _scale(values: NDArray[Any], reading: Reading, notes: list[str]) -> float:
    """Return what the numbers are multiplied by."""
    if reading.scale is not None:
        return reading.scale
    if values.dtype.kind == "f" or reading.kind == "inverse":
        return 1.0
    return _assumed(notes, MILLIMETRES, f"depth of {values.dtype} is taken for millimetres: scale={MILLIMETRES:g}")


def _affine(
    given: NDArray[np.float64], missing: NDArray[np.bool_], reading: Reading, notes: list[str]
) -> NDArray[np.float64]:
    """Return 1 / depth of relative depth."""
    near, far = ASSUMED_RANGE
    if reading.scale is not None:
        return np.maximum(reading.scale * given + (reading.shift or 0.0), 1.0 / checks.MOST_DEPTH)
    if reading.shift is not None:
        raise ValueError(f"shift is {reading.shift!r}: expected scale too, 1 / depth = scale * value + shift")
    low, high = (float(f(given[~missing])) if not missing.all() else 0.0 for f in (np.min, np.max))
    scale = (1.0 / near - 1.0 / far) / (high - low) if high > low else 0.0
    _assumed(
        notes, scale, f"relative depth is taken to reach from {near:g} to {far:g} scene units: give scale and shift"
    )
    return scale * (given - low) + 1.0 / far


def _assumed(notes: list[str], value: float, text: str) -> float:
    """Warn of what is assumed; return it."""
    notes.append(text)
    warnings.warn(text, AssumedWarning, stacklevel=2)
    return value


def _said(space: Space) -> str:
    measured = "" if math.isnan(space.residual) else f", {space.residual:.1f} degrees off those of the depth (mean)"
    return f"normals are in the space {space.name!r}{', its axes found' if space.found else ''}{measured}"


def _optional(name: str, value: float | None) -> float | None:
    return None if value is None else checks.number(name, value)


def _invalid(invalid: Iterable[float] | None, kind: str) -> tuple[float, ...]:
    if invalid is None:
        return INVALID[1:] if kind == "relative" else INVALID
    try:
        return tuple(float(number) for number in invalid)
    except (TypeError, ValueError) as error:
        raise TypeError(f"invalid is {invalid!r}: expected numbers, such as (0, -1)") from error


def _like(name: str, array: NDArray[Any], depth: NDArray[np.float32]) -> None:
    if array.shape != (*depth.shape, 3):
        raise ValueError(f"{name} has shape {array.shape}: expected {(*depth.shape, 3)} as the depth")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} has dtype {array.dtype}: expected real numbers")


def cameras_of(
    size: tuple[int, int],
    count: int | None,
    K: ArrayLike | None,
    K_unit: str,
    yfov: float | None,
    orthographic: float | None,
    camera: Camera | Iterable[Camera] | None,
    view: ArrayLike | None,
    notes: list[str],
) -> list[Camera]:
    """Return the camera of each image: that which is given, or made of intrinsics.

    Arguments are as of `GBuffer.from_depth`, for images of `size`, `count` of them (None: one). What is assumed is
    added to `notes`, and warned of.
    """
    given = {"K": K, "yfov": yfov, "orthographic": orthographic, "camera": camera}
    names = [name for name, value in given.items() if value is not None]
    if len(names) > 1:
        raise ValueError(f"{' and '.join(names)} are given: expected one of {', '.join(given)}")
    if camera is not None and view is not None:
        raise ValueError("view is given: expected None with camera, which has one")
    number = count or 1
    if isinstance(camera, Camera):
        return [camera] * number
    if camera is not None:
        cameras = list(camera)
        if len(cameras) != number:
            raise ValueError(f"camera is a list of {len(cameras)}: expected one Camera, or {number} as images in depth")
        return cameras
    views = _each("view", view, number, (4, 4))
    if K is not None:
        return [_pinhole(one, K_unit, size, each) for one, each in zip(_each("K", K, number), views, strict=True)]
    rows, columns = size
    if orthographic is not None:
        height = checks.number("orthographic", orthographic, low=0.0, above=True, unit="scene units")
        matrix = orthographic_matrix(2.0 * rows / (height * columns), 2.0 / height, 0.0, checks.MOST_DEPTH)
        return [
            Camera(view=np.eye(4) if each is None else each, projection=matrix, width=columns, height=rows)
            for each in views
        ]
    if yfov is None:
        yfov = _assumed(notes, ASSUMED_YFOV, "the field of view is taken for 50 degrees: give K, yfov or orthographic")
    yfov = checks.number("yfov", yfov, low=1e-4, high=3.14, unit="radians")
    focal = 0.5 * rows / math.tan(0.5 * yfov)
    return [
        Camera.from_intrinsics(focal, focal, 0.5 * columns, 0.5 * rows, width=columns, height=rows, view=each)
        for each in views
    ]


def _each(name: str, value: Any, count: int, shape: tuple[int, ...] | None = None) -> list[Any]:
    """Return `count` values: one repeated, or those of a batch."""
    if value is None:
        return [None] * count
    array = np.asarray(host_array(value), np.float64)
    single = array.shape == shape if shape else array.shape in ((4,), (3, 3))
    if single:
        return [array] * count
    if array.ndim > 1 and len(array) == count:
        return list(array)
    expected = shape or "(3, 3) or (4,): fx, fy, cx, cy"
    raise ValueError(f"{name} has shape {array.shape}: expected {expected}, or {count} of them")


def _pinhole(K: NDArray[np.float64], unit: str, size: tuple[int, int], view: ArrayLike | None) -> Camera:
    """Return the camera of intrinsics.

    "pixels" is OpenCV's: pixel centres lie at integers, so that the principal point is half a pixel
    from ours, which is "corner". In units of the image, 0 and 1 are the image's edges.
    """
    checks.choice("K_unit", unit, UNITS)
    if K.shape == (3, 3):
        if K[0, 1] or K[1, 0] or not np.array_equal(K[2], [0.0, 0.0, 1.0]):
            raise ValueError(f"K is {K.tolist()}: expected no skew, and 0 0 1 in the last row")
        K = K[[0, 1, 0, 1], [0, 1, 2, 2]]
    fx, fy, cx, cy = (float(value) for value in K)
    rows, columns = size
    if unit == "image":
        fx, fy, cx, cy = fx * columns, fy * rows, cx * columns, cy * rows
    elif 0.0 < cx <= 1.0 and 0.0 < cy <= 1.0 and min(size) > 4:
        raise ValueError(
            f"K puts the principal point at ({cx:g}, {cy:g}) pixels, into the corner of an image of "
            f"{rows} x {columns}: expected pixels, or K_unit='image' for units of the image's size"
        )
    elif unit == "pixels":
        cx, cy = cx + 0.5, cy + 0.5
    return Camera.from_intrinsics(fx, fy, cx, cy, width=columns, height=rows, view=view)
