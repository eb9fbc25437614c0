"""Sampled lights in float64, as defined in `techniques.sampled_lights`, before the blur."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ssgi_cl.core.environment_samples import sample_environments
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.sample_views import PATTERN, interleaved, sample_views
from ssgi_cl.core.scene import Scene
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

if TYPE_CHECKING:
    from ssgi_cl.techniques.sampled_lights import SampledLightsParams

OFFSET = 1.0
"""Diagonals of a texel by which a receiver is moved along its normal."""


def sampled_lights_reference(
    gbuffer: GBuffer, lights: Sequence[Light], scene: Scene, params: SampledLightsParams
) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by environments, not blurred."""
    environments = [light for light in lights if isinstance(light, Environment)]
    towards, flux = sample_environments(environments, params.count)
    view = SurfaceView.of(gbuffer)
    row, column = (view.inner(centre) for centre in view.centres())
    own = view.inner(view.depth)
    there = np.isfinite(own)
    turn = gbuffer.camera.view[:3, :3]
    eye = gbuffer.camera.position - scene.origin
    position = view.position(row, column, np.where(there, own, 1.0)) @ turn + eye
    normal = view.inner(view.normal) @ turn
    total = np.zeros((*own.shape, 3))
    if not len(towards):
        return total
    views, diagonals = sample_views(towards, scene.bounds - scene.origin, params.map_size)
    rows, columns = own.shape
    order = interleaved(params.count)[:, np.arange(rows)[:, None] % 4, np.arange(columns) % 4]
    for number, matrix in enumerate(views):
        mine = (order == number).any(axis=0) & there & (normal @ towards[number] > 0.0)
        n = normal[mine]
        q = (position[mine] + n * (OFFSET * diagonals[number])) @ matrix[:, :3].T + matrix[:, 3]
        share = _visible(depth_map(scene, matrix, params.map_size), q)
        total[mine] += (PATTERN * (n @ towards[number]) * share)[:, None] * flux[number]
    return total


def depth_map(scene: Scene, matrix: Doubles, texels: int) -> Doubles:
    """Return [texels, texels] the least depth at the middle of each texel, +inf without any."""
    corners = scene.positions[scene.triangles].astype(np.float64) @ matrix[:, :3].T + matrix[:, 3]
    depth = np.full((texels, texels), np.inf)
    y, x = np.mgrid[:texels, :texels] + 0.5
    for (ax, ay, az), (bx, by, bz), (cx, cy, cz) in corners:
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
