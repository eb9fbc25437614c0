"""The light of environments by rays in float64: what more and more rays come to."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.environment_samples import Strata
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.reference.area_lights.area_lights import blocked
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

LIFT, FAR = 1e-4, 2.0
"""Height above its surface at which a ray starts, and its length, relative to the diagonal of the scene's box."""


def sky_rays_reference(gbuffer: GBuffer, scene: Scene, strata: Strata) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by rays to all directions of the strata; no triangle has holes."""
    position, facing, there = SurfaceView.of(gbuffer).in_scene(scene.origin)
    at, normal = position[there], facing[there]
    corners = scene.positions[scene.triangles].astype(np.float64)
    diagonal = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    total = np.zeros((len(at), 3))
    for flux, points in zip(strata.flux, strata.points, strict=True):
        for towards in points:
            cosine = normal @ towards
            lit = np.flatnonzero(cosine > 0.0)
            start = at[lit] + normal[lit] * (LIFT * diagonal)
            way = np.tile(towards * (FAR * diagonal), (len(lit), 1))
            open_ = ~blocked(corners, scene.culled_backs, start, way)
            total[lit] += (cosine[lit] * open_)[:, None] * (flux / len(points))
    result = np.zeros((*gbuffer.size, 3))
    result[there] = total
    return result


def unblocked(strata: Strata, normal: Doubles) -> Doubles:
    """Return irradiance [n, 3] in W/m^2 by strata that nothing blocks; those across the horizon count as even."""
    cosine = normal @ strata.vectors.T
    above = np.maximum(cosine + strata.spread, 0.0)
    part = np.where(cosine < strata.spread, above**2 / (4.0 * np.maximum(strata.spread, 1e-4)), cosine)
    light: Doubles = part @ strata.flux
    return light
