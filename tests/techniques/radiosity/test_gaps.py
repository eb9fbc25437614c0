"""Light that leaves gaps, against paths of light in float64 in a gap whose shape is known."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.radiosity import radiosity as radiosity_module
from ssgi_cl.techniques.radiosity.gaps import LEAST_AREA, NEAR, Openings, openings
from ssgi_cl.techniques.radiosity.light_volume import CELLS
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.radiosity.surfel_points import Sources

from .test_radiosity import box, meshed

Doubles = NDArray[np.float64]
WIDE, DEEP, GAP = 0.5, 0.8, 0.02
"""Sides of a plate under the ceiling of a room of 2 x 2 x 2, and how far below."""
WALLS, GLOW = 0.6, Material(albedo=(0.5,) * 3, emission=(2.0, 1.0, 0.5))


def room(*, gap: float = GAP, thick: float = 0.0) -> Scene:
    """A room round the origin with a plate, or a box with `thick` sides, below its ceiling."""
    walls, top = box(WALLS), 1.0 - gap
    corners, triangles = walls.positions.astype(np.float64).tolist(), walls.triangles.tolist()
    count = len(triangles)
    x, z = 0.5 * WIDE, 0.5 * DEEP
    for height in (top, top - thick) if thick else (top,):
        first = len(corners)
        corners += [(-x, height, -z), (x, height, -z), (x, height, z), (-x, height, z)]
        triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    if thick:
        for i in range(4):
            a, b = first - 4 + i, first - 4 + (i + 1) % 4
            triangles += [(a, b, b + 4), (a, b + 4, a + 4)]
    ids = [0] * count + [1] * (len(triangles) - count)
    return meshed(corners, triangles, (Material(albedo=(WALLS,) * 3), GLOW), ids)


def found(
    runtime: Runtime, scene: Scene, monkeypatch: pytest.MonkeyPatch, lights: Sequence[Light] = ()
) -> tuple[Radiosity, Openings | None]:
    """Return the radiosity of a scene, and what it knows of gaps."""
    results: list[Openings | None] = []

    def kept(*args: object) -> Openings | None:
        results.append(openings(*args))  # type: ignore[arg-type]
        return results[-1]

    monkeypatch.setattr(radiosity_module, "openings", kept)
    radiosity = Radiosity(runtime, RadiosityParams(emission=False))
    radiosity.run(scene, lights)
    return radiosity, results[-1] if results else None  # none is looked for where no light comes


def left(rng: np.random.Generator) -> tuple[float, float]:
    """Return the shares of what the plate's upper side emits that leave the gap after reflections, from below and from
    above."""
    count = 1 << 19
    x, z = rng.uniform(0.0, WIDE, count), rng.uniform(0.0, DEEP, count)
    weight, up, down = np.ones(count), 0.0, 0.0
    for number in range(60):
        ring, turn = np.sqrt(rng.random(len(x))), rng.uniform(0.0, 2.0 * math.pi, len(x))
        across = GAP * ring / np.sqrt(np.maximum(1.0 - ring * ring, 1e-12))
        x, z = x + across * np.cos(turn), z + across * np.sin(turn)
        inside = (x > 0.0) & (x < WIDE) & (z > 0.0) & (z < DEEP)
        gone = float(weight[~inside].sum()) / count
        if number % 2:
            down += gone
        elif number:
            up += gone
        x, z = x[inside], z[inside]
        weight = weight[inside] * (0.5 if number % 2 else WALLS)
    return up, down


def test_what_leaves_a_gap_is_that_of_paths(
    runtime: Runtime, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    radiosity, gaps = found(runtime, room(), monkeypatch)
    assert gaps is not None
    emitted = math.pi * 2.0 * WIDE * DEEP
    up, down = left(rng)
    surfels = radiosity.surfels
    near = float((gaps.sources.received[:, 0] * surfels.part_area).sum()) / emitted
    # Half of what the lights send goes to the ceiling within a hand's breadth, where paths tell what arrives.
    far = 0.5 * float(gaps.lights.flux[:, 0].sum()) / emitted
    # Some 250 paths leave, 75 of which go up: two and a half standard deviations. A tenth of these go farther.
    assert near + far == pytest.approx(up + down, rel=0.16)
    assert near == pytest.approx(0.9 * up, rel=0.29)
    # Emissive surfaces in the gap are drawn by what of their light leaves it straight.
    own = gaps.sources.emits
    drawn = (gaps.sources.exitance[:, 0] * gaps.sources.area * gaps.sources.shown)[own].sum() / emitted
    assert drawn == pytest.approx(_straight(rng), rel=0.25)
    # The lights are at the edges of the plate, and face outwards.
    place, normal = gaps.lights.position, gaps.lights.normal
    off = np.abs(place[:, [0, 2]]) - 0.5 * np.array((WIDE, DEEP))
    apart = np.abs(off.max(axis=1))
    assert np.median(apart) < 0.02
    assert apart.max() < 0.12  # looked at in steps of six tenths of a path's length
    assert (np.abs(normal[:, 1]) < 1e-6).all()
    assert (np.einsum("nc,nc->n", place[:, [0, 2]], normal[:, [0, 2]]) > 0.0).all()
    assert (place[:, 1] > 1.0 - GAP - 0.01).all()
    assert gaps.within.any()
    assert (surfels.part_albedo[gaps.within] == 0.0).all()


def test_irradiance_of_a_room_is_what_its_light_and_walls_give(
    runtime: Runtime, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a plate that emits to both sides all light that leaves arrives, from its lower side and the gap."""
    radiosity, gaps = found(runtime, room(), monkeypatch)
    assert gaps is not None
    rays = radiosity._rays
    assert rays is not None
    own = ~gaps.within & (np.abs(radiosity.surfels.part_position).max(axis=1) > 0.999)  # walls, from inside
    area = radiosity.surfels.part_area
    inside = np.einsum("nc,nc->n", radiosity.surfels.part_position, radiosity.surfels.part_normal) < 0.0
    arrives = float((rays.emitted[:, 0] * area)[own & inside].sum())
    emitted = math.pi * 2.0 * WIDE * DEEP
    straight = _straight(rng)
    # The lower side's alone would be less by what the gap adds.
    expected = emitted * (1.0 + straight + sum(left(rng)))
    assert arrives == pytest.approx(expected, rel=0.03)
    assert arrives > 1.05 * emitted


def _straight(rng: np.random.Generator) -> float:
    """Return the share of what the plate's upper side emits that leaves the gap straight."""
    count = 1 << 19
    x, z = rng.uniform(0.0, WIDE, count), rng.uniform(0.0, DEEP, count)
    ring, turn = np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * math.pi, count)
    across = GAP * ring / np.sqrt(np.maximum(1.0 - ring * ring, 1e-12))
    x, z = x + across * np.cos(turn), z + across * np.sin(turn)
    return float(((x < 0.0) | (x > WIDE) | (z < 0.0) | (z > DEEP)).mean())


def test_the_inside_of_an_emissive_box_sends_nothing(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    _, gaps = found(runtime, room(gap=0.5, thick=0.03), monkeypatch)
    # Its sides are too near to each other for surfels, but there is no gap that light leaves.
    assert gaps is None or float(gaps.lights.flux.sum()) < 0.01 * math.pi * 3.5 * WIDE * DEEP


@pytest.mark.parametrize("name", ["parlour", "spot-300"])
def test_scenes_without_emission_have_none(runtime: Runtime, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    # A sky, so that some space is lit: of scenes without light nothing is looked for.
    _, gaps = found(runtime, make_scene(name).scene, monkeypatch, [Environment(1.0)])
    assert gaps is None


def test_lights_are_the_same_each_time(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = (found(runtime, room(), monkeypatch)[1] for _ in range(2))
    assert one is not None
    assert other is not None
    assert np.array_equal(one.lights.flux, other.lights.flux)
    first: Sources = one.sources
    assert first.near > NEAR * GAP
    assert np.array_equal(first.received, other.sources.received)


def test_parts_of_next_to_no_area_take_no_light_of_paths(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    radiosity, gaps = found(runtime, room(), monkeypatch)
    assert gaps is not None
    received, area = gaps.sources.received, radiosity.surfels.part_area
    side = 2.0 / CELLS
    small = (area > 0.0) & (area < LEAST_AREA * side**2)
    assert small.any()
    assert received[~small].any()
    assert not received[small].any()
