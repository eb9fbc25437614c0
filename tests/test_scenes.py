"""The scenes made by code: what their documentation promises."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from ssgi_cl.lights import DirectionalLight, Environment, SpotLight
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene, cornell_box, hall


@pytest.fixture(scope="module", params=sorted(BUILTIN_SCENES))
def built(request: pytest.FixtureRequest) -> BuiltinScene:
    return BUILTIN_SCENES[request.param]()


def face_normals(built: BuiltinScene) -> np.ndarray:
    corners = built.scene.positions[built.scene.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def centres(built: BuiltinScene) -> np.ndarray:
    scene = built.scene
    return scene.positions[scene.triangles].mean(axis=1) + scene.origin


def material_of(built: BuiltinScene, name: str) -> np.ndarray:
    names = [material.name for material in built.scene.materials]
    return built.scene.material_ids == names.index(name)


def columns(built: BuiltinScene, points: np.ndarray) -> np.ndarray:
    """Return the horizontal image coordinates of world-space points, left to right."""
    camera = built.camera(64, 64)
    in_view = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    return in_view[:, 0] / -in_view[:, 2]


def test_scenes_are_known_by_their_names(built: BuiltinScene) -> None:
    assert BUILTIN_SCENES[built.name]().name == built.name


def test_normals_are_unit_and_face_as_the_triangles_do(built: BuiltinScene) -> None:
    normals = built.scene.normals
    # Unit length to float32 rounding.
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0, atol=1e-6)
    facing = np.einsum("ij,ij->i", normals[built.scene.triangles[:, 0]], face_normals(built))
    # Only faces that crease smoothing joins share a normal, so none turns away from its own.
    assert facing.min() > 0.3


def test_the_same_scene_is_made_each_time(built: BuiltinScene) -> None:
    again = BUILTIN_SCENES[built.name]()
    np.testing.assert_array_equal(built.scene.positions, again.scene.positions)
    np.testing.assert_array_equal(built.scene.triangles, again.scene.triangles)


def test_camera_stands_free_and_looks_at_the_scene(built: BuiltinScene) -> None:
    camera = built.camera(320, 200)
    assert camera.size == (200, 320)
    points = centres(built)
    distance = np.linalg.norm(points - np.array(built.eye), axis=1).min()
    assert distance > 10 * camera.near
    ahead = (points @ camera.view[2, :3] + camera.view[2, 3]) < 0
    # What lies behind the camera is at most its surroundings.
    assert ahead.mean() > 0.8


def test_ao_radius_suits_the_scale(built: BuiltinScene) -> None:
    size = np.ptp(built.scene.bounds, axis=0).max()
    assert 0.01 * size < built.ao_radius < 0.5 * size


def test_cornell_box_has_the_measured_size() -> None:
    box = cornell_box()
    assert len(box.scene.triangles) == 32
    # float32 metres.
    np.testing.assert_allclose(
        box.scene.bounds, [[0, 0, 0], [0.556, 0.5488, 0.5592]], rtol=0, atol=1e-7
    )


def test_cornell_box_has_red_on_the_left_and_green_on_the_right() -> None:
    box = cornell_box()
    points = centres(box)
    assert columns(box, points[material_of(box, "red")]).max() < -0.1
    assert columns(box, points[material_of(box, "green")]).min() > 0.1


def test_walls_of_the_cornell_box_face_inwards_and_its_blocks_outwards() -> None:
    box = cornell_box()
    middle = np.array([0.278, 0.2744, 0.2796])
    inward = np.einsum("ij,ij->i", face_normals(box), middle - centres(box))
    # Five walls and the light come first, two triangles each.
    assert (inward[:12] > 0).all()
    for block in (box.scene.triangles[12:22], box.scene.triangles[22:]):
        corners = box.scene.positions[block]
        out = corners.mean(axis=1) - corners.reshape(-1, 3).mean(axis=0)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", normals, out) > 0).all()


def test_spot_light_of_the_cornell_box_sends_out_what_its_quad_does() -> None:
    box = cornell_box()
    corners = box.scene.positions[box.scene.triangles[material_of(box, "light")]]
    edges = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(edges, axis=1).sum()
    (spot,) = box.lights
    assert isinstance(spot, SpotLight)
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(spot.cone_angle))
    flux = np.asarray(spot.intensity) * solid_angle
    # The area comes from float32 corners.
    np.testing.assert_allclose(flux, math.pi * area * np.array([17, 12, 4]), rtol=1e-5)
    height = corners[..., 1].min() + box.scene.origin[1]
    assert 0 < height - np.asarray(spot.position)[1] < 0.005


def test_hall_is_large_and_made_quickly() -> None:
    start = time.perf_counter()
    built = hall()
    # Array operations take about a second; a loop over triangles would take a minute.
    assert time.perf_counter() - start < 20.0
    assert len(built.scene.triangles) >= 200_000
    assert 28.0 < np.ptp(built.scene.bounds[:, 2]) < 36.0


def test_hall_has_sun_sky_and_a_spot() -> None:
    kinds = {type(light) for light in hall().lights}
    assert kinds == {DirectionalLight, Environment, SpotLight}


def test_hall_has_bars_of_less_than_two_centimetres() -> None:
    built = hall()
    scene = built.scene
    iron = scene.triangles[material_of(built, "iron")]
    corners = scene.positions[iron]
    # The long sides of a bar's eight facets: thin across, long upwards.
    tall = np.ptp(corners[..., 1], axis=1) > 0.3
    wide = np.hypot(np.ptp(corners[tall, :, 0], axis=1), np.ptp(corners[tall, :, 2], axis=1))
    assert tall.sum() > 1000
    assert wide.max() < 0.02


def test_hall_has_saturated_cloth() -> None:
    names = {material.name: np.array(material.albedo) for material in hall().scene.materials}
    for channel, name in enumerate(("red cloth", "green cloth", "blue cloth")):
        others = np.delete(names[name], channel)
        assert names[name][channel] > 3 * others.max()
