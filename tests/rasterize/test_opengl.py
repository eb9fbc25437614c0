"""The OpenGL backend against planes and triangles whose image is known exactly."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.bench.peers import pyrender
from ssgi_cl.core.camera import Camera, perspective_matrix
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.rasterize.raster import opengl

from . import meshes

Doubles = NDArray[np.float64]


pytestmark = pytest.mark.usefixtures("opengl_runs")


def scene_of(corners: ArrayLike, *, normals: ArrayLike | None = None, **rest: Any) -> Scene:
    """Make a scene of separate triangles [triangles, 3, 3], with their own normals by default."""
    corners = np.asarray(corners, np.float64)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    given = np.repeat(flat, 3, axis=0) if normals is None else normals
    return meshes.scene_of(corners.reshape(-1, 3), normals=given, **rest)


def square(depth: float, half: float = 100.0) -> Doubles:
    """Two triangles that face +z at z = -depth, uv (0, 0) at the bottom left by `UVS`."""
    a, b, c, d = ((x * half, y * half, -depth) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.array([[a, b, c], [a, c, d]])


UVS = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]], np.float32)


def rays(camera: Camera) -> tuple[Doubles, Doubles]:
    """World-space start and direction [rows, columns, 3] of every pixel; t is linear depth."""
    rows, columns = camera.size
    near = camera.unproject(np.full((rows, columns), 1.0, np.float32))
    return 2 * near - (far := camera.unproject(np.full((rows, columns), 2.0, np.float32))), (far - near)


def cast(scene: Scene, camera: Camera, layer: int = 0) -> tuple[Doubles, NDArray[np.bool_]]:
    """Return depth [rows, columns] by rays in float64, and where it is safe from edges."""
    start, direction = rays(camera)
    corners = scene.positions[scene.triangles].astype(np.float64) + scene.origin
    hits = np.full((len(corners), *camera.size), np.inf)
    safe = np.ones(camera.size, bool)
    for index, (a, b, c) in enumerate(corners):
        normal = np.cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((a - start) @ normal) / (direction @ normal)
            point = start + depth[..., None] * direction
            inside = np.ones(camera.size, bool)
            for p, q in ((a, b), (b, c), (c, a)):
                distance = np.cross(q - p, point - p) @ normal / np.linalg.norm(q - p)
                # in pixels: distance from the edge's line over the footprint of a pixel
                distance /= np.linalg.norm(normal) * np.abs(depth)
                inside &= distance > 0
                safe &= ~(np.abs(distance) < 1e-3) | ~np.isfinite(distance)
        inside &= (depth > camera.near) & (depth < camera.far)
        hits[index] = np.where(inside, depth, np.inf)
    result: Doubles = np.sort(hits, axis=0)[layer]
    return result, safe


def check_against_rays(scene: Scene, camera: Camera, rtol: float = 2e-6, layer: int = 0) -> None:
    depth = opengl.gbuffer_arrays(scene, camera, layer + 1)["depth"][layer]
    expected, safe = cast(scene, camera, layer)
    assert safe.mean() > 0.8
    assert np.isfinite(expected).any()
    np.testing.assert_allclose(depth[safe], expected[safe], rtol=rtol)


def turned(angle: float = 0.9, distance: float = 6.0) -> Doubles:
    """A large square, turned about +x and +y, `distance` in front of a camera at the origin."""
    cos, sin = math.cos(angle), math.sin(angle)
    about_x = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    about_y = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    corners: Doubles = square(0.0, 3.0) @ (about_x @ about_y).T - (0, 0, distance)
    return corners


CAMERAS = {
    "usual": Camera.look_at((0, 0, 0), (0, 0, -1), width=64, height=48, near=0.01, far=50.0),
    "infinite": Camera.look_at((0, 0, 0), (0, 0, -1), width=64, height=48, near=1e-4),
    "reversed": Camera.look_at((0, 0, 0), (0, 0, -1), width=64, height=48, near=1e-3, reversed_z=True),
    "orthographic": Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=5.0, width=64, height=48, far=40.0),
    "intrinsics": Camera.from_intrinsics(70.0, 55.0, 20.0, 31.5, width=64, height=48),
    "off-centre": Camera(
        view=np.eye(4), projection=perspective_matrix(1.3, 1.7, 0.3, -0.2, 0.1, 80.0), width=33, height=57
    ),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_a_plane_has_exactly_its_depth(name: str) -> None:
    found = opengl.gbuffer_arrays(scene_of(square(3.7)), CAMERAS[name], 1)
    rows, columns = CAMERAS[name].size
    assert found["depth"].shape == (1, rows, columns)
    assert {array.dtype for array in found.values()} == {np.dtype(np.float32)}
    np.testing.assert_allclose(found["depth"], 3.7, rtol=2e-7)  # an ulp or two
    np.testing.assert_allclose(found["normal"], np.broadcast_to([0, 0, 1], (1, rows, columns, 3)))
    np.testing.assert_allclose(found["albedo"], 0.8, rtol=1e-6)
    assert not found["emission"].any()


@pytest.mark.parametrize("name", CAMERAS)
def test_a_turned_plane_is_where_rays_find_it(name: str) -> None:
    check_against_rays(scene_of(turned()), CAMERAS[name])


def test_a_camera_elsewhere_sees_the_same_as_its_rays() -> None:
    camera = Camera.look_at((3, 4, 2), (0.3, 0.1, -6), up=(0.1, 1, 0), width=50, height=41)
    check_against_rays(scene_of(turned()), camera)


def test_row_zero_is_on_top_and_column_zero_on_the_left() -> None:
    corner = square(4.0, 1.0) * (0.2, 0.2, 1) + (-1.5, 1.2, 0)  # up and to the left
    depth = opengl.gbuffer_arrays(scene_of(corner), CAMERAS["usual"], 1)["depth"][0]
    rows, columns = np.nonzero(np.isfinite(depth))
    assert rows.size > 0
    assert rows.max() < 24
    assert columns.max() < 32


def test_layers_go_from_front_to_back() -> None:
    corners = np.concatenate([square(9.0), square(2.0, 0.5), square(5.0)])
    materials = tuple(Material(albedo=(value,) * 3, emission=(0, value, 0)) for value in (0.1, 0.9))
    scene = scene_of(corners, materials=materials, material_ids=[0, 0, 1, 1, 0, 0])
    found = opengl.gbuffer_arrays(scene, CAMERAS["usual"], 4)
    middle = found["depth"][:, 24, 32]
    np.testing.assert_allclose(middle, [2.0, 5.0, 9.0, np.inf], rtol=2e-7)
    np.testing.assert_allclose(found["depth"][:, 0, 0], [5.0, 9.0, np.inf, np.inf], rtol=2e-7)
    np.testing.assert_allclose(found["albedo"][:, 24, 32, 0], [0.9, 0.1, 0.1, 0.0], rtol=1e-6)
    np.testing.assert_allclose(found["emission"][:, 24, 32, 1], [0.9, 0.1, 0.1, 0.0], rtol=1e-6)
    assert not found["normal"][3].any()


@pytest.mark.parametrize("name", ["usual", "orthographic"])
def test_surfaces_closer_than_the_peel_factor_are_one(name: str) -> None:
    corners = np.concatenate([square(4.0), square(4.0 * (1 + 4e-6)), square(4.0 * (1 + 3e-5))])
    depth = opengl.gbuffer_arrays(scene_of(corners), CAMERAS[name], 3)["depth"][:, 20, 20]
    np.testing.assert_allclose(depth, [4.0, 4.0 * (1 + 3e-5), np.inf], rtol=2e-7)


def test_many_random_triangles_are_where_rays_find_them() -> None:
    rng = np.random.default_rng(3)
    corners = rng.uniform((-4, -4, -12), (4, 4, -2), (40, 1, 3)) + rng.normal(size=(40, 3, 3))
    for layer in (0, 2):
        for name in ("usual", "orthographic"):
            camera = CAMERAS[name]
            depth = opengl.gbuffer_arrays(scene_of(corners), camera, layer + 1)["depth"][layer]
            expected, safe = cast(scene_of(corners), camera, layer)
            # rtol: a plane seen at a grazing angle moves by more than an ulp with the ray's.
            np.testing.assert_allclose(depth[safe], expected[safe], rtol=2e-5)


def test_a_triangle_across_the_near_plane_is_cut_there() -> None:
    floor = np.array([[(-30, -1, 20), (30, -1, 20), (0, -1, -60)]], np.float64)
    for near in (0.01, 1.0, 3.0):
        camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=1.6, width=64, height=48, near=near)
        check_against_rays(scene_of(floor), camera)


def test_triangle_data_survives_clipping_and_draw_calls() -> None:
    floor = np.array([[(-30, -1, 20), (30, -1, 20), (0, -1, -60)]], np.float64)
    corners = np.concatenate([turned(), floor, turned(0.3, 9.0), floor - (0, 0.5, 0)])
    materials = tuple(Material(albedo=(value,) * 3) for value in (0.25, 0.5, 0.75))
    scene = scene_of(corners, materials=materials, material_ids=[2, 0, 1, 0, 2, 1])
    camera = CAMERAS["infinite"]
    check_against_rays(scene, camera, rtol=1e-5)
    check_against_rays(scene, camera, rtol=1e-5, layer=1)


def test_what_lies_behind_or_beyond_is_not_seen() -> None:
    corners = np.concatenate([square(-3.0), square(0.005), square(60.0)])
    for name in ("usual", "orthographic"):
        camera = CAMERAS[name]
        beyond = scene_of(corners[[0, 1, 4, 5]])
        assert np.isinf(opengl.gbuffer_arrays(beyond, camera, 2)["depth"]).all()


def test_a_scene_far_from_the_origin_looks_like_one_at_the_origin() -> None:
    origin = np.array([1e6, -2e6, 3e6])
    near = opengl.gbuffer_arrays(scene_of(turned()), CAMERAS["usual"], 2)
    camera = Camera.look_at(origin, origin - (0, 0, 1), width=64, height=48, near=0.01, far=50.0)
    far = opengl.gbuffer_arrays(scene_of(turned(), origin=origin), camera, 2)
    for name, array in near.items():
        np.testing.assert_allclose(far[name], array, rtol=1e-6, atol=1e-6, err_msg=name)


def test_normals_stay_as_the_mesh_says_on_both_sides() -> None:
    slanted = np.array([0.6, 0.0, 0.8])
    back = square(4.0)[:, ::-1]  # seen from behind
    scene = scene_of(back, normals=np.tile(-slanted, (6, 1)))
    camera = CAMERAS["usual"]
    normal = opengl.gbuffer_arrays(scene, camera, 1)["normal"][0]
    np.testing.assert_allclose(normal, np.broadcast_to(-slanted, normal.shape), atol=1e-6)


def test_interpolated_normals_have_unit_length_in_perspective() -> None:
    corners = turned()
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(6, 3)) * 0.4 + (0, 0, 1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    camera = CAMERAS["usual"]
    found = opengl.gbuffer_arrays(scene_of(corners[:1], normals=normals[:3]), camera, 1)
    there = np.isfinite(found["depth"][0])
    points = camera.unproject(found["depth"][0])[there]
    a, b, c = corners[0]
    weights = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), (points - a).T, rcond=None)[0]
    expected = normals[0] + weights.T @ (normals[1:3] - normals[0])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    # atol: the rasteriser interpolates in float32 from vertices snapped to 1/256 px.
    np.testing.assert_allclose(found["normal"][0][there], expected, atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(found["normal"][0][there], axis=1), 1, atol=1e-6)


def test_albedo_is_material_times_colour_times_linear_texture() -> None:
    texture = np.full((4, 4, 4), 255, np.uint8)
    texture[:2, :, :3] = 188  # the upper half
    texture[2:, :, :3] = (255, 64, 0)
    materials = (Material(albedo=(0.8, 0.6, 1.0), texture=0),)
    scene = scene_of(square(4.0, 1.0), uvs=UVS, colors=[0.5, 1.0, 1.0], materials=materials, textures=(texture,))
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=2, width=64, height=64)
    albedo = opengl.gbuffer_arrays(scene, camera, 1)["albedo"][0]
    linear = ((np.array([188, 64]) / 255 + 0.055) / 1.055) ** 2.4
    upper, lower = linear[0] * np.array([0.4, 0.6, 1.0]), np.array([0.4, 0.6 * linear[1], 0.0])
    # Away from the filter's transitions; atol: drivers may decode sRGB to half a code of 8 bits.
    np.testing.assert_allclose(albedo[14:18, 14:50], np.broadcast_to(upper, (4, 36, 3)), atol=2e-3)
    np.testing.assert_allclose(albedo[46:50, 14:50], np.broadcast_to(lower, (4, 36, 3)), atol=2e-3)


def test_a_minified_texture_averages_linear_light() -> None:
    texture = np.zeros((256, 256, 4), np.uint8)
    texture[::2, ::2] = texture[1::2, 1::2] = 255
    texture[..., 3] = 255
    material = Material(albedo=(1.0, 1.0, 1.0), texture=0)
    scene = scene_of(square(4.0, 1.0), uvs=UVS * 4, materials=(material,), textures=(texture,))
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=2, width=32, height=32)
    albedo = opengl.gbuffer_arrays(scene, camera, 1)["albedo"][0]
    np.testing.assert_allclose(albedo, 0.5, atol=5e-3)  # mip levels are stored in 8 bits


def test_holes_are_cut_where_alpha_is_below_the_cutoff() -> None:
    texture = np.full((2, 2, 4), 255, np.uint8)
    texture[:, 0, 3] = 100  # the left half
    corners = np.concatenate([square(4.0, 1.0), square(6.0)])
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=2, width=32, height=32)
    cases = (1.0, 0.5, 6.0, 4.0), (1.0, 0.0, 4.0, 4.0), (0.4, 0.5, 6.0, 6.0), (1.0, 0.3, 4.0, 4.0)
    for alpha, cutoff, left, right in cases:
        materials = (Material(texture=0, alpha=alpha, alpha_cutoff=cutoff), Material())
        of_both = {"uvs": np.concatenate([UVS, UVS]), "material_ids": [0, 0, 1, 1]}
        scene = scene_of(corners, **of_both, materials=materials, textures=(texture,))
        depth = opengl.gbuffer_arrays(scene, camera, 1)["depth"][0]
        np.testing.assert_allclose(depth[:, 6:10], left, rtol=2e-7)
        np.testing.assert_allclose(depth[:, 22:26], right, rtol=2e-7)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (17, 31)])
def test_odd_sizes_are_filled(rows: int, columns: int) -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=columns, height=rows, near=0.01)
    depth = opengl.gbuffer_arrays(scene_of(square(2.0)), camera, 2)["depth"]
    np.testing.assert_allclose(depth[0], 2.0, rtol=2e-7)
    assert np.isinf(depth[1]).all()


def test_two_runs_give_bit_identical_results_and_touch_nothing() -> None:
    rng = np.random.default_rng(9)
    scene = scene_of(rng.uniform((-4, -4, -12), (4, 4, -2), (300, 3, 3)))
    before = scene.positions.copy()
    first = opengl.gbuffer_arrays(scene, CAMERAS["usual"], 3)
    second = opengl.gbuffer_arrays(scene, CAMERAS["usual"], 3)
    for name, array in first.items():
        np.testing.assert_array_equal(array, second[name])
    np.testing.assert_array_equal(scene.positions, before)


def test_a_renderer_of_the_caller_lives_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    pyrender = pytest.importorskip("pyrender")
    content = pyrender.Scene()
    content.add(pyrender.PerspectiveCamera(yfov=1.0, aspectRatio=1.0))
    renderer = pyrender.OffscreenRenderer(8, 8)
    for _ in range(2):
        renderer.render(content)
        depth = opengl.gbuffer_arrays(scene_of(square(2.0)), CAMERAS["usual"], 1)["depth"]
        np.testing.assert_allclose(depth, 2.0, rtol=2e-7)
    renderer.delete()
    # The deleted renderer's context is still current, yet dead.
    depth = opengl.gbuffer_arrays(scene_of(square(3.0)), CAMERAS["usual"], 1)["depth"]
    np.testing.assert_allclose(depth, 3.0, rtol=2e-7)


def test_edge_on_and_degenerate_triangles_give_no_nan() -> None:
    point, through_the_eye = [(0, 0, -2)] * 3, [(0, -1, -2), (0, 1, -2), (0, 0, -9)]
    scene = scene_of([point, through_the_eye, [(-1, 0, -3), (1, 0, -3), (0, 1e-7, -3)]], normals=(0, 0, 0))
    for camera in CAMERAS.values():
        for array in opengl.gbuffer_arrays(scene, camera, 2).values():
            assert not np.isnan(array).any()


@pytest.mark.parametrize("layers", [0, 17])
def test_a_wrong_number_of_layers_is_refused(layers: int) -> None:
    with pytest.raises(ValueError, match=f"layers is {layers}: expected an integer >= 1 and <= 16"):
        opengl.gbuffer_arrays(scene_of(square(2.0)), CAMERAS["usual"], layers)


def test_a_missing_driver_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EGL_DEVICE_ID", "999")
    with pytest.raises(MissingExtraError, match=r"ssgi-cl\[opengl\].*libegl1 libgl1-mesa-dri"):
        opengl.gbuffer_arrays(scene_of(square(2.0)), CAMERAS["usual"], 1)


def test_pyrenders_own_passes_are_timed() -> None:
    material = Material(texture=0, alpha_cutoff=0.5)
    texture = np.full((2, 2, 4), 255, np.uint8)
    scene = scene_of(square(2.0), materials=(material,), textures=(texture,), origin=(1e6, 0, 0))
    assert pyrender.median_ms(scene, CAMERAS["reversed"], "flat", repeats=1) > 0
    assert pyrender.median_ms(scene, CAMERAS["orthographic"], "depth", repeats=2) > 0
