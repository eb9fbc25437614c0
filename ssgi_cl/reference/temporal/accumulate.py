"""Accumulation over frames in float64, as defined in `techniques.temporal.accumulate`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.history import History, Reset
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

if TYPE_CHECKING:
    from ssgi_cl.techniques.temporal.accumulate import AccumulateParams

Mask = NDArray[np.bool_]

LEAST = 1.0 / 64.0
"""Share of the four taps that has to pass."""
STILL = 1.0 / 512.0
"""Pixels: shorter motion is none."""
ROUNDING = 1e-6
"""Of positions in float32, as a share of how far they are; it is added to the distance from the plane."""
CHANGE = 1e-5
"""Share of a mean below which a difference is no change."""


@dataclass(frozen=True, kw_only=True)
class Accumulation:
    """The fields of `AccumulateParams` of the same names, with the same defaults."""

    limit: int = 32
    fast: int = 4
    clamp: str = "neighbourhood"
    clamp_sigma: float = 3.0
    clamp_radius: int = 3
    young: int = 0
    plane_distance: float = 2.0
    normal_angle: float = 0.5


@dataclass(frozen=True)
class _Points:
    """Points [rows, columns, 3] in a view space, with normals and the distance at which their surface ends."""

    position: Doubles
    normal: Doubles
    most: Doubles

    @classmethod
    def of(cls, view: SurfaceView, position: Doubles, normal: Doubles, distance: float) -> _Points:
        sx, sy = view.camera.pixel_to_view[:2]
        depth = -position[..., 2]
        k = np.ones_like(depth) if view.camera.is_orthographic else depth
        most = distance * max(abs(sx), abs(sy)) * k + ROUNDING * np.abs(position).sum(axis=-1)
        return cls(position, normal, most)

    def off(self, other: Doubles) -> Doubles:
        """Return distances of points from the tangent planes."""
        result: Doubles = np.abs((self.normal * (other - self.position)).sum(axis=-1))
        return result


def accumulate_reference(
    plane: ArrayLike,
    gbuffer: GBuffer,
    previous: GBuffer | None = None,
    history: History | None = None,
    params: AccumulateParams | Accumulation | None = None,
) -> History:
    """Return the history of this frame, whose `mean` is the result; arrays are float64."""
    params = params or Accumulation()
    value = np.asarray(plane, np.float64)
    flat = value.ndim == 2
    value = value[..., None] if flat else value
    view = SurfaceView.of(gbuffer)
    there = np.isfinite(view.inner(view.depth))
    if previous is None or history is None:
        reasons = np.where(there, int(Reset.FIRST), int(Reset.NOTHING))
        return _history(value, value, value**2, np.ones(view.size), reasons, flat=flat)
    before = SurfaceView.of(previous)
    held = [np.asarray(a, np.float64) for a in (history.mean, history.fast, history.square)]
    held = [a[..., None] if a.ndim == 2 else a for a in held]
    column, row, point = _places(gbuffer, view, before, params)
    ahead = (point.position[..., 2] < 0.0) | previous.camera.is_orthographic
    left, top = np.floor(column - 0.5).astype(int), np.floor(row - 0.5).astype(int)
    part = column - 0.5 - left, row - 0.5 - top
    total, frames = np.zeros(view.size), np.zeros(view.size)
    sums = [np.zeros_like(value) for _ in held]
    why = np.zeros(view.size, int)
    for down in (0, 1):
        for across in (0, 1):
            weight = (part[0] if across else 1 - part[0]) * (part[1] if down else 1 - part[1])
            failed, y, x = _failed(left + across, top + down, ahead, previous, before, point, params)
            used = there & (weight > 0.0)
            why |= np.where(used, failed, 0)
            weight = np.where(used & (failed == 0), weight, 0.0)
            total += weight
            frames += weight * np.asarray(history.count, np.float64)[y, x]
            for own, array in zip(sums, held, strict=True):
                own += weight[..., None] * array[y, x]
    kept = total >= LEAST
    safe = np.where(kept, total, 1.0)
    now = np.where(kept, frames / safe, 0.0) + 1.0
    count = np.minimum(now, params.limit)
    shares = 1.0 / count, 1.0 / np.minimum(now, min(params.fast, params.limit)), 1.0 / count
    results = []
    for own, array, share in zip((value, value, value**2), sums, shares, strict=True):
        past = array / safe[..., None]
        results.append(np.where(kept[..., None], past + (own - past) * share[..., None], own))
    mean, fast, square = results
    reasons = np.where(there, np.where(kept, 0, why), int(Reset.NOTHING))
    clamps = params.clamp != "none" and params.limit > params.fast
    if clamps or params.young > 1:
        source = fast if params.clamp == "fast" else value
        mean, count, reasons = _clamped(mean, count, reasons, source, view, params, clamps=clamps)
    return _history(mean, fast, square, count, reasons, flat=flat)


def _history(
    mean: Doubles, fast: Doubles, square: Doubles, count: Doubles, reasons: NDArray[np.int_], *, flat: bool
) -> History:
    if flat:
        mean, fast, square = mean[..., 0], fast[..., 0], square[..., 0]
    return History(mean, fast, square, count, reasons.astype(np.uint8))


def _places(
    gbuffer: GBuffer, view: SurfaceView, before: SurfaceView, params: AccumulateParams | Accumulation
) -> tuple[Doubles, Doubles, _Points]:
    """Return column and row in the previous image of each pixel, and what is expected there in its view space."""
    camera, other = view.camera, before.camera
    turn = other.view[:3, :3] @ camera.view[:3, :3].T
    shift = other.view[:3, 3] - turn @ camera.view[:3, 3]
    there = np.isfinite(view.depth)
    depth = np.where(there, view.depth, 1.0)
    was = view.inner(view.position(*view.centres(), depth)) @ turn.T + shift
    centres: Doubles = np.indices(view.size).astype(np.float64) + 0.5
    own_row, own_column = centres[0], centres[1]
    scale = other.width / camera.width, other.height / camera.height
    expected: Doubles = -was[..., 2]
    motion = gbuffer.first("motion")
    if motion is None:
        safe = was.copy()
        safe[..., 2] = np.minimum(was[..., 2], -1e-30) if not other.is_orthographic else was[..., 2]
        seen_row, seen_column = before.pixel(safe)
        across = (seen_column - before.margin[1]) / scale[0] - own_column
        down = (seen_row - before.margin[0]) / scale[1] - own_row
    else:
        moved = gbuffer.inner(motion).astype(np.float64)
        across, down = moved[..., 0], moved[..., 1]
        if motion.shape[2] == 3:
            expected = view.inner(depth) + moved[..., 2]
    across, down = np.clip(across, -2e6, 2e6), np.clip(down, -2e6, 2e6)
    off = np.maximum(np.abs(across - np.rint(across)), np.abs(down - np.rint(down)))
    whole = (off < STILL) & (scale == (1.0, 1.0))
    column: Doubles = (own_column + np.where(whole, np.rint(across), across)) * scale[0]
    row: Doubles = (own_row + np.where(whole, np.rint(down), down)) * scale[1]
    place = before.position(
        row + before.margin[0],
        column + before.margin[1],
        np.where((expected > 0.0) | other.is_orthographic, expected, 1.0),
    )
    points = _Points.of(before, place, view.inner(view.normal) @ turn.T, params.plane_distance)
    if not other.is_orthographic:  # what was behind the camera fails by its sign
        place[..., 2] = np.where(expected > 0.0, place[..., 2], 1.0)
    return column, row, points


def _failed(
    x: NDArray[np.int_],
    y: NDArray[np.int_],
    ahead: Mask,
    previous: GBuffer,
    before: SurfaceView,
    point: _Points,
    params: AccumulateParams | Accumulation,
) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.int_]]:
    """Return the reason for which each tap fails, or 0, and its row and column within the image."""
    rows, columns = before.size
    inside = ahead & (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    at = y + before.margin[0], x + before.margin[1]
    row, column = (index.astype(np.float64) + 0.5 for index in at)
    layers = np.asarray(previous.depth, np.float64).reshape(-1, *before.depth.shape)

    def off(layer: int) -> Doubles:
        depth = layers[layer][at]
        full = np.isfinite(depth)
        place = before.position(row, column, np.where(full, depth, 1.0))
        return np.where(full, point.off(place), np.inf)

    front = off(0)
    behind = np.zeros(x.shape, bool)
    for layer in range(1, len(layers)):
        behind |= off(layer) < front
    turned = (point.normal * before.normal[at]).sum(axis=-1) < math.cos(params.normal_angle)
    failed = np.where(turned, int(Reset.NORMAL), 0)
    failed = np.where(behind, int(Reset.LAYER), failed)
    failed = np.where(front > point.most, int(Reset.PLANE), failed)
    failed = np.where(np.isinf(front), int(Reset.EMPTY), failed)
    failed = np.where(inside, failed, int(Reset.BORDER))
    return failed, y, x


def _clamped(
    mean: Doubles,
    count: Doubles,
    reasons: NDArray[np.int_],
    source: Doubles,
    view: SurfaceView,
    params: AccumulateParams | Accumulation,
    *,
    clamps: bool,
) -> tuple[Doubles, Doubles, NDArray[np.int_]]:
    """Return mean, count and reasons with long means moved where the neighbourhood shows a change, and those of few
    frames joined with the neighbourhood's."""
    rows, columns = view.size
    there = np.isfinite(view.depth)
    row, column = view.centres()
    position = view.inner(view.position(row, column, np.where(there, view.depth, 1.0)))
    normal, there = view.inner(view.normal), np.isfinite(view.inner(view.depth))
    point = _Points.of(view, position, normal, params.plane_distance)
    y, x = np.indices(view.size)
    pixels = np.zeros(view.size)
    sums, squares = np.zeros_like(source), np.zeros_like(source)
    low, high = source, source
    weights, around = np.zeros(view.size), np.zeros_like(source)
    reach = params.clamp_radius
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            inside = (y + dy >= 0) & (y + dy < rows) & (x + dx >= 0) & (x + dx < columns)
            ty, tx = np.clip(y + dy, 0, rows - 1), np.clip(x + dx, 0, columns - 1)
            fits = inside & there[ty, tx] & (point.off(position[ty, tx]) <= point.most)
            fits &= (normal * normal[ty, tx]).sum(axis=-1) >= math.cos(params.normal_angle)
            pixels += fits
            weights += fits * count[ty, tx]
            around += np.where(fits[..., None], count[ty, tx, None] * mean[ty, tx], 0.0)
            step = np.where(fits[..., None], source[ty, tx] - mean[ty, tx], 0.0)
            low = np.where(fits[..., None], np.minimum(low, source[ty, tx]), low)
            high = np.where(fits[..., None], np.maximum(high, source[ty, tx]), high)
            sums += step
            squares += step**2
    most = np.maximum(pixels, 1.0)[..., None]
    longer = there & (count > params.fast) & clamps
    least = np.maximum(params.clamp_sigma * np.sqrt(squares), CHANGE * pixels[..., None] * np.abs(mean))
    beyond = longer[..., None] & (np.abs(sums) > least)
    changed = beyond.any(axis=-1)
    moved: Doubles = np.where(beyond, np.clip(mean + sums / most, low, high), mean)
    joins = there & (count < params.young - 0.5) & (weights > 0.0)
    moved = np.where(joins[..., None], around / np.where(joins, weights, 1.0)[..., None], moved)
    return moved, np.where(changed, params.fast, count), reasons + np.where(changed, int(Reset.CHANGED), 0)
