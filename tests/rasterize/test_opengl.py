"""The OpenGL backend against planes whose image is known exactly; `test_rasterize.py` holds the other to it."""

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


def test_what_lies_behind_or_beyond_is_not_seen() -> None:
    corners = np.concatenate([square(-3.0), square(0.005), square(60.0)])
    for name in ("usual", "orthographic"):
        camera = CAMERAS[name]
        beyond = scene_of(corners[[0, 1, 4, 5]])
        assert np.isinf(opengl.gbuffer_arrays(beyond, camera, 2)["depth"]).all()


def test_a_scene_far_from_the_origin_looks_like_one_at_the_origin() -> None:
    origin = np.array([1e6, -2e6, 3e6])
    slanted = square(6.0) @ [(0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8)]
    near = opengl.gbuffer_arrays(scene_of(slanted), CAMERAS["usual"], 2)
    camera = Camera.look_at(origin, origin - (0, 0, 1), width=64, height=48, near=0.01, far=50.0)
    far = opengl.gbuffer_arrays(scene_of(slanted, origin=origin), camera, 2)
    for name, array in near.items():
        np.testing.assert_allclose(far[name], array, rtol=1e-6, atol=1e-6, err_msg=name)


def test_interpolated_normals_have_unit_length() -> None:
    scene = scene_of(square(4.0, 2.0), normals=[(0, 0, 1), (0.6, 0, 0.8), (0, 0.8, -0.6)] * 2)
    found = opengl.gbuffer_arrays(scene, CAMERAS["usual"], 1)
    normal = found["normal"][np.isfinite(found["depth"])]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1.0, atol=1e-6)


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
