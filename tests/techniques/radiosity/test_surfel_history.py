"""Surfels of a sequence: they follow their triangles, keep their numbers, and begin anew where they must."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import moved
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.radiosity.surfel_history import GROWTH, MOST_KEPT, SurfelHistory
from ssgi_cl.techniques.radiosity.surfels import Surfels, scene_surfels

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float64)


def squares(*corners: Any) -> Scene:
    """Return a scene of squares, each of two triangles."""
    points = np.concatenate(corners).astype(np.float32)
    first = 4 * np.arange(len(corners))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    return Scene(
        positions=points,
        normals=np.zeros_like(points),
        uvs=points[:, :2].copy(),
        colors=np.ones_like(points),
        triangles=triangles,
        material_ids=np.zeros(len(triangles), np.int32),
        materials=(Material(),),
    )


def room() -> Scene:
    """Return a floor, a wall, and a plate that stands between them."""
    floor, wall = 3.0 * (SQUARE - (0.5, 0.0, 0.5)), 3.0 * (SQUARE[:, [0, 2, 1]] - (0.5, 0.0, 0.5))
    return squares(floor, wall, 0.5 * SQUARE[:, [0, 2, 1]] + (0.2, 0.1, 0.3))


PLATE = np.arange(12) >= 8


def turned(angle: float, scale: float = 1.0) -> NDArray[np.float64]:
    """Return a matrix that turns about the vertical through the plate's edge, and scales."""
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    matrix = np.array([[c, 0, s, 0], [0, scale, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])
    matrix[:3, 3] = np.array([0.2, 0.1, 0.3]) - matrix[:3, :3] @ [0.2, 0.1, 0.3]
    return matrix


def test_surfels_follow_their_triangles_and_those_that_stand_keep_every_bit() -> None:
    before = room()
    made, matrix = scene_surfels(before, 512), turned(0.7, 1.2)
    now = moved(before, matrix, vertices=PLATE)
    found = made.following(before, now)
    plate = made.part_triangle >= 4
    assert 0 < plate.sum() < len(plate)
    wanted = made.part_position[plate] @ matrix[:3, :3].T + matrix[:3, 3]
    # Positions of vertices are float32: roundings of 2^-24 of some scene units.
    np.testing.assert_allclose(found.part_position[plate], wanted, atol=1e-6)
    turn = matrix[:3, :3] / 1.2
    np.testing.assert_allclose(found.part_normal[plate], made.part_normal[plate] @ turn.T, atol=1e-6)
    np.testing.assert_allclose(found.part_area[plate], 1.44 * made.part_area[plate], rtol=1e-5)
    own = plate.reshape(-1, PARTS).any(axis=1)
    np.testing.assert_allclose(found.area[own], 1.44 * made.area[own], rtol=1e-5)
    np.testing.assert_allclose(found.normal[own], made.normal[own] @ turn.T, atol=1e-6)
    np.testing.assert_array_equal(found.position, found.part_position[::PARTS])
    for name in ("position", "normal", "area", "albedo"):
        np.testing.assert_array_equal(getattr(found, name)[~own], getattr(made, name)[~own])
        part = np.repeat(~own, PARTS)
        np.testing.assert_array_equal(getattr(found, f"part_{name}")[part], getattr(made, f"part_{name}")[part])
    assert made.following(before, replace(before)) is made


def test_a_triangle_that_loses_its_area_leaves_surfels_finite() -> None:
    before = room()
    flat = before.positions.copy()
    flat[PLATE] = flat[8]
    found = scene_surfels(before, 256).following(before, replace(before, positions=flat))
    assert np.isfinite(found.position).all()
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-9)
    assert (found.area > 0.0).all()


def chosen(history: SurfelHistory, scene: Scene) -> tuple[Surfels, Surfels]:
    """Return surfels placed in a scene, and those that a history takes of them: every second one."""
    made = scene_surfels(scene, 128)
    history.enter(scene)
    return made, history.begin(scene, made, np.arange(0, len(made), 2))


def test_numbers_stay_those_of_the_first_frame_and_others_come_behind() -> None:
    scene, history = room(), SurfelHistory()
    made, kept = chosen(history, scene)
    np.testing.assert_array_equal(kept.part_number, np.arange(len(kept.part_area)))
    now = moved(scene, turned(0.3), vertices=PLATE)
    history.enter(now)
    followed = history.moved(now)
    assert followed is not None
    there = np.arange(1, len(made), 2)[:3]
    joined = followed.chosen(history.joined(np.concatenate([np.arange(0, len(made), 2)[4:], there])))
    # None is lost, and the new ones are last.
    np.testing.assert_array_equal(joined.part_number[: len(kept.part_area)], kept.part_number)
    assert len(joined) == len(kept) + 3
    assert (joined.part_number[len(kept.part_area) :] >= len(kept.part_area)).all()
    assert len(np.unique(joined.part_number)) == len(joined.part_area)


def test_irradiance_is_that_of_the_part_and_of_another_scene_alone() -> None:
    scene, history = room(), SurfelHistory()
    _, kept = chosen(history, scene)
    light = np.random.default_rng(1).random((len(kept.part_area), 3))
    assert history.known(kept, "now") is None
    history.keep(kept, "before", light)
    assert history.known(kept, "before") is None
    back = kept.chosen(np.arange(len(kept))[::-1])
    known = history.known(back, "now")
    assert known is not None
    np.testing.assert_array_equal(known.reshape(-1, PARTS, 3)[::-1].reshape(-1, 3), light)


def test_other_surfaces_and_a_scene_that_leaves_its_cube_begin_anew() -> None:
    scene, history = room(), SurfelHistory()
    chosen(history, scene)
    middle, half = history.middle, history.half
    history.enter(moved(scene, turned(1.0), vertices=PLATE))
    assert history.surfels is not None
    np.testing.assert_array_equal(history.middle, middle)
    shift = np.eye(4)
    shift[1, 3] = 3.0
    far = moved(scene, shift, vertices=PLATE)
    history.enter(far)
    assert history.surfels is None
    assert history.moved(far) is None
    assert history.half == pytest.approx(GROWTH * 0.5 * np.ptp(far.bounds, axis=0).max())
    assert history.half > half
    for other in (replace(scene, materials=(Material(albedo=(0.1, 0.1, 0.1)),)), squares(SQUARE)):
        chosen(history, scene)
        assert history.surfels is not None
        history.enter(other)
        assert history.surfels is None


def test_about_as_many_surfels_have_to_be_lit() -> None:
    history = SurfelHistory()
    _, kept = chosen(history, room())
    count = len(kept)
    for share, wanted in ((0.7, False), (0.9, True), (1.2, True), (1.3, False)):
        assert history.suits(np.arange(round(share * count))) is wanted
    assert MOST_KEPT == 1.25


SKY = [Environment((1.0, 1.0, 1.0))]


def light(
    runtime: Runtime, angles: Any, history: SurfelHistory | None, scales: tuple[float, ...] = (1.0, 1.0)
) -> list[Radiosity]:
    """Return what is found with a plate turned by angles, one after the other."""
    found = []
    for angle, scale in zip(angles, scales, strict=False):
        made = Radiosity(runtime, RadiosityParams(surfels=256))
        made.run(moved(room(), turned(angle, scale), vertices=PLATE), SKY, history=history)
        found.append(made)
    return found


def volume(made: Radiosity) -> NDArray[np.float32]:
    """Return what the surfaces in the cells of the light volume send, [cells, 6, 3]: radiance by area."""
    assert made._result is not None
    held = made._result.volume()
    records = held.records[held.cells.ravel()]
    return records[..., :3] * records[..., 3:]


def test_a_scene_that_hardly_moves_has_hardly_other_light(runtime: Runtime) -> None:
    angles, scales = (0.3, 0.3004), (1.0, 1.002)  # areas that change move all points of other surfels
    steady, anew = (light(runtime, angles, history, scales) for history in (SurfelHistory(), None))
    change, noise = (np.abs(volume(b) - volume(a)).mean() for a, b in (steady, anew))
    assert noise > 0.003 * volume(anew[0]).mean()
    assert change < 0.2 * noise
    # The same light, from other surfels, which change a cell's by 7 % on average.
    level, wanted = volume(steady[1]).mean(), volume(anew[1]).mean()
    assert level == pytest.approx(wanted, rel=0.03)


def test_light_begins_with_that_of_the_frame_before(runtime: Runtime) -> None:
    first, second = light(runtime, (0.3, 0.35), SurfelHistory())
    assert 3 <= second.bounces < first.bounces
    cold = light(runtime, (0.35,), None)[0]
    # Both have all but .2 % of the flux; surfels are others.
    assert volume(second).mean() == pytest.approx(volume(cold).mean(), rel=0.01)


def test_where_nothing_moves_a_history_changes_no_bit(runtime: Runtime) -> None:
    alone, with_history = (light(runtime, (0.3,), history)[0] for history in (None, SurfelHistory()))
    np.testing.assert_array_equal(volume(alone), volume(with_history))
    assert alone.vpls is not None
    assert with_history.vpls is not None
    np.testing.assert_array_equal(alone.vpls.flux, with_history.vpls.flux)
