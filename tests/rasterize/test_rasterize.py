"""The OpenCL rasteriser against the OpenGL one and against itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera, look_at_matrix, perspective_matrix
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import Rasterizer, Scene, gbuffer, load_scene
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

from .meshes import HEIGHT, WIDTH, ahead, depth_of, facing, made, quad, scene_of, slanted, slow_but, there

Doubles = NDArray[np.float64]

SPONZA = Path(__file__).parents[3] / "shared" / "scenes" / "sponza" / "sponza.glb"
FEW = 1e-3
"""Share of pixels in which another triangle may win at a rounding: silhouettes, T-junctions."""

View = tuple[Scene, tuple[float, float, float], tuple[float, float, float], float]
VIEWS = [*BUILTIN_SCENES, "sponza"]


# ---- scenes and cameras


def view_of(name: str) -> View:
    """Return a scene with an eye, a target and a vertical field of view."""
    if name == "sponza":
        if not SPONZA.exists():
            pytest.skip("the Sponza model is not there: ../shared/scenes/sponza/sponza.glb")
        return load_scene(SPONZA), (-10.0, 1.2, -0.3), (8.0, 2.6, 0.4), 1.0
    built = made(name)
    return built.scene, built.eye, built.target, built.yfov


@pytest.fixture(scope="module", params=[slow_but(name, "workshop") for name in VIEWS])
def view(request: pytest.FixtureRequest) -> View:
    """Every scene; the fast tests take one of a hundred thousand triangles, down to wires of 3 mm."""
    return view_of(request.param)


@pytest.fixture(scope="module")
def workshop() -> View:
    return view_of("workshop")


def perspective(of: View) -> Camera:
    return Camera.look_at(of[1], of[2], yfov=of[3], width=WIDTH, height=HEIGHT)


def orthographic(of: View) -> Camera:
    # The plane of the camera lies within the scene, so that triangles cross it.
    height = 0.4 * float(np.linalg.norm(np.subtract(of[2], of[1])))
    return Camera.orthographic(of[1], of[2], view_height=height, width=WIDTH, height=HEIGHT)


def off_centre(of: View) -> Camera:
    projection = perspective_matrix(1.1, 1.3, 0.35, -0.6, 0.05, 40.0)
    view = look_at_matrix(of[1], of[2], (0.1, 1.0, 0.0))
    return Camera(view=view, projection=projection, width=WIDTH, height=HEIGHT)


def reversed_infinite(of: View) -> Camera:
    return Camera.look_at(of[1], of[2], yfov=of[3], width=WIDTH, height=HEIGHT, near=0.3, reversed_z=True)


def intrinsics(of: View) -> Camera:
    view = look_at_matrix(of[1], of[2], (0.0, 1.0, 0.0))
    return Camera.from_intrinsics(230.0, 190.0, 100.5, 80.25, width=WIDTH, height=HEIGHT, view=view, far=9.0)


CAMERAS = [perspective, orthographic, off_centre, reversed_infinite, intrinsics]


def degrees_between(one: NDArray[np.float32], other: NDArray[np.float32]) -> Doubles:
    a, b = one.astype(np.float64), other.astype(np.float64)
    across = np.linalg.norm(np.cross(a, b), axis=-1)
    angle: Doubles = np.degrees(np.arctan2(across, (a * b).sum(axis=-1)))
    return angle


def assert_same_picture(ours: GBuffer, theirs: GBuffer, *, textured: bool) -> None:
    """Hold a picture to another rasteriser's; FEW says which pixels may differ and why."""
    sees, saw = there(ours), there(theirs)
    assert (sees != saw).mean() < FEW, "coverage"
    both = sees & saw
    expected = np.where(both, depth_of(theirs), 1.0).astype(np.float64)
    # An orthographic depth counts from a plane amid the scene: near 0 it is as good as elsewhere.
    least = 0.1 * expected.max() if ours.camera.is_orthographic else 0.0
    error = np.abs(np.where(both, depth_of(ours), 1.0) - expected) / np.maximum(expected, least)
    # 1e-4 tells surfaces apart; where they are the same, both are good to a few roundings.
    assert (error > 1e-4).mean() < FEW, "depth"
    # Orthographic cameras see floors more slantwise, which multiplies roundings.
    good = 5e-6 if ours.camera.is_orthographic else 1e-6
    assert np.quantile(error[error <= 1e-4], 0.99) < good
    same = both & (error <= 1e-4)
    if same.ndim == np.asarray(ours.normal).ndim:
        same = same[0]  # the front layer alone has normals
    turned = degrees_between(np.asarray(ours.normal)[same], np.asarray(theirs.normal)[same])
    # Where two faces touch back to back (a plinth on the floor, once cut open), either may win.
    touching = turned > 179.9
    assert (~touching & (turned > 0.1)).mean() < FEW, "normal"
    off = np.abs(ours.albedo - theirs.albedo)[same][~touching].max(axis=-1)  # type: ignore[operator]
    if textured:
        # Drivers choose the mip level by formulas of their own.
        assert off.mean() < 0.01
        assert np.quantile(off, 0.99) < 0.05
    else:
        assert (off > 1e-5).mean() < FEW, "albedo"


# ---- against OpenGL


@pytest.mark.parametrize("make_camera", CAMERAS)
@pytest.mark.parametrize("name", [slow_but(name, "cornell_box") for name in VIEWS])
@pytest.mark.usefixtures("opengl_runs")
def test_both_backends_draw_the_same(runtime: Runtime, name: str, make_camera: Callable[[View], Camera]) -> None:
    scene, camera = (view := view_of(name))[0], make_camera(view)
    ours = gbuffer(scene, camera, runtime=runtime)
    theirs = gbuffer(scene, camera, backend="pyrender")
    assert there(ours).mean() > 0.1, "the camera should see something"
    assert_same_picture(ours, theirs, textured=bool(scene.textures))


@pytest.mark.usefixtures("opengl_runs")
def test_both_backends_draw_the_same_layers_and_margin(runtime: Runtime, view: View) -> None:
    scene, camera = view[0], perspective(view)
    ours, theirs = (
        gbuffer(scene, camera, layers=3, overscan=0.1, attributes="all", backend=backend, runtime=runtime)
        for backend in ("opencl", "pyrender")
    )
    assert ours.layers == 3
    assert np.shape(ours.normal) == np.shape(theirs.albedo) == (3, HEIGHT + 36, WIDTH + 48, 3)
    assert ours.margin == (18, 24)
    assert there(ours)[1].any(), "there should be a second layer"
    assert_same_picture(ours, theirs, textured=bool(scene.textures))


@pytest.mark.usefixtures("opengl_runs")
def test_both_backends_cut_at_a_near_plane_inside_the_scene(runtime: Runtime, workshop: View) -> None:
    camera = Camera.look_at(workshop[1], workshop[2], yfov=1.4, width=WIDTH, height=HEIGHT, near=4.0)
    ours = gbuffer(workshop[0], camera, runtime=runtime)
    theirs = gbuffer(workshop[0], camera, backend="pyrender")
    assert depth_of(ours).min() >= 4.0
    assert_same_picture(ours, theirs, textured=False)


# ---- margin, position and size of the scene


@pytest.mark.parametrize(
    ("name", "make_camera"),
    [*(("workshop", make) for make in CAMERAS), pytest.param("sponza", perspective, marks=pytest.mark.slow)],
)
def test_a_margin_does_not_change_the_image_within(
    runtime: Runtime, name: str, make_camera: Callable[[View], Camera]
) -> None:
    scene, camera = (view := view_of(name))[0], make_camera(view)
    without, wider = (gbuffer(scene, camera, layers=2, overscan=share, runtime=runtime) for share in (0.0, 0.1))
    for name in ("normal", "albedo"):
        np.testing.assert_array_equal(wider.inner(getattr(wider, name)), getattr(without, name), err_msg=name)
    for layer in range(2):
        np.testing.assert_array_equal(wider.inner(depth_of(wider)[layer]), depth_of(without)[layer])


def test_a_scene_far_away_looks_like_one_at_the_origin(runtime: Runtime, workshop: View) -> None:
    scene, eye, target, yfov = workshop
    shift = np.array([1e6, -2e6, 5e5])
    moved = replace(scene, origin=scene.origin + shift)
    at_home = gbuffer(scene, perspective(workshop), runtime=runtime)
    camera = Camera.look_at(eye + shift, target + shift, yfov=yfov, width=WIDTH, height=HEIGHT)
    away = gbuffer(moved, camera, runtime=runtime)
    # float64 positions 2e6 away are good to 2e-10: edges move by less than a snapping step, but
    # a pixel here and there changes hands.
    assert_same_picture(away, at_home, textured=False)


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_the_unit_of_length_does_not_matter(runtime: Runtime, workshop: View, scale: float) -> None:
    scene, eye, target, yfov = workshop
    scaled = replace(scene, positions=scene.positions * np.float32(scale), origin=scene.origin * scale)
    camera = Camera.look_at(np.multiply(eye, scale), np.multiply(target, scale), yfov=yfov, width=WIDTH, height=HEIGHT)
    small = gbuffer(scaled, camera, runtime=runtime)
    measured = GBuffer(
        camera=small.camera, depth=depth_of(small) / np.float32(scale), normal=small.normal, albedo=small.albedo
    )
    expected = gbuffer(scene, perspective(workshop), runtime=runtime)
    assert_same_picture(measured, expected, textured=False)


# ---- lists, bits, memory


def many_squares(rng: np.random.Generator) -> tuple[Scene, float]:
    """Make 20,000 squares that fill the view, and return the depth of the nearest."""
    depth = rng.permutation(np.linspace(2.0, 30.0, 20000)).astype(np.float32)
    points = (np.float32(facing(2, 1)) * depth[:, None, None]).reshape(-1, 3)
    first = 4 * np.arange(len(depth))[:, None]
    triangles = first + np.array([0, 1, 2, 0, 2, 3])
    return scene_of(points, triangles.reshape(-1, 3)), float(depth.min())


def test_triangles_left_out_by_boxes_are_not_missed(runtime: Runtime, rng: np.random.Generator) -> None:
    # Specks all around the camera; shuffled, each run of triangles is seen in part.
    centres = rng.uniform(-4.0, 4.0, (4000, 3))
    corners = centres[:, None] + rng.uniform(-0.2, 0.2, (4000, 3, 3))
    sorted_ones = corners[np.argsort(centres[:, 0] // 1 * 64 + centres[:, 1] // 1 * 8)]
    camera = ahead(96, 64, near=0.5, far=3.5)
    scenes = [
        scene_of(triangles.reshape(-1, 3), np.arange(12000).reshape(-1, 3))
        for triangles in (sorted_ones, rng.permutation(sorted_ones))
    ]
    results = [gbuffer(scene, camera, layers=2, runtime=runtime) for scene in scenes]
    np.testing.assert_array_equal(results[0].depth, results[1].depth)
    assert np.isfinite(depth_of(results[0])[0]).mean() > 0.2


def test_lists_that_are_too_short_grow(runtime: Runtime, rng: np.random.Generator) -> None:
    scene, nearest = many_squares(rng)
    kept = DeviceScene(runtime, scene)
    camera = ahead(96, 64)
    small, large = (Rasterizer(runtime, camera.size, layers=2) for _ in range(2))
    large._capacity, large._pair_capacity = 1 << 17, 1 << 20
    pictures = []
    for rasterizer in (small, large):
        with runtime.frame():
            pictures.append(rasterizer.render(kept, camera).depth.download())
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_allclose(pictures[0][0], nearest, rtol=3e-7)  # two roundings


def test_the_front_layer_does_not_depend_on_attributes_of_others(runtime: Runtime, view: View) -> None:
    camera = perspective(view)
    first, all_of_them = (
        gbuffer(view[0], camera, layers=2, overscan=0.05, attributes=which, runtime=runtime)
        for which in ("first", "all")
    )
    np.testing.assert_array_equal(first.depth, all_of_them.depth)
    for name in ("normal", "albedo", "emission"):
        one, other = first.first(name), all_of_them.first(name)
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_array_equal(one, other, err_msg=name)
    assert np.shape(first.normal) == (*np.shape(first.depth)[1:], 3)


def test_every_build_of_the_kernels_draws_the_same(other_variant: Runtime, view: View) -> None:
    reference = Runtime.open()
    camera = perspective(view)
    one, other = (
        gbuffer(view[0], camera, layers=2, attributes="all", runtime=runtime) for runtime in (other_variant, reference)
    )
    assert (there(one) == there(other)).all()
    both = there(one)
    # Compilers may fuse or reorder an operation: a rounding or two, 1e-5 for shading.
    np.testing.assert_allclose(depth_of(one)[both], depth_of(other)[both], rtol=1e-6)
    np.testing.assert_allclose(one.normal, other.normal, atol=1e-5)
    np.testing.assert_allclose(one.albedo, other.albedo, atol=1e-4)


def test_small_rectangles_as_on_a_gpu_give_bit_identical_results(variant_runtime: Runtime, workshop: View) -> None:
    kept = DeviceScene(variant_runtime, workshop[0])
    camera = perspective(workshop)
    pictures = []
    for rectangle, group in (((32, 32), (1, 1)), ((1, min(variant_runtime.variant.lanes, 8)), (8, 8))):
        rasterizer = Rasterizer(variant_runtime, camera.size, layers=2)
        rasterizer._rectangle, rasterizer._group = rectangle, group
        with variant_runtime.frame():
            pictures.append(rasterizer.render(kept, camera).depth.download())
    np.testing.assert_array_equal(*pictures)


def test_a_rasterizer_draws_one_scene_after_another_and_makes_nothing_for_the_same(
    runtime: Runtime, workshop: View
) -> None:
    box = made("cornell_box")
    rasterizer = Rasterizer(runtime, (HEIGHT, WIDTH), layers=2)
    kept, other = DeviceScene(runtime, box.scene), DeviceScene(runtime, workshop[0])

    def drawn() -> list[np.ndarray]:
        result = rasterizer.render(kept, box.camera(WIDTH, HEIGHT))
        return [plane.download() for plane in (result.depth, result.normal, result.albedo)]

    with runtime.frame():
        first = drawn()
        rasterizer.render(other, perspective(workshop))
        before = runtime.allocated_bytes, runtime.builds
        rasterizer.render(other, perspective(workshop))
        assert (runtime.allocated_bytes, runtime.builds) == before
        for one, again in zip(first, drawn(), strict=True):
            np.testing.assert_array_equal(one, again)


# ---- small and empty images, errors


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 7), (33, 31), (17, 1)])
def test_odd_sizes_agree_with_a_part_of_a_larger_image(runtime: Runtime, width: int, height: int) -> None:
    capacity = made("cornell_box")
    view = capacity.camera(4, 4).view
    small, large = (
        Camera.from_intrinsics(40.0, 40.0, 0.5 * width, 0.5 * height, width=w, height=h, view=view)
        for w, h in ((width, height), (64, 64))
    )
    one = gbuffer(capacity.scene, small, runtime=runtime)
    other = gbuffer(capacity.scene, large, runtime=runtime)
    assert there(one).any()
    # The same view rays, but for the rounding of the camera's numbers.
    part = depth_of(other)[:height, :width]
    np.testing.assert_allclose(depth_of(one), part, rtol=1e-6)


def test_a_camera_that_sees_nothing_gives_an_empty_image(runtime: Runtime) -> None:
    scene = quad(facing(1, -3))  # behind the camera
    result = gbuffer(scene, ahead(), layers=2, runtime=runtime)
    assert not there(result).any()
    assert not np.asarray(result.normal).any()
    assert not np.asarray(result.albedo).any()


@pytest.mark.parametrize("eye", [(0.0, 0.0, -3.0), (0.0, 0.0, -3.0000002), (9.0, 9.0, -3.0)])
def test_a_camera_inside_a_wall_gives_numbers(runtime: Runtime, eye: tuple[float, float, float]) -> None:
    behind = [(-9, -9, -8), (9, -9, -8), (0, 9, -8)]
    scene = scene_of([*facing(9, 3), *behind], [(0, 1, 2), (0, 2, 3), (4, 5, 6)])
    for way in ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.3, 0.2, -0.1), (0.0, -1.0, 1e-7)):
        camera = Camera.look_at(
            eye, np.add(eye, way), (0.1, 0.3, 1.0) if way[2] > -0.5 else (0, 1, 0), width=64, height=48
        )
        result = gbuffer(scene, camera, layers=2, runtime=runtime)
        assert not np.isnan(depth_of(result)).any()
        assert (depth_of(result) >= camera.near * (1.0 - 1e-6)).all()
        assert np.isfinite(result.normal).all()
        assert np.isfinite(result.albedo).all()


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"layers": 0}, ValueError, "layers is 0"),
        ({"layers": 17}, ValueError, "layers is 17"),
        ({"layers": 1.5}, TypeError, "layers is 1.5"),
        ({"overscan": -0.1}, ValueError, "overscan is -0.1"),
        ({"overscan": 1.1}, ValueError, "overscan is 1.1"),
        ({"overscan": "wide"}, TypeError, "overscan is 'wide'"),
        ({"attributes": "some"}, ValueError, "attributes is 'some'"),
        ({"backend": "vulkan"}, ValueError, "backend is 'vulkan'"),
        ({"camera": None}, TypeError, "camera is None"),
        ({"scene": "room.glb"}, TypeError, "scene is str"),
        ({"scene": "room.glb", "backend": "pyrender"}, TypeError, "scene is str"),
    ],
)
def test_wrong_arguments_are_refused(
    runtime: Runtime, changes: dict[str, object], error: type[Exception], words: str
) -> None:
    arguments = {"scene": slanted(), "camera": ahead(), "runtime": runtime, **changes}
    with pytest.raises(error, match=words):
        gbuffer(**arguments)


def test_a_camera_of_another_size_is_refused(runtime: Runtime) -> None:
    rasterizer = Rasterizer(runtime, (8, 16))
    with pytest.raises(ValueError, match=r"camera has size \(8, 17\)"):
        rasterizer.render(DeviceScene(runtime, slanted()), ahead(17, 8))


def test_an_image_that_is_too_large_with_its_margin_is_refused(runtime: Runtime) -> None:
    with pytest.raises(ValueError, match="at most 16384"):
        gbuffer(slanted(), ahead(16000, 1), overscan=0.1, runtime=runtime)
