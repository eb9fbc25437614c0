"""Crops of a light's view for its shadow map, with texels as fine as the visible pixels need.

As adaptive shadow maps (Fernando, Fernandez, Bala and Greenberg 2001), but with a fixed number of
crops: the one whose texels are too wide for the most pixels is divided in two until all are used. A
crop is 2^-i times 2^-j of a face, and its corner lies on a grid of quarters of its size. Crops of
one size thus have their texels at the same places whatever the camera sees, and shadows do not
crawl. The crops depend on this frame's visible surfaces alone: kept maps equal those that would be
drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.techniques.direct.seen_depths import Seen

CROPS = 8
"""Most crops of a light, or one for every face where that is more."""
ALL_CROPS = 32
"""Most crops of all lights, or one for every face."""
GRID = 4
"""Places in its own size at which a crop may begin."""
MOST_ZOOM = 1 << 7
"""Of a crop, along either axis; float32 resolves a hundredth of its texels."""
ROOM = 3
"""Texels between a crop's border and the surfaces that it serves: the filter's reach."""
FINE = 0.35
"""Of a pixel's width: texels of this width are fine enough."""
_SLACK = 1e-4
"""Relative widening of a face, for roundings."""

CROP_VALUES = 12
"""Numbers that kernels/direct/crops.clh reads of a crop."""

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Crop:
    """A rectangle of a face of a light's view.

    Attributes:
        face: number of the light's camera.
        zoom_x, zoom_y: how much smaller it is than the face, powers of 2.
        left, top: its first texel, of those that the face has at this zoom.
    """

    face: int
    zoom_x: int = 1
    zoom_y: int = 1
    left: int = 0
    top: int = 0

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole face."""
        return self.zoom_x == self.zoom_y == 1

    def camera(self, face: Camera) -> Camera:
        """Return the camera of the crop, with as many texels as that of its face."""
        if self.is_whole:
            return face
        projection = face.projection.copy()
        for axis, (zoom, first, size) in enumerate(
            ((self.zoom_x, self.left, face.width), (self.zoom_y, self.top, face.height))
        ):
            shift = (zoom - 1.0 - 2.0 * first / size) * (1 - 2 * axis)
            projection[axis] = zoom * projection[axis] + shift * projection[3]
        return Camera(view=face.view, projection=projection, width=face.width, height=face.height)

    def values(self, image: int, size: int) -> list[float]:
        """Return the numbers that kernels/direct/crops.clh reads.

        Args:
            image: of the map.
            size: texels along a side of it.
        """
        room = ROOM - 0.5
        # Beyond the face's border its last texel counts.
        sides = [-math.inf if first == 0 else room for first in (self.left, self.top)]
        sides += [
            math.inf if first + size >= zoom * size else size - room
            for first, zoom in ((self.left, self.zoom_x), (self.top, self.zoom_y))
        ]
        return [
            self.face,
            image,
            self.zoom_x,
            self.zoom_y,
            self.left,
            self.top,
            *sides,
            1.0 / self.zoom_x,
            1.0 / self.zoom_y,
        ]


def whole(faces: int) -> tuple[Crop, ...]:
    """Return all of a light's faces as they are."""
    return tuple(Crop(face) for face in range(faces))


def most_crops(faces: int, lights: int) -> int:
    """Return how many crops a light with so many faces may have, one of so many lights."""
    return max(faces, min(CROPS, ALL_CROPS // max(lights, 1)))


def fitted(cameras: tuple[Camera, ...], seen: Seen, most: int) -> tuple[Crop, ...]:
    """Return crops that show all visible surfaces, from coarse to fine.

    Args:
        cameras: of the light's faces.
        seen: tiles of the camera's image.
        most: crops, at least one for every face.
    """
    cells: list[_Cell] = []
    corners, width = seen.corners(), seen.widths()
    for face, camera in enumerate(cameras):
        boxes = _Boxes.of(camera, corners, width, seen.pixels)
        if boxes is not None:
            cells.append(_Cell(face, camera.height, boxes))
    while cells and len(cells) < most:
        worst = max(cells, key=lambda cell: cell.cost)
        if worst.cost <= 0.0:
            break
        cells.remove(worst)
        cells += worst.halves()
    found = {cell.crop for cell in cells} or {Crop(0)}
    return tuple(sorted(found, key=lambda c: (c.zoom_x * c.zoom_y, c.face, c.zoom_x, c.top, c.left)))


def excess(crops: tuple[Crop, ...], cameras: tuple[Camera, ...], seen: Seen) -> float:
    """Return by how much texels are wider than `FINE`, summed over pixels, in pixels; infinite where crops do not show
    all that is seen.

    Args:
        crops: of a light.
        cameras, seen: see `fitted`.
    """
    total = 0.0
    corners, width = seen.corners(), seen.widths()
    for face, camera in enumerate(cameras):
        boxes = _Boxes.of(camera, corners, width, seen.pixels)
        if boxes is None:
            continue
        size = camera.height
        best = np.full(len(boxes.pixels), np.inf)
        for crop in crops:
            if crop.face != face:
                continue
            zoom, first = (np.array(pair) for pair in ((crop.zoom_x, crop.zoom_y), (crop.left, crop.top)))
            low, high = boxes.low * size * zoom - first, boxes.high * size * zoom - first
            # Beyond the face's border its last texel counts.
            inside = ((low >= ROOM) | (first == 0)) & ((high <= size - ROOM) | (first + size >= zoom * size))
            ratio = (1.0 / (size * zoom) / boxes.width).max(axis=1)
            best = np.where(inside.all(axis=1), np.minimum(best, ratio), best)
        total += float((np.maximum(best - FINE, 0.0) * boxes.pixels).sum())
    return total


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Bounding boxes of the camera's tiles in a face.

    Attributes:
        low, high: [n, 2] columns and rows of the boxes, fractions of the face.
        width: [n, 2] of a pixel, likewise.
        pixels: [n] pixels of each tile.
    """

    low: Doubles
    high: Doubles
    width: Doubles
    pixels: Doubles

    @classmethod
    def of(cls, camera: Camera, corners: Doubles, width: Doubles, pixels: Doubles) -> _Boxes | None:
        """Return the boxes of the tiles that a face shows; None if it shows none.

        Args:
            camera: of the face.
            corners: [n, 8, 3] corners of each tile's hull, world space.
            width: [n] width of a pixel, scene units.
            pixels: [n] pixels of each tile.
        """
        sx, sy, ox, oy = camera.pixel_to_view
        if not camera.is_orthographic:
            about = _near(camera, corners)
            corners, width, pixels = corners[about], width[about], pixels[about]
            if not len(corners):
                return None
        view = corners @ camera.view[:3, :3].T + camera.view[:3, 3]
        if camera.is_orthographic:
            place, scale = view[..., :2], np.ones(len(view))
        else:
            near = 1e-6 * float(np.abs(view).max(initial=0.0)) + 1e-300
            kept = view[..., 2].min(axis=1, initial=0.0) < -near
            view, width, pixels = _beyond(view[kept], near), width[kept], pixels[kept]
            place = view[..., :2] / -view[..., 2:]
            scale = -view[..., 2].mean(axis=1)
        side = np.array([sx * camera.width, sy * camera.height])
        place = (place - (ox, oy)) / side
        low, high = place.min(axis=1), place.max(axis=1)
        met = ((high >= -_SLACK) & (low <= 1.0 + _SLACK)).all(axis=1)
        if not met.any():
            return None
        relative = width[met, None] / (scale[met, None] * np.abs(side))
        return cls(np.clip(low[met], 0.0, 1.0), np.clip(high[met], 0.0, 1.0), relative, pixels[met])

    def within(self, axis: int, low: float, high: float) -> _Boxes | None:
        """Return the boxes clipped to two bounds along an axis; None if none is left."""
        kept = (self.high[:, axis] >= low) & (self.low[:, axis] <= high)
        if not kept.any():
            return None
        lows, highs = self.low[kept], self.high[kept]
        length = np.maximum(highs[:, axis] - lows[:, axis], 1e-300)
        lows[:, axis] = np.maximum(lows[:, axis], low)
        highs[:, axis] = np.minimum(highs[:, axis], high)
        # Pixels are taken to be spread evenly.
        part = np.minimum((highs[:, axis] - lows[:, axis]) / length, 1.0)
        return _Boxes(lows, highs, self.width[kept], self.pixels[kept] * np.maximum(part, 1e-3))


class _Cell:
    """A rectangle of a face and its crop.

    Attributes:
        crop: the smallest one that shows the rectangle.
        cost: excess width of its texels, summed over pixels; 0 where all are fine enough.
    """

    def __init__(self, face: int, size: int, boxes: _Boxes) -> None:
        self._face, self._size, self._boxes = face, size, boxes
        self._low, self._high = boxes.low.min(axis=0), boxes.high.max(axis=0)
        bounds = zip(self._low.tolist(), self._high.tolist(), strict=True)
        zooms, firsts = zip(*(_smallest(low, high, size) for low, high in bounds), strict=True)
        self.crop = Crop(face, *zooms, *firsts)
        self._ratio = 1.0 / (size * np.array(zooms)) / boxes.width
        self._can = np.array(zooms) < MOST_ZOOM
        excess = np.where(self._can, np.maximum(self._ratio - FINE, 0.0), 0.0)
        self.cost = float((excess.max(axis=1) * boxes.pixels).sum())

    def halves(self) -> list[_Cell]:
        """Return the cells of both halves, along the axis whose texels are the most too wide."""
        excess = (np.maximum(self._ratio - FINE, 0.0) * self._boxes.pixels[:, None]).sum(axis=0)
        axis = int(np.argmax(np.where(self._can, excess, -1.0)))
        low, high = float(self._low[axis]), float(self._high[axis])
        middle = 0.5 * (low + high)
        parts = (self._boxes.within(axis, low, middle), self._boxes.within(axis, middle, high))
        return [_Cell(self._face, self._size, part) for part in parts if part is not None]


def _near(camera: Camera, corners: Doubles) -> NDArray[np.bool_]:
    """Return [n] whether each hull may meet a square perspective face."""
    middle = corners.mean(axis=1)
    radius = np.sqrt(((corners - middle[:, None]) ** 2).sum(axis=2).max(axis=1))
    view = middle @ camera.view[:3, :3].T + camera.view[:3, 3]
    half = abs(camera.pixel_to_view[2]) * (1.0 + _SLACK)
    beside = np.abs(view[:, :2]).max(axis=1) + half * view[:, 2]
    return np.asarray(beside <= radius * math.sqrt(1.0 + half * half))


def _smallest(low: float, high: float, size: int) -> tuple[int, int]:
    """Return zoom and first texel of the smallest crop that holds an interval of the face."""
    step = max(size // GRID, 1)
    zoom = MOST_ZOOM
    while zoom > 1:
        first = math.floor((low * size * zoom - ROOM) / step) * step
        # Not beyond the face.
        last = -(-(zoom - 1) * size // step) * step
        first = min(max(first, 0), last)
        if first + size >= min(high * size * zoom + ROOM, zoom * size):
            return zoom, first
        zoom //= 2
    return 1, 0


def _beyond(view: Doubles, near: float) -> Doubles:
    """Return corners [n, 36, 3] of hulls [n, 8, 3] clipped to what lies beyond a depth."""
    depth = -view[..., 2]
    ahead = depth > near
    if ahead.all():
        return view
    farthest = np.take_along_axis(view, depth.argmax(axis=1)[:, None, None], axis=1)
    inner = np.where(ahead[..., None], view, farthest)
    a, b = view[:, _PAIRS[0]], view[:, _PAIRS[1]]
    da, db = depth[:, _PAIRS[0]], depth[:, _PAIRS[1]]
    cut = (da > near) != (db > near)
    t = np.where(cut, (near - da) / np.where(cut, db - da, 1.0), 0.0)
    between = a + t[..., None] * (b - a)
    between[..., 2] = -near
    return np.concatenate([inner, np.where(cut[..., None], between, farthest)], axis=1)


_PAIRS = np.array([(a, b) for a in range(8) for b in range(a + 1, 8)]).T
