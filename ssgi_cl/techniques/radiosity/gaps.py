"""Gaps: what leaves spaces too narrow for surfels that emissive surfaces shine into, as lights at their openings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hilbert_curve import curve_numbers
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.srgb import mean_color
from ssgi_cl.core.vpls import LUMINANCE, PARTS, Vpls
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity.light_volume import CELLS, cells_at
from ssgi_cl.techniques.radiosity.surfel_points import Sources
from ssgi_cl.techniques.radiosity.surfels import Surfels, facing_axis
from ssgi_cl.techniques.radiosity.triangle_rays import TriangleRays, scattered

Doubles = NDArray[np.float64]
Flags = NDArray[np.bool_]

PATHS = 4096
"""From emissive surfaces without room in front of them."""
BOUNCES = 40
"""Of a path, at most."""
FEW = 0.02
"""Of the paths: with fewer left they end."""
MOST_SOURCES = 512
"""Places that stand for such surfaces."""
LIGHTS = 16
"""Lights at openings, at most."""
TRIES = 64
"""Rays by which it is known which share of a light goes far."""
SPREAD = 4
"""Parts of a light from which these come."""
LEAST_FAR = 0.05
"""That share, at least."""
STEPS = 0.125 * 1.6 ** np.arange(12)
"""Widths of a gap along a ray at which it is looked whether it has left."""
NEAR = 4.0
"""Widths of a gap from where light leaves it within which paths tell where it arrives, beyond which lights do."""
LEAST_AREA = 0.01
"""Of a part to which paths bring light, in sides of a cell squared: smaller ones stand for no surface."""
SEED = 11


@dataclass(frozen=True, eq=False)
class Openings:
    """Light that leaves gaps.

    Attributes:
        lights: at their openings: what surfaces in gaps reflect.
        within: [parts] which parts of surfels lie in a gap that is lit.
        sources: what shines on surfels: the parts of `lights`, and emissive surfaces without room in front of them.
    """

    lights: Vpls
    within: Flags
    sources: Sources


def openings(
    runtime: Runtime, scene: Scene, surfels: Surfels, narrow: Surfels, width: float, is_lit: Callable[[Doubles], Flags]
) -> Openings | None:
    """Return what leaves gaps; None if no emissive surface is without room in front of it. Waits for the device.

    A cavity's opening is about as bright from all sides: paths of light are followed from emissive surfaces until they
    leave, and lights where they do face out of the gap. A surface is in a gap where another is in front of it within
    `width`.

    Args:
        runtime: the device.
        scene: without holes.
        surfels: with room in front of them.
        narrow: emissive ones without.
        width: of gaps at most, scene units.
        is_lit: returns whether places [n, 3] of world space are in air that light enters.
    """
    emitting = np.flatnonzero(narrow.part_emission.any(axis=1) & (narrow.part_area > 0.0))
    if not len(emitting):
        return None
    chosen = emitting[((np.arange(PATHS) + 0.5) * (len(emitting) / PATHS)).astype(np.intp)]
    area = narrow.part_area[chosen] * (narrow.part_area[emitting].sum() / narrow.part_area[chosen].sum())
    world = TriangleRays(runtime, scene)
    shift = narrow.origin - scene.origin
    position, normal = narrow.part_position[chosen] + shift, narrow.part_normal[chosen]
    emission = narrow.part_emission[chosen]
    random = np.random.default_rng(SEED)
    flux, albedo = math.pi * area[:, None] * emission, _albedo(scene)
    gone: list[_Gone] = []
    lit: list[Doubles] = []
    for number in range(BOUNCES):
        way = scattered(normal, random.random((2, len(normal))).T)
        triangle, end, facing = world.met(world.start(position, normal, way), way)
        met = triangle >= 0
        stays = met.copy()
        stays[met] = world.blocked(end[met], facing[met], width)
        out = np.flatnonzero(met & ~stays)
        gone.append(
            _Gone(np.where(number, -1, out), position[out], normal[out], way[out], end[out], facing[out], flux[out])
        )
        lit.append(end[stays])
        # A path goes on with the probability of its brightest channel.
        share = albedo[triangle]
        lasts = share.max(axis=1)
        on = np.flatnonzero(stays & (random.random(len(lasts)) < lasts))
        if len(on) < FEW * len(chosen):
            break
        position, normal = end[on], facing[on]
        flux = flux[on] * (share[on] / lasts[on, None])
    left = _left(world, _Gone(*map(np.concatenate, zip(*gone, strict=True))), width, is_lit)
    shown = np.zeros(len(chosen))
    shown[left.first[left.first >= 0]] = 1.0
    reflected = left.chosen(left.first < 0)
    far = np.linalg.norm(reflected.end - reflected.position, axis=1) > NEAR * width
    lights = _lights(world, reflected.chosen(far), width, random)
    place = surfels.part_position + (surfels.origin - scene.origin)
    cells = _cells(scene, place)
    within = _within(world, place, surfels.part_normal, cells, np.concatenate(lit), width)
    received = _received(scene, surfels, cells, within, reflected.chosen(~far))
    # The share of light that leaves is that of neighbours together.
    share = np.add.reduceat(shown, np.arange(0, len(shown), PARTS)) / PARTS
    shown = np.repeat(share, PARTS)[: len(shown)]
    out = np.flatnonzero(shown)
    few = min(MOST_SOURCES, len(out))
    own = out[((np.arange(few) + 0.5) * (len(out) / max(few, 1))).astype(np.intp)]
    scale = area[out].sum() / max(area[own].sum(), 1e-300)
    return Openings(
        lights,
        within,
        Sources.joined(
            narrow.part_position[chosen[own]] + narrow.origin,
            narrow.part_normal[chosen[own]],
            area[own] * scale,
            math.pi * emission[own],
            shown[own],
            lights,
            NEAR * width,
            received,
        ),
    )


def _albedo(scene: Scene) -> Doubles:
    """Return [triangles, 3] what share of light triangles reflect."""
    materials = scene.materials
    albedo = np.array([m.albedo for m in materials])
    for number, material in enumerate(materials):
        if material.texture >= 0:
            albedo[number] *= mean_color(scene.textures[material.texture])
    own = albedo[scene.material_ids] * scene.colors[scene.triangles].mean(axis=1)
    found: Doubles = np.clip(own + np.array([m.spread for m in materials])[scene.material_ids], 0.0, 1.0)
    return found


def _cells(scene: Scene, position: Doubles) -> NDArray[np.intp]:
    """Return numbers of cells of the cube round a scene, of places relative to its origin."""
    return cells_at((position - (scene.bounds[0] - scene.origin)) / _side(scene))


def _side(scene: Scene) -> float:
    """Return the side of a cell, scene units."""
    return max(float(np.ptp(scene.bounds, axis=0).max()) / CELLS, 1e-300)


def _within(
    world: TriangleRays, position: Doubles, normal: Doubles, cells: NDArray[np.intp], lit: Doubles, width: float
) -> Flags:
    """Return which places on surfaces lie in a gap, of those in cells where paths met surfaces in one."""
    there = np.zeros(CELLS**3, np.bool_)
    there[_cells(world.scene, lit)] = True
    found = there[cells]
    found[found] = world.blocked(position[found], normal[found], width)
    return found


def _received(scene: Scene, surfels: Surfels, cells: NDArray[np.intp], within: Flags, near: _Gone) -> Doubles:
    """Return irradiance [parts, 3] by flux that arrives at surfaces: the same for all parts of a cell that face alike.

    What arrives where no part is goes to all.
    """
    received = np.zeros((len(surfels.part_area), 3))
    if not len(near.flux):
        return received
    to = _cells(scene, near.end) * 6 + facing_axis(near.facing)
    keys, to = np.unique(to, return_inverse=True)
    there = np.zeros(CELLS**3, np.bool_)
    there[keys // 6] = True
    parts = np.flatnonzero(there[cells] & ~within & (surfels.part_area > LEAST_AREA * _side(scene) ** 2))
    own = cells[parts] * 6 + facing_axis(surfels.part_normal[parts])
    slot = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
    parts, slot = parts[keys[slot] == own], slot[keys[slot] == own]
    area = np.bincount(slot, surfels.part_area[parts], len(keys))
    sums = np.stack([np.bincount(to, one, len(keys)) for one in near.flux.T], axis=1)
    found = sums[area > 0.0].sum(axis=0)
    raised = np.where(found > 0.0, sums.sum(axis=0) / np.maximum(found, 1e-300), 1.0)
    received[parts] = (sums / np.where(area > 0.0, area, np.inf)[:, None] * raised)[slot]
    return received


class _Gone(NamedTuple):
    """Paths at the end of which no gap is.

    Attributes:
        first: [n] from which emissive place they come straight, -1 for others.
        position, normal: [n, 3] of the surface that they come from last.
        way: [n, 3] that they go then.
        end, facing: [n, 3] where that ends, and the normal there.
        flux: [n, 3] W.
    """

    first: NDArray[np.intp]
    position: Doubles
    normal: Doubles
    way: Doubles
    end: Doubles
    facing: Doubles
    flux: Doubles

    def chosen(self, which: Flags | NDArray[np.intp]) -> _Gone:
        """Return some."""
        chosen: Any = (values[which] for values in self)
        return _Gone(*chosen)


def _lights(world: TriangleRays, paths: _Gone, width: float, random: np.random.Generator) -> Vpls:
    """Return lights at openings, of which as much goes far as along paths: each stands for neighbours."""
    bright = paths.flux @ LUMINANCE
    if not bright.any():
        none = np.zeros((0, 3))
        return Vpls(none, none, none, np.zeros(0), Vpls(none, none, none, np.zeros(0)))
    across = paths.way - np.einsum("nc,nc->n", paths.way, paths.normal)[:, None] * paths.normal
    low, high = paths.position.min(axis=0), paths.position.max(axis=0)
    order = np.argsort(curve_numbers(paths.position, low, high), kind="stable")
    count = max(min(LIGHTS, len(order) // PARTS), 1)
    ends = np.arange(count * PARTS + 1) * len(order) // (count * PARTS)
    number = np.repeat(np.arange(count * PARTS), np.diff(ends))
    # Each light and part lies where the path in the middle of its own does.
    places = paths.position[order[(ends[:-1] + ends[1:]) // 2]]
    at = places[PARTS // 2 :: PARTS]

    def sums(values: Doubles, groups: NDArray[np.intp]) -> Doubles:
        total: Doubles = np.stack([np.bincount(groups, one, groups[-1] + 1) for one in values[order].T], axis=1)
        return total

    flux, parts = sums(paths.flux, number // PARTS), sums(paths.flux, number)
    parts = np.concatenate([parts, np.zeros((count * PARTS - len(parts), 3))])
    normal = sums(across * bright[:, None], number // PARTS)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    many = np.repeat(normal, TRIES, axis=0)
    start = np.repeat(places[:: PARTS // SPREAD], TRIES // SPREAD, axis=0)
    _, end, _ = world.met(start, scattered(many, random.random((2, len(many))).T))
    share = np.maximum((np.linalg.norm(end - start, axis=1) > NEAR * width).reshape(-1, TRIES).mean(axis=1), LEAST_FAR)
    area = np.full(count, (2.0 * NEAR * width) ** 2)
    origin, each = world.scene.origin, np.repeat(share, PARTS)[:, None]
    few = Vpls(places + origin, np.repeat(normal, PARTS, axis=0), parts / each, np.repeat(area / PARTS, PARTS))
    return Vpls(at + origin, normal, flux / share[:, None], area, few)


def _left(world: TriangleRays, paths: _Gone, width: float, is_lit: Callable[[Doubles], Flags]) -> _Gone:
    """Return the paths that came out of a gap, their positions where they did.

    That is where nothing is as near to both sides. Where nothing was in front of a surface itself, it is in air.
    """
    start = world.start(paths.position, paths.normal, paths.way)
    length = np.linalg.norm(paths.end - start, axis=1)
    along = np.minimum(STEPS * width, 0.99 * length[:, None])
    places = start[:, None] + along[..., None] * paths.way[:, None]
    outside = np.zeros(along.shape, np.bool_)
    gap = world.blocked(paths.position, paths.normal, width)
    outside[~gap] = is_lit(places[~gap].reshape(-1, 3) + world.scene.origin).reshape(-1, len(STEPS))
    flat, sides = places[gap].reshape(-1, 3), np.repeat(paths.normal[gap], len(STEPS), axis=0)
    held = world.blocked(np.concatenate([flat, flat]), np.concatenate([sides, -sides]), width, 0.0)
    outside[gap] = ~held.reshape(2, -1, len(STEPS)).all(axis=0)
    leaves: Flags = np.any(outside, axis=1)
    exits = places[np.arange(len(outside)), outside.argmax(axis=1)]
    return paths._replace(position=exits).chosen(leaves)
