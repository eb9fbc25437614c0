"""Derived images of a device G-buffer: view-space normals that face the viewer, and 1 / depth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import downloaded
from ssgi_cl.reference.gbuffer import SurfaceView

from ..analytic import CAMERAS, SCENES, Plane, camera, scene, tilted, trace, uploaded, view_of

FLIPS = 1e-3
"""Share of pixels in which the smaller of two equal depth differences may be either."""


def derived(runtime: Runtime, gbuffer: GBuffer) -> NDArray[np.float32]:
    """Return [rows, columns, 3]: the device's view-space normals."""
    return np.moveaxis(uploaded(runtime, gbuffer).normal.download(), 0, -1)


def degrees_between(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the angle between unit vectors; exact for small angles too."""
    wide = a.astype(np.float64), b.astype(np.float64)
    across = np.linalg.norm(np.cross(*wide), axis=-1)
    return np.degrees(np.arctan2(across, np.sum(wide[0] * wide[1], axis=-1)))


def facing_normal(camera: Camera, plane: Plane) -> NDArray[np.float64]:
    """Return the view-space normal of a plane made by `tilted`, which faces the camera."""
    return camera.view[:3, :3] @ np.asarray(plane.normal)


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("size", [(3, 5), (17, 31), (47, 61), (16, 600), (600, 16)], ids=str)
def test_normals_from_depth_are_right_to_a_tenth_of_a_degree_on_planes(
    variant_runtime: Runtime, kind: str, size: tuple[int, int]
) -> None:
    made = camera(kind, size)
    for tilt in (0.0, 60.0, 89.0):
        gbuffer = trace(made, [plane := tilted(made, tilt)], normals=False)
        # A pixel without a neighbour in its row or column knows too little.
        there = np.isfinite(gbuffer.depth)
        known = there & _beside(there, 0) & _beside(there, 1)
        normal = derived(variant_runtime, gbuffer)
        wanted = np.broadcast_to(facing_normal(made, plane), normal.shape)
        wrong = degrees_between(normal, wanted)[known]
        # Depths are rounded to 2^-24, and pixels are 0.001 radians apart at least.
        assert wrong.max(initial=0.0) < 0.1, f"tilt {tilt}"


def _beside(there: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    padded = np.pad(there, [(int(axis == i),) * 2 for i in (0, 1)])
    rows, columns = there.shape
    after = padded[2 * (axis == 0) :, 2 * (axis == 1) :]
    return padded[:rows, :columns] | after


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("given", [True, False], ids=["given", "from depth"])
def test_normals_agree_with_numpy_reference_and_have_unit_length(
    variant_runtime: Runtime, name: str, kind: str, given: bool
) -> None:
    gbuffer = view_of(name, kind)
    if not given:
        gbuffer = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth)
    normal = derived(variant_runtime, gbuffer)
    # Positions are rounded to 2^-24 of a depth of 5 and lie 0.05 apart, which is 1e-4 degrees.
    wrong = degrees_between(normal, SurfaceView.of(gbuffer).normal) > 0.01
    assert wrong.mean() <= FLIPS
    length = np.linalg.norm(normal.astype(np.float64), axis=-1)
    # A given normal's components are rounded by 2^-24, and by GBuffer left alone within 1e-5.
    np.testing.assert_allclose(length, np.isfinite(gbuffer.depth).astype(float), rtol=0, atol=6e-6)


@pytest.mark.parametrize("kind", CAMERAS)
def test_normal_that_faces_away_from_its_surface_is_turned(variant_runtime: Runtime, kind: str) -> None:
    gbuffer = view_of("corner", kind)
    turned = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, normal=-np.asarray(gbuffer.normal))
    a, b = derived(variant_runtime, gbuffer), derived(variant_runtime, turned)
    # In a crease the surface rebuilt from depth may be the other one; measured: 1 pixel of 2867,
    # with the camera given by intrinsics.
    assert np.mean(np.any(a != b, axis=-1)) <= FLIPS


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_smooth_normal_beyond_a_silhouette_keeps_its_side(variant_runtime: Runtime, sign: float) -> None:
    # The surface is tilted by 80 degrees and its interpolated normal by 95: the view ray says that
    # the normal faces away, the surface that it does not. Its opposite faces the viewer already.
    made = Camera.look_at((0, 0, 5), (0, 0, 0), yfov=0.05, width=20, height=20)
    plane, leaning = tilted(made, 80.0), tilted(made, 95.0)
    depth = trace(made, [plane]).depth
    normal = sign * np.broadcast_to(leaning.normal, (20, 20, 3))
    result = derived(variant_runtime, GBuffer(camera=made, depth=depth, normal=normal))
    wanted = sign * facing_normal(made, leaning)
    np.testing.assert_allclose(result, np.broadcast_to(wanted, result.shape), atol=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1)], ids=str)
@pytest.mark.parametrize("kind", CAMERAS)
def test_image_of_one_row_or_column_has_finite_normals_that_face_the_viewer(
    variant_runtime: Runtime, size: tuple[int, int], kind: str
) -> None:
    made = camera(kind, size)
    gbuffer = GBuffer(camera=made, depth=np.full(size, 3.0, np.float32))
    normal = derived(variant_runtime, gbuffer)
    # All differences have no depth, so the surface lies across the view.
    np.testing.assert_allclose(normal, np.broadcast_to([0, 0, 1], normal.shape), atol=1e-6)


def test_lone_pixel_has_a_normal_towards_the_viewer(variant_runtime: Runtime) -> None:
    made = camera(size=(9, 40))
    depth = np.full(made.size, np.inf, np.float32)
    depth[4, 0] = depth[4, 39] = depth[0, 17] = depth[8, 16] = 2.0
    normal = derived(variant_runtime, GBuffer(camera=made, depth=depth))
    wanted = np.where(np.isfinite(depth)[..., None], [0.0, 0.0, 1.0], 0.0)
    np.testing.assert_allclose(normal, wanted, atol=1e-6)  # a length of 1, rounded


def test_given_normal_of_0_is_reconstructed_and_others_are_kept(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = view_of("bumpy")
    holes = rng.random(gbuffer.size) < 0.3
    partly = np.where(holes[..., None], 0.0, gbuffer.normal)
    mixed = derived(variant_runtime, GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, normal=partly))
    given = derived(variant_runtime, gbuffer)
    rebuilt = derived(variant_runtime, GBuffer(camera=gbuffer.camera, depth=gbuffer.depth))
    np.testing.assert_array_equal(mixed, np.where(holes[..., None], rebuilt, given))


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("reach", [3.0, 30.0])
def test_any_depths_give_finite_unit_normals(
    variant_runtime: Runtime, rng: np.random.Generator, kind: str, reach: float
) -> None:
    made = camera(kind, (33, 70))
    depth = (10.0 ** rng.uniform(-reach, reach, made.size)).astype(np.float32)
    normal = derived(variant_runtime, GBuffer(camera=made, depth=depth))
    length = np.linalg.norm(normal.astype(np.float64), axis=-1)
    np.testing.assert_allclose(length, 1.0, rtol=0, atol=1e-6)  # some roundings of 2^-24


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_linear_measure_is_the_inverse_depth_or_the_depth_itself(variant_runtime: Runtime, kind: str) -> None:
    gbuffer = view_of("noisy", kind)
    linear = uploaded(variant_runtime, gbuffer).linear.download()[0]
    depth = np.asarray(gbuffer.depth)
    wanted = depth if kind == "orthographic" else np.where(np.isinf(depth), np.inf, 1.0 / depth)
    np.testing.assert_allclose(linear, wanted, rtol=2e-7)  # a division, rounded


@pytest.mark.parametrize("given", [True, False], ids=["given", "from depth"])
def test_each_layer_has_the_normals_that_it_would_have_alone(
    variant_runtime: Runtime, rng: np.random.Generator, given: bool
) -> None:
    made = camera("perspective")
    alone = [scene(name, made, rng) for name in ("corner", "ball")]
    # Factors of two: depths of one layer stay apart from the other's, and keep all their bits.
    depth = np.stack([np.asarray(alone[0].depth), np.asarray(alone[1].depth) * 1024.0])
    normal = np.stack([np.asarray(each.normal) for each in alone])
    both = GBuffer(camera=made, depth=depth, normal=normal if given else None)
    device = DeviceGBuffer(variant_runtime, made.size, layers=2, attributes=2)
    device.upload(both)
    for layer in range(2):
        single = GBuffer(camera=made, depth=depth[layer], normal=normal[layer] if given else None)
        wanted = uploaded(variant_runtime, single).normal.download()
        images = device.normal.download()[3 * layer : 3 * layer + 3]
        np.testing.assert_array_equal(images, wanted, err_msg=f"layer {layer}")
    wanted = uploaded(variant_runtime, GBuffer(camera=made, depth=depth[0])).linear.download()
    np.testing.assert_array_equal(device.linear.download(), wanted)


def test_a_deeper_layer_has_its_own_attributes_or_those_of_no_array(runtime: Runtime, rng: np.random.Generator) -> None:
    made = camera(size=(5, 7))
    depth = np.stack([np.full((5, 7), i + 1.0) for i in range(2)])
    albedo, emission = rng.random((2, 5, 7, 3)), rng.random((5, 7, 3))
    gbuffer = GBuffer(camera=made, depth=depth, albedo=albedo, emission=emission)
    device = on_device(gbuffer, runtime)
    assert device.attributes == 2
    back = downloaded(device)
    np.testing.assert_array_equal(back.albedo, gbuffer.albedo)
    np.testing.assert_array_equal(np.asarray(back.emission)[0], gbuffer.emission)
    np.testing.assert_array_equal(np.asarray(back.emission)[1], 0.0)
    plain = GBuffer(camera=made, depth=depth, emission=emission)
    assert on_device(plain, runtime).attributes == 1


def test_a_layer_is_an_image_of_its_own_size(runtime: Runtime) -> None:
    device = DeviceGBuffer(runtime, (8, 6), layers=2, margin=(1, 2), attributes=2)
    view = device.layer(1)
    assert (view.size, view.margin, view.whole, view.front) == ((10, 10), (0, 0), (10, 10), 1)
    assert view.albedo is device.albedo
    assert (device.size, device.front) == ((8, 6), 0)
    with pytest.raises(ValueError, match="number is 2: expected 0 to 1"):
        device.layer(2)
    with pytest.raises(ValueError, match="attributes is 3: expected 0, 1 or 2, all layers"):
        DeviceGBuffer(runtime, (8, 6), layers=2, attributes=3)


@pytest.mark.parametrize("layers", [1, 2])
def test_normals_derived_in_place_are_those_of_kept_ones(
    variant_runtime: Runtime, rng: np.random.Generator, layers: int
) -> None:
    made = camera("perspective")
    alone = [scene(name, made, rng) for name in ("corner", "ball")][:layers]
    depths = [np.asarray(each.depth) * 1024.0**layer for layer, each in enumerate(alone)]
    gbuffer = GBuffer(camera=made, depth=np.stack(depths), normal=np.stack([np.asarray(each.normal) for each in alone]))
    in_place = DeviceGBuffer(variant_runtime, made.size, layers=layers, attributes=layers, world="until derived")
    for _ in range(2):  # what is derived is not taken for given the second time
        in_place.upload(gbuffer)
        with pytest.raises(ValueError, match="does not keep its normals"):
            in_place.normal_world  # noqa: B018
        kept = uploaded(variant_runtime, gbuffer).normal.download()
        np.testing.assert_array_equal(in_place.normal.download(), kept)


def test_gbuffer_of_another_size_is_refused(runtime: Runtime) -> None:
    device = DeviceGBuffer(runtime, (8, 8))
    gbuffer = trace(made := camera(size=(4, 4)), [tilted(made, 0.0)])
    with pytest.raises(ValueError, match=r"size, margin and layers \(\(4, 4\).*expected"):
        device.upload(gbuffer)


def test_deriving_without_a_camera_is_refused(runtime: Runtime) -> None:
    with pytest.raises(ValueError, match=r"no camera: call set_camera or upload first"):
        DeviceGBuffer(runtime, (8, 8)).derive()
