"""Reflective shadow maps in device memory: uploaded or drawn there, anywhere in the world."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.rsm import BRIGHTEST, LEAST_COSINE, DeviceRsm, on_device_rsm, surfaces
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.raster.shadow_map import RsmRenderer, light_cameras
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

PLANES = ("position", "normal", "flux", "area")
LIGHTS = {
    "spot": SpotLight((0.28, 0.54, 0.28), (0.2, -1.0, 0.1), 0.9, (1.0, 2.0, 3.0)),
    "point": PointLight((0.15, 0.3, 0.25), (3.0, 2.0, 1.0)),
    "directional": DirectionalLight((0.1, -0.2, 1.0), (2.0, 2.0, 1.0)),
}


def wall_map(distance: float = 2.0, *, tilt: float = 0.0, shift: float = 0.0, size: int = 64) -> ReflectiveShadowMap:
    """Return what a spot light at (shift, 0, 0) sees of a wall before it, turned by `tilt`."""
    light = SpotLight((shift, 0.0, 0.0), (0.0, 0.0, -1.0), 0.4, 1.0)
    camera = Camera.look_at((shift, 0, 0), (shift, 0, -max(1.0, shift)), yfov=0.9, width=size, height=size)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    ones = camera.unproject(np.ones((size, size), np.float32)) - camera.position
    depth = (-distance * normal[2] / (ones @ normal)).astype(np.float32)
    return ReflectiveShadowMap(
        light=light,
        camera=camera,
        depth=depth,
        position=camera.unproject(depth),
        normal=np.broadcast_to(normal, (size, size, 3)),
        flux=np.ones((size, size, 3)),
    )


def contents(device: DeviceRsm) -> dict[str, NDArray[np.float32]]:
    return {name: getattr(device, name).download() for name in PLANES}


@pytest.mark.parametrize("kind", LIGHTS)
def test_drawn_without_read_back_is_what_is_uploaded(variant_runtime: Runtime, kind: str) -> None:
    runtime, light, scene = variant_runtime, LIGHTS[kind], BUILTIN_SCENES["cornell_box"]().scene
    uploaded = on_device_rsm(rsm(scene, light, size=37, runtime=runtime), runtime)
    renderer, cameras = RsmRenderer(runtime, 37), light_cameras(light, scene.bounds, 37)
    drawn = DeviceRsm(runtime, (37, 37), len(cameras))
    drawn.begin(light, cameras, reach=10.0, brightest=1.0)
    for face, camera in enumerate(cameras):
        flux = renderer.render(device_scene(scene, runtime), light, camera)
        drawn.write_face(face, renderer.target.depth, renderer.target.normal_world, flux)
    a, b = contents(uploaded), contents(drawn)
    for name in PLANES:
        # Some roundings of 2^-24 of numbers as large as the greatest.
        np.testing.assert_allclose(a[name], b[name], rtol=1e-6, atol=1e-6 * np.abs(a[name]).max())


@pytest.mark.parametrize("tilt", [0.0, 0.9, -1.0])
def test_areas_of_texels_add_up_to_the_surface_that_the_light_sees(tilt: float) -> None:
    seen = wall_map(tilt=tilt, size=256)
    area = surfaces(seen)[2]
    # Corners of the map on the wall, in its plane.
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * math.tan(0.45)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    ways = np.column_stack([corners, -np.ones(4)])
    points = ways * (-2.0 * normal[2] / (ways @ normal))[:, None]
    diagonals = np.cross(points[2] - points[0], points[3] - points[1])
    expected = 0.5 * np.linalg.norm(diagonals)
    # The midpoint rule over 256 texels.
    assert area.sum() == pytest.approx(expected, rel=1e-3)


def test_a_grazing_texel_stands_for_no_more_than_at_the_least_cosine() -> None:
    seen = wall_map(size=4)
    grazing = replace(seen, normal=np.broadcast_to([1.0, 0.0, 1e-4], (4, 4, 3)))
    facing = surfaces(seen)[2]
    # At the map's corners the beam meets the wall at the cosine 0.86 or more.
    assert (surfaces(grazing)[2] <= facing / LEAST_COSINE).all()


def test_normals_are_turned_to_the_side_that_is_lit(variant_runtime: Runtime) -> None:
    seen = wall_map(tilt=0.5)
    away = replace(seen, normal=-np.asarray(seen.normal))
    device = DeviceRsm(variant_runtime, (64, 64))
    device.upload(seen)
    facing = device.normal.download()
    device.upload(away)
    np.testing.assert_array_equal(device.normal.download(), facing)
    np.testing.assert_allclose(facing[2], math.cos(0.5), rtol=1e-6)


def test_a_map_far_from_the_origin_is_as_exact_as_one_there(runtime: Runtime) -> None:
    near, far = DeviceRsm(runtime, (64, 64)), DeviceRsm(runtime, (64, 64))
    near.upload(wall_map(tilt=0.3))
    far.upload(wall_map(tilt=0.3, shift=1e6))
    np.testing.assert_array_equal(far.origin, (1e6, 0.0, 0.0))
    # The given positions are rounded to 0.06; the eye itself, in float64, to 1e-10.
    np.testing.assert_allclose(far.position.download(), near.position.download(), rtol=0, atol=1e-6)
    camera = Camera.look_at((1e6 + 1.0, 0, 1), (1e6, 0, -2), width=8, height=8)
    points = np.array([[0.5], [0.25], [-1.0], [1.0]])
    world = np.append(points[:3, 0] + far.origin, 1.0)
    np.testing.assert_allclose((far.to_view(camera) @ points)[:, 0], (camera.view @ world)[:3], rtol=0, atol=1e-9)


def test_the_way_back_from_view_space_is_the_inverse(runtime: Runtime) -> None:
    device = DeviceRsm(runtime, (64, 64))
    device.upload(wall_map(shift=3.0))
    camera = Camera.look_at((4, 5, 6), (0, 1, 0), width=8, height=8)
    last = [0.0, 0.0, 0.0, 1.0]
    there, back = (np.vstack([m, last]) for m in (device.to_view(camera), device.from_view(camera)))
    np.testing.assert_allclose(there @ back, np.eye(4), rtol=0, atol=1e-12)


def test_positions_that_depth_does_not_explain_are_kept(runtime: Runtime) -> None:
    seen = wall_map(shift=10.0)
    moved = np.asarray(seen.position) + np.float32(0.125)
    device = DeviceRsm(runtime, (64, 64))
    device.upload(replace(seen, position=moved))
    expected = np.moveaxis(moved.astype(np.float64) - device.origin, -1, 0)
    np.testing.assert_allclose(device.position.download(), expected, rtol=0, atol=1e-6)


def test_where_nothing_is_all_is_zero_whatever_was_given(variant_runtime: Runtime) -> None:
    seen = wall_map(size=5)
    depth = np.asarray(seen.depth).copy()
    depth[1:3, 2] = np.inf
    device = DeviceRsm(variant_runtime, (5, 5))
    device.upload(replace(seen, depth=depth))
    for name, plane in contents(device).items():
        assert not plane[:, 1:3, 2].any(), name
        assert plane[-1, 0].any(), name  # z or blue or the area


def test_flux_is_limited_so_that_sums_stay_finite(runtime: Runtime) -> None:
    seen = wall_map(size=2)
    device = DeviceRsm(runtime, (2, 2))
    device.upload(replace(seen, flux=np.full((2, 2, 3), 3e38)))
    np.testing.assert_array_equal(device.flux.download(), np.float32(BRIGHTEST))


def test_the_same_map_is_uploaded_once(runtime: Runtime) -> None:
    one, other = wall_map(), wall_map(distance=3.0)
    device = on_device_rsm(one, runtime)
    version, allocated = device.version, runtime.allocated_bytes
    assert on_device_rsm(one, runtime) is device
    assert device.version == version
    assert on_device_rsm(other, runtime) is device
    assert device.version > version
    assert runtime.allocated_bytes == allocated
    assert device.position.download()[2].max() == pytest.approx(-3.0)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda runtime: np.ones((4, 4)), TypeError, r"rsm is ndarray: expected ReflectiveShadow"),
        (lambda runtime: None, TypeError, r"rsm is NoneType: expected ReflectiveShadowMap or Dev"),
        (lambda runtime: DeviceRsm(runtime, (4, 4)), ValueError, r"device RSM is empty: upload"),
        (
            lambda runtime: DeviceRsm(runtime, (8, 8), 6).upload(wall_map()),
            ValueError,
            r"has 1 faces of \[\(64, 64\)\] texels: expected 6 of",
        ),
    ],
)
def test_something_else_than_a_filled_map_is_refused(
    runtime: Runtime, make: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        on_device_rsm(make(runtime), runtime)
