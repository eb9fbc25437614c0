"""Gaps: what leaves spaces too narrow for surfels that emissive surfaces shine into, as lights at their openings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.core.scene import Scene, mean_emission
from ssgi_cl.core.vpls import LUMINANCE, PARTS, Vpls
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import LIFT
from ssgi_cl.techniques.radiosity.surfel_rays import RAYS, REACH, ROW, Sources, SurfelPoints
from ssgi_cl.techniques.radiosity.surfels import Surfels, curve_numbers

Doubles = NDArray[np.float64]

EMITTERS = 128
"""Most surfels that stand for the emissive sides in gaps."""
AROUND = 2.0
"""Widths of a gap within which surfels count as near."""
LIGHTS = 32
"""Most lights at openings."""
STEPS = 0.125 * 1.5 ** np.arange(10)
"""Widths of a gap along a ray where it is looked whether it has left."""
APART = 4.0
SLICE = 20.0
BOUNCES = 64


@dataclass(frozen=True, eq=False)
class Openings:
    """Light that leaves gaps.

    Attributes:
        lights: at their openings, what surfaces in them reflect.
        within: [parts] whether a part of the surfels that were given lies in one that is lit.
        sources: what shines on surfels: the parts of lights, and emissive surfaces without room in front of them.
    """

    lights: Vpls
    within: NDArray[np.bool_]
    sources: Sources


def openings(runtime: Runtime, scene: Scene, surfels: Surfels, narrow: Surfels, width: float, is_lit: Callable[[Doubles], NDArray[np.bool_]]) -> Openings | None:
    """Return what leaves gaps; None if no emissive surface is in one. Waits for the device.

    Args:
        runtime: the device.
        scene: without holes.
        surfels: that have air before them.
        narrow: those that have none.
        width: of the widest gap, scene units: what has a surface as near before it lies in one.
    """
    from scipy.spatial import cKDTree  # takes a tenth of a second, which other commands do without

    emits = np.flatnonzero(narrow.emission.any(axis=1))
    if not len(emits):
        return None
    every = -(-len(emits) // EMITTERS)
    sources = narrow.chosen(emits[every // 2 :: every])
    tree = cKDTree(sources.part_position)
    dark = narrow.chosen(np.flatnonzero(~narrow.emission.any(axis=1)))

    def near(some: Surfels) -> NDArray[np.intp]:
        far = AROUND * width + np.sqrt(some.area.max(initial=0.0))
        return np.flatnonzero(np.isfinite(tree.query(some.position, distance_upper_bound=far)[0]))

    own = near(surfels)
    local = joined(sources, dark.chosen(near(dark)), surfels.chosen(own))
    count = len(local.part_area)
    area = local.part_area.copy()
    area[: PARTS * len(sources)] *= narrow.area[emits].sum() / sources.area.sum()
    points = SurfelPoints(runtime, scene, local.numbered())
    blocked = _blocked(points, local.part_position, local.part_normal, width)
    covered = blocked.copy()
    covered[: count - PARTS * len(own)] = True
    # What rays from parts in gaps meet.
    ways, reach = hemisphere_ways(RAYS), REACH * float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    triangle, where = _met(points, ways, reach)
    inside = np.flatnonzero(covered)
    triangle, where = triangle[:, inside].T, where[:, inside].T * reach
    way = _turned(ways[:, :, points.numbers[inside] % (TILE * TILE)], local.part_normal[inside])
    lift = LIFT * reach / REACH
    start = local.part_position[inside] + lift * local.part_normal[inside]
    met = triangle >= 0
    glow = np.array([mean_emission(scene, material) for material in scene.materials]).reshape(-1, 3)
    shines = np.where(met[..., None], glow[scene.material_ids[triangle]], 0.0)
    # Ends of rays have the light of the nearest part that faces as they do.
    end = start[:, None] + way * where[..., None]
    corners = scene.positions[scene.triangles[triangle]].astype(np.float64)
    facing = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    facing /= np.maximum(np.linalg.norm(facing, axis=-1, keepdims=True), 1e-300)
    facing *= -np.sign(np.einsum("nrc,nrc->nr", facing, way))[..., None]
    stays = np.zeros(met.shape, np.bool_)
    stays[met] = _blocked(points, end[met], facing[met], width)
    # Others leave where first nothing is as near to both sides.
    part, ray = np.nonzero(met & ~stays)
    along = np.minimum(STEPS * width, 0.99 * where[part, ray][:, None])
    places = start[part][:, None] + along[..., None] * way[part, ray][:, None]
    sides = np.broadcast_to(local.part_normal[inside][part][:, None], places.shape).reshape(-1, 3)
    between = _blocked(points, places.reshape(-1, 3), sides, width)
    between[between] = _blocked(points, places.reshape(-1, 3)[between], -sides[between], width)
    outside = ~between.reshape(along.shape)
    # Nothing is as near to some parts, as on the inner sides of boxes: what they send leaves through air.
    free = np.flatnonzero(~blocked[inside][part])
    reached = places[free] * 1.0
    outside[free] = is_lit(reached.reshape(-1, 3) + local.origin).reshape(len(free), -1)
    goes = outside.any(axis=1)
    part, ray = part[goes], ray[goes]
    exits = places[goes, outside[goes].argmax(axis=1)]
    leaves = np.zeros(met.shape, np.bool_)
    leaves[part, ray] = True
    known = cKDTree(_sides(local.part_position[inside], local.part_normal[inside], width))
    off, nearest = known.query(_sides(end[stays], facing[stays], width), distance_upper_bound=width * APART)
    stays[stays] = np.isfinite(off)
    other = np.zeros(met.shape, np.intp)
    other[stays] = nearest[np.isfinite(off)]
    emitted = math.pi * shines.mean(axis=1)
    albedo = local.part_albedo[inside]
    received = emitted
    for _ in range(BOUNCES):
        sent = albedo * received
        now = emitted + np.where(stays[..., None], sent[other], 0.0).mean(axis=1)
        change = np.abs(now - received).sum()
        received = now
        if change < 1e-3 * received.sum():
            break
    sent = albedo * received
    of_sources = PARTS * len(sources)
    shown = np.zeros(count)
    shown[inside] = leaves.mean(axis=1)
    out = np.flatnonzero(shown[:of_sources])
    lit = np.zeros(count, np.bool_)
    lit[inside] = received.any(axis=1)
    within = np.zeros(len(surfels.part_area), np.bool_)
    within[(own[:, None] * PARTS + np.arange(PARTS)).ravel()] = lit[count - PARTS * len(own) :]
    if not len(part):
        return Openings(_lights(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), 1.0), within, _sources(local, area, out, shown, None))
    flux = (area[inside, None] * sent / RAYS)[part]
    exitance = float((area[inside] @ (sent @ LUMINANCE)) / area[inside][sent.any(axis=1)].sum())
    # Openings of gaps are across the surfaces at their sides.
    normal = local.part_normal[inside][part]
    across = way[part, ray] - np.einsum("nc,nc->n", way[part, ray], normal)[:, None] * normal
    free = ~blocked[inside][part]
    across[free], exits[free] = normal[free], start[part[free]]
    lights = _lights(exits + local.origin, across, flux, exitance)
    return Openings(lights, within, _sources(local, area, out, shown, lights.parts))


def _sources(local: Surfels, area: Doubles, out: NDArray[np.intp], shown: Doubles, lights: Vpls | None) -> Sources:
    position, normal = local.part_position[out] + local.origin, local.part_normal[out]
    exitance, own = math.pi * local.part_emission[out], area[out]
    if lights is None:
        return Sources(position, normal, own, exitance, shown[out], np.ones(len(out), np.bool_))
    return Sources(
        np.concatenate([position, lights.position]),
        np.concatenate([normal, lights.normal]),
        np.concatenate([own, lights.area]),
        np.concatenate([exitance, lights.flux / lights.area[:, None]]),
        np.concatenate([shown[out], np.ones(len(lights))]),
        np.arange(len(out) + len(lights)) < len(out),
    )


def _sides(position: Doubles, normal: Doubles, width: float) -> Doubles:
    """Return [n, 7] coordinates in which points near each other are on the same side of the same surface."""
    along = np.einsum("nc,nc->n", position, normal)
    return np.concatenate([position, APART * width * normal, SLICE * along[:, None]], axis=1)


def _lights(position: Doubles, way: Doubles, flux: Doubles, exitance: float) -> Vpls:
    """Return lights for rays that leave: the mean of neighbours', whose area sends their flux with an exitance."""
    low, high = (position.min(axis=0), position.max(axis=0)) if len(position) else (np.zeros(3), np.ones(3))
    order = np.argsort(curve_numbers(position, low, high), kind="stable") if len(position) else np.zeros(0, np.intp)
    position, way, flux = position[order], way[order], flux[order]
    count = min(LIGHTS, -(-len(order) // PARTS))
    bright = flux @ LUMINANCE
    ends = np.cumsum(bright)
    number = np.minimum(((ends - 0.5 * bright) / ends[-1] * count * PARTS).astype(np.intp), count * PARTS - 1) if count else order

    def mean(group: NDArray[np.intp], groups: int) -> Vpls:
        def total(values: Doubles) -> Doubles:
            return np.stack([np.bincount(group, v, groups) for v in values.T], axis=1)

        weight = np.maximum(np.bincount(group, bright, groups), 1e-300)[:, None]
        normal = total(way * bright[:, None])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        sent = total(flux)
        area = np.maximum(sent @ LUMINANCE / max(exitance, 1e-300), 1e-12)
        return Vpls(total(position * bright[:, None]) / weight, normal, sent, area)

    parts, lights = mean(number, count * PARTS), mean(number // PARTS, count)
    parts = replace(parts, normal=np.repeat(lights.normal, PARTS, axis=0))
    return replace(lights, parts=parts)


def joined(*some: Surfels) -> Surfels:
    """Return surfels one after the other."""
    names = [name for name in some[0].__dataclass_fields__ if name != "origin"]
    return Surfels(origin=some[0].origin, **{n: np.concatenate([getattr(one, n) for one in some]) for n in names})


def _met(points: SurfelPoints, ways: NDArray[np.float32], reach: float) -> tuple[NDArray[np.int32], Doubles]:
    """Return triangles [rays, parts] that rays meet first, -1 for none, and the part of the way there."""
    runtime, scene, stride = points.runtime, points.scene, len(points)
    bvh = scene_bvh(scene, runtime)
    met, where = runtime.empty(len(ways) * stride, np.int32), runtime.empty(len(ways) * stride, np.float32)
    runtime.kernel("radiosity/radiosity_met.cl").run(
        (1, stride),
        points=points.array,
        ways=runtime.array(ways),
        nodes=bvh.nodes,
        triangles=bvh.triangles,
        met=met,
        where=where,
        rays=len(ways),
        lift=LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0))),
        reach=reach,
    )
    found, at = (one.download().reshape(-1, stride)[:, : points.count] for one in (met, where))
    return found, at.astype(np.float64)


def _blocked(points: SurfelPoints, position: Doubles, normal: Doubles, reach: float) -> NDArray[np.bool_]:
    """Return whether a triangle is in front of places [n, 3], relative to the origin of surfels, within a reach."""
    runtime, scene, count = points.runtime, points.scene, len(position)
    stride = max(-(-count // ROW) * ROW, ROW)
    rows = np.zeros((9, stride), np.float32)
    rows[5] = 1.0
    rows[:3, :count], rows[3:6, :count] = (position + points.surfels.origin - scene.origin).T, normal.T
    bvh, far = scene_bvh(scene, runtime), runtime.empty(stride, np.float32)
    runtime.kernel("radiosity/radiosity_room.cl").run(
        (1, stride),
        points=runtime.array(rows),
        ways=runtime.array(_ahead()),
        nodes=bvh.nodes,
        triangles=bvh.triangles,
        far=far,
        rays=1,
        lift=LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0))),
        reach=reach,
    )
    return far.download()[:count] == 0.0


def _ahead() -> NDArray[np.float32]:
    ways = np.zeros((1, 3, TILE * TILE), np.float32)
    ways[0, 2] = 1.0
    return ways


def _turned(ways: NDArray[np.float32], normal: Doubles) -> Doubles:
    """Return [n, rays, 3] directions [rays, 3, n] about normals [n, 3], as kernels/rays/hemisphere.clh has them."""
    nx, ny, nz = normal.T
    sign = np.where(nz > -0.5, 1.0, -1.0)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    u = np.stack([sign * nx * nx * a + 1.0, sign * b, -sign * nx], axis=1)
    v = np.stack([b, ny * ny * a + sign, -ny], axis=1)
    p, q, r = (ways[:, i].T[..., None].astype(np.float64) for i in range(3))
    turned: Doubles = p * u[:, None] + q * v[:, None] + r * normal[:, None]
    return turned
