"""Generated scenes: determinism, closed meshes, views outside of geometry, names."""

from __future__ import annotations

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.lights import Environment
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.parts import Part, complete
from ssgi_cl.rasterize.scenes import (
    BUILTIN_SCENES,
    KINDS,
    REPORTED,
    TUNED_ON,
    VALIDATED_ON,
    VALIDATION_ROOMS,
    BuiltinScene,
    generated,
    is_scene,
    make_scene,
)
from ssgi_cl.rasterize.scenes.generated import VIEWS, solids
from ssgi_cl.rasterize.scenes.generated.chance import Chance
from ssgi_cl.rasterize.scenes.generated.model import PLASTER, Model, upright_to
from ssgi_cl.rasterize.scenes.generated.views import Candidate, Surroundings, chosen

from .meshes import front_depth, made, slow_but

CLOSED_KINDS = ("chambers", "colonnade", "machine", "street")
"""Kinds whose scenes are always closed; those of rooms are sometimes."""


@pytest.fixture(params=KINDS)
def built(request: pytest.FixtureRequest) -> BuiltinScene:
    return made(f"{request.param}-3")


def is_closed(scene: Scene) -> bool:
    """Return whether every edge has as many triangles in one direction as in the other."""
    bits = (scene.positions + np.float32(0.0)).view(np.uint32).astype(np.uint64)  # -0 is 0
    # A number for each place; two of 100,000 places have the same one with a chance of 1e-9.
    number = bits @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    corners = np.unique(number, return_inverse=True)[1][scene.triangles].astype(np.int64)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    there, back = (np.sort(a[a < b] * len(number) + b[a < b]) for a, b in ((start, end), (end, start)))
    return np.array_equal(there, back)


def volume(part: Part) -> float:
    corners = part.positions[part.triangles]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def as_scene(part: Part) -> Scene:
    model = Model()
    model.add(part, PLASTER)
    return model.scene()


def winding(corners: np.ndarray, point: np.ndarray) -> float:
    """Return how often closed surfaces go round a point: the sum of the signed solid angles of triangles over 4 pi."""
    a, b, c = np.moveaxis((to := corners - point) / np.linalg.norm(to, axis=2, keepdims=True), 1, 0)
    volume = (a * np.cross(b, c)).sum(axis=1)
    return float(np.arctan2(volume, 1.0 + (a * b + b * c + c * a).sum(axis=1)).sum() / (2.0 * np.pi))


@pytest.mark.parametrize("kind", [slow_but(kind, "room") for kind in KINDS])
def test_same_name_gives_bit_identical_results(kind: str) -> None:
    first, again = made(f"{kind}-3"), generated(f"{kind}-3")
    for name in ("positions", "normals", "colors", "triangles", "material_ids"):
        assert getattr(first.scene, name).tobytes() == getattr(again.scene, name).tobytes(), name
    assert (first.eye, first.target, first.more_views) == (again.eye, again.target, again.more_views)


def test_closed_scenes_are_watertight_and_open_ones_are_not(built: BuiltinScene) -> None:
    assert 5_000 < len(built.scene.triangles) < 160_000, "as many as small real scenes have"
    assert is_closed(built.scene) == built.closed
    if built.name.split("-")[0] in CLOSED_KINDS:
        assert built.closed


def test_rooms_are_closed_or_open() -> None:
    assert {made(f"room-{seed}").closed for seed in (3, 8)} == {True, False}


def test_normals_face_as_the_triangles_do(built: BuiltinScene) -> None:
    scene = built.scene
    corners = scene.positions[scene.triangles].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(faces, axis=1)
    large = lengths > 1e-7  # of what is smaller, float32 positions turn the face
    facing = np.einsum("ij,ij->i", scene.normals[scene.triangles[:, 0]], faces)
    assert (facing[large] > 0.0).mean() > 0.9995


def test_views_are_outside_of_geometry_and_show_much(built: BuiltinScene, runtime: Runtime) -> None:
    views = built.views()
    assert len(views) == VIEWS
    corners = (built.scene.positions[built.scene.triangles] + built.scene.origin).astype(np.float64)
    for view in views:
        if built.closed:
            assert abs(winding(corners, np.array(view.eye))) < 0.01
        camera = view.camera(64, 48)
        depth = front_depth(built.scene, camera, runtime)
        seen = np.isfinite(depth)
        # At least half of the picture, and of that no more than an eighth is close to the eye.
        assert seen.mean() > 0.5
        assert (depth[seen] < 0.5).mean() < 0.125
        assert np.median(depth[seen]) > 1.0


def test_every_kind_renders(built: BuiltinScene, runtime: Runtime) -> None:
    given = {"bounces": 0, "ao": False, "shadow_size": 256, "runtime": runtime}
    frame = gi.render(built.scene, built.camera(64, 48), built.lights, **given)
    image = frame.image.astype(np.float64)
    assert image.shape == (48, 64, 3)
    assert image.std() > 10.0
    assert 20.0 < image.mean() < 235.0
    size = np.ptp(built.scene.bounds, axis=0).max()
    assert 0.01 * size < built.ao_radius < 0.2 * size
    assert any(isinstance(light, Environment) for light in built.lights)


@pytest.mark.parametrize(
    "name", ["attic-1", "room", "room-", "room-01", "room--1", "room-1.5", "Room-1", "room-1000000"]
)
def test_unknown_names_are_refused_with_the_kinds(name: str) -> None:
    assert not is_scene(name)
    kinds = "room, colonnade, foliage, machine, street, terrain, chambers, panel, window, rods, spot, point"
    message = f"scene is '{name}': expected one of cornell_box.*, or KIND-SEED with KIND one of {kinds} and SEED an "
    with pytest.raises(ValueError, match=f"{message}integer from 0 to 999999"):
        make_scene(name)


def test_sets_of_scenes_share_none() -> None:
    for first, second in ((TUNED_ON, VALIDATED_ON), (TUNED_ON, REPORTED), (VALIDATED_ON, REPORTED)):
        assert not set(first) & set(second)
    for names in (TUNED_ON, VALIDATED_ON):
        assert {name.split("-")[0] for name in names} == set(KINDS)
        assert len(set(names)) == len(names)
    assert set(REPORTED) <= set(BUILTIN_SCENES)


@pytest.mark.parametrize("name", VALIDATION_ROOMS)
def test_rooms_of_validation_are_closed_lit_as_named_and_seen_from_within(name: str, runtime: Runtime) -> None:
    room = made(name)
    assert room.closed
    assert is_closed(room.scene)
    assert generated(name).scene.positions.tobytes() == room.scene.positions.tobytes()
    kind = name.split("-")[0]
    lit = {type(light).__name__ for light in room.own_lights}
    expected = {"spot": {"SpotLight"}, "point": {"PointLight"}, "window": {"DirectionalLight", "Environment"}}
    assert lit == expected.get(kind, set())
    emits = np.array([material.emits for material in room.scene.materials])[room.scene.material_ids]
    assert emits.any() == (kind in ("panel", "rods"))
    corners = (room.scene.positions[room.scene.triangles] + room.scene.origin).astype(np.float64)
    assert abs(winding(corners, np.array(room.eye))) < 0.01
    depth = front_depth(room.scene, room.camera(64, 48), runtime)
    assert np.isfinite(depth).mean() > 0.85
    assert (depth < 0.5).mean() < 0.125


def test_rooms_of_validation_are_of_kinds_that_nothing_is_tuned_on() -> None:
    assert len(set(VALIDATION_ROOMS)) == 12
    kinds = {name.split("-")[0] for name in VALIDATION_ROOMS}
    assert kinds == {"panel", "window", "rods", "spot", "point"}
    assert not kinds & {name.split("-")[0] for name in (*TUNED_ON, *VALIDATED_ON)}
    sizes = [np.ptp(made(name).scene.bounds, axis=0).tolist() for name in VALIDATION_ROOMS]
    assert len({tuple(np.round(size, 3)) for size in sizes}) == 12


# ---- what scenes are made with


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (solids.cylinder(64), np.pi),
        (solids.cone(64), np.pi / 3.0),
        (solids.sphere(4), 4.0 / 3.0),
        (solids.sphere(64), 4.0 / 3.0 * np.pi),
        (solids.torus(1.0, 0.25, 96, 48), 2.0 * np.pi**2 * 0.25**2),
        (solids.prism([(1, 0), (0, 1), (-1, 0), (0, -1)], 0.5), 1.0),
        (solids.arch(2.0, 0.5, 0.3, 96), 0.5 * np.pi * (1.5**2 - 1.0) * 0.3),
        (solids.cushion(1.0, 64), 4.0 / 3.0 * np.pi),
    ],
    ids=["cylinder", "cone", "octahedron", "sphere", "torus", "prism", "arch", "cushion"],
)
def test_solids_are_closed_and_hold_their_volume(part: Part, expected: float) -> None:
    assert is_closed(as_scene(part))
    # Facets of 64 segments leave 0.3 % of the volume out.
    assert volume(complete(part, 0.7)) == pytest.approx(expected, rel=5e-3)


def test_sheet_with_thickness_is_closed_and_without_is_open() -> None:
    x, y = np.meshgrid(np.linspace(0, 3, 7), np.linspace(2, 0, 5))
    points = np.stack([x, y, 0.0 * x], axis=-1)
    thick = solids.sheet(points, 0.1)
    assert is_closed(as_scene(thick))
    assert volume(thick) == pytest.approx(0.6)
    assert not is_closed(as_scene(solids.sheet(points, 0.0)))


def test_chance_depends_on_kind_and_seed_alone() -> None:
    numbers = Chance("room", 7).uniforms(-1.0, 3.0, 4000)
    assert (numbers == Chance("room", 7).uniforms(-1.0, 3.0, 4000)).all()
    assert (numbers != Chance("room", 8).uniforms(-1.0, 3.0, 4000)).all()
    assert (numbers != Chance("street", 7).uniforms(-1.0, 3.0, 4000)).all()
    assert numbers.min() >= -1.0
    assert numbers.max() < 3.0
    # The mean of 4000 has a standard error of 0.018.
    assert abs(numbers.mean() - 1.0) < 0.08
    drawn = [Chance("room", seed).whole(2, 4) for seed in range(60)]
    assert set(drawn) == {2, 3, 4}


def test_frames_turn_and_move_what_is_added_inside() -> None:
    model = Model()
    with model.at((1.0, 0.0, 0.0), 0.5 * np.pi), model.at((0.0, 0.0, 2.0)):
        model.bar((0, 0, 0), (0, 0, 1), 0.1, PLASTER)
    low, high = model.scene().bounds
    # +z turns to +x: from x = 1 + 2 on for 1 m, 0.1 to the sides (less a facet's sag).
    np.testing.assert_allclose([low[0], high[0]], [3.0, 4.0], rtol=0, atol=1e-6)
    assert abs(low[2] + 0.1) < 0.01
    np.testing.assert_allclose(upright_to((0, 0, 2.0)) @ [0, 1, 0], [0, 0, 1], rtol=0, atol=1e-15)


def walled() -> Surroundings:
    model = Model()
    model.box((-2, -2, -2), (2, 2, -1), PLASTER)
    model.box((-0.5, -0.5, 1.0), (0.5, 0.5, 2.0), PLASTER)
    return Surroundings(model.parts())


def test_eyes_are_free_outside_of_what_is_closed_and_away_from_surfaces() -> None:
    around = walled()
    assert around.winding((0, 0, 1.5)) == pytest.approx(1.0)
    assert around.winding((0, 0, 0)) == pytest.approx(0.0, abs=1e-9)
    assert around.is_free((0, 0, 0), 0.9)
    assert not around.is_free((0, 0, 0.5), 0.6)
    assert not around.is_free((0, 0, -1.5), 0.1)
    # Beside an edge: the nearest point is no vertex and not inside of a face.
    assert around.is_free((0.8, 0.0, 0.6), 0.49)
    assert not around.is_free((0.8, 0.0, 0.6), 0.51)


def test_probe_finds_the_distance_of_the_nearest_surface() -> None:
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.6, width=5, height=3)
    seen = walled().distances(camera)
    ways = camera.unproject(np.ones((3, 5)))
    np.testing.assert_allclose(seen, np.linalg.norm(ways, axis=-1), rtol=1e-5)
    away = gi.Camera.look_at((0, 0, 0), (1, 0, 0), yfov=0.2, width=3, height=3)
    assert np.isinf(walled().distances(away)).all()


def test_view_that_shows_nothing_comes_last_and_one_inside_never() -> None:
    inside, empty = Candidate((0, 0, 1.5), (0, 0, 0)), Candidate((0, 0, 0), (1, 0, 0))
    good = Candidate((0, 0, 0.5), (0, 0, -1.0))
    asked = {"yfov": 0.6, "clearance": 0.2, "coverage": 0.9}
    assert chosen(walled(), [inside, empty, good], 1, **asked) == [good]
    assert chosen(walled(), [inside, empty, good], 2, **asked) == [good, empty]
    with pytest.raises(RuntimeError, match="2 of 3 views are free"):
        chosen(walled(), [inside, empty, good], 3, **asked)
