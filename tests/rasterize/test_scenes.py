"""The scenes made by code: what their documentation promises."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from ssgi_cl.core.lights import DirectionalLight, Environment, SpotLight
from ssgi_cl.rasterize.parts import complete
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.rasterize.scenes.scatter import copies, noise, rotation, shares
from ssgi_cl.rasterize.scenes.shapes import ball, box, pole

from .meshes import made, slow_but


@pytest.fixture(params=sorted(BUILTIN_SCENES))
def built(request: pytest.FixtureRequest) -> BuiltinScene:
    return made(request.param)


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


def test_normals_are_unit_and_face_as_the_triangles_do(built: BuiltinScene) -> None:
    normals = built.scene.normals
    # Unit length to float32 rounding.
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0, atol=1e-6)
    facing = np.einsum("ij,ij->i", normals[built.scene.triangles[:, 0]], face_normals(built))
    # Only faces that crease smoothing joins share a normal, so none turns away from its own.
    assert facing.min() > 0.3


@pytest.mark.parametrize("name", [slow_but(name, "cornell_box", "parlour") for name in BUILTIN_SCENES])
def test_the_same_scene_is_made_each_time_and_quickly(name: str) -> None:
    built = made(name)
    start = time.perf_counter()
    again = BUILTIN_SCENES[name]()
    # Array operations take about a second for the hall, a fraction for others, even on a busy
    # machine not much more; a loop over triangles would take a minute.
    assert time.perf_counter() - start < (20.0 if name == "hall" else 10.0)
    np.testing.assert_array_equal(built.scene.positions, again.scene.positions)
    np.testing.assert_array_equal(built.scene.triangles, again.scene.triangles)


def test_camera_stands_free_and_looks_at_the_scene(built: BuiltinScene) -> None:
    camera = built.camera(320, 200)
    assert camera.size == (200, 320)
    size = np.ptp(built.scene.bounds, axis=0).max()
    assert 0.01 * size < built.ao_radius < 0.5 * size
    assert made(built.name) is built, "it is known by its name"
    points = centres(built)
    distance = np.linalg.norm(points - np.array(built.eye), axis=1).min()
    assert distance > 10 * camera.near
    ahead = (points @ camera.view[2, :3] + camera.view[2, 3]) < 0
    # What lies behind the camera is at most its surroundings.
    assert ahead.mean() > 0.8


def test_cornell_box_has_the_measured_size() -> None:
    box = made("cornell_box")
    assert len(box.scene.triangles) == 32
    # float32 metres.
    np.testing.assert_allclose(box.scene.bounds, [[0, 0, 0], [0.556, 0.5488, 0.5592]], rtol=0, atol=1e-7)


def test_cornell_box_has_red_on_the_left_and_green_on_the_right() -> None:
    box = made("cornell_box")
    points = centres(box)
    assert columns(box, points[material_of(box, "red")]).max() < -0.1
    assert columns(box, points[material_of(box, "green")]).min() > 0.1


def test_walls_of_the_cornell_box_face_inwards_and_its_blocks_outwards() -> None:
    box = made("cornell_box")
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
    box = made("cornell_box")
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


def test_hall_is_large_with_sun_sky_a_spot_and_bars_of_less_than_two_centimetres() -> None:
    built = made("hall")
    assert len(built.scene.triangles) >= 200_000
    assert 28.0 < np.ptp(built.scene.bounds[:, 2]) < 36.0
    assert {type(light) for light in built.lights} == {DirectionalLight, Environment, SpotLight}
    scene = built.scene
    iron = scene.triangles[material_of(built, "iron")]
    corners = scene.positions[iron]
    # The long sides of a bar's eight facets: thin across, long upwards.
    tall = np.ptp(corners[..., 1], axis=1) > 0.3
    wide = np.hypot(np.ptp(corners[tall, :, 0], axis=1), np.ptp(corners[tall, :, 2], axis=1))
    assert tall.sum() > 1000
    assert wide.max() < 0.02


def test_hall_has_saturated_cloth() -> None:
    names = {material.name: np.array(material.albedo) for material in made("hall").scene.materials}
    for channel, name in enumerate(("red cloth", "green cloth", "blue cloth")):
        others = np.delete(names[name], channel)
        assert names[name][channel] > 3 * others.max()


def test_every_view_stands_free_and_sees_the_scene(built: BuiltinScene) -> None:
    points = centres(built)
    for view in built.views():
        camera = view.camera(64, 48)
        distance = np.linalg.norm(points - np.array(view.eye), axis=1).min()
        # Half of the reach of ambient occlusion, so that nothing fills the picture.
        assert distance > 0.5 * view.ao_radius
        in_view = points @ camera.view[:3, :3].T + camera.view[:3, 3]
        slopes = np.abs(in_view[:, :2] / in_view[:, 2:])
        reach = math.tan(0.5 * view.yfov)
        seen = (in_view[:, 2] < 0) & (slopes[:, 0] < reach * 64 / 48) & (slopes[:, 1] < reach)
        assert seen.mean() > 0.05


def test_views_are_the_own_one_and_then_the_others() -> None:
    built = made("workshop")
    first, *others = built.views()
    assert (first.eye, first.target) == (built.eye, built.target)
    assert tuple((view.eye, view.target) for view in others) == built.more_views
    assert all(view.scene is built.scene for view in others)
    assert all(len(view.views()) == 1 for view in others)


@pytest.mark.parametrize("name", ["parlour", "workshop", "terrace"])
def test_small_scenes_are_compact(name: str) -> None:
    built = made(name)
    assert 10_000 <= len(built.scene.triangles) <= 150_000
    assert len(built.views()) >= 2


def test_workshop_is_a_room_with_wires_of_millimetres() -> None:
    built = made("workshop")
    scene = built.scene
    rubber = scene.triangles[material_of(built, "rubber")]
    edges = np.linalg.norm(scene.positions[rubber] - np.roll(scene.positions[rubber], 1, axis=1), axis=-1)
    # The shortest edges are sides of an octagon round a wire 3 mm across.
    assert edges.min() < 0.002
    assert built.scene.bounds[1, 1] - built.scene.bounds[0, 1] < 4.0


def test_parlour_is_closed() -> None:
    """Floor, ceiling and four walls each reach from end to end."""
    scene = made("parlour").scene
    corners = scene.positions[scene.triangles]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    for axis in range(3):
        across = [i for i in range(3) if i != axis]
        for bound in (low[axis], high[axis]):
            side = corners[(corners[..., axis] == bound).all(axis=1)][..., across]
            # The walls stand within a floor and a ceiling of .25 m.
            np.testing.assert_allclose(np.ptp(side, axis=(0, 1)), (high - low)[across], atol=0.51)


def test_terrace_has_sky_above_and_solid_leaves() -> None:
    built = made("terrace")
    assert {type(light) for light in built.lights} == {DirectionalLight, Environment}
    scene = built.scene
    leaves = scene.triangles[material_of(built, "leaf")]
    corners = scene.positions[leaves].astype(np.float64)
    # Signed volume: each leaf is closed and faces outwards.
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    each = volume.reshape(-1, 8).sum(axis=1)
    # Coordinates of 14 m in float32 leave about 1e-5 of a leaf's 1e-5 m^3 in doubt.
    assert (each > 0.0).all()


def test_shares_depend_on_the_seed_alone() -> None:
    # The bits of PCG64 for a seed are fixed for good; these are its first three for 7.
    np.testing.assert_allclose(shares(7, 3), [0.625095467, 0.897213801, 0.77568569], rtol=0, atol=1e-9)
    assert (shares(7, 100) != shares(8, 100)).all()
    values = shares(1, 10000)
    assert values.min() >= 0.0
    assert values.max() < 1.0
    # The mean of 10,000 has a standard error of 0.003.
    assert abs(values.mean() - 0.5) < 0.012


def test_rotation_turns_by_the_right_hand() -> None:
    turned = rotation((0.0, 0.0, 2.0), [0.5 * np.pi])[0] @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], rtol=0, atol=1e-15)


def test_copies_are_scaled_then_turned_then_moved() -> None:
    part = complete(box((0, 0, 0), (1, 1, 1)), 0.5)
    both = copies(
        part, [(5.0, 0.0, 0.0), (0.0, 7.0, 0.0)],
        turns=rotation((0.0, 1.0, 0.0), [0.0, 0.5 * np.pi]), scales=[(2.0, 1.0, 3.0)] * 2,
    )  # fmt: skip
    first, second = both.positions.reshape(2, -1, 3)
    np.testing.assert_allclose(first.max(axis=0), [7.0, 1.0, 3.0])
    # A quarter turn about y takes +z to +x and +x to -z.
    np.testing.assert_allclose(second.max(axis=0), [3.0, 8.0, 0.0], atol=1e-12)
    assert len(both.triangles) == 2 * len(part.triangles)
    assert both.triangles.max() == len(both.positions) - 1


def test_normals_of_stretched_copies_stay_normal() -> None:
    part = complete(ball(1.0, 24), 1.0)
    stretched = complete(copies(part, [(0.0, 0.0, 0.0)], scales=[(3.0, 1.0, 1.0)]), 1.0)
    assert stretched.normals is not None
    gradient = stretched.positions / [9.0, 1.0, 1.0]
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    # Averaged over facets of 15 degrees, stretched by 3; scaled like positions they would be 53
    # degrees off.
    assert np.einsum("ij,ij->i", stretched.normals, gradient).min() > 0.97


def test_copies_need_normals() -> None:
    with pytest.raises(ValueError, match="box has no normals: expected a completed part"):
        copies(box((0, 0, 0), (1, 1, 1)), [(0.0, 0.0, 0.0)])


def test_noise_is_smooth_and_within_0_and_1() -> None:
    x, y = np.meshgrid(np.linspace(0.0, 30.0, 601), np.linspace(0.0, 30.0, 601))
    values = noise(5, x, y)
    assert values.min() >= 0.0
    assert values.max() < 1.0
    assert values.std() > 0.1
    # The cubic blend has a slope of at most 1.5 a unit, here 0.05 a step.
    assert np.abs(np.diff(values, axis=1)).max() <= 1.5 * 0.05


def test_pole_runs_from_end_to_end_with_its_radius() -> None:
    part = pole((1.0, 2.0, 3.0), (1.0, 2.0, 7.0), 0.25, 16)
    np.testing.assert_allclose(np.ptp(part.positions, axis=0), [0.5, 0.5, 4.0], atol=1e-12)
    away = np.hypot(part.positions[:, 0] - 1.0, part.positions[:, 1] - 2.0)
    np.testing.assert_allclose(away, 0.25)
