"""Motion of the pixels of a G-buffer: where each was in the previous image, and how well that fits its depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera

if TYPE_CHECKING:
    from ssgi_cl.core.gbuffer import GBuffer

Doubles = NDArray[np.float64]

MOST_MOTION = 1e6
"""Pixels: the longest motion, beyond any image. What was behind the previous camera moved so far."""

FITS = 0.01
"""Difference of depths, relative to them, up to which a pixel fits the previous image: a surface's slope within a
pixel is below it nearly everywhere, and the gap to another surface above."""

CLEARLY = 4.0
"""Factor between two residuals from which on one convention clearly fits better."""
SMALL = 1e-4
"""Residual below which every convention fits: the picture hardly moves, or its motion is hardly wrong."""

_CONVENTIONS: dict[str, tuple[float, float, bool]] = {
    "pixels": (1.0, 1.0, False),
    "blender": (1.0, -1.0, False),
    "nuke": (-1.0, 1.0, False),
    "ndc": (1.0, -1.0, True),
}
"""Factors that make columns and rows to the previous image of stored numbers, and whether these are shares of half
the image."""

MOTION_KINDS = tuple(_CONVENTIONS)
"""Conventions of stored motion.

"pixels": that of `GBuffer.motion`; "blender": its pass Vector, previous - current in pixels, y up; "nuke": forward,
next - current in pixels, y up, of a motion that goes on evenly; "ndc": previous - current in normalised device
coordinates, -1 to 1 across the image, y up.
"""


@dataclass(frozen=True)
class Residual:
    """How well motion fits the depth of the previous image.

    Attributes:
        median: of the difference between the previous depth and the one that the motion expects there, relative to
            it, over the pixels that both images show.
        share: of these pixels whose difference is at most `FITS`.
        pixels: number of them.
    """

    median: float
    share: float
    pixels: int

    def __str__(self) -> str:
        return f"median residual {self.median:.2g} of the depth, {self.share:.0%} of {self.pixels} pixels within {FITS}"


def motion_of(value: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return motion [rows, columns, 2 or 3] float32, checked, for a depth whose last axes are `shape`.

    Raises:
        TypeError: not of real numbers.
        ValueError: another shape, NaN, or a motion beyond `MOST_MOTION` pixels.
    """
    array = checks.floats("motion", value)
    if array.ndim != 3 or array.shape[:2] != shape or array.shape[2] not in (2, 3):
        raise ValueError(
            f"motion has shape {array.shape}: expected ({shape[0]}, {shape[1]}, 2 or 3) as the depth: columns and rows "
            "to the previous image in pixels, and the change of depth in scene units"
        )
    checks.values_in_range("motion", array[..., :2], low=-MOST_MOTION, high=MOST_MOTION, unit="px")
    depth = array[..., 2:]
    checks.values_in_range("motion", depth, low=-checks.MOST_DEPTH, high=checks.MOST_DEPTH, unit="scene units")
    return array


def converted(stored: NDArray[Any], kind: str, camera: Camera) -> NDArray[np.float32]:
    """Return motion [rows, columns, 2 or 3] in pixels, down the rows, of one in another convention.

    Args:
        stored: likewise shaped, as a file has it.
        kind: one of `MOTION_KINDS`.
        camera: whose image has the pixels.
    """
    across, down, halves = _CONVENTIONS[checks.choice("motion_kind", kind, MOTION_KINDS)]
    scale = (0.5 * camera.width, 0.5 * camera.height) if halves else (1.0, 1.0)
    result = np.array(stored, np.float64)
    result[..., 0] *= across * scale[0]
    result[..., 1] *= down * scale[1]
    if kind == "nuke" and result.shape[2] > 2:
        result[..., 2] *= -1.0
    return result.astype(np.float32)


def camera_motion(depth: NDArray[np.float32], camera: Camera, previous: Camera) -> NDArray[np.float32]:
    """Return the motion of surfaces that stand still.

    Args:
        depth: [rows, columns] scene units, +inf where nothing is; with a margin or without.
        camera: sees it.
        previous: saw the previous image; its pixels count as those of `camera` where its size differs.

    Returns:
        [rows, columns, 3] float32: columns and rows in pixels, and previous depth minus depth in scene units; 0 where
        nothing is, and `MOST_MOTION` columns and rows where it was behind the previous camera.
    """
    there = np.isfinite(depth)
    column, row, before = seen_before(depth, camera, previous)
    ahead = there & ((before > 0.0) | previous.is_orthographic)
    own_row, own_column = _centres(depth.shape, camera)
    scale = camera.width / previous.width, camera.height / previous.height
    motion = np.stack([column * scale[0] - own_column, row * scale[1] - own_row, before - depth], axis=-1)
    with np.errstate(invalid="ignore"):
        motion[..., :2] = np.clip(motion[..., :2], -MOST_MOTION, MOST_MOTION)
    motion[there & ~ahead] = (MOST_MOTION, MOST_MOTION, 0.0)
    motion[~there] = 0.0
    return motion.astype(np.float32)


def seen_before(depth: NDArray[np.float32], camera: Camera, previous: Camera) -> tuple[Doubles, Doubles, Doubles]:
    """Return column and row in the image of `previous`, and the depth there, of each pixel of `camera`."""
    turn = previous.view[:3, :3] @ camera.view[:3, :3].T
    shift = previous.view[:3, 3] - turn @ camera.view[:3, 3]
    own_row, own_column = _centres(depth.shape, camera)
    sx, sy, ox, oy = camera.pixel_to_view
    deep = np.where(np.isfinite(depth), depth, 1.0).astype(np.float64)
    k = np.ones_like(deep) if camera.is_orthographic else deep
    view = np.stack([(sx * own_column + ox) * k, (sy * own_row + oy) * k, -deep], axis=-1) @ turn.T + shift
    before = -view[..., 2]
    sx, sy, ox, oy = previous.pixel_to_view
    k = np.ones_like(before) if previous.is_orthographic else np.where(before > 0.0, before, 1.0)
    return (view[..., 0] / k - ox) / sx, (view[..., 1] / k - oy) / sy, before


def _centres(shape: tuple[int, ...], camera: Camera) -> tuple[Doubles, Doubles]:
    """Return row and column of the pixels of arrays that may have a margin, counted in the camera's image."""
    rows, columns = np.indices(shape) + 0.5
    return rows - (shape[0] - camera.height) / 2, columns - (shape[1] - camera.width) / 2


def depth_residual(gbuffer: GBuffer, previous: GBuffer, motion: NDArray[np.float32] | None = None) -> Residual:
    """Return how well the motion of a G-buffer fits the depth of the previous one.

    1 / depth (orthographic: depth) of the previous front layer is interpolated between four pixels, on which it is
    linear wherever these lie on a plane.

    Args:
        gbuffer: the current image.
        previous: the one before.
        motion: [rows, columns, 2 or 3] to try in place of that of `gbuffer`; where it has none either, surfaces stand
            still.

    Raises:
        ValueError: no pixel of the previous image is met.
    """
    own, before = gbuffer.first("depth"), previous.first("depth")
    assert own is not None  # noqa: S101  every G-buffer has one
    assert before is not None  # noqa: S101
    given = gbuffer.first("motion") if motion is None else motion
    if given is None:
        given = camera_motion(own, gbuffer.camera, previous.camera)
    row, column = _centres(own.shape, gbuffer.camera)
    scale = previous.camera.width / gbuffer.camera.width, previous.camera.height / gbuffer.camera.height
    column = (column + given[..., 0]) * scale[0] + previous.margin[1] - 0.5
    row = (row + given[..., 1]) * scale[1] + previous.margin[0] - 0.5
    still = seen_before(own, gbuffer.camera, previous.camera)[2]
    expected = own + given[..., 2].astype(np.float64) if given.shape[2] > 2 else still
    left, top = np.floor(column), np.floor(row)
    inside = (left >= 0) & (top >= 0) & (left + 1 < before.shape[1]) & (top + 1 < before.shape[0])
    used = np.isfinite(own) & inside & (expected > 0.0)
    x, y = left[used].astype(int), top[used].astype(int)
    fx, fy = column[used] - x, row[used] - y
    taps = np.stack([before[y, x], before[y, x + 1], before[y + 1, x], before[y + 1, x + 1]]).astype(np.float64)
    weights = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy])
    whole = np.isfinite(taps).all(axis=0)
    if not whole.any():
        raise ValueError(
            "the motion leads no pixel to a surface of the previous image: expected motion in pixels to the frame "
            "before, of frames that show the same"
        )
    taps, weights, wanted = taps[:, whole], weights[:, whole], expected[used][whole]
    flat = previous.camera.is_orthographic
    seen = (weights * taps).sum(axis=0) if flat else 1.0 / (weights / taps).sum(axis=0)
    size = previous.camera.tolerance_depth(wanted)
    off = np.abs(seen - wanted) / size
    return Residual(float(np.median(off)), float((off <= FITS).mean()), int(off.size))


def verified(stored: NDArray[Any], kind: str, gbuffer: GBuffer, previous: GBuffer) -> tuple[NDArray[np.float32], str]:
    """Return stored motion in pixels, and a note with its residual against the previous image.

    Args:
        stored: [rows, columns, 2 or 3], as a file has it.
        kind: one of `MOTION_KINDS`; "" finds it: the one with the least residual.
        gbuffer: of the current image.
        previous: of the one before.

    Raises:
        ValueError: another convention fits the previous depth clearly better, or without `kind` none does so.
    """
    tried: dict[str, Residual] = {}
    for each in MOTION_KINDS:
        try:
            tried[each] = depth_residual(gbuffer, previous, motion=_tried(stored, each, gbuffer.camera))
        except ValueError:
            continue  # it leads out of the previous image
    if not tried or (kind and kind not in tried):
        raise ValueError(
            f"motion read as {kind or 'any of ' + ', '.join(MOTION_KINDS)} leads no pixel to a surface of the previous "
            "image: expected the frame before, and motion that is not scaled by a shutter"
        )
    order = sorted(tried, key=lambda each: tried[each].median)
    best, second = order[0], order[min(1, len(order) - 1)]
    if not kind and second != best and tried[second].median < max(CLEARLY * tried[best].median, SMALL):
        raise ValueError(
            f"motion fits the previous depth as {best!r} ({tried[best]}) and as {second!r} ({tried[second]}): expected "
            "motion_kind=, as it does not tell which it is"
        )
    if kind and tried[kind].median > max(CLEARLY * tried[best].median, SMALL):
        raise ValueError(
            f"motion read as {kind!r} does not fit the previous depth ({tried[kind]}); as {best!r} it does "
            f"({tried[best]}): expected motion_kind={best!r}"
        )
    chosen = kind or best
    return converted(stored, chosen, gbuffer.camera), f"motion is read as {chosen!r}: {tried[chosen]}"


def _tried(stored: NDArray[Any], kind: str, camera: Camera) -> NDArray[np.float32]:
    """Return stored motion as one kind has it, limited as `GBuffer.motion` is."""
    return np.clip(converted(stored, kind, camera), -MOST_MOTION, MOST_MOTION)
