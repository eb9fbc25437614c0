"""Surfels: pieces of a scene's surfaces, each with area, albedo and emission."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hilbert_curve import CURVE_BITS, curve_numbers
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene, mean_emission
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.techniques.radiosity.surface_points import (
    SurfacePoints,
    coats_of,
    places_of,
    surface_points,
    triangle_cross,
)

Doubles = NDArray[np.float64]

WIDEST = 3.0
"""Diagonal of the box round a surfel, over the root of its area, at most: the curve leaves a surface and comes back
elsewhere, and far parts take visibility and irradiance of a place that is not theirs. Half of the surfels are within
1.6."""


@dataclass(frozen=True, eq=False)
class Surfels:
    """One-sided pieces of surfaces, each of which consists of `PARTS` points.

    Consecutive surfels are neighbours that face alike: they are sorted by the axis nearest to
    their normal and along a Hilbert curve. Values of a surfel are means over its parts by area; its
    position is that of the part nearest to their mean. Parts of no area fill up a surfel.

    Attributes:
        origin: [3] float64, world space: positions count from here.
        position, normal: [count, 3] float64, scene units and unit vectors on the surfel's side.
        area: [count] float64, squared scene units, > 0.
        albedo: [count, 3] float64 in [0, 1].
        emission: [count, 3] float64, W m^-2 sr^-1.
        part_position, part_normal, part_area, part_albedo, part_emission: [PARTS count, ...] of
            the parts, those of a surfel one after the other, nearest to its position first.
        part_triangle: [PARTS count] the triangle of the scene that a part lies on.
        part_weights: [PARTS count, 3] float64, of the triangle's vertices in its position.
        part_number: [PARTS count] numbers that parts keep when others are left out or they move.
    """

    origin: Doubles
    position: Doubles
    normal: Doubles
    area: Doubles
    albedo: Doubles
    emission: Doubles
    part_position: Doubles
    part_normal: Doubles
    part_area: Doubles
    part_albedo: Doubles
    part_emission: Doubles
    part_triangle: NDArray[np.intp]
    part_weights: Doubles
    part_number: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.area)

    @classmethod
    def none(cls, origin: Doubles | None = None) -> Surfels:
        """Return no surfel."""
        rows = np.zeros((0, 3))
        values = {"position": rows, "normal": rows, "area": np.zeros(0), "albedo": rows, "emission": rows}
        of_parts: dict[str, Any] = {f"part_{name}": none for name, none in values.items()}
        none = np.zeros(0, np.intp)
        return cls(
            origin=np.zeros(3) if origin is None else origin,
            **values,
            **of_parts,
            part_triangle=none,
            part_weights=rows,
            part_number=none,
        )

    def centred(self, part: NDArray[np.intp]) -> Surfels:
        """Return the surfels with the positions of their parts of numbers `part` [count].

        That part is then the first.
        """
        rows = np.arange(len(self))
        moved = {name: getattr(self, name).copy() for name in _OF_PARTS}
        for values in moved.values():
            parts = _by_surfel(values)
            parts[rows, 0], parts[rows, part] = parts[rows, part], parts[rows, 0]
        return replace(self, position=moved["part_position"][::PARTS], **moved)

    def mean_of_parts(self, values: Doubles) -> Doubles:
        """Return means [count, ...] by area of values [PARTS count, ...] of the parts."""
        mean: Doubles = _by_surfel(self.part_area[:, None] * values).sum(axis=1) / self.area[:, None]
        return mean

    def chosen(self, order: NDArray[np.intp]) -> Surfels:
        """Return the surfels of these numbers, in this order."""
        own = {name: getattr(self, name).take(order, axis=0) for name in _OWN}
        of_parts = {}
        for name in _OF_PARTS:
            rows = _by_surfel(getattr(self, name)).take(order, axis=0)
            of_parts[name] = rows.reshape(-1, *rows.shape[2:])
        return Surfels(origin=self.origin, **own, **of_parts)

    def with_more(self, others: Surfels) -> Surfels:
        """Return these and others of the same scene after them."""
        names = (*_OWN, *_OF_PARTS)
        joined = {name: np.concatenate([getattr(self, name), getattr(others, name)]) for name in names}
        return Surfels(origin=self.origin, **joined)

    def numbered(self) -> Surfels:
        """Return the surfels with their parts numbered in their order."""
        return replace(self, part_number=np.arange(len(self.part_area)))

    def renumbered(self, number: NDArray[np.intp]) -> Surfels:
        """Return the surfels with other numbers of their parts, [numbers] by those that they have."""
        return replace(self, part_number=number[self.part_number])

    def following(self, before: Scene, now: Scene) -> Surfels:
        """Return the surfels of `before` where their triangles are in `now`, which has the same ones.

        Areas change with those of their triangles. Surfels on triangles that stand still keep every bit.
        """
        shift = np.asarray(before.origin, np.float64) - now.origin
        corners = before.positions[before.triangles].astype(np.float64) + shift
        stands = (corners == now.positions[now.triangles]).all(axis=(1, 2))[self.part_triangle]
        if stands.all() and not shift.any():
            return self
        own = np.flatnonzero(~stands)
        triangle = self.part_triangle[own]
        was, cross = (np.stack(triangle_cross(scene, triangle), axis=1) for scene in (before, now))
        double, now_double = (np.sqrt(np.einsum("nc,nc->n", c, c)) for c in (was, cross))
        side = np.sign(np.einsum("nc,nc->n", was, self.part_normal[own]))
        normal = side[:, None] * cross / np.maximum(now_double, 1e-300)[:, None]
        position, part_normal, area = self.part_position + shift, self.part_normal.copy(), self.part_area.copy()
        vertices = now.positions[now.triangles[triangle]].astype(np.float64)
        position[own] = np.einsum("nk,nkc->nc", self.part_weights[own], vertices)
        part_normal[own] = np.where(now_double[:, None] > 0.0, normal, part_normal[own])
        area[own] *= np.maximum(now_double / np.maximum(double, 1e-300), LEAST_GROWTH)
        moved = replace(self, origin=np.asarray(now.origin), part_position=position, part_normal=part_normal)
        moved = replace(moved, part_area=area, area=area.reshape(-1, PARTS).sum(axis=1))
        facing = moved.mean_of_parts(part_normal)
        length = np.sqrt(np.einsum("nc,nc->n", facing, facing))
        facing /= np.maximum(length, 1e-300)[:, None]
        mean = {name: moved.mean_of_parts(getattr(self, f"part_{name}")) for name in ("albedo", "emission")}
        of = {"area": moved.area, "normal": facing, **mean}
        turned = ~stands.reshape(-1, PARTS).all(axis=1)
        kept = {
            name: np.where(turned if name == "area" else turned[:, None], value, getattr(self, name))
            for name, value in of.items()
        }
        kept["normal"] = np.where((length > LEAST_FACING)[:, None], kept["normal"], self.normal)
        return replace(moved, position=position[::PARTS], **kept)


def _by_surfel(values: NDArray[Any]) -> NDArray[Any]:
    """Return values of parts [PARTS count, ...] as [count, PARTS, ...], of the same memory."""
    return values.reshape(-1, PARTS, *values.shape[1:])


LEAST_GROWTH = 1e-6
"""What the area of a part shrinks to at most, as a share: surfels have some."""
LEAST_FACING = 1e-3
"""Length of the mean normal of a surfel's parts below which it keeps the direction that it had."""
_OWN = ("position", "normal", "area", "albedo", "emission")
_OF_PARTS = (*(f"part_{name}" for name in _OWN), "part_triangle", "part_weights", "part_number")


EMITTERS = 0.25
"""Part of the surfels that triangles get by the flux that they emit, the others by area: what emits
is small, and the shadows of its light are as soft as it has surfels."""


@dataclass(frozen=True, eq=False)
class TriangleShares:
    """Shares of a scene's surfels by triangle.

    Attributes:
        ends: [n] float64: parts of each triangle and all before it, up to 1; 0 if none has area.
        area, density: [n] float64: its area, and its part over that.
        emits: [n] whether it emits light.
    """

    ends: Doubles
    area: Doubles
    density: Doubles
    emits: NDArray[np.bool_]

    @classmethod
    def of(cls, scene: Scene) -> TriangleShares:
        """Return those of a scene."""
        area = 0.5 * np.sqrt(sum(one * one for one in triangle_cross(scene, slice(None))))
        emission = np.array([float(np.sum(mean_emission(scene, m))) for m in scene.materials], np.float64)
        shine = (emission / max(emission.max(initial=0.0), 1e-300))[scene.material_ids]
        density = np.zeros(len(area))
        parts = (np.ones(len(area)), 1.0 - EMITTERS), (shine, EMITTERS)
        for weight, part in parts if shine.any() else [(np.ones(len(area)), 1.0)]:
            density += part * weight / max(float((weight * area).sum()), 1e-300)
        emits = np.array([m.emits for m in scene.materials], np.bool_)[scene.material_ids]
        return cls(np.cumsum(density * area), area, density, emits)


def scene_surfels(scene: Scene, count: int, shares: TriangleShares | None = None) -> Surfels:
    """Return surfels on both sides of all triangles that have both, of equal area but where surfaces emit.

    Points are drawn in proportion to `TriangleShares`, stratified over the list of triangles and,
    within one, by the R sequence (Roberts 2018). Sorted along a curve, each `PARTS` of them are a
    surfel. Points in holes that a texture's alpha cuts out are left out, with their area.

    Args:
        scene: any.
        count: of surfels of both sides together, about; >= 2.
        shares: of the scene's triangles, where they are known.

    Returns:
        About count surfels and as many as wide ones are cut into, an even number if all triangles have a back; none
        if none has an area.
    """
    shares = shares or TriangleShares.of(scene)
    points, area = _points(scene, PARTS * max(int(count / (1.0 + _backs(scene, shares))), 1), shares)
    if not len(area):
        return Surfels.none(np.asarray(scene.origin))
    low, high = scene.bounds - scene.origin
    kind = facing_axis(points.normal) + 6 * points.emission.any(axis=1) + 12 * scene.culled_backs[points.triangle]
    index, real = _narrow(points.position, area, *_in_order(_along(points.position, low, high, kind), kind))
    first, kinds = _surfels(np.asarray(scene.origin), points, area, index, real), kind[index[:, 0]]
    both = first.chosen(np.flatnonzero(kinds < 12))
    other = replace(both, normal=-both.normal, part_normal=-both.part_normal)
    whole = first.with_more(other)
    # Neighbours come together, whichever side of their triangles they are on.
    return whole.chosen(_along(whole.position, low, high, facing_axis(whole.normal))).numbered()


class LitSurfels(NamedTuple):
    """Surfels, each of points that light reaches or of others.

    Attributes:
        surfels: of both kinds.
        lit: [count] which it reaches.
        unlit_position, unlit_normal, unlit_area: [n, 3], [n, 3] and [n] of all points that it does not reach.
    """

    surfels: Surfels
    lit: NDArray[np.bool_]
    unlit_position: Doubles
    unlit_normal: Doubles
    unlit_area: Doubles


def lit_surfels(
    scene: Scene,
    count: int,
    reached: Callable[[Doubles, Doubles, NDArray[np.intp]], NDArray[np.bool_]],
    shares: TriangleShares,
    *,
    others: bool,
) -> LitSurfels:
    """Return surfels as of `scene_surfels` that light reaches.

    Args:
        scene, count, shares: see `scene_surfels`.
        reached: returns whether light reaches points, of positions, normals and numbers; those that emit count as if
            it did.
        others: whether to return surfels that light does not reach, too.
    """
    triangle, weights, area = _drawn(scene, PARTS * max(int(count / (1.0 + _backs(scene, shares))), 1), shares)
    origin = np.asarray(scene.origin)
    if not len(area):
        none = np.zeros((0, 3))
        return LitSurfels(Surfels.none(origin), np.zeros(0, np.bool_), none, none, np.zeros(0))
    position, normal = places_of(scene, triangle, weights)
    backs = np.flatnonzero(~scene.culled_backs[triangle])
    number = np.concatenate([np.arange(len(area)), backs])
    position, normal = position[number], np.concatenate([normal, -normal[backs]])
    triangle, weights, area = triangle[number], weights[number], area[number]
    lit = shares.emits[triangle] | reached(position, normal, np.arange(len(area)))
    unlit = np.flatnonzero(~lit)
    black = position[unlit] + origin, normal[unlit], area[unlit]
    left = np.arange(len(area)) if others else np.flatnonzero(lit)
    if not len(left):
        return LitSurfels(Surfels.none(origin), np.zeros(0, np.bool_), *black)
    triangle, weights, area, lit = triangle[left], weights[left], area[left], lit[left]
    albedo, emission, _ = coats_of(scene, triangle, weights)
    points = SurfacePoints(position[left], normal[left], albedo, emission, triangle, weights)
    kind = facing_axis(points.normal) + 6 * points.emission.any(axis=1) + 12 * ~lit
    low, high = scene.bounds - scene.origin
    index, real = _narrow(points.position, area, *_in_order(_along(points.position, low, high, kind), kind))
    found = _surfels(origin, points, area, index, real)
    order = _along(found.position, low, high, facing_axis(found.normal))
    return LitSurfels(found.chosen(order).numbered(), kind[index[order, 0]] < 12, *black)


def _backs(scene: Scene, shares: TriangleShares) -> float:
    """Return which part of the area of a scene's triangles has a back, too."""
    return float(shares.area[~scene.culled_backs].sum()) / max(float(shares.area.sum()), 1e-300)


def surfels_of(scene: Scene, points: SurfacePoints, areas: Doubles) -> Surfels:
    """Return surfels of points of areas [n] > 0 on their sides: of `PARTS` neighbours that face alike, each, however
    far apart."""
    if not len(areas):
        return Surfels.none(np.asarray(scene.origin))
    kind = facing_axis(points.normal)
    low, high = scene.bounds - scene.origin
    index, real = _in_order(_along(points.position, low, high, kind), kind)
    return _surfels(np.asarray(scene.origin), points, areas, index, real).numbered()


def _along(positions: Doubles, low: Doubles, high: Doubles, kind: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the order of points by kind and along a curve."""
    return np.argsort(kind * np.int64(1 << 3 * CURVE_BITS) + curve_numbers(positions, low, high), kind="stable")


def _points(scene: Scene, count: int, shares: TriangleShares) -> tuple[SurfacePoints, Doubles]:
    """Return points on the triangles that lie in no hole, and the area of each."""
    triangle, weights, area = _drawn(scene, count, shares)
    points, solid = surface_points(scene, triangle, weights)
    return (points, area) if solid.all() else (points.chosen(np.flatnonzero(solid)), area[solid])


def _drawn(scene: Scene, count: int, shares: TriangleShares) -> tuple[NDArray[np.intp], Doubles, Doubles]:
    """Return of points their triangles, the weights of the vertices in their positions, and areas."""
    ends = shares.ends
    total = float(ends[-1])
    if not total > 0.0:
        return np.zeros(0, np.intp), np.zeros((0, 3)), np.zeros(0)
    wanted = (np.arange(count) + 0.5) * (total / count)
    triangle = np.minimum(np.searchsorted(ends, wanted, "right"), len(ends) - 1)
    u, v = r_points(0, count, 2).T
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    area = total / count / shares.density[triangle]
    for kind in (False, True):  # triangles get whole points: what that loses or adds, all share
        own = shares.emits[triangle] == kind
        area[own] *= shares.area[shares.emits == kind].sum() / max(float(area[own].sum()), 1e-300)
    return triangle, np.stack([1.0 - u - v, u, v], axis=1), area


def facing_axis(normal: Doubles) -> NDArray[np.int64]:
    """Return [n] 0 to 5: the axis nearest to a direction, and its sign."""
    axis = np.abs(normal).argmax(axis=1)
    down = np.take_along_axis(normal, axis[:, None], 1)[:, 0] < 0.0
    number: NDArray[np.int64] = 2 * axis + down
    return number


def _narrow(
    positions: Doubles, areas: Doubles, index: NDArray[np.intp], real: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return surfels [n, PARTS] of points, and which of these count, with those wider than `WIDEST` cut in two.

    They are cut where the gap between their points is largest along the longest side of their box.
    """
    done: list[tuple[NDArray[np.intp], NDArray[np.bool_], NDArray[np.intp]]] = []
    number = np.arange(len(index))
    while len(index):
        position = positions.take(index.T, axis=0)
        low, high = position.min(axis=0), position.max(axis=0)  # what does not count is where what does is
        squared = np.sum((high - low) ** 2, axis=1)
        wide = squared > WIDEST**2 * np.sum(areas[index] * real, axis=1)
        done.append((index[~wide], real[~wide], number[~wide]))
        axis = np.argmax(high - low, axis=1)[wide]
        index, real, number = index[wide], real[wide], np.repeat(number[wide], 2)
        along = positions[index, axis[:, None]]
        order = np.argsort(np.where(real, along, np.inf), axis=1, kind="stable")
        index, real = np.take_along_axis(index, order, 1), np.take_along_axis(real, order, 1)
        along = np.take_along_axis(along, order, 1)
        gaps = np.where(real[:, 1:], np.diff(along, axis=1), -1.0)
        first = np.arange(PARTS) <= np.argmax(gaps, axis=1)[:, None]
        index, real = np.repeat(index, 2, axis=0), np.repeat(real, 2, axis=0)
        real[0::2] &= first
        real[1::2] &= ~first
        index = np.where(real, index, np.take_along_axis(index, np.argmax(real, axis=1)[:, None], 1))
    order = np.argsort(np.concatenate([own for _, _, own in done]), kind="stable")
    return np.concatenate([own for own, _, _ in done])[order], np.concatenate([own for _, own, _ in done])[order]


def _in_order(order: NDArray[np.intp], kind: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return surfels [n, PARTS] of consecutive points of an order by kind, and which of these count: none is of two
    kinds."""
    counts = np.bincount(kind, minlength=1)
    firsts = np.cumsum(counts) - counts
    index, real = [], []
    for first, own in zip(firsts, counts, strict=True):
        rounded = -(-own // PARTS) * PARTS
        number = np.arange(rounded)
        index.append(order[first + np.minimum(number, max(own - 1, 0))])
        real.append(number < own)
    return np.concatenate(index).reshape(-1, PARTS), np.concatenate(real).reshape(-1, PARTS)


def _surfels(
    origin: Doubles, points: SurfacePoints, areas: Doubles, index: NDArray[np.intp], real: NDArray[np.bool_]
) -> Surfels:
    """Return surfels of points [n, PARTS], of which those that are `real` count."""
    area = areas[index] * real
    whole = area.sum(axis=1)

    def mean(values: Doubles) -> Doubles:
        result: Doubles = np.einsum("np,npc->nc", area, values) / whole[:, None]
        return result

    position = points.position.take(index, axis=0)
    away = position - mean(position)[:, None]
    away = np.einsum("npc,npc->np", away, away)
    # A padding part is as near as the last real one, and comes behind it.
    nearest = np.argsort(away, axis=1, kind="stable")
    index, area = np.take_along_axis(index, nearest, 1), np.take_along_axis(area, nearest, 1)
    position, normal, albedo, emission, triangle, weights = points.chosen(index)
    facing = mean(normal)
    length = np.sqrt(np.einsum("nc,nc->n", facing, facing))
    # Normals of one axis lie within 55 degrees of it, so that their mean does not vanish.
    facing /= length[:, None]
    none = np.zeros_like(triangle)  # parts are numbered when all are there
    values = (position, normal, area, albedo, emission, triangle, weights, none)
    of_parts: dict[str, Any] = {
        name: array.reshape(-1, *array.shape[2:]) for name, array in zip(_OF_PARTS, values, strict=True)
    }
    return Surfels(
        origin=origin,
        position=position[:, 0],
        normal=facing,
        area=whole,
        albedo=mean(albedo),
        emission=mean(emission),
        **of_parts,
    )
