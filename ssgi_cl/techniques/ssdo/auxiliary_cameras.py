"""Cameras that see what another misses: a rule for where to place them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.device.gbuffer import DeviceGBuffer

Doubles = NDArray[np.float64]

BLOCKS = (12, 16)
"""Rows and columns of blocks of the image, each of which offers places along its view ray."""
SHARES = (0.3, 0.6, 0.9)
"""Of the way to the nearest surface of a block."""
BEYOND = 2.0
"""View rays that meet nothing end at this many times the median depth."""
CLOSEST = 0.3
"""Distance of a place from the median point, in parts of the camera's own."""
YFOV = 1.6
"""Vertical field of view, radians: what lies round the median point is near."""


@checked_keywords
def auxiliary_cameras(
    camera: Camera, gbuffer: GBuffer | DeviceGBuffer | ArrayLike, count: int = 4, *, size: float = 0.5
) -> list[Camera]:
    """Place cameras that see what a camera misses.

    All look at the median of the visible points. Each stands where the camera sees that nothing
    is in the way (on its view ray to the nearest surface of a part of the image, at most 0.9
    of the way), so none is in or behind a wall, and within the box round the camera and all that
    is visible. One after the other takes the place whose direction
    from the median point is most unlike those of all before it, the camera's own first: what one
    sees from the back or in profile, no other sees as well.

    Args:
        camera: whose blind spots count.
        gbuffer: what it sees: a G-buffer, or its depth [rows, columns] in scene units without
            margin.
        count: cameras, 0 to 64.
        size: rows and columns, in parts of the camera's, in (0, 1].

    Returns:
        Perspective cameras, the most unlike first; none where nothing is seen.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    count = checks.integer("count", count, low=0, high=64)
    size = checks.number("size", size, low=0.0, high=1.0, above=True, unit="of the camera's size")
    depth = _depth(camera, gbuffer)
    if not np.isfinite(depth).any():
        return []
    target, places = _places(camera, depth)
    own = camera.position - target
    ways = places - target
    distance = np.linalg.norm(ways, axis=-1)
    far_enough = distance >= CLOSEST * float(np.linalg.norm(own))
    places, ways = places[far_enough], ways[far_enough] / distance[far_enough, None]
    likeness = ways @ (own / np.linalg.norm(own))
    rows, columns = (max(1, round(size * pixels)) for pixels in camera.size)
    cameras: list[Camera] = []
    for _ in range(min(count, len(places))):
        chosen = int(np.argmin(likeness))
        up = camera.view[1, :3]
        if abs(ways[chosen] @ up) > 0.99:
            up = camera.view[0, :3]
        cameras.append(Camera.look_at(places[chosen], target, up, yfov=YFOV, width=columns, height=rows))
        likeness = np.maximum(likeness, ways @ ways[chosen])
    return cameras


def _depth(camera: Camera, gbuffer: GBuffer | DeviceGBuffer | ArrayLike) -> NDArray[np.float32]:
    """Return the front layer's depth [rows, columns] without margin."""
    if isinstance(gbuffer, DeviceGBuffer):
        rows, columns = gbuffer.margin
        whole = gbuffer.depth.download()[0]
        depth: NDArray[np.float32] = whole[rows : whole.shape[0] - rows, columns : whole.shape[1] - columns]
    elif isinstance(gbuffer, GBuffer):
        first = gbuffer.first("depth")
        assert first is not None  # noqa: S101  every G-buffer has a depth
        depth = gbuffer.inner(first)
    else:
        depth = checks.plane("gbuffer", np.asarray(gbuffer), unit="scene units", low=0.0, infinite=True)
    if depth.shape != camera.size:
        raise ValueError(f"gbuffer has size {depth.shape}: expected {camera.size} as the camera")
    return depth


def _places(camera: Camera, depth: NDArray[np.float32]) -> tuple[Doubles, Doubles]:
    """Return the median visible point [3] and free places [n, 3], world space."""
    rows, columns = (min(b, s) for b, s in zip(BLOCKS, camera.size, strict=True))
    starts = [np.arange(n) * s // n for n, s in zip((rows, columns), camera.size, strict=True)]
    nearest = np.minimum.reduceat(np.minimum.reduceat(depth, starts[0], 0), starts[1], 1)
    small = Camera(
        view=camera.view, projection=camera.projection, width=columns, height=rows, depth_range=camera.depth_range
    )
    seen = np.isfinite(nearest)
    limit = BEYOND * float(np.median(nearest[seen]))
    free = np.where(seen, nearest, limit).astype(np.float32)
    visible = small.unproject(free)[seen]
    box = np.vstack([visible, camera.position])
    places = np.concatenate([small.unproject(np.float32(share) * free).reshape(-1, 3) for share in SHARES])
    within = ((places >= box.min(axis=0)) & (places <= box.max(axis=0))).all(axis=-1)
    return np.median(visible, axis=0), places[within]
