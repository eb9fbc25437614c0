"""Default camera and lights of scenes without their own."""

from __future__ import annotations

import json
import math
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.default_camera import camera_from_json, default_camera, default_lights

from .meshes import front_depth, made, scene_of, slow_but

FOV = 0.9  # radians
WIDE = (80, 60)  # width, height

# Each side of a cube: its normal, and the corners of the side counter-clockwise seen from outside.
SIDES = {
    "+x": ((1, 0, 0), ((1, 0, 1), (1, 0, 0), (1, 1, 0), (1, 1, 1))),
    "-x": ((-1, 0, 0), ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0))),
    "+y": ((0, 1, 0), ((0, 1, 1), (1, 1, 1), (1, 1, 0), (0, 1, 0))),
    "-y": ((0, -1, 0), ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))),
    "+z": ((0, 0, 1), ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))),
    "-z": ((0, 0, -1), ((1, 0, 0), (0, 0, 0), (0, 1, 0), (1, 1, 0))),
}


def box(
    *,
    without: str = "",
    inward: bool = False,
    size: tuple[float, float, float] = (2.0, 1.0, 1.5),
    centre: NDArray[np.float64] | None = None,
) -> Scene:
    """A box of the given size, seen from outside or (inward) a room, perhaps without a side."""
    positions, normals, triangles = [], [], []
    for name, (normal, corners) in SIDES.items():
        if name == without:
            continue
        first = len(positions)
        positions += [(np.array(corner) - 0.5) * size for corner in corners]
        normals += [np.array(normal) * (-1.0 if inward else 1.0)] * 4
        for corner in ((0, 1, 2), (0, 2, 3)):
            triangle = [first + index for index in corner]
            triangles.append(triangle[::-1] if inward else triangle)
    return scene_of(positions, triangles, normals=normals, origin=np.zeros(3) if centre is None else centre)


def one_triangle(points: ArrayLike) -> Scene:
    corners = np.asarray(points, np.float64)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return scene_of(corners, normals=normal / np.linalg.norm(normal))


def view_of(scene: Scene, runtime: Runtime, size: tuple[int, int] = WIDE) -> Camera:
    return default_camera(scene, *size, FOV, runtime)


def point_light(scene: Scene, camera: Camera, runtime: Runtime) -> PointLight:
    """Return the first default light, which must be a point light."""
    light = default_lights(scene, camera, runtime)[0]
    assert isinstance(light, PointLight)
    return light


def is_inside(camera: Camera, scene: Scene) -> bool:
    low, high = scene.bounds
    return bool(((camera.position > low) & (camera.position < high)).all())


@pytest.mark.parametrize("size", [(80, 60), (60, 80), (160, 20), (33, 33)])
def test_an_object_fills_the_picture_and_is_not_cut(runtime: Runtime, size: tuple[int, int]) -> None:
    scene = box()
    camera = view_of(scene, runtime, size)
    covered = np.isfinite(front_depth(scene, camera, runtime))
    assert not is_inside(camera, scene)
    rows, columns = np.nonzero(covered)
    assert not covered[[0, -1]].any(), "it is cut at the top or bottom"
    assert not covered[:, [0, -1]].any(), "it is cut at a side"
    share = max(np.ptp(rows) + 1 + 1, np.ptp(columns) + 1 + 1) / np.array(covered.shape)
    # 0.9 of the picture in the tighter direction, less a pixel on either side for rounding.
    assert share.max() > 0.9 - 3.0 / min(size)


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_the_view_does_not_depend_on_the_scale(runtime: Runtime, scale: float) -> None:
    plain, scaled = box(), box(size=(2.0 * scale, 1.0 * scale, 1.5 * scale))
    ours, theirs = view_of(plain, runtime), view_of(scaled, runtime)
    # float32 positions differ by roundings of 2^-24; a tie between sides would show as a jump.
    np.testing.assert_allclose(theirs.position / scale, ours.position, rtol=1e-5, atol=1e-5)


def test_the_view_does_not_depend_on_where_the_scene_is(runtime: Runtime) -> None:
    far = np.array([1e7, -2e7, 3e7])
    ours, theirs = view_of(box(), runtime), view_of(box(centre=far), runtime)
    # float64 at 3e7 resolves 4e-9, and look_at goes through the position once more.
    np.testing.assert_allclose(theirs.position - far, ours.position, rtol=0, atol=1e-6)


def test_a_room_is_seen_from_within(runtime: Runtime) -> None:
    scene = box(inward=True)
    camera = view_of(scene, runtime)
    assert is_inside(camera, scene)
    depth = front_depth(scene, camera, runtime)
    assert np.isfinite(depth).all()
    # No wall in the face: half of the picture is further than a third of the room's diagonal.
    assert float(np.median(depth)) > np.linalg.norm(scene.bounds[1] - scene.bounds[0]) / 3.0


@pytest.mark.parametrize("side", [slow_but(side, "+x", "-z") for side in ("+x", "-x", "+z", "-z")])
def test_a_room_without_a_wall_is_seen_through_the_gap(runtime: Runtime, side: str) -> None:
    scene = box(without=side, inward=True)
    camera = view_of(scene, runtime)
    assert not is_inside(camera, scene)
    way = camera.position - scene.bounds.mean(axis=0)
    # Straight from the front: the direction is set by hand, the position follows from it.
    np.testing.assert_allclose(way / np.linalg.norm(way), SIDES[side][0], rtol=0, atol=1e-6)


def test_a_room_without_a_ceiling_is_seen_from_above(runtime: Runtime) -> None:
    scene = box(without="+y", inward=True)
    camera = view_of(scene, runtime)
    assert camera.position[1] > scene.bounds[1, 1]
    assert camera.view[2, 1] > math.sin(math.radians(35.0)), "it hardly looks down"


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_single_sided_surface_is_seen_from_its_front(runtime: Runtime, side: float) -> None:
    scene = one_triangle([[-side, -1, 0], [side, -1, 0], [0, 1, 0]])
    camera = view_of(scene, runtime)
    assert camera.position[2] * side > 0.0
    assert np.isfinite(front_depth(scene, camera, runtime)).any()


@pytest.mark.parametrize("scale", [1e-20, 1e15])
def test_a_triangle_of_any_size_is_seen(runtime: Runtime, scale: float) -> None:
    corners = np.array([[-1, -1, 0.2], [1, -1, 0], [0, 1, -0.3]]) * scale
    scene = one_triangle(corners)
    camera = view_of(scene, runtime)
    assert np.isfinite(front_depth(scene, camera, runtime)).mean() > 0.05


@pytest.mark.slow
def test_a_large_scene_is_looked_round_in_a_fraction_of_a_second(runtime: Runtime) -> None:
    scene = made("hall").scene
    view_of(scene, runtime)  # compiles and uploads
    start = perf_counter()
    default_lights(scene, view_of(scene, runtime), runtime)
    # Measured 0.45 s with 600 000 triangles on two cores; the hall has fewer. A loaded machine
    # gets ten times as long.
    assert perf_counter() - start < 3.0


def test_an_object_gets_a_sun_from_behind_the_viewer_and_a_sky(runtime: Runtime) -> None:
    scene = box()
    camera = view_of(scene, runtime)
    sun, sky = default_lights(scene, camera, runtime)
    assert isinstance(sun, DirectionalLight)
    assert isinstance(sky, Environment)
    direction = np.asarray(sun.direction)
    assert direction[1] < 0.0, "it shines from below"
    assert direction @ -camera.view[2, :3] > 0.0, "it shines in the viewer's face"


def test_a_closed_room_gets_a_light_inside(runtime: Runtime) -> None:
    scene = box(inward=True)
    camera = view_of(scene, runtime)
    light = point_light(scene, camera, runtime)
    low, high = scene.bounds
    assert (np.asarray(light.position) > low).all()
    assert (np.asarray(light.position) < high).all()


def test_a_room_seen_through_a_gap_gets_a_light_inside(runtime: Runtime) -> None:
    scene = box(without="+z", inward=True)
    light = point_light(scene, view_of(scene, runtime), runtime)
    assert (np.abs(np.asarray(light.position)) < 0.5 * np.array([2.0, 1.0, 1.5])).all()


def test_a_light_is_brighter_in_a_larger_room(runtime: Runtime) -> None:
    powers = []
    for scale in (1.0, 10.0):
        scene = box(inward=True, size=(2.0 * scale, scale, 1.5 * scale))
        powers.append(np.asarray(point_light(scene, view_of(scene, runtime), runtime).intensity))
    # Irradiance falls with the square of the distance; distances are float32.
    np.testing.assert_allclose(powers[1], 100.0 * powers[0], rtol=1e-4)


def test_a_view_straight_down_gets_lights(runtime: Runtime) -> None:
    scene = box()
    camera = Camera.look_at((0, 5, 0), (0, 0, 0), (0, 0, -1), yfov=FOV, width=8, height=6)
    lights = default_lights(scene, camera, runtime)
    assert isinstance(lights[0], DirectionalLight)


CAMERA = {"origin": [1, 2, 3], "forward": [0, 0, -2], "up": [0, 1, 0], "fov_deg": 90.0}


def written(folder: Path, content: object) -> Path:
    path = folder / "camera.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_camera_from_json_is_where_the_file_says(tmp_path: Path) -> None:
    camera = camera_from_json(written(tmp_path, CAMERA), 200, 100)
    np.testing.assert_allclose(camera.position, [1, 2, 3], rtol=0, atol=1e-12)  # float64 roundings
    np.testing.assert_allclose(-camera.view[2, :3], [0, 0, -1], rtol=0, atol=1e-12)
    # 90 degrees across: the picture's half width is as far as the plane; float64 roundings.
    np.testing.assert_allclose(camera.projection[0, 0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(camera.projection[1, 1], 2.0, rtol=1e-12)


def test_camera_from_json_takes_the_size_of_the_file_unless_it_is_given(tmp_path: Path) -> None:
    path = written(tmp_path, {"camera": {**CAMERA, "width": 64, "height": 32}})
    assert camera_from_json(path, None, None).size == (32, 64)
    assert camera_from_json(path, 10, None).size == (32, 10)
    with pytest.raises(ValueError, match="width is 0"):
        camera_from_json(path, 0, None)
    assert camera_from_json(written(tmp_path, CAMERA), None, None).size == (600, 800)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not JSON"),
        ("[1, 2]", "lacks origin, forward, up, fov_deg"),
        ({**CAMERA, "camera": 3}, "lacks origin"),
        ({key: CAMERA[key] for key in ("origin", "forward", "up")}, "lacks fov_deg"),
        ({**CAMERA, "fov_deg": 0}, "fov_deg is 0"),
        ({**CAMERA, "fov_deg": "60"}, "fov_deg is '60'"),
        ({**CAMERA, "origin": [1, 2]}, "origin"),
        ({**CAMERA, "origin": ["a", 2, 3]}, "origin"),
        ({**CAMERA, "forward": [0, 0, 0]}, "forward"),
        ({**CAMERA, "up": [0, 0, 1]}, "up"),
        ({**CAMERA, "width": 0}, "width is 0"),
        ({**CAMERA, "height": 2.5}, "height is 2.5"),
    ],
)
def test_camera_from_json_names_what_is_wrong(tmp_path: Path, content: object, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        camera_from_json(written(tmp_path, content), None, None)


def test_camera_from_json_says_that_a_file_is_missing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"nothing\.json cannot be read: No such file"):
        camera_from_json(tmp_path / "nothing.json", None, None)
