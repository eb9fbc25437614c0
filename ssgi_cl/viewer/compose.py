"""Pictures beside pictures: the wipe, and the error in false colours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]

RAMP = np.array(
    [(0, 0, 4), (51, 16, 104), (123, 35, 130), (196, 60, 117), (246, 110, 92), (254, 180, 123), (252, 253, 191)],
    np.float64,
)
"""Colours of errors from 0 to 1 and above: dark to bright, also in grey."""

SOFTENING = 0.01
"""Of the reference's mean, added to its value where an error is a share of it."""


def wiped(left: Picture, right: Picture, share: float) -> Picture:
    """Return `left` up to a share of the width, and `right` beyond it, with a line between.

    `right` is brought to the size of `left` where it differs.
    """
    rows, columns = left.shape[:2]
    if right.shape != left.shape:
        across = np.arange(columns) * right.shape[1] // columns
        right = right[np.arange(rows) * right.shape[0] // rows][:, across]
    edge = round(share * columns)
    both = np.concatenate([left[:, :edge], right[:, edge:]], axis=1)
    if 0 < edge < columns:
        both[:, edge - 1 : edge + 1] = 255
    return both


def relative_error(values: Floats, reference: Floats) -> Floats:
    """Return |values - reference| / (reference + 1 % of its mean), of luminance or of a share; [rows, columns]."""
    if values.ndim == 3:
        weights = np.array([0.2126, 0.7152, 0.0722], np.float32)
        values, reference = values @ weights, reference @ weights
    base = reference + np.float32(SOFTENING) * (np.mean(reference) or np.float32(1.0))
    error: Floats = np.abs(values - reference) / np.maximum(base, np.float32(1e-20))
    return error


def false_colours(error: Floats) -> Picture:
    """Return [rows, columns, 3] uint8: errors of 0 dark, of 1 and above bright."""
    place = np.clip(np.nan_to_num(error, nan=1.0, posinf=1.0), 0.0, 1.0) * (len(RAMP) - 1)
    channels = [np.interp(place, np.arange(len(RAMP)), RAMP[:, channel]) for channel in range(3)]
    picture: Picture = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return picture
