"""View rays through pixels, in float64: where rays of references start and end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera

Doubles = NDArray[np.float64]


def visibility_rays(
    camera: Camera, rows: slice, origin: Doubles, scale: float = 1.0, offset: Doubles | None = None
) -> tuple[Doubles, Doubles]:
    """Return [n, 3] where view rays start, and [n, 3] by what they advance per unit depth.

    World space relative to `origin`, times `scale`; pixel centres of some rows, row by row.
    `offset` [2, n] moves each from its centre, to the right and down, in pixels.
    """
    sx, sy, ox, oy = camera.pixel_to_view
    column, row = np.arange(camera.width) + 0.5, np.arange(rows.start, rows.stop) + 0.5
    x, y = np.meshgrid(sx * column + ox, sy * row + oy)
    if offset is not None:
        x, y = x.ravel() + sx * offset[0], y.ravel() + sy * offset[1]
    across = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)
    ahead = np.array([0.0, 0.0, -1.0])
    turn = camera.view[:3, :3]
    eye = (-(camera.view[:3, 3] + turn @ origin) * scale) @ turn
    if camera.is_orthographic:
        start = eye + scale * (across @ turn)
        return start, np.broadcast_to(ahead @ turn, start.shape).copy()
    along = (across + ahead) @ turn
    return np.broadcast_to(eye, along.shape).copy(), along


def depths_in_sphere(
    camera: Camera, start: Doubles, along: Doubles, middle: Doubles, reach: float, scale: float = 1.0
) -> tuple[Doubles, Doubles, Doubles]:
    """Return depths [n] between which view rays may meet a scene, and that of its middle.

    A ray that starts and ends at the sphere round the scene, `reach` round `middle`, and within the
    camera's planes, keeps its precision: far from it float32 is coarse. Where the first is not less
    than the second, the line can't meet the scene.

    Args:
        camera: whose near and far plane count.
        start, along, scale: see `visibility_rays`.
        middle, reach: of the sphere, in the coordinates of the lines.
    """
    speed = np.linalg.norm(along, axis=-1)
    depth = np.sum((middle - start) * along, axis=-1) / speed**2
    near = np.maximum(camera.near * scale, depth - reach / speed)
    far = np.minimum(camera.far * scale, depth + reach / speed)
    return near, far, depth
