"""Gathering from a reflective shadow map in float64, as `techniques.rsm.rsm_gather` does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.patterns import cap_pattern, disk_pattern, square_points, tile_turns
from ssgi_cl.reference.rsm.rsm import face_rotations, texels

if TYPE_CHECKING:
    from ssgi_cl.techniques.rsm.rsm_gather import RsmGatherParams

LEAST = 1e-18
"""Of a squared distance in square scene units, as in kernels/rsm/receiver.clh."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Discs:
    """Small discs that shine: [..., 3] position, normal, flux and [...] area; shapes broadcast."""

    position: Doubles
    normal: Doubles
    flux: Doubles
    area: Doubles

    @classmethod
    def of(cls, rsm: ReflectiveShadowMap) -> Self:
        """Return all texels in one row, positions relative to the first camera's."""
        position, normal, area = texels(rsm)
        flux = np.asarray(rsm.flux, np.float64) * np.isfinite(rsm.depth)[..., None]
        return cls(
            position=position.reshape(-1, 3), normal=normal.reshape(-1, 3), flux=flux.reshape(-1, 3), area=area.ravel()
        )

    def weighted(self, index: NDArray[np.intp], count: Doubles) -> Discs:
        """Return those of an index, each for `count` such texels, but no smaller than one."""
        return Discs(
            position=self.position[index],
            normal=self.normal[index],
            flux=self.flux[index] * count[..., None],
            area=self.area[index] * np.maximum(count, 1),
        )


def rsm_gather_reference(gbuffer: GBuffer, rsm: ReflectiveShadowMap, params: RsmGatherParams) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by one map, gathered for every pixel."""
    return gathered(SurfaceView.of(gbuffer), rsm, params)


def gathered(view: SurfaceView, rsm: ReflectiveShadowMap, params: RsmGatherParams) -> Doubles:
    """Return the irradiance of all pixels of a view, whatever the resolution."""
    rows, columns = view.size
    points, normals = receivers(view, rsm)
    discs = Discs.of(rsm)
    if params.pattern in ("flux", "all"):
        samples = discs if params.pattern == "all" else drawn_by_flux(rsm, params.samples)
        row = [irradiance(p, n, samples) for p, n in zip(points, normals, strict=True)]
    else:
        row = [irradiance(points[y], normals[y], _round_pixels(points[y], y, rsm, discs, params)) for y in range(rows)]
    there = np.isfinite(view.inner(view.depth))
    return np.where(there[..., None], np.reshape(row, (rows, columns, 3)), 0.0)


def receivers(view: SurfaceView, rsm: ReflectiveShadowMap) -> tuple[Doubles, Doubles]:
    """Return [rows, columns, 3] positions and normals, world axes, from the map's origin."""
    turn, eye = view.camera.view[:3, :3], view.camera.position
    points = view.inner(view.positions()) @ turn + (eye - rsm.cameras[0].position)
    return points, view.inner(view.normal) @ turn


def irradiance(points: Doubles, normals: Doubles, discs: Discs) -> Doubles:
    """Return [points, 3]: the sum over discs of flux cos cos / (pi d^2 + area)."""
    way = discs.position - points[:, None]
    square = np.maximum(np.sum(way**2, axis=-1), LEAST)
    falls = np.maximum(np.sum(normals[:, None] * way, axis=-1), 0.0)
    leaves = np.maximum(-np.sum(discs.normal * way, axis=-1), 0.0)
    factor = falls * leaves / (square * (np.pi * square + discs.area))
    result: Doubles = np.sum(factor[..., None] * discs.flux, axis=1)
    return result


def drawn_by_flux(rsm: ReflectiveShadowMap, count: int) -> Discs:
    """Return `count` texels drawn in proportion to flux by hierarchical warping."""
    power = np.asarray(rsm.flux, np.float64).sum(axis=-1) * np.isfinite(rsm.depth)
    levels = [power]
    while levels[-1].shape != (1, 1):
        grown = np.pad(levels[-1], [(0, size % 2) for size in levels[-1].shape])
        levels.append(grown[::2, ::2] + grown[::2, 1::2] + grown[1::2, ::2] + grown[1::2, 1::2])
    index = np.zeros(count, np.intp)
    if levels[-1][0, 0] > 0.0:
        index = np.array([_descended(levels, u, v) for u, v in square_points(count)], np.intp)
    chosen = power.ravel()[index]
    lit = chosen > 0.0
    stands_for = np.where(lit, levels[-1][0, 0] / (count * np.where(lit, chosen, 1.0)), 0.0)
    return Discs.of(rsm).weighted(index, stands_for)


def _descended(levels: list[Doubles], u: float, v: float) -> int:
    """Return the texel that a point of the unit square comes to."""
    y = x = 0
    for sums in levels[-2::-1]:
        y, x = 2 * y, 2 * x
        parts = np.zeros((2, 2))
        block = sums[y : y + 2, x : x + 2]
        parts[: block.shape[0], : block.shape[1]] = block
        share = parts[0].sum() / parts.sum()
        down = v >= share and parts[1].sum() > 0.0
        v = (v - share) / (1.0 - share) if down else v / share
        share = parts[int(down), 0] / parts[int(down)].sum()
        right = u >= share and parts[int(down), 1] > 0.0
        u = (u - share) / (1.0 - share) if right else u / share
        y, x = y + down, x + right
    return int(y * levels[0].shape[1] + x)


def _round_pixels(points: Doubles, row: int, rsm: ReflectiveShadowMap, texels: Discs, params: RsmGatherParams) -> Discs:
    """Return [columns, samples] discs of the pattern round each pixel of a row of the image."""
    turn = np.zeros(len(points))
    if params.pattern == "rotated":
        turn = tile_turns()[row % 4][np.arange(len(points)) % 4]
    return texels.weighted(*samples_round(points, rsm, params.samples, params.radius, "unbiased", turn))


def samples_round(
    points: Doubles, rsm: ReflectiveShadowMap, samples: int, reach: float, weights: str, turn: Doubles
) -> tuple[NDArray[np.intp], Doubles]:
    """Return the samples of a map round each of some points, [points, samples].

    Args:
        points: [points, 3], world axes, from the map's origin.
        rsm: of one face, or of the six of a point light.
        samples: of each point.
        reach: radius of the disk in sides of a face; inf: to the furthest corner.
        weights: "unbiased" or "paper", see `disk_pattern`.
        turn: [points] angles of the pattern, radians.

    Returns:
        Flat index of texels, and how many texels each sample stands for.
    """
    if len(rsm.cameras) == 6:
        return _in_cap(points, turn, rsm, cap_pattern(samples, weights, min(0.5 * np.pi * reach, np.pi)))
    camera = rsm.cameras[0]
    rows, columns = camera.size
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    local = points @ camera.view[:3, :3].T
    # From the middle of the map in halves of its sides; beyond the border, and behind the light,
    # moved to the border along the line to the middle.
    k = np.ones(len(points)) if camera.is_orthographic else -local[:, 2]
    slope = np.array([to_x * columns / 2, to_y * rows / 2])
    middle = (local[:, :2] - k[:, None] * (np.array([at_x, at_y]) + slope)) / slope
    middle = middle / np.maximum(np.abs(middle).max(axis=-1), np.maximum(k, 1e-30))[:, None]
    half = 0.5 * np.array([columns, rows])
    middle = (middle + 1.0) * half
    radius = np.linalg.norm(np.maximum(middle, 2.0 * half - middle), axis=-1)
    if np.isfinite(reach):
        radius = np.full(len(points), reach * max(rows, columns))
    pattern = _turned(disk_pattern(samples, weights), turn)
    at = middle[:, None] + radius[:, None, None] * pattern[..., :2]
    inside = (at >= 0.0).all(axis=-1) & (at < 2.0 * half).all(axis=-1)
    column, line = np.moveaxis(np.clip(np.floor(at), 0, 2.0 * half - 1.0).astype(np.intp), -1, 0)
    return line * columns + column, np.where(inside, radius[:, None] ** 2 * pattern[..., 3], 0.0)


def _in_cap(points: Doubles, turn: Doubles, rsm: ReflectiveShadowMap, cap: Doubles) -> tuple[NDArray[np.intp], Doubles]:
    """Return the samples of a point light: of a pattern of directions round that of each point."""
    length = np.sqrt(np.maximum(np.sum(points**2, axis=-1, keepdims=True), LEAST))
    x, y, z = np.moveaxis(points / length, -1, 0)
    a = 1.0 / np.maximum(1.0 + z, 1e-6)
    across = np.stack([1.0 - x * x * a, -x * y * a, -x], axis=-1)
    along = np.stack([-x * y * a, 1.0 - y * y * a, -y], axis=-1)
    frame = np.stack([across, along, points / length], axis=1)
    pattern = _turned(cap, turn)
    direction = pattern[..., :3] @ frame
    main = np.abs(direction).argmax(axis=-1)
    face = 2 * main + (np.take_along_axis(direction, main[..., None], -1)[..., 0] < 0.0)
    local = np.einsum("psij,psj->psi", face_rotations()[face], direction)
    camera = rsm.cameras[0]
    rows, columns = camera.size
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    slope = local[..., :2] / -local[..., 2:]
    column = np.clip(np.floor((slope[..., 0] - at_x) / to_x), 0, columns - 1).astype(np.intp)
    line = np.clip(np.floor((slope[..., 1] - at_y) / to_y), 0, rows - 1).astype(np.intp)
    texel_angle = abs(to_x * to_y) / (1.0 + np.sum(slope**2, axis=-1)) ** 1.5
    return (face * rows + line) * columns + column, pattern[..., 3] / texel_angle


def _turned(pattern: Doubles, angle: Doubles) -> Doubles:
    """Return [pixels, samples, 4] the pattern turned about z by the angle of each pixel."""
    result = np.repeat(pattern[None], len(angle), axis=0)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    result[..., 0] = cosine * pattern[:, 0] - sine * pattern[:, 1]
    result[..., 1] = sine * pattern[:, 0] + cosine * pattern[:, 1]
    return result
