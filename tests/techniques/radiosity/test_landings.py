"""Surfels where rays land: on surfaces that are narrow, with what their materials say."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity.landings import AREA, landings
from ssgi_cl.techniques.radiosity.light_volume import CELLS
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.radiosity.surface_points import surface_points, weights_at
from ssgi_cl.techniques.radiosity.surfels import Surfels, scene_surfels
from ssgi_cl.techniques.radiosity.triangle_rays import TriangleRays

from .test_radiosity import meshed

Doubles = NDArray[np.float64]
THICK = 0.006
"""Of a board in a room of 2 x 2 x 2: a fifth of a cell."""
WALL, BOARD = Material(albedo=(0.5,) * 3), Material(albedo=(0.2, 0.4, 0.6))
LIGHT = Material(albedo=(0.0,) * 3, emission=(5.0,) * 3)


def board(*, glows: bool = False) -> Scene:
    """Return a room with a light at its ceiling and a board in the middle."""
    walls = trimesh.creation.box(bounds=[[-1.0] * 3, [1.0] * 3])
    plate = trimesh.creation.box(bounds=[[-0.5, -THICK, -0.5], [0.5, 0.0, 0.5]])
    light = trimesh.creation.box(bounds=[[-0.3, 0.8, -0.3], [0.3, 0.85, 0.3]])
    whole = trimesh.util.concatenate([walls, plate, light])
    ids = np.repeat([0, 1, 2], [len(walls.faces), len(plate.faces), len(light.faces)])
    return meshed(whole.vertices, whole.faces, (WALL, LIGHT if glows else BOARD, LIGHT), ids)


def landed(runtime: Runtime, scene: Scene, surfels: Surfels) -> Surfels:
    def closed(position: Doubles, normal: Doubles) -> NDArray[np.bool_]:
        return np.zeros(len(position), np.bool_)

    return landings(TriangleRays(runtime, scene), surfels, scene.bounds[0], 2.0 / CELLS, closed)


def in_room(surfels: Surfels) -> Surfels:
    """Return those on sides of surfaces that face the room, not the inside of things or the outside."""
    before = surfels.position + surfels.origin + 1e-4 * surfels.normal
    height = before[:, 1]
    inside = (np.abs(before) < 1.0).all(axis=1)
    inside &= ~((np.abs(before[:, [0, 2]]) < 0.5).all(axis=1) & (height > -THICK) & (height < 0.0))
    inside &= ~((np.abs(before[:, [0, 2]]) < 0.3).all(axis=1) & (height > 0.8) & (height < 0.85))
    return surfels.chosen(np.flatnonzero(inside))


def edges(surfels: Surfels) -> NDArray[np.bool_]:
    """Return which parts lie on the board's edges, and count."""
    place = surfels.part_position + surfels.origin
    side = np.abs(np.abs(place[:, [0, 2]]).max(axis=1) - 0.5) < 1e-6
    return side & (place[:, 1] > -THICK) & (place[:, 1] < 0.0) & (surfels.part_area > 0.0)


def test_edges_of_a_board_have_surfels_where_rays_land(runtime: Runtime) -> None:
    scene = board()
    surfels = in_room(scene_surfels(scene, 4096))
    found = landed(runtime, scene, surfels)
    own, more = edges(surfels), edges(found)
    # The edges have .04 % of all area, 26 of the parts, and lie in 4 x 16 to 4 x 18 cells.
    assert own.sum() < 30 < more.sum() <= 4 * 18
    real = found.part_area > 0.0
    np.testing.assert_allclose(found.part_area[real], AREA * (2.0 / CELLS) ** 2)
    np.testing.assert_allclose(found.part_albedo[more], np.tile(BOARD.albedo, (more.sum(), 1)))
    np.testing.assert_allclose(np.linalg.norm(found.part_normal[real], axis=1), 1.0, rtol=1e-6)
    # They face the rays that landed: out of the board.
    place = found.part_position + found.origin
    assert (np.sum(place[more] * found.part_normal[more], axis=1) > 0.0).all()
    # Each lies on its triangle.
    corners = scene.positions[scene.triangles[found.part_triangle]].astype(np.float64)
    np.testing.assert_allclose(np.einsum("nk,nkc->nc", found.part_weights, corners), found.part_position, atol=1e-7)


def test_places_that_have_a_part_get_no_other_nor_do_lights(runtime: Runtime) -> None:
    scene = board()
    surfels = in_room(scene_surfels(scene, 1 << 14))

    def slots(of: Surfels) -> NDArray[np.intp]:
        real = of.part_area > 0.0
        place, normal = (of.part_position + of.origin)[real], of.part_normal[real]
        cell = np.clip(((place + 1.0) * (CELLS / 2.0) + 0.01 * normal).astype(int), 0, CELLS - 1)
        axis = np.abs(normal).argmax(axis=1)
        down = normal[np.arange(len(axis)), axis] < 0.0
        return np.ravel_multi_index((*cell.T, 2 * axis + down), (CELLS,) * 3 + (6,))  # type: ignore[no-any-return]

    found = landed(runtime, scene, surfels)
    assert len(np.unique(slots(found))) == len(slots(found)) > 0
    assert not np.isin(slots(found), slots(surfels)).any()
    glowing = landed(runtime, board(glows=True), in_room(scene_surfels(board(glows=True), 2048)))
    assert not edges(glowing).any()


def test_no_ray_lands_in_an_empty_room_of_many_surfels(runtime: Runtime) -> None:
    walls = trimesh.creation.box(bounds=[[-1.0] * 3, [1.0] * 3])
    scene = meshed(walls.vertices, walls.faces, (WALL,), [0] * len(walls.faces))
    surfels = in_room(scene_surfels(scene, 1 << 16))
    assert len(landed(runtime, scene, surfels)) * PARTS < 0.01 * len(surfels.part_area)
    assert len(landed(runtime, scene, surfels.chosen(np.zeros(0, np.intp)))) == 0


def test_radiosity_has_light_of_the_edges_of_a_board(runtime: Runtime) -> None:
    radiosity = Radiosity(runtime, RadiosityParams(surfels=1024))
    radiosity.run(board(), [])
    surfels = radiosity.surfels
    assert edges(surfels).sum() > 24
    # As parts they are rays' ends alone: a virtual point light there would be next to the board's sides.
    assert radiosity.vpls is not None
    assert radiosity.vpls.parts is not None
    landing = surfels.part_area < 2.0 * AREA * (2.0 / CELLS) ** 2
    assert (landing & edges(surfels)).any()
    assert not radiosity.vpls.parts.flux[landing].any()
    assert (np.repeat(radiosity.irradiance, PARTS, axis=0)[landing & edges(surfels)] > 0.0).all()


def test_weights_at_a_place_of_a_triangle_give_it_back() -> None:
    scene = board()
    random = np.random.default_rng(5)
    triangle = random.integers(0, len(scene.triangles), 500)
    weights = random.dirichlet((1.0, 1.0, 1.0), 500)
    points, solid = surface_points(scene, triangle, weights)
    assert solid.all()
    np.testing.assert_allclose(weights_at(scene, triangle, points.position), weights, atol=1e-9)
    # Beyond an edge, they are those of a place on the triangle.
    beyond = weights_at(scene, triangle, points.position + 5.0 * points.normal + 3.0)
    assert (beyond >= 0.0).all()
    np.testing.assert_allclose(beyond.sum(axis=1), 1.0)
