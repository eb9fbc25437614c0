"""Measures of sequences of images: error, temporal noise, ghosting and lag.

All are of errors e = image - reference, one reference a frame, over the pixels that show something.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer

Doubles = NDArray[np.float64]
Images = Sequence[NDArray[np.floating]]
Masks = Sequence[NDArray[np.bool_]]

UNCOVERED = 8
"""Frames for which a pixel counts as uncovered."""
DEPTH = 0.02
"""Difference of depths, relative to them, from which on the previous image shows another surface."""
POP = 0.01
"""Change of a pixel from which on it is a pop, relative to the mean of the image."""
FOLLOWED = 0.9
"""Share of a step that has to be followed."""


def rmse(images: Images, references: Images, masks: Masks) -> float:
    """Return the root mean square error over some pixels of all frames; NaN if there are none."""
    squares = [_squared(i, r)[m] for i, r, m in zip(images, references, masks, strict=True)]
    values = np.concatenate(squares)
    return float(np.sqrt(values.mean())) if values.size else float("nan")


def temporal_noise(images: Images, references: Images, masks: Masks) -> float:
    """Return the root mean square of what the change from frame to frame errs by, from the second frame on.

    It is e - e of the frame before in the same pixel: a static error is none, flicker and swimming are.
    """
    errors = [np.asarray(i, np.float64) - r for i, r in zip(images, references, strict=True)]
    changes = [b - a for a, b in pairwise(errors)]
    nothing = [np.zeros_like(change) for change in changes]
    return rmse(changes, nothing, masks[1:])


def uncovered(gbuffers: Sequence[GBuffer]) -> list[NDArray[np.bool_]]:
    """Return for each frame which pixels came into view within the last `UNCOVERED` frames, that one included.

    Found by the depth of the previous image in the nearest pixel of where the motion leads, without what techniques
    look at: normals, planes and weights. The first frame has none.

    Args:
        gbuffers: without margin, with motion of three components from the second frame on.
    """
    ages: list[NDArray[np.int_]] = [np.full(gbuffers[0].size, UNCOVERED)]
    for before, now in pairwise(gbuffers):
        depth, motion, earlier = now.first("depth"), now.first("motion"), before.first("depth")
        assert depth is not None  # noqa: S101  every G-buffer has one
        assert earlier is not None  # noqa: S101
        if motion is None or motion.shape[2] != 3:
            raise ValueError("a G-buffer has no motion of three components")
        row, column = np.indices(now.size)
        x = np.rint(column + np.clip(motion[..., 0], -1e5, 1e5)).astype(int)
        y = np.rint(row + np.clip(motion[..., 1], -1e5, 1e5)).astype(int)
        inside = (x >= 0) & (x < before.size[1]) & (y >= 0) & (y < before.size[0])
        x, y = np.where(inside, x, 0), np.where(inside, y, 0)
        expected = np.where(np.isfinite(depth), depth + motion[..., 2], 1.0)
        seen = np.where(np.isfinite(earlier[y, x]), earlier[y, x], np.inf)
        same = inside & (np.abs(seen - expected) <= DEPTH * expected)
        ages.append(np.where(same, np.minimum(ages[-1][y, x] + 1, UNCOVERED), 0))
    return [age < UNCOVERED for age in ages]


def lag(images: Images, references: Images, switched: int) -> int:
    """Return the frames after a switch until `FOLLOWED` of the step is followed; 0: in the frame itself.

    The step is the mean of the references' change; -1 if no image follows it.
    """
    before, after = (float(np.mean(references[i])) for i in (switched - 1, switched))
    for number, image in enumerate(images[switched:]):
        if abs(float(np.mean(image)) - after) <= (1.0 - FOLLOWED) * abs(before - after):
            return number
    return -1


def flicker(images: Images, references: Images, gbuffers: Sequence[GBuffer]) -> float:
    """Return the mean change from frame to frame beyond that of the references, from the second image on.

    A change is that of the logarithm of luminance after reprojection, |log(L + .01) - log(L' + .01)|, L' the previous
    image between the pixels where the motion leads. Where the reference changes as much, as at edges and fine textures,
    nothing counts. Pixels that the previous image did not show do not count.

    Args:
        images, references: radiance [rows, columns, 3], W m^-2 sr^-1.
        gbuffers: of the same frames, without margin, with motion of three components.
    """
    found = []
    for i, x, y, there in _led(gbuffers):
        change, own = (
            np.abs(_logarithm(array[i]) - _between(_logarithm(array[i - 1]), x, y)) for array in (images, references)
        )
        found.append(np.maximum(change - own, 0.0)[there])
    values = np.concatenate(found)
    return float(values.mean()) if values.size else float("nan")


def pops(images: Images, references: Images, gbuffers: Sequence[GBuffer]) -> float:
    """Return the share of pixels that change by more than `POP` of the mean from frame to frame, of those in
    which the reference changes less than that.

    Luminance after reprojection; arguments are those of `flicker`.
    """
    least = POP * float(np.mean(references))
    popped, steady = 0, 0
    for i, x, y, there in _led(gbuffers):
        change, own = (
            np.abs(_luminance(array[i]) - _between(_luminance(array[i - 1]), x, y)) for array in (images, references)
        )
        still = there & (own < least)
        popped, steady = popped + int((still & (change > least)).sum()), steady + int(still.sum())
    return popped / steady if steady else float("nan")


def _led(gbuffers: Sequence[GBuffer]) -> Iterator[tuple[int, Doubles, Doubles, NDArray[np.bool_]]]:
    """Yield the number of each image but the first, column and row of the image before that the motion leads to, and
    which pixels it showed."""
    for i in range(1, len(gbuffers)):
        depth, motion, before = (
            gbuffers[i].first("depth"),
            gbuffers[i].first("motion"),
            gbuffers[i - 1].first("depth"),
        )
        assert depth is not None  # noqa: S101  every G-buffer has one
        assert before is not None  # noqa: S101
        if motion is None or motion.shape[2] != 3:
            raise ValueError("a G-buffer has no motion of three components")
        row, column = np.indices(gbuffers[i].size)
        x: Doubles = column.astype(np.float64) + np.clip(motion[..., 0], -1e5, 1e5)
        y: Doubles = row.astype(np.float64) + np.clip(motion[..., 1], -1e5, 1e5)
        rows, columns = before.shape
        there = np.isfinite(depth) & (x >= 0.0) & (x <= columns - 1) & (y >= 0.0) & (y <= rows - 1)
        x[~there] = y[~there] = 0.0
        expected = np.where(there, depth + motion[..., 2], 1.0)
        seen = before[np.rint(y).astype(int), np.rint(x).astype(int)]
        there &= np.abs(np.where(np.isfinite(seen), seen, 0.0) - expected) <= DEPTH * expected
        yield i, x, y, there


def _luminance(radiance: NDArray[np.floating]) -> Doubles:
    result: Doubles = np.asarray(radiance, np.float64).mean(axis=-1)
    return result


def _logarithm(radiance: NDArray[np.floating]) -> Doubles:
    result: Doubles = np.log(_luminance(radiance) + 0.01)
    return result


def _between(image: Doubles, x: Doubles, y: Doubles) -> Doubles:
    """Return an image between its pixels, at columns and rows within it."""
    left, top = (np.clip(v.astype(int), 0, n - 2) for v, n in ((x, image.shape[1]), (y, image.shape[0])))
    fx, fy = x - left, y - top
    upper = image[top, left] * (1.0 - fx) + image[top, left + 1] * fx
    lower = image[top + 1, left] * (1.0 - fx) + image[top + 1, left + 1] * fx
    result: Doubles = upper * (1.0 - fy) + lower * fy
    return result


def _squared(image: NDArray[np.floating], reference: NDArray[np.floating]) -> Doubles:
    """Return squared errors [rows, columns], of colours their mean over channels."""
    error = np.asarray(image, np.float64) - np.asarray(reference, np.float64)
    squares: Doubles = error**2
    return squares if squares.ndim == 2 else squares.mean(axis=-1)
