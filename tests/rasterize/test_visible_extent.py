"""Defaults that come from what is seen: the radius of ambient occlusion, and the camera of scenes
with a ground, a backdrop or a dome, and of long ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import default_ao_radius
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.raster.default_camera import default_camera
from ssgi_cl.rasterize.raster.extent import Extent
from ssgi_cl.rasterize.raster.visible_extent import visible_extent

from .meshes import front_depth, made

FOV = 0.9  # radians
SHARED = Path(__file__).parents[3] / "shared" / "scenes"


def joined(*meshes: Any) -> Scene:
    return load_scene(trimesh.Scene(list(meshes)))


def ship(at: Sequence[float] = (0.0, 0.5, 0.0)) -> trimesh.Trimesh:
    """A body 3 units long of 1280 triangles, its lowest point at the height of `at` less 0.5."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    return mesh.apply_transform(np.diag([3.0, 1.0, 1.0, 1.0])).apply_translation(at)


def quad(size: float, parts: int = 1) -> trimesh.Trimesh:
    """A ground at y = 0 of 2 * parts^2 triangles that face up."""
    line = np.linspace(-0.5 * size, 0.5 * size, parts + 1)
    x, z = np.meshgrid(line, line, indexing="ij")
    vertices = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    first = (np.arange(parts)[:, None] * (parts + 1) + np.arange(parts)).reshape(-1, 1)
    row = parts + 1
    halves = np.array([[0, 1, row], [1, row + 1, row]])
    faces = (first[:, None] + halves).reshape(-1, 3)
    return trimesh.Trimesh(vertices, faces, process=False)


def inward(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)


def dome(radius: float) -> trimesh.Trimesh:
    """A sphere of 320 triangles that faces inward."""
    return inward(trimesh.creation.icosphere(subdivisions=2, radius=radius))


@cache
def city(blocks: int) -> Scene:
    """Houses along x, one in each 10 units, of other heights and depths."""
    rng = np.random.default_rng(8)
    houses = []
    for block in range(blocks):
        size = (8.0, rng.uniform(4.0, 9.0), rng.uniform(6.0, 9.0))
        house = trimesh.creation.box(size)
        houses.append(house.apply_translation((10.0 * block, 0.5 * size[1], 0.0)))
    return joined(*houses)


def seen_from(eye: Sequence[float], target: Sequence[float] = (0.0, 0.5, 0.0)) -> Camera:
    return Camera.look_at(eye, target, yfov=FOV, width=160, height=120)


def test_a_wall_that_fills_the_picture_has_the_picture_s_diagonal(runtime: Runtime) -> None:
    scene = joined(trimesh.creation.box((100.0, 100.0, 2.0)))
    camera = seen_from((0, 0, 8), (0, 0, 0))
    # 7 units away; every pixel has that depth, rounded to float32.
    expected = 2.0 * 7.0 * math.tan(0.5 * FOV) * math.hypot(1.0, 160 / 120)
    assert visible_extent(scene, camera, runtime=runtime) == pytest.approx(expected, rel=1e-5)


def test_an_orthographic_picture_has_its_own_diagonal(runtime: Runtime) -> None:
    scene = joined(trimesh.creation.box((100.0, 100.0, 2.0)))
    for eye in (8.0, 80.0):
        camera = Camera.orthographic((0, 0, eye), (0, 0, 0), view_height=3.0, width=160, height=120)
        assert visible_extent(scene, camera, runtime=runtime) == pytest.approx(5.0)


def test_it_is_never_more_than_the_scene(runtime: Runtime) -> None:
    scene = joined(trimesh.creation.box((1.0, 2.0, 2.0)))
    for eye in ((0, 0, 500), (0, 0, 5)):
        assert visible_extent(scene, seen_from(eye, (0, 0, 0)), runtime=runtime) <= 3.0 + 1e-6
    away = seen_from((0, 0, 50), (0, 0, 100))
    assert visible_extent(scene, away, runtime=runtime) == pytest.approx(3.0)


@pytest.mark.parametrize("scale", [1e-18, 1e15])
def test_it_scales_with_the_scene(runtime: Runtime, scale: float) -> None:
    def extent(size: float) -> float:
        body = ship().apply_scale(size)
        camera = seen_from((0, size, 5 * size), (0, 0, 0))
        return visible_extent(joined(body), camera, runtime=runtime)

    assert extent(scale) == pytest.approx(scale * extent(1.0), rel=1e-4)  # of float32 positions


@pytest.mark.parametrize("around", [[quad(1000.0)], [quad(126.0, 60)], [dome(60.0)], [quad(126.0), dome(62.0)]])
def test_what_is_around_an_object_hardly_changes_its_radius(runtime: Runtime, around: list[trimesh.Trimesh]) -> None:
    camera = seen_from((1.5, 1.5, 4.0))
    alone = default_ao_radius(joined(ship()), camera, runtime)
    radius = default_ao_radius(joined(ship(), *around), camera, runtime)
    assert 0.05 * 2.0 < alone < 0.05 * 3.4  # 5 % of the ship's length, about
    # At most 5 % of twice the diagonal of the ship's box, which `alone` has once.
    assert 0.5 * alone < radius < 2.01 * alone


def test_a_street_has_the_radius_of_its_houses_whatever_its_length(runtime: Runtime) -> None:
    radii = []
    for blocks in (10, 40):
        camera = seen_from((-12.0, 6.0, 14.0), (20.0, 3.0, 0.0))
        radii.append(default_ao_radius(city(blocks), camera, runtime))
    assert radii[1] == pytest.approx(radii[0], rel=0.1)
    assert 0.5 < radii[1] < 4.0  # units; houses are 4 to 9 high


@pytest.mark.parametrize("name", ["terrace", "room-3", "street-3", pytest.param("hall", marks=pytest.mark.slow)])
def test_built_in_views_get_about_the_radius_that_was_chosen_for_them(runtime: Runtime, name: str) -> None:
    built = made(name)
    radius = default_ao_radius(built.scene, built.camera(160, 120), runtime)
    assert 0.6 < radius / built.ao_radius < 1.6
    box = 0.05 * float(np.linalg.norm(np.ptp(built.scene.bounds, axis=0)))
    assert radius < 0.6 * box, "5 % of the box is too much in all of these"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hall", "street-1", "foliage-3"])
def test_small_motion_of_the_camera_changes_the_radius_as_little(runtime: Runtime, name: str) -> None:
    built = made(name)
    eye, target = np.array(built.eye), np.array(built.target)
    step = 0.002 * (target - eye)  # 0.2 % of the distance, for 20 frames
    radii = [
        default_ao_radius(
            built.scene, Camera.look_at(eye + k * step, target, built.up, yfov=built.yfov, width=80, height=60), runtime
        )
        for k in range(20)
    ]
    change = np.abs(np.diff(np.log(radii)))
    assert 0.0 < change.max() < 0.02, "a step is 0.2 % of the distance: ten times that is a jump"


def test_the_radius_depends_on_scene_and_camera_alone(runtime: Runtime) -> None:
    built = made("cornell_box")
    first, second = built.camera(160, 120), built.camera(160, 120).cropped(40, 30, 60, 40)
    large = built.camera(1600, 1200)
    values = [default_ao_radius(built.scene, camera, runtime) for camera in (first, second, first, large, second)]
    assert values[0] == values[2] == values[3]
    assert values[1] == values[4]


def test_render_takes_it_by_default(runtime: Runtime) -> None:
    built = made("room-3")
    camera = built.camera(80, 60)
    radius = default_ao_radius(built.scene, camera, runtime)

    def ao(**options: Any) -> Any:
        frame = gi.render(built.scene, camera, built.lights, bounces=0, outputs=("ao",), runtime=runtime, **options)
        return frame.ao

    np.testing.assert_array_equal(ao(), ao(ao_radius=radius))
    assert (ao() != ao(ao_radius=2.0 * radius)).any()


def test_a_frame_without_occlusion_draws_no_depth_map_for_it(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object, **more: object) -> float:
        raise AssertionError("it is not needed")

    monkeypatch.setattr("ssgi_cl.frame.renderer.visible_extent", refuse)
    built = made("cornell_box")
    for options in ({"ao": False}, {"ao_radius": 0.1}):
        gi.render(built.scene, built.camera(16, 12), built.lights, bounces=0, runtime=runtime, **options)
    with pytest.raises(AssertionError, match="not needed"):
        gi.render(built.scene, built.camera(16, 12), built.lights, bounces=0, runtime=runtime)


# --- the subject and the default camera --------------------------------------------------------


@pytest.mark.parametrize("around", [[], [quad(4.0)]])
def test_an_object_and_what_is_hardly_larger_are_the_subject_together(around: list[trimesh.Trimesh]) -> None:
    scene = joined(ship(), *around)
    np.testing.assert_array_equal(Extent.of_subject(scene).bounds, Extent.of(scene).bounds)


@pytest.mark.parametrize(
    "around", [[quad(20.0)], [quad(1000.0)], [quad(126.0, 20)], [dome(60.0)], [quad(126.0), dome(62.0)]]
)
def test_a_ground_or_a_dome_is_not_part_of_the_subject(around: list[trimesh.Trimesh]) -> None:
    subject = Extent.of_subject(joined(ship(), *around))
    np.testing.assert_allclose(subject.bounds, [[-1.5, 0, -0.5], [1.5, 1, 0.5]], atol=1e-5)


def test_a_fine_ground_is_not_part_of_a_much_smaller_subject() -> None:
    body = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    subject = Extent.of_subject(joined(body, quad(60.0, 100)))  # squares 0.6 wide
    np.testing.assert_allclose(subject.size, 1.0, atol=1e-3)


def test_coarse_things_beside_a_fine_one_are_no_backdrop() -> None:
    fine = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    coarse = [trimesh.creation.icosphere(subdivisions=0, radius=0.5) for _ in range(7)]
    row = [mesh.apply_translation((1.1 + 1.1 * i, 0.0, 0.0)) for i, mesh in enumerate(coarse)]
    scene = joined(fine, *row)
    np.testing.assert_array_equal(Extent.of_subject(scene).bounds, Extent.of(scene).bounds)


def test_the_air_between_two_objects_in_a_dome_is_no_room(runtime: Runtime) -> None:
    scene = joined(ship((-2.5, 0.5, 0.0)), ship((2.5, 0.5, 0.0)), dome(60.0))
    camera = default_camera(scene, 160, 120, FOV, runtime)
    assert not Extent.of_subject(scene).holds(camera.position)
    assert np.linalg.norm(camera.position) < 15.0


@pytest.mark.parametrize("name", ["parlour", "room-3", "cornell_box", pytest.param("hall", marks=pytest.mark.slow)])
def test_rooms_have_no_backdrop(name: str) -> None:
    scene = made(name).scene
    np.testing.assert_array_equal(Extent.of_subject(scene).bounds, Extent.of(scene).bounds)


def wall(size: float, distance: float) -> trimesh.Trimesh:
    """A wall behind the ship that faces +z."""
    mesh = quad(size)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 2, (1, 0, 0)))
    return mesh.apply_translation((0.0, 0.0, -distance))


@pytest.mark.parametrize("around", [[quad(1000.0)], [dome(60.0)], [quad(126.0), wall(126.0, 5.0)], [quad(126.0, 20)]])
def test_an_object_before_a_backdrop_fills_the_picture(runtime: Runtime, around: list[trimesh.Trimesh]) -> None:
    scene, body = joined(ship(), *around), joined(ship())
    camera = default_camera(scene, 160, 120, FOV, runtime)
    assert (camera.view[:3, :3] @ (0, 1, 0))[1] > 0.5
    both, alone = (front_depth(each, camera, runtime) for each in (scene, body))
    covered = np.isfinite(alone)
    # The ship is seen whole, large, and nothing stands before it.
    assert not covered[[0, -1]].any()
    assert not covered[:, [0, -1]].any()
    assert covered.mean() > 0.12
    np.testing.assert_allclose(both[covered], alone[covered], rtol=1e-3)


@pytest.mark.parametrize("blocks", [40, pytest.param(200, marks=pytest.mark.slow)])
def test_a_long_city_is_no_thin_strip(runtime: Runtime, blocks: int) -> None:
    scene = city(blocks)
    camera = default_camera(scene, 160, 120, FOV, runtime)
    covered = np.isfinite(front_depth(scene, camera, runtime))
    # Seen from the side, 400 units by 9 would be 3 rows of 120.
    assert np.ptp(np.nonzero(covered)[0]) > 50
    assert np.ptp(np.nonzero(covered)[1]) > 70
    assert covered.mean() > 0.06
    assert not covered[[0, -1]].any(), "all of it is in the picture"
    assert not covered[:, [0, -1]].any(), "all of it is in the picture"
    assert not Extent.of(scene).holds(camera.position)


def test_a_long_hall_is_seen_from_within(runtime: Runtime) -> None:
    scene = joined(inward(trimesh.creation.box((400.0, 8.0, 9.0))))
    assert Extent.of(scene).holds(default_camera(scene, 160, 120, FOV, runtime).position)


def test_a_room_on_a_large_ground_is_seen_through_its_gap(runtime: Runtime) -> None:
    room = inward(trimesh.creation.box((4.0, 3.0, 4.0)))
    room.update_faces(room.triangles_center[:, 2] < 1.9)
    room.apply_translation((0.0, 1.6, 0.0))
    scene = joined(room.subdivide(), quad(200.0))
    camera = default_camera(scene, 160, 120, FOV, runtime)
    np.testing.assert_allclose(-camera.view[2, :3], [0, 0, -1], atol=1e-6)
    assert 4.0 < camera.position[2] < 10.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "sponza/sponza.glb",
        "veach_ajar/veach-ajar.glb",
        "japanese_garden/japanese_garden.glb",
        "bunny/stanford-bunny.obj",
        "spot/spot_triangulated.obj",
        "teapot/teapot.obj",
    ],
)
def test_shared_scenes_fill_their_default_pictures(runtime: Runtime, name: str) -> None:
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f"needs the scene files in {SHARED}")
    scene = load_scene(path)
    camera = default_camera(scene, 160, 120, math.radians(50.0), runtime)
    covered = np.isfinite(front_depth(scene, camera, runtime))
    assert covered.mean() > 0.15
    box = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    assert 0.01 * box < default_ao_radius(scene, camera, runtime) <= 0.05 * box * (1.0 + 1e-9)
