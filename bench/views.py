"""Views whose camera moves: the cameras of a sequence of frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.tuning.context import Context

STEP = 1e-3
"""Way of the camera between frames, in distances from eye to target."""
STEPS = 8
"""To the side, until the camera starts again."""


def moving_cameras(context: Context) -> Iterator[Camera]:
    """Return cameras of frames without end, each to the side of the one before."""
    view, (rows, columns) = context.view, context.size
    eye, target, up = (np.asarray(v, np.float64) for v in (view.eye, view.target, view.up))
    side = np.cross(target - eye, up)
    side /= np.linalg.norm(side) or 1.0
    for step in count():
        x, y, z = (eye + side * (STEP * (1 + step % STEPS) * np.linalg.norm(target - eye))).tolist()
        yield replace(view, eye=(x, y, z)).camera(columns, rows)
