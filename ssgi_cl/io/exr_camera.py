"""Cameras in the headers of OpenEXR files: the standard's matrices, and the attributes of renderers.

The standard's are worldToCamera (row vectors; left-handed, +z forward) and worldToNDC (row vectors; (0, 0) at the top
left of the display window, (1, 1) at the bottom right), see OpenEXR's StandardAttributes. Some writers transpose them.
V-Ray, Redshift and Unreal's Movie Render Queue have attributes of their own, Arnold focal length and aperture.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.normal_space import SAME
from ssgi_cl.io.exr_header import ExrHeader

Matrix = NDArray[np.float64]

RIGID = 1e-3
"""Deviation of a matrix from a rigid motion, above which it is none: headers hold float32."""
FORWARD = np.diag([1.0, 1.0, -1.0, 1.0])
"""From +z forward to +z backward, or the other way."""


class HeaderCamera(NamedTuple):
    """A camera of a header.

    Attributes:
        camera: of the display window; None where the header says too little.
        note: where it is from and what it lacks; "" where there is nothing of a camera.
        axes: [3, 3], from the axes of the file's world to those of the camera's.
    """

    camera: Camera | None
    note: str
    axes: Matrix = SAME


def header_camera(attributes: Mapping[str, Any], header: ExrHeader) -> HeaderCamera:
    """Return the camera that a header describes.

    Args:
        attributes: of the file, by name.
        header: whose display window and pixel aspect ratio it has.

    World space is as the file's, but where that is left-handed z is negated; Unreal's x forward, y right, z up is
    turned to -z forward, x right, y up. The units stay.
    """
    left, top, right, bottom = header.display
    size = right - left + 1, bottom - top + 1
    named = {re.sub(r"[^a-z0-9/]", "", name.lower()): value for name, value in attributes.items()}
    ndc, placed = _matrix(named.get("worldtondc")), _matrix(named.get("worldtocamera"))
    if ndc is not None and placed is not None:
        first = _rigid(FORWARD @ placed)
        for view in (first, _rigid(placed)):
            camera = None if view is None else _by_ndc(ndc, view, size)
            if camera is not None:
                axes = _axes(FORWARD @ placed if view is first else placed)
                return HeaderCamera(camera, "camera: worldToCamera and worldToNDC of the header", axes)
    view, where, axes = _view(named)
    focal = _focal(named, size[0])
    if focal is None:
        lacks = "" if view is None else f"camera: {where} of the header has no field of view"
        return HeaderCamera(None, lacks)
    fx, words = focal
    fy = fx * header.pixel_aspect
    if view is None:
        view, where = np.eye(4), "no position, so that the world is the camera's"
    camera = Camera.from_intrinsics(fx, fy, 0.5 * size[0], 0.5 * size[1], width=size[0], height=size[1], view=view)
    return HeaderCamera(camera, f"camera: {words} of the header, {where}", axes)


def camera_attributes(camera: Camera) -> dict[str, NDArray[np.float32]]:
    """Return worldToCamera and worldToNDC of a camera of the display window, as the standard has them."""
    x, y, z, w = camera.projection @ camera.view
    to_ndc = np.stack([0.5 * (x + w), 0.5 * (w - y), z, w])
    matrices = {"worldToCamera": FORWARD @ camera.view, "worldToNDC": to_ndc}
    return {name: np.ascontiguousarray(matrix.T, np.float32) for name, matrix in matrices.items()}


# ---- position


def _view(named: Mapping[str, Any]) -> tuple[Matrix | None, str, Matrix]:
    """Return a world-to-view matrix of ours, the name of what it is from, and `HeaderCamera.axes`."""
    standard = _matrix(named.get("worldtocamera"))
    if standard is not None:
        # A right-handed world and a camera with +z forward: a mirror.
        forward = np.linalg.det(standard[:3, :3]) < 0.0
        return _rigid(FORWARD @ standard if forward else standard), "worldToCamera", SAME
    for name in ("cameratransform", "rs/camera/xform", "rs/camera/transform"):
        placed = _matrix(named.get(name))
        if placed is not None and abs(np.linalg.det(placed)) > 1e-12:
            inverse = np.asarray(np.linalg.inv(placed), np.float64)
            return _rigid(inverse), {"cameratransform": "cameraTransform"}.get(name, name), _axes(inverse)
    return _unreal(named)


def _unreal(named: Mapping[str, Any]) -> tuple[Matrix | None, str, Matrix]:
    """Return the view matrix of curPos (cm) and curRot (degrees): x forward, y right, z up, left-handed."""
    parts: dict[str, float] = {}
    for name, value in named.items():
        found = re.fullmatch(r"unreal/.*?(curpos|currot)/(x|y|z|pitch|yaw|roll)", name)
        number = _number(value)
        if found and number is not None:
            parts.setdefault(found[2], number)
    if parts.keys() != {"x", "y", "z", "pitch", "yaw", "roll"}:
        return None, "", SAME
    (sp, cp), (sy, cy), (sr, cr) = (
        (math.sin(math.radians(parts[name])), math.cos(math.radians(parts[name]))) for name in ("pitch", "yaw", "roll")
    )
    forward = (cp * cy, cp * sy, sp)
    right = (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, -sr * cp)
    up = (-(cr * sp * cy + sr * sy), cy * sr - cr * sp * sy, cr * cp)
    ours = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])  # right, up, back
    view = np.eye(4)
    view[:3, :3] = np.array([right, up, np.negative(forward)]) @ ours.T
    view[:3, 3] = -view[:3, :3] @ (ours @ [parts["x"], parts["y"], parts["z"]])
    return view, "curPos and curRot", ours


def _axes(view: Matrix) -> Matrix:
    """Return what takes normals to the world of `_rigid`'s matrix: a mirror if theirs is left-handed."""
    return SAME if np.linalg.det(view[:3, :3]) > 0.0 else FORWARD[:3, :3]


def _rigid(matrix: Matrix) -> Matrix | None:
    """Return the nearest rigid motion without a mirror; None of what is none."""
    turn = matrix[:3, :3]
    scale = abs(np.linalg.det(turn)) ** (1.0 / 3.0)
    u, _, v = np.linalg.svd(turn)
    if scale <= 0.0 or np.abs(turn / scale - u @ v).max() > RIGID or abs(scale - 1.0) > RIGID:
        return None
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = u @ v, matrix[:3, 3]
    if np.linalg.det(view[:3, :3]) < 0.0:
        view[:3] = view[:3] @ FORWARD  # a left-handed world
    return view


def _matrix(value: Any) -> Matrix | None:
    """Return a matrix for column vectors: an attribute holds one for row vectors, unless its last row tells.

    Of 12 numbers the first nine are axes and the last three the position, as V-Ray writes them.
    """
    if isinstance(value, str):
        value = [float(number) for number in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", value)]
    if value is None or np.size(value) not in (12, 16):
        return None
    numbers = np.asarray(value, np.float64).ravel()
    if not np.isfinite(numbers).all():
        return None
    if len(numbers) == 12:
        placed = np.eye(4)
        placed[:3] = numbers.reshape(4, 3).T
        return placed
    matrix = numbers.reshape(4, 4)
    transposed = np.array_equal(matrix[3], [0, 0, 0, 1]) and not np.array_equal(matrix[:3, 3], [0, 0, 0])
    return matrix if transposed else matrix.T


# ---- projection


def _by_ndc(ndc: Matrix, view: Matrix, size: tuple[int, int]) -> Camera | None:
    """Return the camera of worldToNDC and a view matrix; None where they do not belong together."""
    for world in (np.eye(4), FORWARD):  # `view` counts z the other way in a left-handed world
        for matrix in (ndc, ndc.T):
            x, y, _, w = matrix @ world @ np.linalg.inv(view)
            # From 0..1, rows downwards, to -1..1, rows upwards.
            rows = np.array([2.0 * x - w, w - 2.0 * y, w])
            camera = _projected(rows, view, size)
            if camera is not None:
                return camera
    return None


def _projected(rows: Matrix, view: Matrix, size: tuple[int, int]) -> Camera | None:
    """Return the camera whose x, y and w in clip space are `rows` [3, 4] of view space; None if there is none."""
    width, height = size
    depth, constant = rows[2, 2], rows[2, 3]
    perspective = abs(depth) > abs(constant)
    rows = rows / (-depth if perspective else constant or 1.0)
    shift = 2 if perspective else 3
    wanted = np.zeros((3, 4))
    wanted[0, [0, shift]], wanted[1, [1, shift]] = rows[0, [0, shift]], rows[1, [1, shift]]
    wanted[2] = [0.0, 0.0, -1.0, 0.0] if perspective else [0.0, 0.0, 0.0, 1.0]
    scales = wanted[0, 0], wanted[1, 1]
    if min(scales) <= 0.0 or np.abs(rows - wanted).max() > RIGID * max(scales):
        return None
    if perspective:
        fx, fy = 0.5 * width * scales[0], 0.5 * height * scales[1]
        cx, cy = 0.5 * width * (1.0 - wanted[0, 2]), 0.5 * height * (1.0 + wanted[1, 2])
        return Camera.from_intrinsics(fx, fy, cx, cy, width=width, height=height, view=view)
    flat = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=2.0 / scales[1], width=width, height=height)
    projection = flat.projection.copy()
    projection[0], projection[1] = wanted[0], wanted[1]
    return replace(flat, view=view, projection=projection)


def _focal(named: Mapping[str, Any], width: int) -> tuple[float, str] | None:
    """Return the focal length in pixels across, and what it is from."""
    numbers = {name: number for name, value in named.items() if (number := _number(value)) is not None}
    focal = next((v for n, v in numbers.items() if n.endswith("focallength") and v > 0.0), None)
    for pattern in (
        r".*(filmaperture|aperture|filmback|sensor)(x|horizontal|width|w)",
        r".*cameraaperture",
        r".*filmaperture",
    ):
        aperture = next((v for n, v in numbers.items() if re.fullmatch(pattern, n) and v > 0.0), None)
        if focal is not None and aperture is not None:
            return focal / aperture * width, f"focal length {focal:g} and aperture {aperture:g}"
    for name, number in numbers.items():
        if re.fullmatch(r"(rs/camera/|unreal/.*camera.*/|camera)(fov|fieldofview)", name) and 0.0 < number < 180.0:
            return 0.5 * width / math.tan(math.radians(0.5 * number)), f"field of view of {number:g} degrees across"
    return None


def _number(value: Any) -> float | None:
    """Return an attribute that is a number, or the text of one."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None
