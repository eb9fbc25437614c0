"""Emitters: the emissive surfaces of a scene as quadrilaterals, and the triangles that their points are drawn from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene, mean_emission
from ssgi_cl.core.vpls import LUMINANCE
from ssgi_cl.device.constants import AREA_EMITTER, AREA_QUANTILES, AREA_SOURCE

Doubles = NDArray[np.float64]

MOST = 16
"""Quadrilaterals: every pixel sums up all of them."""
MOST_PAIRED = 1024
"""Triangles up to which two that make a quadrilateral are looked for."""
ROUND = 1.1
"""Ratio of the variances along the longer and the shorter side below which neither is the longer."""
FLAT = 1e-4
"""Sine of the angle between triangles that make one."""


@dataclass(frozen=True, eq=False)
class Emitters:
    """The emissive surfaces of a scene.

    Up to `MOST` quadrilaterals are exact. More are put into groups of neighbours that face alike, each of which is
    one rectangle of the same area, flux and spread; points are drawn from the triangles themselves.

    Attributes:
        table: [count, AREA_EMITTER] float32: four corners, anti-clockwise from in front; radiance; 1 where the back
            emits too; luminance of the radiance; area; plane:
            unit normal, and its distance from the origin.
        sources: [count, AREA_QUANTILES, AREA_SOURCE] float32: corner, two edges and unit normal of the triangle at
            each quantile of the group's flux, or -2 after those of the parallelogram that the emitter is. Coordinates
            are relative to the scene's origin.
        channels: 1 if all emitters have the same colour, else 3.
    """

    table: NDArray[np.float32]
    sources: NDArray[np.float32]
    channels: int

    def __len__(self) -> int:
        return len(self.table)

    @classmethod
    def of(cls, scene: Scene) -> Emitters:
        """Return those of a scene; none may be there."""
        radiance = np.array([mean_emission(scene, m) * m.emits for m in scene.materials]).reshape(-1, 3)
        chosen = np.flatnonzero(np.any(radiance > 0.0, axis=1)[scene.material_ids])
        corners = scene.positions[scene.triangles[chosen]].astype(np.float64)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * np.linalg.norm(normal, axis=1)
        chosen, corners, normal = chosen[area > 0.0], corners[area > 0.0], normal[area > 0.0]
        area = area[area > 0.0]
        normal /= 2.0 * area[:, None]
        backs = ~scene.culled_backs[chosen]
        light = radiance[scene.material_ids[chosen]]
        group = _groups(scene, chosen, corners, normal, area, light, backs)
        count = int(group.max(initial=-1)) + 1
        table = np.zeros((count, AREA_EMITTER))
        sources = np.zeros((count, AREA_QUANTILES, AREA_SOURCE))
        for q in range(count):
            own = np.flatnonzero(group == q)
            weight = area[own] * np.maximum(light[own] @ LUMINANCE, 1e-300)
            ends = np.cumsum(weight) / weight.sum()
            drawn = own[np.searchsorted(ends, (np.arange(AREA_QUANTILES) + 0.5) / AREA_QUANTILES)]
            sources[q, :, 0:3] = corners[drawn, 0]
            sources[q, :, 3:9] = (corners[drawn, 1:] - corners[drawn, :1]).reshape(-1, 6)
            sources[q, :, 9:12] = normal[drawn]
            whole = float(area[own].sum())
            mean = (area[own, None] * light[own]).sum(axis=0) / whole
            exact = _outline(corners[own], normal[own]) if len(own) <= 2 else None
            if exact is not None and _is_parallelogram(exact):
                sources[q, :, 0:9] = np.concatenate([exact[0], exact[1] - exact[0], exact[3] - exact[0]])
                sources[q, :, 12] = -2.0
            table[q, :12] = (_rectangle(corners[own], normal[own], area[own]) if exact is None else exact).ravel()
            table[q, 12:15], table[q, 15], table[q, 16], table[q, 17] = mean, backs[own[0]], mean @ LUMINANCE, whole
            ring = table[q, :12].reshape(4, 3)
            facing = np.cross(ring[2] - ring[0], ring[3] - ring[1])
            facing /= max(float(np.linalg.norm(facing)), 1e-300)
            table[q, 18:21], table[q, 21] = facing, facing @ ring.mean(axis=0)
        colours = table[:, 12:15] / np.maximum(table[:, 16:17], 1e-300)
        same = count == 0 or bool(np.allclose(colours, colours[0], rtol=1e-4, atol=1e-6))
        return cls(table.astype(np.float32), sources.astype(np.float32), 1 if same else 3)


def _groups(
    scene: Scene,
    chosen: NDArray[np.intp],
    corners: Doubles,
    normal: Doubles,
    area: Doubles,
    light: Doubles,
    backs: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Return the number of the emitter that each triangle belongs to."""
    count = len(chosen)
    own = np.arange(count)
    if count <= MOST_PAIRED:
        ids = scene.material_ids[chosen]
        for i in range(count):
            if own[i] != i:
                continue
            flat = np.flatnonzero((ids == ids[i]) & (normal @ normal[i] > 1.0 - FLAT) & (own == np.arange(count)))
            for j in flat[flat > i]:
                if _outline(corners[[i, j]], normal[[i, j]]) is not None:
                    own[j] = i
                    break
    _, group = np.unique(own, return_inverse=True)
    if group.max(initial=-1) < MOST:
        return group
    # Those that face alike; then the groups with most flux times size are halved across their longer side.
    axis = np.abs(normal).argmax(axis=1)
    side = np.take_along_axis(normal, axis[:, None], 1)[:, 0] < 0.0
    _, group = np.unique(2 * axis + side + 6 * backs, return_inverse=True)
    middle = corners.mean(axis=1)
    flux = area * (light @ LUMINANCE)
    groups = [np.flatnonzero(group == number) for number in range(int(group.max()) + 1)]
    while len(groups) < MOST:
        sizes = [float(np.ptp(middle[one], axis=0).max() * flux[one].sum()) for one in groups]
        largest = int(np.argmax(sizes))
        if sizes[largest] == 0.0:
            break
        one = groups.pop(largest)
        one = one[np.argsort(middle[one, np.ptp(middle[one], axis=0).argmax()], kind="stable")]
        total = np.cumsum(flux[one])
        cut = min(max(int(np.searchsorted(total, 0.5 * total[-1])) + 1, 1), len(one) - 1)
        groups += [one[:cut], one[cut:]]
    for number, one in enumerate(groups):
        group[one] = number
    return group


def _outline(corners: Doubles, normal: Doubles) -> Doubles | None:
    """Return the four corners of one triangle, or of two that make a convex quadrilateral; else None."""
    if len(corners) == 1:
        return np.asarray(corners[0][[0, 1, 2, 2]], np.float64)
    first, second = corners
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    same = np.linalg.norm(first[:, None] - second[None], axis=2) <= 1e-6 * size
    if np.count_nonzero(same) != 2:
        return None
    (i, j), alone = np.flatnonzero(same.any(axis=1)), int(np.flatnonzero(~same.any(axis=0))[0])
    # The corner that only the other triangle has comes between the two that both have.
    ring = np.insert(first, {(0, 1): 1, (1, 2): 2, (0, 2): 3}[int(i), int(j)], second[alone], axis=0)
    edges = np.roll(ring, -1, axis=0) - ring
    turn = np.cross(edges, np.roll(edges, -1, axis=0)) @ normal[0]
    return np.asarray(ring, np.float64) if bool((turn >= -1e-9 * size * size).all()) else None


def _is_parallelogram(ring: Doubles) -> bool:
    off = ring[0] - ring[1] + ring[2] - ring[3]
    return bool(np.abs(off).max() <= 1e-6 * np.ptp(ring, axis=0).max())


def _rectangle(corners: Doubles, normal: Doubles, area: Doubles) -> Doubles:
    """Return the corners of a rectangle with the area, place and spread of triangles."""
    whole = float(area.sum())
    facing = (area[:, None] * normal).sum(axis=0)
    facing /= max(float(np.linalg.norm(facing)), 1e-300)
    points = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1).reshape(-1, 3)
    weight = np.repeat(area / 4.0, 4)
    middle = (weight[:, None] * points).sum(axis=0) / whole
    offset = points - middle
    offset -= np.outer(offset @ facing, facing)
    spread = (weight[:, None] * offset).T @ offset / whole
    size, axes = np.linalg.eigh(spread)
    u = axes[:, 2] - (axes[:, 2] @ facing) * facing
    u /= max(float(np.linalg.norm(u)), 1e-300)
    v = np.cross(facing, u)
    if size[2] < ROUND * size[1]:  # no direction is the longer: that of most edges, or at right angles to them
        edges = np.roll(corners, -1, axis=1) - corners
        turned = (edges @ u + 1j * (edges @ v)) ** 4
        turned /= np.maximum(np.abs(turned), 1e-300) ** 0.75  # as long as an edge
        angle = float(np.angle(turned.sum())) / 4.0
        u, v = np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u
        size[1:] = [float(((offset @ w) ** 2) @ weight) / whole for w in (v, u)]
    long, short = (np.sqrt(3.0 * max(float(s), 0.0)) for s in (size[2], size[1]))
    scale = np.sqrt(whole / max(4.0 * long * short, 1e-300))
    long, short = (min(s * scale, 1e30) for s in (long, short))
    return np.array([middle + a * long * u + b * short * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
