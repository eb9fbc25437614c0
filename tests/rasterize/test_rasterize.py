"""The OpenCL rasteriser against the OpenGL one, planes that are known exactly, and itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera, look_at_matrix, perspective_matrix
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import Material, Rasterizer, Scene, gbuffer, load_scene
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

from .meshes import scene_of

Doubles = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPONZA = Path(__file__).parents[3] / "shared" / "scenes" / "sponza" / "sponza.glb"
WIDTH, HEIGHT = 240, 180
FEW = 1e-3
"""Share of pixels in which another triangle may win at a rounding: silhouettes, T-junctions."""

View = tuple[Scene, tuple[float, float, float], tuple[float, float, float], float]


# ---- scenes and cameras


@pytest.fixture(scope="module", params=[*BUILTIN_SCENES, pytest.param("sponza", marks=pytest.mark.slow)])
def view(request: pytest.FixtureRequest) -> View:
    """A scene with an eye, a target and a vertical field of view."""
    if request.param == "sponza":
        if not SPONZA.exists():
            pytest.skip("the Sponza model is not there: ../shared/scenes/sponza/sponza.glb")
        return load_scene(SPONZA), (-10.0, 1.2, -0.3), (8.0, 2.6, 0.4), 1.0
    return built_in(request.param)


def built_in(name: str) -> View:
    made = BUILTIN_SCENES[name]()
    return made.scene, made.eye, made.target, made.yfov


@pytest.fixture(scope="module")
def hall() -> View:
    return built_in("hall")


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


def quad(corners: ArrayLike, **more: Any) -> Scene:
    """Make a scene of one quadrangle."""
    return scene_of(corners, [(0, 1, 2), (0, 2, 3)], **more)


def sheet(points: Doubles) -> NDArray[np.int64]:
    """Triangles [n, 3] that join neighbours of `points` [rows, columns, 3]."""
    rows, columns = points.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    both = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2)
    return both.reshape(-1, 3)


def jittered_plane(rng: np.random.Generator, cells: int, half: float, depth: float) -> Doubles:
    """Points [cells + 1, cells + 1, 3] of the plane z = -depth, each off its place at random."""
    steps = np.linspace(-half, half, cells + 1)
    x, y = np.meshgrid(steps, steps)
    jitter = rng.uniform(-0.35, 0.35, (2, *x.shape)) * (steps[1] - steps[0])
    return np.stack([x + jitter[0], y + jitter[1], np.full_like(x, -depth)], axis=-1)


def plane_depth(camera: Camera, normal: ArrayLike, offset: float) -> Doubles:
    """Linear depth [rows, columns] at which each view ray meets normal . x = offset."""
    near = camera.unproject(np.full(camera.size, 1.0, np.float32))
    far = camera.unproject(np.full(camera.size, 2.0, np.float32))
    start, along = 2.0 * near - far, far - near
    depth: Doubles = (offset - start @ np.asarray(normal)) / (along @ np.asarray(normal))
    return depth


def ahead(width: int = WIDTH, height: int = HEIGHT, **more: float) -> Camera:
    """Return a camera at 0 that looks down -z."""
    return Camera.look_at((0, 0, 0), (0, 0, -1), width=width, height=height, **more)  # type: ignore[arg-type]


def depth_of(result: GBuffer) -> NDArray[np.float32]:
    return np.asarray(result.depth)


def there(result: GBuffer) -> Mask:
    return np.isfinite(depth_of(result))


def assert_same_bits(one: GBuffer, other: GBuffer) -> None:
    for name in ("depth", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


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


def assert_backends_agree(runtime: Runtime, view: View, make_camera: Callable[[View], Camera]) -> None:
    scene, camera = view[0], make_camera(view)
    ours = gbuffer(scene, camera, runtime=runtime)
    theirs = gbuffer(scene, camera, backend="pyrender")
    assert there(ours).mean() > 0.1, "the camera should see something"
    assert_same_picture(ours, theirs, textured=bool(scene.textures))


@pytest.mark.parametrize(
    "make_camera", [CAMERAS[0], *(pytest.param(make, marks=pytest.mark.slow) for make in CAMERAS[1:])]
)
@pytest.mark.usefixtures("opengl_runs")
def test_both_backends_draw_the_same(runtime: Runtime, view: View, make_camera: Callable[[View], Camera]) -> None:
    assert_backends_agree(runtime, view, make_camera)


@pytest.mark.parametrize("make_camera", CAMERAS[1:])
@pytest.mark.usefixtures("opengl_runs")
def test_both_backends_draw_the_same_with_every_camera(runtime: Runtime, make_camera: Callable[[View], Camera]) -> None:
    assert_backends_agree(runtime, built_in("cornell_box"), make_camera)


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
def test_both_backends_cut_at_a_near_plane_inside_the_scene(runtime: Runtime, hall: View) -> None:
    camera = Camera.look_at(hall[1], hall[2], yfov=1.4, width=WIDTH, height=HEIGHT, near=4.0)
    ours = gbuffer(hall[0], camera, runtime=runtime)
    theirs = gbuffer(hall[0], camera, backend="pyrender")
    assert depth_of(ours).min() >= 4.0
    assert_same_picture(ours, theirs, textured=False)


# ---- margin, position and size of the scene


@pytest.mark.parametrize("make_camera", CAMERAS)
def test_a_margin_does_not_change_the_image_within(
    runtime: Runtime, hall: View, make_camera: Callable[[View], Camera]
) -> None:
    without, wider = (
        gbuffer(hall[0], make_camera(hall), layers=2, overscan=share, runtime=runtime) for share in (0.0, 0.1)
    )
    for name in ("normal", "albedo"):
        np.testing.assert_array_equal(wider.inner(getattr(wider, name)), getattr(without, name), err_msg=name)
    for layer in range(2):
        np.testing.assert_array_equal(wider.inner(depth_of(wider)[layer]), depth_of(without)[layer])


def test_a_textured_image_does_not_change_with_a_margin(runtime: Runtime, view: View) -> None:
    camera = perspective(view)
    without = gbuffer(view[0], camera, runtime=runtime)
    wider = gbuffer(view[0], camera, overscan=0.07, runtime=runtime)
    for name in ("depth", "normal", "albedo"):
        np.testing.assert_array_equal(wider.inner(getattr(wider, name)), getattr(without, name))


def test_a_scene_far_away_looks_like_one_at_the_origin(runtime: Runtime, hall: View) -> None:
    scene, eye, target, yfov = hall
    shift = np.array([1e6, -2e6, 5e5])
    moved = replace(scene, origin=scene.origin + shift)
    at_home = gbuffer(scene, perspective(hall), runtime=runtime)
    camera = Camera.look_at(eye + shift, target + shift, yfov=yfov, width=WIDTH, height=HEIGHT)
    away = gbuffer(moved, camera, runtime=runtime)
    # float64 positions 2e6 away are good to 2e-10: edges move by less than a snapping step, but
    # a pixel here and there changes hands.
    assert_same_picture(away, at_home, textured=False)


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1e2, 1e4])
def test_the_unit_of_length_does_not_matter(runtime: Runtime, hall: View, scale: float) -> None:
    scene, eye, target, yfov = hall
    scaled = replace(scene, positions=scene.positions * np.float32(scale), origin=scene.origin * scale)
    camera = Camera.look_at(np.multiply(eye, scale), np.multiply(target, scale), yfov=yfov, width=WIDTH, height=HEIGHT)
    small = gbuffer(scaled, camera, runtime=runtime)
    measured = GBuffer(
        camera=small.camera, depth=depth_of(small) / np.float32(scale), normal=small.normal, albedo=small.albedo
    )
    expected = gbuffer(scene, perspective(hall), runtime=runtime)
    assert_same_picture(measured, expected, textured=False)


# ---- watertightness


@pytest.mark.parametrize("shared", [True, False], ids=["shared vertices", "own vertices"])
@pytest.mark.parametrize("cells", [3, 40, 400], ids=["large", "small", "below a pixel"])
def test_a_tessellated_plane_has_no_hole(runtime: Runtime, rng: np.random.Generator, cells: int, shared: bool) -> None:
    points = jittered_plane(rng, cells, half=4.0, depth=2.0)
    triangles = sheet(points)
    flat = points.reshape(-1, 3)
    if not shared:
        flat, triangles = flat[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3)
    result = gbuffer(scene_of(flat, triangles), ahead(), layers=2, runtime=runtime)
    front, behind = depth_of(result)
    # All vertices lie at exactly this depth; the plane through them is off by a rounding.
    np.testing.assert_allclose(front, 2.0, rtol=5e-7)
    assert not np.isfinite(behind).any()


def test_a_tessellated_sphere_seen_from_within_has_no_hole(runtime: Runtime, rng: np.random.Generator) -> None:
    polar = np.linspace(0.0, np.pi, 61)[:, None]
    azimuth = np.linspace(0.0, 2.0 * np.pi, 121)[None, :]
    points = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.cos(polar) + 0.0 * azimuth, np.sin(polar) * np.sin(azimuth)], axis=-1
    )
    points *= rng.uniform(0.9, 1.1, (61, 121, 1))
    points[:, -1] = points[:, 0]
    points[0], points[-1] = points[0, 0], points[-1, 0]
    scene = scene_of(points.reshape(-1, 3), sheet(points))
    for target in ((1, 0, 0), (0, 1, 0.01), (-0.3, -1, 0.2), (0.1, 0, -1)):
        camera = Camera.look_at((0.01, 0.02, 0.03), target, (0.1, 0.2, 1), yfov=1.6, width=WIDTH, height=HEIGHT)
        assert there(gbuffer(scene, camera, runtime=runtime)).all()


def test_a_pixel_on_an_edge_belongs_to_one_triangle(runtime: Runtime, rng: np.random.Generator) -> None:
    # Vertices on pixel centres and on the lines between them. If a pixel were covered twice, the
    # triangle of lesser number would win, and the picture would change with the numbers.
    step = 1.0 / 32.0
    places = (np.arange(-40, 41) // 2 * 2 + 0.5) * step
    x, y = np.meshgrid(places[::2], places[::2])
    points = np.stack([x, y, np.full_like(x, -1.0)], axis=-1)
    triangles = sheet(points)
    corners = points.reshape(-1, 3)[triangles.ravel()]
    colors = np.repeat(rng.uniform(0.0, 1.0, (len(triangles), 3)), 3, axis=0)
    order = rng.permutation(len(triangles))
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=64 * step, width=64, height=64, far=2.0)
    numbers = np.arange(triangles.size).reshape(-1, 3)
    one = gbuffer(scene_of(corners, numbers, colors=colors), camera, runtime=runtime)
    other = gbuffer(scene_of(corners, numbers[order], colors=colors), camera, runtime=runtime)
    assert there(one)[16:48, 16:48].all()
    assert_same_bits(one, other)


@pytest.mark.parametrize("half", [1e2, 1e4, 1e5, 1e6])
@pytest.mark.parametrize("pitch", [0.0, 0.3, 1.2])
def test_a_huge_ground_under_the_camera_is_whole(runtime: Runtime, half: float, pitch: float) -> None:
    ground = quad([(-half, 0, -half), (half, 0, -half), (half, 0, half), (-half, 0, half)])
    camera = Camera.look_at((0.3, 1.6, 0.2), (1.3, 1.6 - np.tan(pitch), 0.9), width=WIDTH, height=HEIGHT, near=1e-3)
    expected = plane_depth(camera, (0, 1, 0), 0.0)
    inside = (expected > 0.0) & (expected < 0.5 * half)
    depth = depth_of(gbuffer(ground, camera, runtime=runtime))
    assert np.isfinite(depth[inside]).all()
    assert not np.isfinite(depth[expected < 0.0]).any()
    # Towards the horizon the ray's slope cancels: 1e-7 / (1.6 / depth) at 1e4 m is 6e-4.
    near = inside & (expected < 100.0)
    np.testing.assert_allclose(depth[near], expected[near], rtol=1e-5)


@pytest.mark.parametrize("half", [1e3, 2e4, 1e5, 1e6])
def test_a_diagonal_of_huge_triangles_leaves_no_gap(runtime: Runtime, half: float) -> None:
    wall = quad([(-half, -half, -10), (half, -half, -10), (half, half, -10), (-half, half, -10)])
    for eye in ((0.0, 0.0, 0.0), (3.0, 0.7, 0.0), (-40.0, 35.0, 0.0)):
        camera = Camera.look_at(eye, np.add(eye, (0, 0, -1)), width=WIDTH, height=HEIGHT)
        # Three roundings: of the plane's offset, of the slope, and of the quotient.
        np.testing.assert_allclose(depth_of(gbuffer(wall, camera, runtime=runtime)), 10.0, 2e-7)


def test_a_camera_in_a_closed_room_of_huge_triangles_sees_no_hole(runtime: Runtime) -> None:
    half = 1e5
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    capacity = scene_of(corners, triangles)
    for eye in ((0, 0, 0), (half - 2.0, half - 3.0, -half + 1.0), (0.3 * half, -half + 1.6, 7.0)):
        for way in ((1, 0.2, 0.1), (-0.4, -1, 0.3), (0.3, 0.5, -1), (0.7, -0.7, 0.7)):
            camera = Camera.look_at(
                eye, np.add(eye, way), (0.3, 1, 0.2), yfov=1.5, width=WIDTH, height=HEIGHT, near=0.1
            )
            assert there(gbuffer(capacity, camera, runtime=runtime)).all()


# ---- odd triangles


def test_depth_of_a_slanted_plane_is_right_to_a_few_roundings(runtime: Runtime) -> None:
    normal, offset = np.array([0.25, 0.75, 0.5]), -1.0
    x, y = np.array([-8.0, 8.0, 8.0, -8.0]), np.array([-8.0, -8.0, 8.0, 8.0])
    plane = quad(np.stack([x, y, (offset - 0.25 * x - 0.75 * y) / 0.5], axis=-1))
    for camera in (ahead(), Camera.orthographic((0, 0, 5), (0, 0, 0), view_height=4.0, width=WIDTH, height=HEIGHT)):
        expected = plane_depth(camera, normal, offset)
        depth = depth_of(gbuffer(plane, camera, runtime=runtime))
        seen = (expected > 0.01) & (expected < 12.0)
        assert seen.mean() > 0.3
        np.testing.assert_allclose(depth[seen], expected[seen], rtol=1e-6)


def test_a_scene_of_one_triangle(runtime: Runtime) -> None:
    scene = scene_of([(-1, -1, -2), (1, -1, -2), (-1, 1, -2)], [(0, 1, 2)])
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=4.0, width=200, height=200, far=9.0)
    result = gbuffer(scene, camera, runtime=runtime)
    row, column = np.mgrid[:200, :200]
    x, y = (column + 0.5) / 50.0 - 2.0, 2.0 - (row + 0.5) / 50.0
    # Half an unit square, but for the pixels on the slanted edge, which lies on their centres.
    inside = (x > -1.0) & (y > -1.0) & (x + y < -1e-6)
    outside = (x < -1.0) | (y < -1.0) | (x + y > 1e-6)
    assert there(result)[inside].all()
    assert not there(result)[outside].any()
    np.testing.assert_array_equal(depth_of(result)[inside], 2.0)


def test_triangles_without_area_are_not_seen_and_do_no_harm(runtime: Runtime) -> None:
    wall = [(-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3)]
    needle = [(-1, -1, -2), (0, 0, -2), (1, 1, -2), (0.5, 0.5, -2)]
    scene = scene_of([*wall, *needle], [(4, 4, 4), (0, 1, 2), (4, 5, 6), (0, 2, 3), (4, 5, 4), (5, 6, 7)])
    alone = quad(wall)
    camera = ahead(yfov=1.1)
    np.testing.assert_array_equal(
        depth_of(gbuffer(scene, camera, runtime=runtime)), depth_of(gbuffer(alone, camera, runtime=runtime))
    )


def test_a_surface_seen_edge_on_has_a_depth_within_its_own(runtime: Runtime) -> None:
    wall = [(-9, -9, -6), (9, -9, -6), (9, 9, -6), (-9, 9, -6)]
    blade = [(0, -1, -2), (0, -1, -4), (0, 1, -4), (0, 1, -2)]
    scene = scene_of([*wall, *blade], [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    for width in (64, 65):  # the blade lies between two columns, and in the middle of one
        for shift in (0.0, 1e-9, 1e-6):
            camera = Camera.look_at((shift, 0, 0), (shift, 0, -1), width=width, height=48)
            depth = depth_of(gbuffer(scene, camera, runtime=runtime))
            of_wall = np.abs(depth - 6.0) < 1e-5
            assert (of_wall | ((depth >= 2.0 - 1e-5) & (depth <= 4.0 + 1e-5))).all()
            assert (~of_wall).any(axis=0).sum() <= 1


@pytest.mark.parametrize("backend_side", [1.0, -1.0], ids=["front", "back"])
def test_both_sides_are_drawn_with_the_normal_of_the_mesh(runtime: Runtime, backend_side: float) -> None:
    normal = np.array([0.6, 0.0, 0.8]) * backend_side
    corners = [(-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3)]
    result = gbuffer(quad(corners, normals=np.tile(normal, (4, 1))), ahead(), runtime=runtime)
    assert there(result).all()
    # Normalised in float32.
    expected = np.broadcast_to(normal, (HEIGHT, WIDTH, 3))
    np.testing.assert_allclose(result.normal, expected, atol=3e-7)


# ---- attributes


def slanted(**more: Any) -> Scene:
    """Make a floor that runs from below the camera to far ahead."""
    corners = [(-6, -1, 1), (6, -1, 1), (6, -1, -12), (-6, -1, -12)]
    return quad(corners, **more)


def floor_points(camera: Camera) -> tuple[Doubles, Mask]:
    """World positions [rows, columns, 3] on `slanted`, and where it is."""
    depth = plane_depth(camera, (0, 1, 0), -1.0)
    points = camera.unproject(np.where(depth > 0, depth, 1.0).astype(np.float32))
    seen = (depth > 0) & (np.abs(points[..., 0]) < 5.9) & (points[..., 2] > -11.9)
    return points, seen


def test_vertex_colours_are_interpolated_in_perspective(runtime: Runtime) -> None:
    corners = np.array([(-6, -1, 1), (6, -1, 1), (6, -1, -12), (-6, -1, -12)], np.float64)

    def colour(points: Doubles) -> Doubles:
        x, z = points[..., 0], points[..., 2]
        return np.stack([0.5 + x / 13.0, -z / 13.0 + 0.08, 0.5 + x / 30.0 + z / 40.0], axis=-1)

    scene = slanted(colors=colour(corners), materials=(Material(albedo=(1.0, 0.5, 1.0)),))
    result = gbuffer(scene, ahead(yfov=1.2), runtime=runtime)
    points, seen = floor_points(result.camera)
    expected = colour(points) * (1.0, 0.5, 1.0)
    # Slopes are good to 1e-7, which is 1e-6 of a 12 m floor where it is seen at 5 degrees.
    np.testing.assert_allclose(result.albedo[seen], expected[seen], atol=3e-6)


def test_a_texture_lies_where_its_coordinates_say(runtime: Runtime) -> None:
    cells = np.indices((16, 16)).sum(axis=0) % 2 * 255
    texels = np.repeat(np.repeat(cells, 16, axis=0), 16, axis=1).astype(np.uint8)
    texture = np.stack([texels, 255 - texels, texels, np.full_like(texels, 255)], axis=-1)
    uvs = np.array([(-0.5, 0.0), (1.5, 0.0), (1.5, 2.0), (-0.5, 2.0)])  # repeated twice
    scene = slanted(uvs=uvs, materials=(Material(albedo=(1.0, 1.0, 0.25), texture=0),), textures=(texture,))
    result = gbuffer(scene, ahead(yfov=1.2), runtime=runtime)
    points, seen = floor_points(result.camera)
    u = (points[..., 0] + 6.0) / 6.0 - 0.5
    v = (1.0 - points[..., 2]) / 6.5
    column, row = u % 1.0 * 16.0, (1.0 - v % 1.0) * 16.0
    # Away from the edges of cells, and near enough that a pixel is smaller than a texel or two.
    clear = (np.abs(column % 1.0 - 0.5) < 0.3) & (np.abs(row % 1.0 - 0.5) < 0.3)
    seen &= clear & (points[..., 2] > -4.0)
    assert seen.sum() > 500
    light = (np.floor(column) + np.floor(row)) % 2
    expected = np.stack([light, 1.0 - light, 0.25 * light], axis=-1)
    np.testing.assert_allclose(result.albedo[seen], expected[seen], atol=1e-5)


@pytest.mark.parametrize("depth", [1.0, 30.0], ids=["magnified", "minified"])
def test_a_cut_out_keeps_its_shape_and_shows_what_lies_behind(runtime: Runtime, depth: float) -> None:
    alpha = np.zeros((64, 64), np.uint8)
    alpha[:, 32:] = 255
    texture = np.dstack([np.full((64, 64, 3), 255, np.uint8), alpha])
    half = depth
    corners = [(-half, -half, -depth), (half, -half, -depth), (half, half, -depth), (-half, half, -depth)]
    behind = [(-99, -99, -50), (99, -99, -50), (99, 99, -50), (-99, 99, -50)]
    uvs = [(0, 0), (1, 0), (1, 1), (0, 1)]
    scene = scene_of(
        [*corners, *behind],
        [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)],
        uvs=[*uvs, *uvs],
        materials=(Material(texture=0, alpha_cutoff=0.5), Material()),
        material_ids=[0, 0, 1, 1],
        textures=(texture,),
    )
    camera = ahead(120, 120, yfov=1.2)
    first, second = depth_of(gbuffer(scene, camera, layers=2, runtime=runtime))
    x = camera.unproject(np.full(camera.size, depth, np.float32))[..., 0] / half
    solid, hole = (x > 0.02) & (x < 0.97), (x < -0.02) & (x > -0.97)
    np.testing.assert_allclose(first[solid], depth, rtol=1e-6)
    np.testing.assert_allclose(first[hole], 50.0, rtol=1e-6)
    np.testing.assert_allclose(second[solid], 50.0, rtol=1e-6)
    assert not np.isfinite(second[hole]).any()


def test_emission_is_that_of_the_material(runtime: Runtime) -> None:
    scene = slanted(materials=(Material(emission=(3.0, 0.5, 7.0)),))
    result = gbuffer(scene, ahead(), runtime=runtime)
    seen = there(result)
    assert result.emission is not None
    np.testing.assert_array_equal(np.asarray(result.emission)[seen], [(3.0, 0.5, 7.0)] * seen.sum())
    assert not np.asarray(result.emission)[~seen].any()


# ---- lists, bits, memory


def many_squares(rng: np.random.Generator) -> tuple[Scene, float]:
    """Make 20,000 squares that fill the view, and return the depth of the nearest."""
    depth = rng.permutation(np.linspace(2.0, 30.0, 20000)).astype(np.float32)
    corner = np.array([(-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1)], np.float32)
    points = (corner * depth[:, None, None]).reshape(-1, 3)
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


def test_two_runs_give_bit_identical_results(runtime: Runtime, view: View) -> None:
    camera = perspective(view)
    for layers in (1, 2):
        one, other = (gbuffer(view[0], camera, layers=layers, runtime=runtime) for _ in "ab")
        assert_same_bits(one, other)


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


def test_small_rectangles_as_on_a_gpu_give_bit_identical_results(variant_runtime: Runtime, hall: View) -> None:
    kept = DeviceScene(variant_runtime, hall[0])
    camera = perspective(hall)
    pictures = []
    for rectangle, group in (((32, 32), (1, 1)), ((1, min(variant_runtime.variant.lanes, 8)), (8, 8))):
        rasterizer = Rasterizer(variant_runtime, camera.size, layers=2)
        rasterizer._rectangle, rasterizer._group = rectangle, group
        with variant_runtime.frame():
            pictures.append(rasterizer.render(kept, camera).depth.download())
    np.testing.assert_array_equal(*pictures)


def test_a_steady_frame_allocates_and_builds_nothing(runtime: Runtime, hall: View) -> None:
    kept = DeviceScene(runtime, hall[0])
    rasterizer = Rasterizer(runtime, (HEIGHT, WIDTH), layers=2)
    with runtime.frame():
        rasterizer.render(kept, perspective(hall))
        before = runtime.allocated_bytes, runtime.builds
        rasterizer.render(kept, perspective(hall))
    assert (runtime.allocated_bytes, runtime.builds) == before


def test_a_rasterizer_draws_one_scene_after_another(runtime: Runtime, hall: View) -> None:
    capacity = BUILTIN_SCENES["cornell_box"]()
    rasterizer = Rasterizer(runtime, (HEIGHT, WIDTH))
    camera = capacity.camera(WIDTH, HEIGHT)
    kept = DeviceScene(runtime, capacity.scene)
    with runtime.frame():
        first = rasterizer.render(kept, camera).depth.download()
        rasterizer.render(DeviceScene(runtime, hall[0]), perspective(hall))
        again = rasterizer.render(kept, camera).depth.download()
    np.testing.assert_array_equal(first, again)


# ---- small and empty images, errors


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 7), (33, 31), (17, 1)])
def test_odd_sizes_agree_with_a_part_of_a_larger_image(runtime: Runtime, width: int, height: int) -> None:
    capacity = BUILTIN_SCENES["cornell_box"]()
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
    scene = quad([(-1, -1, 3), (1, -1, 3), (1, 1, 3), (-1, 1, 3)])  # behind the camera
    result = gbuffer(scene, ahead(), layers=2, runtime=runtime)
    assert not there(result).any()
    assert not np.asarray(result.normal).any()
    assert not np.asarray(result.albedo).any()


@pytest.mark.parametrize("eye", [(0.0, 0.0, -3.0), (0.0, 0.0, -3.0000002), (9.0, 9.0, -3.0)])
def test_a_camera_inside_a_wall_gives_numbers(runtime: Runtime, eye: tuple[float, float, float]) -> None:
    wall = [(-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3)]
    behind = [(-9, -9, -8), (9, -9, -8), (0, 9, -8)]
    scene = scene_of([*wall, *behind], [(0, 1, 2), (0, 2, 3), (4, 5, 6)])
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
