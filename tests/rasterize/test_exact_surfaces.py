"""The OpenCL rasteriser on surfaces that are known exactly: planes, closed meshes, attributes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Material
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer

from .meshes import FLOOR, HEIGHT, WIDTH, ahead, assert_same_bits, depth_of, facing, quad, scene_of, slanted, there

Doubles = NDArray[np.float64]
Mask = NDArray[np.bool_]


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


# ---- watertightness


@pytest.mark.parametrize("shared", [True, False], ids=["shared vertices", "own vertices"])
@pytest.mark.parametrize(("cells", "zoom"), [(3, 1), (40, 1), (100, 4)], ids=["large", "small", "below a pixel"])
def test_a_tessellated_plane_has_no_hole(
    runtime: Runtime, rng: np.random.Generator, cells: int, zoom: int, shared: bool
) -> None:
    points = jittered_plane(rng, cells, half=4.0, depth=2.0)
    triangles = sheet(points)
    flat = points.reshape(-1, 3)
    if not shared:
        flat, triangles = flat[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3)
    result = gbuffer(scene_of(flat, triangles), ahead(WIDTH // zoom, HEIGHT // zoom), layers=2, runtime=runtime)
    front, behind = depth_of(result)
    # All vertices lie at exactly this depth; the plane through them is off by a rounding.
    np.testing.assert_allclose(front, 2.0, rtol=5e-7)
    assert not np.isfinite(behind).any()


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


def test_triangles_without_area_are_not_seen_and_do_no_harm(runtime: Runtime) -> None:
    wall = facing(9, 3)
    needle = [(-1, -1, -2), (0, 0, -2), (1, 1, -2), (0.5, 0.5, -2)]
    scene = scene_of([*wall, *needle], [(4, 4, 4), (0, 1, 2), (4, 5, 6), (0, 2, 3), (4, 5, 4), (5, 6, 7)])
    alone = quad(wall)
    camera = ahead(yfov=1.1)
    np.testing.assert_array_equal(
        depth_of(gbuffer(scene, camera, runtime=runtime)), depth_of(gbuffer(alone, camera, runtime=runtime))
    )


def test_a_surface_seen_edge_on_has_a_depth_within_its_own(runtime: Runtime) -> None:
    wall = facing(9, 6)
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
    result = gbuffer(quad(facing(9, 3), normals=np.tile(normal, (4, 1))), ahead(), runtime=runtime)
    assert there(result).all()
    # Normalised in float32.
    expected = np.broadcast_to(normal, (HEIGHT, WIDTH, 3))
    np.testing.assert_allclose(result.normal, expected, atol=3e-7)


# ---- attributes


def floor_points(camera: Camera) -> tuple[Doubles, Mask]:
    """World positions [rows, columns, 3] on `slanted`, and where it is."""
    depth = plane_depth(camera, (0, 1, 0), -1.0)
    points = camera.unproject(np.where(depth > 0, depth, 1.0).astype(np.float32))
    seen = (depth > 0) & (np.abs(points[..., 0]) < 5.9) & (points[..., 2] > -11.9)
    return points, seen


def test_vertex_colours_are_interpolated_in_perspective(runtime: Runtime) -> None:
    def colour(points: Doubles) -> Doubles:
        x, z = points[..., 0], points[..., 2]
        return np.stack([0.5 + x / 13.0, -z / 13.0 + 0.08, 0.5 + x / 30.0 + z / 40.0], axis=-1)

    scene = slanted(colors=colour(np.array(FLOOR, np.float64)), materials=(Material(albedo=(1.0, 0.5, 1.0)),))
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
    uvs = [(0, 0), (1, 0), (1, 1), (0, 1)]
    scene = scene_of(
        [*facing(depth, depth), *facing(99, 50)],
        [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)],
        uvs=[*uvs, *uvs],
        materials=(Material(texture=0, alpha_cutoff=0.5), Material()),
        material_ids=[0, 0, 1, 1],
        textures=(texture,),
    )
    camera = ahead(120, 120, yfov=1.2)
    first, second = depth_of(gbuffer(scene, camera, layers=2, runtime=runtime))
    x = camera.unproject(np.full(camera.size, depth, np.float32))[..., 0] / depth
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
