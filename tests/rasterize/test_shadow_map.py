"""Reflective shadow maps against the flux, the solid angles and the surfaces known exactly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import Material, Scene, rsm
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.shadow_map import RsmRenderer, every_nth, light_cameras
from ssgi_cl.rasterize.scenes import BuiltinScene

from . import meshes
from .meshes import made

Doubles = NDArray[np.float64]
WHITE = (1.0, 1.0, 1.0)
DOWNWARDS = SpotLight((0, 3, 0), (0, -1, 0), 0.5, 9.0), PointLight((0, 3, 0), 9.0), DirectionalLight((0, -1, 0), 9.0)


def scene_of(corners: ArrayLike, quads: ArrayLike, normals: ArrayLike, albedo: tuple[float, float, float]) -> Scene:
    """Make a scene of quadrangles [count, 4] with a normal each."""
    quads = np.asarray(quads)
    triangles = 4 * np.arange(len(quads))[:, None] + np.array([0, 1, 2, 0, 2, 3])
    of_corners = np.repeat(normals, 4, axis=0)
    material = Material(albedo=albedo)
    points = np.asarray(corners)[quads.ravel()]
    return meshes.scene_of(points, triangles.reshape(-1, 3), normals=of_corners, materials=(material,))


def ground(half: float = 50.0, albedo: tuple[float, float, float] = WHITE) -> Scene:
    """Make the square y = 0, 2 half a side."""
    corners = [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)]
    return scene_of(corners, [(0, 1, 2, 3)], [(0, 1, 0)], albedo)


def room(albedo: tuple[float, float, float] = WHITE) -> Scene:
    """Make the box from (-1, -1, -1) to (2, 1, 3), seen from within."""
    corners = [(x, y, z) for x in (-1, 2) for y in (-1, 1) for z in (-1, 3)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    normals = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    return scene_of(corners, quads, normals, albedo)


def cornell_box() -> tuple[BuiltinScene, SpotLight]:
    box = made("cornell_box")
    (light,) = box.lights
    assert isinstance(light, SpotLight)
    return box, light


def total(result: ReflectiveShadowMap) -> Doubles:
    """Return [3] the flux of all texels in W."""
    flux: Doubles = np.asarray(result.flux, np.float64).sum(axis=(0, 1))
    return flux


# ---- total flux


@pytest.mark.parametrize(
    ("cone", "size"),
    [
        pytest.param(cone, size, marks=[pytest.mark.slow] * ((i + k) % 2 == 1 or size == 1024))
        for i, cone in enumerate((0.2, 0.7, 1.2))
        for k, size in enumerate((128, 512, 1024))
    ],
)
def test_a_spot_light_reflects_intensity_times_solid_angle_times_albedo(
    runtime: Runtime, size: int, cone: float
) -> None:
    light = SpotLight((0.0, 3.0, 0.0), (0.1, -1.0, 0.05), cone, (10.0, 20.0, 5.0))
    albedo = (0.9, 0.5, 0.1)
    result = rsm(ground(400.0, albedo), light, size=size, runtime=runtime)
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(cone))
    expected = np.multiply((10.0, 20.0, 5.0), albedo) * solid_angle
    # A texel at the rim counts as a whole or not at all: some 2 pi R texels, half of them
    # wrong by half their size, in random directions.
    np.testing.assert_allclose(total(result), expected, rtol=0.01)


@pytest.mark.parametrize("size", [32, 128, pytest.param(512, marks=pytest.mark.slow)])
def test_a_point_light_in_a_closed_room_reflects_all_it_sends_out(runtime: Runtime, size: int) -> None:
    light = PointLight((0.3, -0.2, 0.6), (1.0, 2.0, 3.0))
    albedo = (0.8, 0.6, 0.4)
    result = rsm(room(albedo), light, size=size, runtime=runtime)
    assert np.isfinite(np.asarray(result.depth)).all()
    expected = 4.0 * math.pi * np.multiply((1.0, 2.0, 3.0), albedo)
    # The midpoint rule for a texel's solid angle: its error falls with the square of the size.
    np.testing.assert_allclose(total(result), expected, rtol=max(1e-5, 0.5 / size**2))


@pytest.mark.parametrize(
    ("direction", "size"),
    [
        pytest.param(direction, size, marks=[pytest.mark.slow] * ((i + k) % 2 == 1 or size == 1024))
        for i, direction in enumerate(((0.0, -1.0, 0.0), (0.5, -1.0, 0.3)))
        for k, size in enumerate((128, 512, 1024))
    ],
)
def test_a_directional_light_reflects_irradiance_times_the_area_it_sees(
    runtime: Runtime, size: int, direction: tuple[float, float, float]
) -> None:
    light = DirectionalLight(direction, (2.0, 4.0, 8.0))
    result = rsm(ground(3.0, (0.5, 0.5, 0.25)), light, size=size, runtime=runtime)
    cosine = 1.0 / np.linalg.norm(direction)
    expected = np.array([1.0, 2.0, 2.0]) * 36.0 * cosine
    # The outline is sampled at texel centres: less than a row of texels on each side.
    np.testing.assert_allclose(total(result), expected, rtol=1.0 / size)


def test_a_light_that_sees_nothing_gives_zeros(runtime: Runtime) -> None:
    light = SpotLight((0, 3, 0), (0, 1, 0.1), 0.5, 9.0)
    result = rsm(ground(), light, size=32, runtime=runtime)
    assert np.isposinf(np.asarray(result.depth)).all()
    for name in ("position", "normal", "flux"):
        assert not np.asarray(getattr(result, name)).any(), name


def test_beyond_the_cone_there_is_depth_but_no_flux(runtime: Runtime) -> None:
    light = SpotLight((0, 2, 0), (0, -1, 0), 0.6, 1.0)
    result = rsm(ground(), light, size=64, runtime=runtime)
    assert np.isfinite(np.asarray(result.depth)).all()
    offset = np.asarray(result.position)[..., [0, 2]]
    angle = np.arctan2(np.linalg.norm(offset, axis=-1), 2.0)
    dark = np.asarray(result.flux).max(axis=-1) == 0.0
    # A texel on the rim may fall on either side by a rounding.
    clear = np.abs(angle - 0.6) > 1e-5
    np.testing.assert_array_equal(dark[clear], angle[clear] > 0.6)
    assert dark.any()


# ---- geometry


def assert_on_the_room(result: ReflectiveShadowMap) -> None:
    position, normal = np.asarray(result.position), np.asarray(result.normal)
    walls = np.array([(-1, -1, -1), (2, 1, 3)], np.float64)
    gap = np.abs(position[..., None, :] - walls)  # [rows, columns, least or greatest, axis]
    # Positions are good to the rounding of a few metres; a texel in a corner is on two walls.
    on = gap < 2e-6
    assert on.any(axis=(-1, -2)).all()
    inward = np.where(on[..., 0, :], 1.0, 0.0) + np.where(on[..., 1, :], -1.0, 0.0)
    single = on.sum(axis=(-1, -2)) == 1
    np.testing.assert_allclose(normal[single], inward[single], atol=1e-6)


def test_positions_and_normals_lie_on_the_surfaces(runtime: Runtime) -> None:
    for light in (PointLight((0.3, -0.2, 0.6), 1.0), SpotLight((1.5, 0.5, 0.0), (-1.0, -0.3, 0.8), 0.9, 1.0)):
        assert_on_the_room(rsm(room(), light, size=64, runtime=runtime))


def test_a_directional_light_sees_the_whole_scene_from_outside(runtime: Runtime) -> None:
    scene = made("terrace").scene
    direction = np.array([-0.8, -0.46, -0.34])
    (camera,) = light_cameras(DirectionalLight(direction, 1.0), scene.bounds, 64)
    points = (scene.positions[::97] + scene.origin) @ camera.view[:3, :3].T + camera.view[:3, 3]
    sx, sy, ox, oy = camera.pixel_to_view
    for place, scale, offset in ((points[:, 0], sx, ox), (points[:, 1], sy, oy)):
        assert (((place - offset) / scale > 0.5) & ((place - offset) / scale < 63.5)).all()
    assert ((-points[:, 2] > camera.near) & (-points[:, 2] < camera.far)).all()
    np.testing.assert_allclose(-camera.view[2, :3], direction / np.linalg.norm(direction))


def test_a_spot_lights_camera_holds_its_cone(runtime: Runtime) -> None:
    light = SpotLight((1, 2, 3), (0.3, -0.9, 0.2), 0.8, 1.0)
    (camera,) = light_cameras(light, np.array([(-5.0, -5, -5), (5, 5, 5)]), 128)
    np.testing.assert_allclose(camera.position, (1, 2, 3), atol=1e-12)
    sx, _, ox, _ = camera.pixel_to_view
    column = (math.tan(0.8) - ox) / sx
    # Between one and a few texels are left for filters.
    assert 1.0 <= 128 - column < 3.0


def test_six_faces_cover_every_direction_once(rng: np.random.Generator) -> None:
    position = np.array([0.3, -0.2, 0.6])
    cameras = light_cameras(PointLight(position, 1.0), np.array([(-1.0, -1, -1), (2, 1, 3)]), 16)
    assert len(cameras) == 6
    way = rng.normal(size=(20000, 3))
    seen = np.zeros(len(way), np.int64)
    for camera in cameras:
        point = way @ camera.view[:3, :3].T
        sx, sy, ox, oy = camera.pixel_to_view
        depth = np.where(point[:, 2] < 0, -point[:, 2], np.nan)
        column, row = (point[:, 0] / depth - ox) / sx, (point[:, 1] / depth - oy) / sy
        seen += (column >= 0) & (column < 16) & (row >= 0) & (row < 16)
    np.testing.assert_array_equal(seen, 1)


def test_faces_are_stacked_in_the_order_of_the_axes(runtime: Runtime) -> None:
    result = rsm(room(), PointLight((0.3, -0.2, 0.6), 1.0), size=9, runtime=runtime)
    assert np.asarray(result.depth).shape == (54, 9)
    middle = np.asarray(result.position)[4::9, 4]
    expected = [(2, -0.2, 0.6), (-1, -0.2, 0.6), (0.3, 1, 0.6), (0.3, -1, 0.6), (0.3, -0.2, 3), (0.3, -0.2, -1)]
    np.testing.assert_allclose(middle, expected, atol=1e-6)


# ---- small maps, other builds, errors


def test_a_map_of_one_texel(runtime: Runtime) -> None:
    for light in DOWNWARDS:
        result = rsm(ground(), light, size=1, runtime=runtime)
        assert np.asarray(result.depth).shape == (6 if isinstance(light, PointLight) else 1, 1)
        assert (np.asarray(result.flux) > 0).any()
        assert np.isfinite(np.asarray(result.flux)).all()


def test_every_build_of_the_kernels_gives_the_same(other_variant: Runtime) -> None:
    reference = Runtime.open()
    scene = made("hall")
    for light in scene.lights:
        if isinstance(light, Environment):
            continue
        one = rsm(scene.scene, light, size=96, runtime=other_variant)
        other = rsm(scene.scene, light, size=96, runtime=reference)
        np.testing.assert_allclose(one.depth, other.depth, rtol=1e-6)
        # Compilers may fuse an operation: a rounding or two.
        largest = np.abs(np.asarray(other.flux)).max()
        np.testing.assert_allclose(one.flux, other.flux, atol=1e-6 * largest)


def test_a_steady_map_allocates_and_builds_nothing(runtime: Runtime) -> None:
    scene, light = cornell_box()
    kept = DeviceScene(runtime, scene.scene)
    renderer = RsmRenderer(runtime, 64)
    (camera,) = light_cameras(light, scene.scene.bounds, 64)
    with runtime.frame():
        renderer.render(kept, light, camera)
        before = runtime.allocated_bytes, runtime.builds
        first = renderer.render(kept, light, camera).download()
        again = renderer.render(kept, light, camera).download()
    assert (runtime.allocated_bytes, runtime.builds) == before
    np.testing.assert_array_equal(first, again)


def test_depth_for_shadows_is_a_few_roundings_off(runtime: Runtime) -> None:
    scene, light = cornell_box()
    kept = DeviceScene(runtime, scene.scene)
    (camera,) = light_cameras(light, scene.scene.bounds, 64)
    renderer = RsmRenderer(runtime, 64)
    with runtime.frame():
        renderer.render(kept, light, camera)
        plane = runtime.plane(3, (64, 64), math.inf)
        renderer.write_depth(plane, 1)
        (before, depth, behind), (exact,) = plane.download(), renderer.target.depth.download()
    # Rounding of a plane seen at a cosine of .05.
    np.testing.assert_allclose(depth, exact, rtol=2e-6)
    for other in (before, behind):
        assert not np.isfinite(other).any()


@pytest.mark.parametrize("step", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_every_nth_texel_is_that_of_the_whole_map(variant_runtime: Runtime, step: int) -> None:
    box, light = cornell_box()
    kept = DeviceScene(variant_runtime, box.scene)
    (camera,) = light_cameras(light, box.scene.bounds, 37)
    few, all_ = (RsmRenderer(variant_runtime, 37, step=n) for n in (step, 1))
    with variant_runtime.frame():
        for renderer in (few, all_):
            renderer.render(kept, light, camera)
        middle = slice(step // 2, None, step)
        for name in ("depth", "normal_world", "albedo"):
            found = getattr(few.target, name).download()
            wanted = getattr(all_.target, name).download()[:, middle, middle]
            np.testing.assert_array_equal(found[:, : wanted.shape[1], : wanted.shape[2]], wanted)
        flux = [renderer.flux.download().sum() for renderer in (few, all_)]
    # Its camera looks through the texels' own middles: x / z of what is there.
    reduced = every_nth(camera, step)
    own, whole = (reduced.pixel_to_view, camera.pixel_to_view)
    for axis in (0, 1):
        at = own[axis] * 0.5 + own[2 + axis]
        np.testing.assert_allclose(at, whole[axis] * (step // 2 + 0.5) + whole[2 + axis])
        np.testing.assert_allclose(own[axis], step * whole[axis])
    # 37 texels are 19 pairs but for one half.
    np.testing.assert_allclose(flux[0], flux[1], rtol=0.1)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"size": 0}, ValueError, "size is 0"),
        ({"size": 9000}, ValueError, "size is 9000"),
        ({"size": 2.0}, TypeError, "size is 2.0"),
        ({"light": Environment(1.0)}, TypeError, "light is Environment"),
        ({"light": None}, TypeError, "light is NoneType"),
        ({"scene": "room.glb"}, TypeError, "scene is str"),
    ],
)
def test_wrong_arguments_are_refused(
    runtime: Runtime, changes: dict[str, object], error: type[Exception], words: str
) -> None:
    light = PointLight((0, 1, 0), 1.0)
    arguments = {"scene": ground(), "light": light, "size": 8, "runtime": runtime, **changes}
    with pytest.raises(error, match=words):
        rsm(**arguments)


@pytest.mark.parametrize(
    "light",
    [SpotLight((0.3, 0.2, 1.0), (0.2, -1.0, 0.3), 0.6, 1.0), PointLight((0.4, 0.1, 1.2), 1.0)],
    ids=["spot", "point"],
)
def test_a_mesh_without_normals_has_those_of_its_faces(variant_runtime: Runtime, light: SpotLight | PointLight) -> None:
    scene = room()
    bare = replace(scene, normals=np.zeros_like(scene.normals))
    given, found = (rsm(s, light, size=33, runtime=variant_runtime) for s in (scene, bare))
    np.testing.assert_array_equal(found.flux, given.flux)
    cosine = np.abs(np.sum(np.asarray(given.normal) * np.asarray(found.normal), axis=-1))
    seen = np.isfinite(np.asarray(given.depth))
    # In a corner one of two neighbours lies on the texel's own face, at an edge of the map either
    # may be missing.
    assert np.mean(cosine[seen] > 0.9999) > 0.95
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=-1)[seen], 1.0, atol=1e-5)
