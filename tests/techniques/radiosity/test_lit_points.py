"""Which points of surfaces light comes to, against cavities whose light is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity import lit_points
from ssgi_cl.techniques.radiosity.air import Air
from ssgi_cl.techniques.radiosity.lit_points import BOUNCES, CLOSED, FEW_POINTS, LitPoints
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.radiosity.surfels import TriangleShares, lit_surfels
from ssgi_cl.techniques.radiosity.triangle_rays import TriangleRays

from .test_radiosity import meshed

Doubles = NDArray[np.float64]
CELLS, LOW, SIDE = 32, np.full(3, -2.0), 0.125
"""Of a grid of 4 x 4 x 4 round the origin."""


def globe(cap: float = 0.0) -> tuple[Scene, float]:
    """Return a sphere of radius 1 without a cap of a share of its area, and which share its triangles lack."""
    mesh = trimesh.creation.icosphere(subdivisions=4)
    gone = mesh.triangles_center[:, 2] > 1.0 - 2.0 * cap
    gone &= cap > 0.0
    scene = meshed(mesh.vertices, mesh.faces[~gone], (Material(albedo=(0.5,) * 3),), [0] * int((~gone).sum()))
    return scene, float(mesh.area_faces[gone].sum() / mesh.area)


def inside(count: int) -> tuple[Doubles, Doubles]:
    """Return points of the inside of the sphere's lower half, a little within its triangles, and their normals."""
    random = np.random.default_rng(3)
    normal = random.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[:, 2] = np.abs(normal[:, 2])
    return -0.99 * normal, normal


def air(*, within: int) -> Air:
    """Return the air of the grid: space 1 outside of the sphere, that of number `within` in it."""
    z, y, x = (np.indices((CELLS,) * 3) + 0.5) * SIDE - 2.0
    radius = np.sqrt(x * x + y * y + z * z)
    numbers = np.where(radius > 1.0, 1, within).astype(np.int32)
    numbers[np.abs(radius - 1.0) < SIDE] = 0
    return Air(numbers)


@pytest.mark.parametrize("cap", [0.05, 0.2])
def test_paths_leave_a_sphere_through_a_hole_in_proportion_to_its_area(runtime: Runtime, cap: float) -> None:
    # Light of a point of a sphere comes to all others alike, so that each bounce leaves with the same probability.
    scene, share = globe(cap)
    lit = LitPoints(TriangleRays(runtime, scene), air(within=0), LOW, SIDE, 1.5 * SIDE)
    position, normal = inside(40_000)
    lit.enter(frozenset({1}), position[:1], normal[:1])
    found = lit.reached(position, normal, np.arange(len(position)))
    expected = 1.0 - (1.0 - share) ** BOUNCES
    # Four deviations of so many points are .009; points lie a little within, where the hole looks a little larger.
    assert found.mean() == pytest.approx(expected, abs=0.015)


def test_points_before_lit_air_are_lit_unless_a_triangle_is_before_it(runtime: Runtime) -> None:
    scene, _ = globe()
    lit = LitPoints(TriangleRays(runtime, scene), air(within=2), LOW, SIDE, 1.5 * SIDE)
    position, normal = inside(2000)
    lit.enter(frozenset({1}), position, normal)
    numbers = np.arange(len(position))
    outer = np.repeat([[0.0, 0.0, -1.01]], 2000, axis=0)
    assert lit.reached(outer, np.repeat([[0.0, 0.0, -1.0]], 2000, axis=0), numbers).all()
    # The lit air of the outside is as near to points within, behind triangles.
    assert not lit.reached(position, -normal, numbers).any()
    assert not lit.reached(position, normal, numbers).any()


def test_spaces_from_which_no_path_leaves_are_closed(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    position, normal = inside(2000)
    for cap, state in ((0.0, CLOSED), (0.2, 0)):
        lit = LitPoints(TriangleRays(runtime, globe(cap)[0]), air(within=2), LOW, SIDE, 1.5 * SIDE)
        lit.enter(frozenset({1}), position, normal)
        assert lit.states.tolist() == [0, 1, state]
        # Few points tell nothing of a space.
        lit.enter(frozenset({1}), position[: FEW_POINTS // 2], normal[: FEW_POINTS // 2])
        assert lit.states.tolist() == [0, 1, 0]
    monkeypatch.setattr(lit_points, "FEW_REACHED", 1.1)
    lit.enter(frozenset({1}), position, normal)
    assert lit.states.tolist() == [0, 1, CLOSED]
    assert not lit.reached(position, normal, np.arange(len(position))).any()  # without a path


def test_places_without_air_are_no_closed_space(runtime: Runtime) -> None:
    lit = LitPoints(TriangleRays(runtime, globe()[0]), air(within=0), LOW, SIDE, 1.5 * SIDE)
    lit.enter(frozenset({1}), *inside(2000))
    assert lit.states.tolist() == [0, 1]


def test_a_path_ends_where_it_comes_into_a_closed_space(runtime: Runtime) -> None:
    # Points so near to their cells' walls that no air is in front of them; all else within is closed.
    scene, share = globe(0.2)
    lit = LitPoints(TriangleRays(runtime, scene), air(within=2), LOW, SIDE, 0.01 * SIDE)
    position, normal = inside(40_000)
    lit.enter(frozenset({1}), position[:1], normal[:1])
    lit.states[2] = CLOSED
    found = lit.reached(position, normal, np.arange(len(position)))
    # Some rays along the wall pass no closed air, and go on.
    assert share - 0.01 < found.mean() < share + 0.06 < 1.0 - (1.0 - share) ** 2


def test_surfels_are_of_points_that_light_reaches_or_of_others() -> None:
    corners, triangles = boxes((np.full(3, -1.0), np.full(3, 1.0)))
    glow = Material(albedo=(0.5,) * 3, emission=(1.0,) * 3)
    ids = (np.abs(corners[triangles][..., 1] - 1.0) < 1e-6).all(axis=1).astype(int)
    scene = meshed(corners, triangles, (Material(albedo=(0.5,) * 3), glow), ids)

    def reached(position: Doubles, normal: Doubles, numbers: NDArray[np.intp]) -> NDArray[np.bool_]:
        assert len(position) == len(normal) == len(numbers) == len(np.unique(numbers))
        return position[:, 0] > 0.3

    shares = TriangleShares.of(scene)
    found = lit_surfels(scene, 1024, reached, shares, others=True)
    surfels = found.surfels
    real = (surfels.part_area > 0.0).reshape(-1, PARTS)
    right = (surfels.part_position[:, 0] > 0.3).reshape(-1, PARTS)
    emits = surfels.part_emission.any(axis=1).reshape(-1, PARTS)
    np.testing.assert_array_equal((right | emits) & real, found.lit[:, None] & real)
    assert 0.3 < found.lit.mean() < 0.7
    assert surfels.area.sum() == pytest.approx(48.0, rel=1e-6)  # of both sides
    left = surfels.area[~found.lit].sum()
    assert found.unlit_area.sum() == pytest.approx(left)
    assert (found.unlit_position[:, 0] <= 0.3).all()
    np.testing.assert_allclose(np.linalg.norm(found.unlit_normal, axis=1), 1.0)
    alone = lit_surfels(scene, 1024, reached, shares, others=False)
    assert alone.lit.all()
    assert alone.surfels.area.sum() == pytest.approx(48.0 - left)


def test_a_point_has_the_same_paths_among_any_others(runtime: Runtime) -> None:
    lit = LitPoints(TriangleRays(runtime, globe(0.2)[0]), air(within=0), LOW, SIDE, 1.5 * SIDE)
    position, normal = inside(999)
    lit.enter(frozenset({1}), position[:1], normal[:1])
    numbers = np.arange(999)
    found = lit.reached(position, normal, numbers)
    assert 0.2 < found.mean() < 0.8
    some = np.arange(5, 999, 7)
    np.testing.assert_array_equal(lit.reached(position[some], normal[some], numbers[some]), found[some])


def boxes(*sizes: tuple[Doubles, Doubles]) -> tuple[Doubles, NDArray[np.intp]]:
    """Return corners and triangles of closed boxes by least and greatest corners."""
    parts = [trimesh.creation.box(bounds=np.stack(size)) for size in sizes]
    mesh = trimesh.util.concatenate(parts)
    return mesh.vertices, mesh.faces


def test_surfels_lie_neither_in_things_nor_on_the_floor_below_them(runtime: Runtime) -> None:
    # Boxes with a hundredth of the surfaces each, smaller than what counts as a space of its own.
    places = [(x, z) for x in (-1.0, 1.0) for z in (-1.0, 1.0)]
    low = [np.array([x - 0.2, 0.0, z - 0.2]) for x, z in places]
    corners, triangles = boxes(
        (np.array([-2.0, -0.4, -2.0]), np.array([2.0, 0.0, 2.0])), *((one, one + 0.4) for one in low)
    )
    scene = meshed(corners, triangles, (Material(albedo=(0.5,) * 3),), [0] * len(triangles))
    radiosity = Radiosity(runtime, RadiosityParams(surfels=1024))
    radiosity.run(scene, [Environment(1.0)])
    surfels = radiosity.surfels
    place = surfels.part_position + surfels.origin
    real = surfels.part_area > 0.0
    off = np.abs(np.abs(place[:, [0, 2]]) - 1.0).max(axis=1)
    beneath = (np.abs(place[:, 1]) < 1e-6) & (off < 0.19)
    assert not (beneath & real).any()
    towards = np.sum((np.sign(place[:, [0, 2]]) - place[:, [0, 2]]) * surfels.part_normal[:, [0, 2]], axis=1)
    sides = (place[:, 1] > 0.01) & (place[:, 1] < 0.39)
    assert sides.any()
    assert (towards[sides & real] < 0.0).all()
    # On the floor beside the boxes, those that see one are there.
    floor = (np.abs(place[:, 1]) < 1e-6) & (off > 0.21) & (off < 0.5)
    assert surfels.part_area[floor & real].sum() == pytest.approx(4 * (1.0 - 0.42**2), rel=0.1)
    assert math.isfinite(float(radiosity.irradiance.max()))
