"""Parts of a light's view that its shadow map shows: the finer, the nearer to the camera.

Cascades (Zhang, Sun, Xu and Lun 2006, "Parallel-split shadow maps for large-scale virtual
environments"), of every face of any light. Departs: a part is 2^-i times 2^-j of the face, and its
corner lies on a grid of eighths of its size, so that parts of one size have their texels at the
same places whatever the camera sees, and shadows do not crawl. The parts depend on what is seen in
this frame alone: maps that were kept are those that would be drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.techniques.shading.seen_depths import Seen

PARTS = 4
"""Of a face, at most."""
FACE_PARTS = 2
"""Of each of the six faces of a point light, at most."""
GRID = 8
"""Places in its own size at which a part may begin."""
MOST_ZOOM = 1 << 7
"""Of a part, along either axis; float32 tells a hundredth of its texels apart."""
ROOM = 3
"""Texels between a part's border and what it shows: the filter's reach."""
FINE = 0.35
"""Of a pixel's width: texels of this width serve all that is seen."""
_NEAREST = 0.02
"""Fraction of the tiles that may be nearer than where the finest part is meant for."""
_SLACK = 1e-4
"""Of a face's half width by which it is taken to be wider, for roundings."""

Doubles = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Crop:
    """A part of a face of a light's view.

    Attributes:
        face: number of the light's camera.
        zoom_x, zoom_y: how much smaller it is than the face, powers of 2.
        left, top: its first texel, of those that the face has at this zoom.
        holds_all: whether it holds all that is seen of the face.
    """

    face: int
    zoom_x: int = 1
    zoom_y: int = 1
    left: int = 0
    top: int = 0
    holds_all: bool = True

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole face."""
        return self.zoom_x == self.zoom_y == 1

    def camera(self, face: Camera) -> Camera:
        """Return the camera that draws it, with as many texels as that of its face."""
        if self.is_whole:
            return face
        projection = face.projection.copy()
        for axis, (zoom, first, size) in enumerate((
            (self.zoom_x, self.left, face.width), (self.zoom_y, self.top, face.height)
        )):
            shift = (zoom - 1.0 - 2.0 * first / size) * (1 - 2 * axis)
            projection[axis] = zoom * projection[axis] + shift * projection[3]
        return Camera(view=face.view, projection=projection, width=face.width, height=face.height)

    def values(self) -> list[float]:
        """Return what kernels/shade/crops.clh reads."""
        room = -math.inf if self.holds_all else ROOM - 0.5
        return [self.face, self.zoom_x, self.zoom_y, self.left, self.top, room,
                1.0 / self.zoom_x, 1.0 / self.zoom_y]


def whole(faces: int) -> tuple[Crop, ...]:
    """Return all of a light's faces as they are."""
    return tuple(Crop(face) for face in range(faces))


def fitted(cameras: tuple[Camera, ...], seen: Seen) -> tuple[Crop, ...]:
    """Return the parts that show all that is seen, of each face the coarsest first.

    Args:
        cameras: of the light's faces.
        seen: by the camera.
    """
    if not len(seen.nearest):
        return (Crop(0),)
    nearest = float(np.quantile(seen.nearest, _NEAREST))
    farthest = max(float(seen.farthest.max()), nearest)
    parts = PARTS if len(cameras) == 1 else FACE_PARTS
    depths = farthest * (nearest / farthest) ** (np.arange(parts) / parts)
    corners = [seen.corners(math.inf), *(seen.corners(float(most)) for most in depths[1:])]
    found: list[Crop] = []
    for face, camera in enumerate(cameras):
        last: Crop | None = None
        for points in corners:
            extent = _extent(camera, points)
            if extent is None:
                break
            crop = _part(face, camera.size[0], extent, last is None)
            if last is not None and crop.zoom_x * crop.zoom_y < 2 * last.zoom_x * last.zoom_y:
                continue
            found.append(crop)
            last = crop
    return tuple(found) or (Crop(0),)


def _part(face: int, size: int, extent: tuple[Interval, Interval], holds_all: bool) -> Crop:
    """Return the smallest part that holds what lies within fractions of the face."""
    zooms, firsts = [], []
    for low, high in extent:
        zoom = MOST_ZOOM
        while zoom > 1 and (first := _first(low, high, zoom, size)) is None:
            zoom //= 2
        if zoom == 1:
            first = 0
        zooms.append(zoom)
        firsts.append(first)
    return Crop(face, zooms[0], zooms[1], int(firsts[0] or 0), int(firsts[1] or 0), holds_all)


def _first(low: float, high: float, zoom: int, size: int) -> int | None:
    """Return the first texel of the part of this size that holds an interval, or None."""
    step = max(size // GRID, 1)
    start = math.floor((low * size * zoom - ROOM) / step)
    end = high * size * zoom + ROOM
    # As far back as the face goes.
    first = min(start * step, (zoom - 1) * size // step * step)
    first = max(first, 0)
    if first + size >= end or first + size >= zoom * size:
        return first
    return None


def _extent(camera: Camera, corners: Doubles) -> tuple[Interval, Interval] | None:
    """Return between which fractions of a face's columns and rows hulls lie; None: outside.

    Args:
        camera: of the face.
        corners: [n, 8, 3] of each hull, world space.
    """
    if not len(corners):
        return None
    view = corners @ camera.view[:3, :3].T + camera.view[:3, 3]
    depth = -view[..., 2]
    sx, sy, ox, oy = camera.pixel_to_view
    if camera.is_orthographic:
        slope_x, slope_y = view[..., 0], view[..., 1]
    else:
        near = 1e-6 * float(np.abs(view).max()) + 1e-300
        view, depth = _before(view, depth, near)
        if not len(view):
            return None
        slope_x, slope_y = view[..., 0] / depth, view[..., 1] / depth
    columns = (slope_x - ox) / (sx * camera.width)
    rows = (slope_y - oy) / (sy * camera.height)
    least_x, most_x = columns.min(axis=1), columns.max(axis=1)
    least_y, most_y = rows.min(axis=1), rows.max(axis=1)
    met = ((most_x >= -_SLACK) & (least_x <= 1.0 + _SLACK)
           & (most_y >= -_SLACK) & (least_y <= 1.0 + _SLACK))
    if not met.any():
        return None
    return tuple(  # type: ignore[return-value]
        (max(float(least[met].min()), 0.0), min(float(most[met].max()), 1.0))
        for least, most in ((least_x, most_x), (least_y, most_y))
    )


_PAIRS = np.array([(a, b) for a in range(8) for b in range(a + 1, 8)]).T


def _before(view: Doubles, depth: Doubles, near: float) -> tuple[Doubles, Doubles]:
    """Return corners [m, 36, 3] and their depths of what of hulls lies beyond a depth."""
    kept = depth.max(axis=1) > near
    view, depth = view[kept], depth[kept]
    ahead = depth > near
    inner = np.where(ahead[..., None], view, np.take_along_axis(
        view, depth.argmax(axis=1)[:, None, None], axis=1))
    if ahead.all():
        return inner, -inner[..., 2]
    a, b = view[:, _PAIRS[0]], view[:, _PAIRS[1]]
    da, db = depth[:, _PAIRS[0]], depth[:, _PAIRS[1]]
    cut = (da > near) != (db > near)
    t = np.where(cut, (near - da) / np.where(cut, db - da, 1.0), 0.0)
    between = a + t[..., None] * (b - a)
    between[..., 2] = np.where(cut, -near, between[..., 2])
    between = np.where(cut[..., None], between, inner[:, :1])
    points = np.concatenate([inner, between], axis=1)
    return points, -points[..., 2]
