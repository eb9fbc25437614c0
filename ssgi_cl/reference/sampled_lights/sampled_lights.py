"""Sampled lights in float64: directional lights with a depth map each, before the blur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

SETS = 16
"""Sets of samples, of which a pixel takes one."""
OFFSET = 1.0
"""Diagonals of a texel by which a receiver is moved along its normal."""


def sampled_lights_reference(
    gbuffer: GBuffer,
    scene: Scene,
    towards: Doubles,
    flux: Doubles,
    views: Doubles,
    diagonals: Doubles,
    order: NDArray[np.int64],
    texels: int,
) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by environments, not blurred.

    Args:
        gbuffer, scene: what is lit, and what blocks light.
        towards, flux: [n, 3] directions to the light and the irradiance of each, W/m^2.
        views: [n, 3, 4] from points to (column, row, depth) of each direction's map.
        diagonals: [n] of a map's texel, scene units.
        order: [n / 16, 4, 4] which directions a pixel of a 4 x 4 tile takes.
        texels: along the side of a map.
    """
    position, normal, there = SurfaceView.of(gbuffer).in_scene(scene.origin)
    total = np.zeros((*there.shape, 3))
    if not len(towards):
        return total
    rows, columns = there.shape
    order = order[:, np.arange(rows)[:, None] % 4, np.arange(columns) % 4]
    for number, matrix in enumerate(views):
        mine = (order == number).any(axis=0) & there & (normal @ towards[number] > 0.0)
        n = normal[mine]
        q = (position[mine] + n * (OFFSET * diagonals[number])) @ matrix[:, :3].T + matrix[:, 3]
        share = _visible(depth_map(scene, matrix, texels), q)
        total[mine] += (SETS * (n @ towards[number]) * share)[:, None] * flux[number]
    return total


def depth_map(scene: Scene, matrix: Doubles, texels: int) -> Doubles:
    """Return [texels, texels] the least depth at the middle of each texel, +inf without any."""
    corners = scene.positions[scene.triangles].astype(np.float64) @ matrix[:, :3].T + matrix[:, 3]
    depth = np.full((texels, texels), np.inf)
    y, x = np.mgrid[:texels, :texels] + 0.5
    for ((ax, ay, az), (bx, by, bz), (cx, cy, cz)), no_back in zip(corners, scene.culled_backs, strict=True):
        if no_back and (bx - ax) * (cy - ay) - (cx - ax) * (by - ay) < 0:
            continue  # rows run upwards as seen from the light
        a = (bx - x) * (cy - y) - (cx - x) * (by - y)
        b = (cx - x) * (ay - y) - (ax - x) * (cy - y)
        c = (ax - x) * (by - y) - (bx - x) * (ay - y)
        total = a + b + c
        inside = ((a >= 0) & (b >= 0) & (c >= 0)) | ((a <= 0) & (b <= 0) & (c <= 0))
        inside &= total != 0
        z = (a * az + b * bz + c * cz) / np.where(total == 0, 1.0, total)
        depth = np.where(inside, np.minimum(depth, z), depth)
    return depth


def _visible(depth: Doubles, at: Doubles) -> Doubles:
    """Return the share of light at points [n, 3] of a map: 2 x 2 comparisons, interpolated."""
    last = len(depth) - 1
    left, top = np.floor(at[:, 0] - 0.5), np.floor(at[:, 1] - 0.5)
    fx, fy = at[:, 0] - 0.5 - left, at[:, 1] - 0.5 - top
    x0, y0 = (np.clip(v, 0, last).astype(np.int64) for v in (left, top))
    x1, y1 = np.minimum(x0 + 1, last), np.minimum(y0 + 1, last)
    a, b, c, d = ((depth[y, x] >= at[:, 2]) * 1.0 for y in (y0, y1) for x in (x0, x1))
    result: Doubles = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
    return result
