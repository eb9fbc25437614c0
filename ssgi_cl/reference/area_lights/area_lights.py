"""The light of emissive surfaces in float64: polygons without blockers, and rays to points of them."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

LIFT = 1e-4
"""Height above its surface at which a ray starts, relative to the diagonal of the scene's box."""
SHORT = 1e-4
"""Part of a ray left out at its end."""


def polygon_irradiance(corners: Doubles, at: Doubles, normal: Doubles) -> Doubles:
    """Return irradiance [...] per radiance by a polygon that nothing blocks; less than 0 behind it.

    Lambert 1760; as vectors, Baum, Rushmeier and Winget 1989, equation 1.

    Args:
        corners: [n, 3] scene units, anti-clockwise as seen from its front.
        at, normal: [..., 3] what is lit, and its unit normals.
    """
    ring = corners - at[..., None, :]
    high = np.einsum("...ik,...k->...i", ring, normal)
    total = np.zeros(at.shape[:-1])
    out, into = np.zeros(at.shape), np.zeros(at.shape)  # where it crosses the horizon
    for i in range(len(corners)):
        a, b, ha, hb = ring[..., i - 1, :], ring[..., i, :], high[..., i - 1], high[..., i]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = a + (b - a) * (ha / (ha - hb))[..., None]
        leaves, enters = (ha > 0) & (hb <= 0), (ha <= 0) & (hb > 0)
        start = np.where(enters[..., None], crossing, a)
        end = np.where(leaves[..., None], crossing, b)
        total += np.where((ha > 0) | (hb > 0), _edge(start, end, normal), 0.0)
        out, into = np.where(leaves[..., None], crossing, out), np.where(enters[..., None], crossing, into)
    result: Doubles = -0.5 * (total + _edge(out, into, normal))
    return result


def _edge(a: Doubles, b: Doubles, normal: Doubles) -> Doubles:
    across = np.cross(a, b)
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, np.einsum("...k,...k->...", a, b))
    result: Doubles = np.einsum("...k,...k->...", across, normal) * angle / np.maximum(sine, 1e-300)
    return result


def area_lights_reference(gbuffer: GBuffer, scene: Scene, side: int = 8) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by the emissive surfaces of a scene.

    Rays go to side^2 points of each emissive triangle, the middles of equal parts. No emission is textured.
    """
    position, facing, there = SurfaceView.of(gbuffer).in_scene(scene.origin)
    at, normal = position[there], facing[there]
    corners = scene.positions[scene.triangles].astype(np.float64)
    edges = corners[:, 1:] - corners[:, :1]
    double = np.cross(edges[:, 0], edges[:, 1])
    lift = LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    start = at + normal * lift
    total = np.zeros((len(at), 3))
    for number in range(len(corners)):
        material = scene.materials[scene.material_ids[number]]
        light = np.array(material.emission)
        if not light.any():
            continue
        for u, v in _middles(side):
            way = corners[number, 0] + u * edges[number, 0] + v * edges[number, 1] - start
            squared = np.maximum((way * way).sum(axis=1), 1e-24)
            sent = -way @ double[number]
            sent = np.maximum(sent, 0.0) if scene.culled_backs[number] else np.abs(sent)
            sent[np.abs((at - corners[number, 0]) @ double[number]) <= lift * np.linalg.norm(double[number])] = 0.0
            got = np.maximum((way * normal).sum(axis=1), 0.0) * sent / squared**2 / (2.0 * side * side)
            lit = np.flatnonzero(got > 0.0)
            got[lit] *= ~blocked(corners, scene.culled_backs, start[lit], way[lit] * (1.0 - SHORT))
            total += got[:, None] * light
    result = np.zeros((*gbuffer.size, 3))
    result[there] = total
    return result


def blocked(
    corners: Doubles, culled: np.typing.NDArray[np.bool_], origin: Doubles, way: Doubles
) -> np.typing.NDArray[np.bool_]:
    """Return [n] whether a triangle lies between the ends of each ray, origin + t way with 0 < t < 1."""
    found = np.zeros(len(origin), bool)
    for (a, b, c), no_back in zip(corners, culled, strict=True):
        p = np.cross(way, c - a)
        det = p @ (b - a)
        s = origin - a
        q = np.cross(s, b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v, t = (s * p).sum(axis=1) / det, (way * q).sum(axis=1) / det, q @ (c - a) / det
        found |= (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1) & ((det < 0) | (not no_back))
    return found


def _middles(side: int) -> Doubles:
    """Return [side^2, 2] the middles of equal parts of the triangle u, v, 1 - u - v > 0."""
    up = [(i + 1 / 3, j + 1 / 3) for i in range(side) for j in range(side - i)]
    down = [(i + 2 / 3, j + 2 / 3) for i in range(side - 1) for j in range(side - 1 - i)]
    return np.array(up + down) / side
