"""Triangles without a back: in pictures, in maps of lights and skies, and for the rays of references."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.raster import opengl
from ssgi_cl.techniques.radiosity.surfels import scene_surfels

from . import meshes
from .loading import Gltf, written

NO_BACK, BOTH = Material(double_sided=False), Material()
FLOOR = [(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)]
BOARD = [(-3, 1, 3), (3, 1, 3), (3, 1, -3), (-3, 1, -3)]
"""Both face up."""
CAMERAS = {
    "perspective": Camera.look_at((0.2, 0.1, 3), (0, 0, 0), width=96, height=72, yfov=1.2),
    "orthographic": Camera.orthographic((0.2, 0.1, 3), (0, 0, 0), view_height=3.0, width=96, height=72),
    "within": Camera.look_at((1.5, 1.0, 0.2), (0, 0, -1), width=96, height=72, near=0.01),
}


def quads(*corners: ArrayLike, materials: tuple[Material, ...]) -> Scene:
    """Make a scene of quadrangles, one of each material."""
    count = len(corners)
    triangles = [(4 * i + a, 4 * i + b, 4 * i + c) for i in range(count) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    positions = np.concatenate([np.asarray(one, np.float32) for one in corners])
    edges = [np.asarray(one, np.float32) for one in corners]
    normals = np.repeat([np.cross(e[1] - e[0], e[2] - e[0]) for e in edges], 4, axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ids = np.repeat(np.arange(count), 2)
    return meshes.scene_of(positions, triangles, normals=normals, material_ids=ids, materials=materials)


def soup(rng: np.random.Generator, count: int = 300) -> Scene:
    """Make triangles of all sizes and ways, half of them without a back."""
    middle = rng.uniform(-1.5, 1.5, (count, 1, 3))
    size = 10.0 ** rng.uniform(-1.5, 1.0, (count, 1, 1))
    corners = middle + size * rng.uniform(-1.0, 1.0, (count, 3, 3))
    materials = (NO_BACK, BOTH)
    return meshes.scene_of(corners.reshape(-1, 3), material_ids=np.arange(count) % 2, materials=materials)


def only_seen(scene: Scene, camera: Camera) -> Scene:
    """Return a scene of what is there for a camera, both sides of each triangle of which are there."""
    corners = scene.positions[scene.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    to_eye = camera.position - corners[:, 0]
    if camera.is_orthographic:
        to_eye = np.broadcast_to(camera.view[2, :3], to_eye.shape)
    chosen = ~scene.culled_backs | (np.einsum("nc,nc->n", normal, to_eye) > 0.0)
    return replace(
        scene,
        triangles=scene.triangles[chosen],
        material_ids=scene.material_ids[chosen],
        materials=(BOTH,) * len(scene.materials),
    )


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_a_picture_is_that_of_the_triangles_that_face_the_camera(
    variant_runtime: Runtime, rng: np.random.Generator, camera: Camera
) -> None:
    scene = soup(rng)
    found = gi.rasterize.gbuffer(scene, camera, layers=2, runtime=variant_runtime)
    right = gi.rasterize.gbuffer(only_seen(scene, camera), camera, layers=2, runtime=variant_runtime)
    all_sides = gi.rasterize.gbuffer(replace(scene, materials=(BOTH, BOTH)), camera, runtime=variant_runtime)
    np.testing.assert_array_equal(found.depth, right.depth)
    assert (found.first("depth") != all_sides.depth).mean() > 0.05


@pytest.mark.usefixtures("opengl_runs")
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_opengl_culls_the_same(rng: np.random.Generator, camera: Camera) -> None:
    scene = soup(rng)
    found = opengl.gbuffer_arrays(scene, camera)["depth"]
    right = opengl.gbuffer_arrays(only_seen(scene, camera), camera)["depth"]
    # Triangles seen edge on may fall to either side: they cover few pixels.
    assert (found != right).mean() < 2e-3


@pytest.mark.parametrize("up", [True, False])
@pytest.mark.parametrize(
    "light",
    [
        DirectionalLight((0, -1, 0), 2.0),
        PointLight((0, 5, 0), 20.0),
        Environment(np.eye(4)[0][:, None, None] * [1.0, 1.0, 1.0]),
    ],
    ids=("sun", "point", "sky"),
)
def test_light_passes_a_board_that_turns_its_back_on_it(runtime: Runtime, up: bool, light: Light) -> None:
    """Of the environment only the texels round the zenith shine."""
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    board = quads(FLOOR, BOARD if up else BOARD[::-1], materials=(BOTH, NO_BACK))
    bare = quads(FLOOR, materials=(BOTH,))
    camera = Camera.look_at((0, 0.5, 0.4), (0, 0, 0), width=32, height=24, yfov=0.6)

    def light_of(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        if isinstance(light, Environment):
            gbuffer = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
            sky = gi.sampled_lights(gbuffer, [light], scene=scene, runtime=runtime)
            return sky * np.float32(0.8 / math.pi), gi.truth.radiance(scene, camera, [light], paths=256, bounces=0).mean
        frame = gi.render(scene, camera, [light], bounces=0, ao=False, runtime=runtime)
        traced = gi.truth.radiance(scene, camera, [light], paths=16, bounces=0)
        return frame.radiance, traced.mean

    for found, right in zip(light_of(board), light_of(bare), strict=True):
        assert right.min() > 0.01
        # The sky's directions are moved a little where the scene's bounds are others.
        np.testing.assert_allclose(found, 0.0 * right if up else right, atol=0.02 * right.max())


@pytest.mark.parametrize(("facing", "expected"), [(True, 0.5), (False, 1.0)])
def test_rays_of_ambient_occlusion_pass_backs(facing: bool, expected: float) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
    wall = [(0, 0, -50), (0, 0, 50), (0, 50, 50), (0, 50, -50)]  # faces -x
    scene = quads(np.multiply(FLOOR, 9), wall if facing else wall[::-1], materials=(NO_BACK, NO_BACK))
    near = Camera.look_at((-0.01, 3, 0), (-0.01, 0, 0), (0, 0, -1), width=3, height=3, yfov=1e-3)
    # Of a point at the foot of an endless wall, half of the hemisphere is hidden.
    for attenuation in ("none", np.ones(2)):
        found = gi.ray_ao(scene, near, radius=20.0, rays=1024, attenuation=attenuation)
        np.testing.assert_allclose(found, expected, atol=0.02)


@pytest.mark.parametrize("down", [True, False])
def test_a_panel_emits_to_its_front_alone(down: bool) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    glowing = replace(NO_BACK, emission=(1.0, 1.0, 1.0))
    panel = [(-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)]  # faces down
    scene = quads(FLOOR, panel if down else panel[::-1], materials=(Material(albedo=(0.5,) * 3), glowing))
    camera = Camera.look_at((0, 1, 0), (0, 0, 0), (0, 0, -1), width=8, height=8, yfov=0.02)
    found = gi.truth.radiance(scene, camera, [], paths=256, bounces=0).mean.mean()
    # Form factor of a square of half side 1 at distance 2: four of the corner form, Howell's C-12.
    x = 0.5
    factor = 4.0 / (2.0 * math.pi) * 2.0 * x / math.hypot(1.0, x) * math.atan(x / math.hypot(1.0, x))
    assert found == pytest.approx(0.5 * factor if down else 0.0, rel=0.02)


def test_surfels_are_on_the_sides_that_are_there() -> None:
    scene = quads(FLOOR, BOARD, materials=(NO_BACK, BOTH))
    found = scene_surfels(scene, 1024)
    up = found.normal[:, 1] > 0.0
    assert found.area[up].sum() == pytest.approx(18.0**2 + 6.0**2)
    assert found.area[~up].sum() == pytest.approx(6.0**2)
    assert 900 <= len(found) <= 1024 + 48


def test_files_say_which_backs_are_there(tmp_path: Path) -> None:
    made = Gltf()
    for sides in ({}, {"doubleSided": True}):
        made.triangle(material=made.material(**sides))
    path = written(tmp_path, "a.glb", made.bytes())
    wanted: list[tuple[bool | None, list[bool]]] = [(None, [False, True]), (True, [False] * 2), (False, [True] * 2)]
    for cull, there in wanted:
        assert [m.double_sided for m in load_scene(path, cull=cull).materials] == there
    plain = written(tmp_path, "t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert not load_scene(plain).culls
    assert load_scene(plain, cull=True).culls
    with pytest.raises(TypeError, match="cull"):
        load_scene(path, cull="back")  # type: ignore[arg-type]
