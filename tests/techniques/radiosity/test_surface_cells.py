"""Radiance that surfaces send, by place and direction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.radiosity import radiosity as radiosity_module
from ssgi_cl.techniques.radiosity.light_volume import CELLS, LightVolume
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.radiosity.surface_cells import FAINT, FARTHEST, LEAST_SHOWN, NEAR, Pieces, SurfaceCells
from ssgi_cl.techniques.vpl.vpl_choice import on_device_rsms

Doubles = NDArray[np.float64]


Light = tuple[Pieces, Doubles]


def light(
    position: list[list[float]], normal: list[list[float]], area: list[float], exitance: list[float] | Doubles
) -> Light:
    flux = np.outer(np.multiply(area, exitance), np.ones(3))
    return Pieces(np.array(position), np.array(normal, np.float64), np.array(area)), flux


def volume_of(runtime: Runtime, lit: Light, also: Light | None = None, unlit: Light | None = None) -> LightVolume:
    return SurfaceCells(runtime, lit[0], LOW, EXTENT, None if unlit is None else unlit[0]).light(lit[1], also)


def at(volume: LightVolume, x: int, y: int, z: int) -> NDArray[np.float32]:
    """Return radiance and area [FACES, 4] of a cell."""
    record: NDArray[np.float32] = volume.records[volume.cells[z, y, x]]
    return record


LOW, EXTENT = np.array((-1.0, 0.0, 3.0)), 4.0
SIDE = EXTENT / CELLS


def centre(x: int, y: int, z: int) -> list[float]:
    """Return the middle of a cell."""
    point: list[float] = (LOW + SIDE * (np.array((x, y, z)) + 0.5)).tolist()
    return point


def test_a_surface_sends_its_radiance_to_the_side_that_it_faces(runtime: Runtime) -> None:
    volume = volume_of(runtime, light([centre(4, 5, 6)], [[0, 1, 0]], [0.004], [math.pi]))
    np.testing.assert_allclose(at(volume, 4, 5, 6)[2, :3], 1.0)
    np.testing.assert_allclose(at(volume, 4, 5, 6)[:, 3], [FAINT, FAINT, 0.004 / SIDE**2, *[FAINT] * 3], rtol=1e-6)
    # Cells without a surface take the nearest one's.
    assert len(volume.records) == 1
    assert (volume.cells == 0).all()
    assert (volume.records[0, [0, 1, 3, 4, 5], :3] == 0.0).all()


def test_surfaces_in_one_cell_count_by_their_area(runtime: Runtime) -> None:
    both = light([centre(4, 5, 6)] * 2, [[1, 0, 0]] * 2, [0.001, 0.003], [math.pi, 5 * math.pi])
    np.testing.assert_allclose(at(volume_of(runtime, both), 4, 5, 6)[0, :3], 4.0, rtol=1e-6)


def test_unlit_surfaces_are_black_where_no_other_is(runtime: Runtime) -> None:
    # One stands alone; two are near a lit one that faces the same way, as in a wall thinner than the cell.
    far = 4 + math.ceil(NEAR) + 3
    lit = light([centre(4, 5, 6), centre(6, 7, 6)], [[0, 1, 0], [-1, 0, 0]], [0.004] * 2, [math.pi] * 2)
    dark = [centre(4, 5, 6), centre(6, 5, 6), centre(far, 5, 6), centre(6, 6, 6)]
    black = light(dark, [[0, 1, 0]] * 4, [0.004, 1.0, 0.002, 1.0], [0.0] * 4)
    volume = volume_of(runtime, lit, unlit=black)
    np.testing.assert_allclose(at(volume, 4, 5, 6)[2], [*[1.0] * 3, 0.004 / SIDE**2], rtol=1e-6)
    np.testing.assert_allclose(at(volume, 6, 5, 6)[2], [*[1.0] * 3, FAINT], rtol=1e-6)
    np.testing.assert_allclose(at(volume, far, 5, 6)[2], [*[0.0] * 3, 0.002 / SIDE**2], rtol=1e-6)
    # Where a lit surface is that faces elsewhere, the nearest lit one counts, not a nearer black one.
    np.testing.assert_allclose(at(volume, 6, 7, 6)[2, :3], 1.0)


def test_the_nearest_surface_counts_where_there_is_none(runtime: Runtime) -> None:
    # Two that face along -z, and what faces along y beside them: one within `NEAR`, as seen from above, one beyond.
    sent = np.array((1.0, 3.0, 5.0, 7.0))
    places = [centre(2, 5, 6), centre(20, 5, 6), centre(1 + int(NEAR), 5, 6), centre(21 + int(NEAR), 5, 6)]
    volume = volume_of(runtime, light(places, [[0, 0, -1]] * 2 + [[0, 1, 0]] * 2, [1e-3] * 4, math.pi * sent))
    np.testing.assert_allclose(at(volume, 1 + int(NEAR), 5, 6)[5], [*[1.0] * 3, FAINT], rtol=1e-6)
    np.testing.assert_allclose(at(volume, 21 + int(NEAR), 5, 6)[5], [*[0.0] * 3, FAINT], rtol=1e-6)
    # Cells without a surface have what the nearest has that has one.
    np.testing.assert_allclose(at(volume, 0, 5, 6)[5, :3], 1.0)
    np.testing.assert_allclose(at(volume, 40, 5, 6)[2, :3], 7.0)


def test_surfaces_lend_as_nearest_first_searched_by_brute_force(runtime: Runtime, rng: np.random.Generator) -> None:
    """Few pieces that face along axes, at cells near a corner of the cube; `NEAR` grows with their width."""
    place = np.unique(rng.integers(1, 10, (60, 3)), axis=0)
    axis = rng.integers(0, 3, len(place))
    sign = rng.choice((-1.0, 1.0), len(place))
    normal = np.zeros((len(place), 3))
    normal[np.arange(len(place)), axis] = sign
    sent = rng.random(len(place))
    points = [centre(*cell) for cell in place.tolist()]
    for wide in (0.5, 1.5, 99.0):
        area = [(wide * SIDE) ** 2] * len(place)
        volume = volume_of(runtime, light(points, normal.tolist(), area, math.pi * sent))
        within = min(NEAR * max(wide, 1.0), FARTHEST)
        for number, cell in enumerate(place):
            record = at(volume, *cell.tolist())
            away = np.linalg.norm(place - (cell + normal[number]), axis=1)
            away[(place - cell) @ normal[number] < 0.0] = np.inf  # what is behind may be beyond a wall
            for face in range(6):
                there = (2 * axis + (sign < 0.0) == face) & (away <= within + 1e-9)
                if face == 2 * axis[number] + (sign[number] < 0.0):
                    np.testing.assert_allclose(record[face, :3], sent[number], rtol=1e-6)
                elif not there.any():
                    assert not record[face, :3].any()
                else:
                    nearest = sent[there & (away <= away[there].min() + 1e-9)]
                    assert np.abs(nearest - record[face, 0]).min() < 1e-6 * nearest.max()


@pytest.mark.parametrize("way", [1, -1])
def test_a_wall_looks_for_surfaces_before_it(runtime: Runtime, way: int) -> None:
    """Ceilings of two rooms, as far from the wall between them."""
    places, normals = [centre(10, 5, 6), centre(9, 5, 6), centre(11, 5, 6)], [[way, 0, 0], [0, -1, 0], [0, -1, 0]]
    volume = volume_of(runtime, light(places, normals, [1e-3] * 3, [0.0, math.pi, 3 * math.pi]))
    np.testing.assert_allclose(at(volume, 10, 5, 6)[3, :3], 2.0 + way)


def test_a_wall_takes_no_light_from_beyond_it(runtime: Runtime) -> None:
    """The rim of a picture on a wall, in a cell without a part of it, and a bright ceiling behind the wall."""
    places, normals = [centre(10, 5, 6), centre(9, 5, 6)], [[1, 0, 0], [0, -1, 0]]
    volume = volume_of(runtime, light(places, normals, [1e-3] * 2, [0.0, math.pi]))
    np.testing.assert_array_equal(at(volume, 10, 5, 6)[3, :3], 0.0)
    np.testing.assert_allclose(at(volume, 9, 5, 6)[3, :3], 1.0)


def test_a_slanted_surface_counts_for_the_sides_that_it_faces(runtime: Runtime) -> None:
    volume = volume_of(runtime, light([centre(4, 5, 6)], [[0.6, 0.0, -0.8]], [0.002], [math.pi]))
    np.testing.assert_allclose(at(volume, 4, 5, 6)[[0, 5], :3], 1.0)
    np.testing.assert_allclose(at(volume, 4, 5, 6)[[0, 5], 3], np.array((0.36, 0.64)) * 0.002 / SIDE**2, rtol=1e-6)


def test_light_besides_is_added_and_never_more_than_its_own_surface_sends(runtime: Runtime) -> None:
    """A light on a sliver of surface, of which the pieces have caught little."""
    own = light([centre(4, 5, 6)], [[0, 1, 0]], [1e-6], [math.pi])
    also = light([centre(4, 5, 6)], [[0, 1, 0]], [1e-3], [2 * math.pi])
    np.testing.assert_allclose(at(volume_of(runtime, own, also), 4, 5, 6)[2, :3], 3.0)


def test_pieces_count_as_they_are_shown(runtime: Runtime) -> None:
    both = light([centre(4, 5, 6)] * 2, [[1, 0, 0]] * 2, [0.002, 0.002], [math.pi, 5 * math.pi])
    cells = SurfaceCells(runtime, both[0], LOW, EXTENT, shown=np.array((0.75, 0.25)))
    record = at(cells.light(both[1]), 4, 5, 6)[0]
    np.testing.assert_allclose(record, [*[0.75 * 1.0 + 0.25 * 5.0] * 3, 0.004 / SIDE**2], rtol=1e-6)


def test_what_no_surface_sees_gives_way_to_what_one_sees(runtime: Runtime) -> None:
    """The bottom of a floor, and what stands on the floor and faces down."""
    places = [centre(4, 5, 6), centre(4, 5, 6), centre(6, 5, 6), centre(9 + int(NEAR), 5, 6)]
    lit = light(places, [[0, -1, 0]] * 4, [0.002] * 4, [math.pi, 3 * math.pi, 5 * math.pi, 7 * math.pi])
    seen = np.array((True, False, False, False))
    volume = SurfaceCells(runtime, lit[0], LOW, EXTENT, seen=seen).light(lit[1])
    down = 3
    mixed = (1.0 + 3.0 * LEAST_SHOWN) / (1.0 + LEAST_SHOWN)
    for x in (4, 6):
        np.testing.assert_allclose(at(volume, x, 5, 6)[down, :3], mixed, rtol=1e-6)
    assert at(volume, 6, 5, 6)[down, 3] == np.float32(FAINT)
    # Farther than `NEAR` cells from what is seen it has its own light.
    np.testing.assert_allclose(at(volume, 9 + int(NEAR), 5, 6)[down], [*[7.0] * 3, 0.002 / SIDE**2], rtol=1e-6)


def test_a_wall_divides_the_cells_that_it_cuts(runtime: Runtime) -> None:
    """Floor on both sides of a wall at .3 of a cell, which slants by a fifth of a cell for each, and its neighbours."""
    wall = np.array((1.0, 0.0, 0.2)) / math.hypot(1.0, 0.2)
    near, far, next_to = ([*centre(8, 5, 6)] for _ in range(3))
    near[0] -= 0.4 * SIDE
    far[0] += 0.4 * SIDE
    next_to[2] += SIDE
    next_to[0] += 0.3 * SIDE
    lit = light([near, far, next_to], [[0, 1, 0]] * 3, [0.002, 0.001, 0.001], [math.pi, 7 * math.pi, 5 * math.pi])
    at_wall = wall @ (np.array(centre(8, 5, 6)) - np.array((0.2 * SIDE, 0.0, 0.0)))
    beyond = np.sign(lit[0].position @ wall - at_wall)

    def planes(partner: NDArray[np.intp], height: float) -> Doubles:
        """Pieces on other sides of the wall do not see each other."""
        assert 0.0 < height < SIDE
        towards = np.where(beyond[partner] != beyond, beyond[partner], 0.0)
        return towards[:, None] * np.append(wall, at_wall)

    cells = SurfaceCells(runtime, lit[0], LOW, EXTENT, planes=planes)
    volume = cells.light(lit[1])

    def seen(x: float, z: float, place: float) -> NDArray[np.float32]:
        """Return what faces up at `place` cells from the left side of cell (x, 5, z)."""
        number = volume.cells[int(z), 5, int(x)]
        assert number < 0
        plane = volume.planes[-1 - number]
        behind = plane[:3] @ np.array((x + place, 5.5, z + 0.5)) < plane[3]
        return volume.records[2 * (-1 - number) + behind, 2]

    assert len(volume.planes) == 2
    for place, sent, area in ((0.1, 1.0, 0.002), (0.2, 1.0, 0.002), (0.4, 7.0, 0.001), (0.9, 7.0, 0.001)):
        np.testing.assert_allclose(seen(8, 6, place), [*[sent] * 3, area / SIDE**2], rtol=1e-6)
    # The cell behind has surfaces on one side of the wall alone, and those of the other from where it has some.
    np.testing.assert_allclose(seen(8, 7, 0.9)[:3], 5.0, rtol=1e-6)
    np.testing.assert_allclose(seen(8, 7, 0.01)[:3], 1.0, rtol=1e-6)


def test_planes_that_do_not_part_what_is_hidden_divide_nothing(runtime: Runtime) -> None:
    """What hides one piece from another may be bent, and lie with its plane on one side of both."""
    two = [[*centre(8, 5, 6)] for _ in range(2)]
    two[0][0] -= 0.3 * SIDE
    two[1][0] += 0.3 * SIDE
    lit = light(two, [[0, 1, 0]] * 2, [0.002, 0.001], [1.0, 2.0])
    for x, y, count in ((1.0, 0.0, 0), (0.0, 1.0, 0), (-1.0, 0.0, 1)):
        off = (x, y, 0.0) @ (np.array(centre(8, 5, 6)) - np.array((0.1, 0.2, 0.0)) * SIDE)

        def planes(partner: NDArray[np.intp], _: float, plane: Any = (x, y, 0.0, off)) -> Doubles:
            return np.where((np.arange(2) == 1) & (partner == 0), 1.0, 0.0)[:, None] * np.array(plane)

        assert len(SurfaceCells(runtime, lit[0], LOW, EXTENT, planes=planes).light(lit[1]).planes) == count


def test_pieces_look_at_that_of_a_cell_beside_which_counts_most(runtime: Runtime) -> None:
    places = [centre(8, 5, 6), centre(8, 5, 6), centre(9, 5, 6), centre(9, 5, 6), centre(9, 6, 6)]
    lit = light(places, [[0, 1, 0]] * 5, [0.001, 0.002, 0.001, 0.003, 0.001], [1.0] * 5)
    looked: list[list[int]] = []

    def planes(partner: NDArray[np.intp], _: float) -> Doubles:
        looked.append(partner.tolist())
        return np.zeros((5, 4))

    SurfaceCells(runtime, lit[0], LOW, EXTENT, planes=planes)
    # At the heaviest of its own cell; of the cells at +x, -x, +y, -y, +z and -z, and itself where none is there.
    assert looked[0] == [1, 1, 3, 3, 4]
    assert looked[1:] == [[3, 3, 2, 3, 4], [0, 1, 1, 1, 4], [0, 1, 4, 4, 4], [0, 1, 2, 3, 3], *[[0, 1, 2, 3, 4]] * 2]


def test_without_surfaces_it_is_black(runtime: Runtime) -> None:
    volume = SurfaceCells(runtime, Pieces.none(), LOW, EXTENT).light(np.zeros((0, 3)))
    assert (volume.records[..., :3] == 0.0).all()
    assert (volume.cells == 0).all()


def test_in_a_room_it_is_the_mean_radiance_of_its_surfaces(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    """A white furnace: all surfaces send the sky's radiance. With rays, pieces would count as they are shown."""
    monkeypatch.setattr(radiosity_module, "rays_meet_triangles", lambda scene: False)
    built = BUILTIN_SCENES["hall"]()
    scene = built.scene
    radiosity, sky = Radiosity(runtime, RadiosityParams(surfels=512)), Environment(2.0)
    volume = radiosity.run(scene, [sky]).volume()
    assert radiosity.run(scene, [sky]).volume() is volume
    vpls = radiosity.vpls
    assert vpls is not None
    assert vpls.parts is not None
    low = volume.low
    cells = ((vpls.parts.position - low) / volume.side).astype(int)
    assert (cells >= 0).all()
    assert (cells <= CELLS).all()
    # Power through all sides: the projected areas of pieces add up as 1 by their squares.
    area = volume.records[..., 3:].astype(np.float64)
    total = float((volume.records[..., :3] * area)[area[..., 0] > 2 * FAINT].sum())
    sent = float(vpls.parts.flux.sum()) / math.pi / volume.side**2
    assert abs(total / sent - 1.0) < 0.02  # what is fainter is left out


def test_light_of_maps_that_surfaces_reflect_straight_is_in_it(runtime: Runtime) -> None:
    built = BUILTIN_SCENES["parlour"]()
    spot = next(one for one in built.lights if isinstance(one, SpotLight))
    drawn = rsm(built.scene, spot, size=64, runtime=runtime)
    (seen,) = on_device_rsms([drawn], runtime)
    radiosity = Radiosity(runtime, RadiosityParams(surfels=512, bounces=1))
    volume, vpls = radiosity.run(built.scene, [], rsms=[seen]).volume(), radiosity.vpls
    assert vpls is not None
    area = volume.records[..., 3:].astype(np.float64)
    total = float((volume.records[..., :3] * area)[area[..., 0] > 2 * FAINT].sum())
    bounced = float(vpls.flux.sum()) / math.pi / volume.side**2
    straight = float(np.asarray(drawn.flux).sum()) / math.pi / volume.side**2
    # What lies in cells without a surfel that faces as it does is lost.
    assert bounced + 0.6 * straight < total < 1.1 * (bounced + straight)
