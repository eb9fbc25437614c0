"""Cameras: held to their own 4 x 4 matrices, for every kind of projection."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera, look_at_matrix, perspective_matrix

EYE, TARGET = (3.0, 2.0, 5.0), (0.5, -1.0, 0.0)
W, H = 64, 48


def with_projection(projection: NDArray[np.float64], depth_range: Any = "-1..1") -> Camera:
    view = look_at_matrix(EYE, TARGET, (0, 1, 0))
    return Camera(view=view, projection=projection, width=W, height=H, depth_range=depth_range)


def frustum(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Any:
    """OpenGL's glFrustum, from its manual."""
    return np.array(
        [
            [2 * near / (right - left), 0, (right + left) / (right - left), 0],
            [0, 2 * near / (top - bottom), (top + bottom) / (top - bottom), 0],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )


def ortho(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Any:
    """OpenGL's glOrtho, from its manual."""
    return np.array(
        [
            [2 / (right - left), 0, 0, -(right + left) / (right - left)],
            [0, 2 / (top - bottom), 0, -(top + bottom) / (top - bottom)],
            [0, 0, -2 / (far - near), -(far + near) / (far - near)],
            [0, 0, 0, 1],
        ]
    )


def reversed_ortho(near: float, far: float) -> Any:
    """Near at 1 and far at 0, x and y off the centre."""
    matrix = ortho(-1, 3, -2, 1, near, far)
    matrix[2] = 0, 0, 1 / (far - near), far / (far - near)
    return matrix


CAMERAS = {
    "perspective": Camera.look_at(EYE, TARGET, width=W, height=H, near=0.1, far=100.0),
    "infinite far": Camera.look_at(EYE, TARGET, width=W, height=H, near=0.1),
    "reversed": Camera.look_at(EYE, TARGET, width=W, height=H, near=0.1, far=100.0, reversed_z=True),
    "reversed, infinite far": Camera.look_at(EYE, TARGET, width=W, height=H, near=0.1, reversed_z=True),
    "off-centre": with_projection(frustum(-0.1, 0.3, -0.2, 0.05, 0.1, 100.0)),
    "scaled matrix": with_projection(frustum(-0.1, 0.3, -0.2, 0.05, 0.1, 100.0) * 7.0),
    "orthographic": Camera.orthographic(EYE, TARGET, view_height=4.0, width=W, height=H, near=0.1, far=100.0),
    "off-centre orthographic": with_projection(ortho(-1, 3, -2, 1, 0.1, 100.0)),
    "reversed orthographic": with_projection(reversed_ortho(0.1, 100.0), "0..1"),
    "intrinsics": Camera.from_intrinsics(
        50.0, 60.0, 20.0, 30.0, width=W, height=H, near=0.1, far=100.0, view=look_at_matrix(EYE, TARGET, (0, 1, 0))
    ),
}
CAMERAS["margin"] = CAMERAS["off-centre"].with_margin((3, 5))
CAMERAS["orthographic margin"] = CAMERAS["off-centre orthographic"].with_margin((3, 5))
every_camera = pytest.mark.parametrize("name", CAMERAS)


def pixels_of(camera: Camera, world: NDArray[np.float64]) -> tuple[Any, Any, Any, Any]:
    """Column, row, linear depth and NDC depth of world points, by the two matrices alone."""
    points = np.concatenate([world, np.ones((len(world), 1))], axis=1)
    view = points @ camera.view.T
    clip = view @ camera.projection.T
    ndc = clip[:, :3] / clip[:, 3:]
    column = (ndc[:, 0] + 1.0) / 2.0 * camera.width
    row = (1.0 - ndc[:, 1]) / 2.0 * camera.height
    return column, row, -view[:, 2], ndc[:, 2]


@every_camera
def test_unproject_is_the_inverse_of_projecting(name: str, rng: np.random.Generator) -> None:
    camera = CAMERAS[name]
    depth = np.exp2(rng.uniform(-3, 6, camera.size)).astype(np.float32)
    column, row, found, _ = pixels_of(camera, camera.unproject(depth).reshape(-1, 3))
    rows, columns = np.indices(camera.size) + 0.5
    np.testing.assert_allclose(column, columns.ravel(), rtol=0, atol=1e-10)  # float64: of about 100
    np.testing.assert_allclose(row, rows.ravel(), rtol=0, atol=1e-10)
    np.testing.assert_allclose(found, depth.ravel(), rtol=1e-12)


@every_camera
def test_near_and_far_are_found_in_the_matrix_and_their_planes_at_the_ends_of_the_range(name: str) -> None:
    camera = CAMERAS[name]
    # The matrix holds them through differences that lose far / near = 1000 of 2e-16.
    far = math.inf if "infinite" in name else 100.0
    assert (camera.near, camera.far) == (pytest.approx(0.1, rel=1e-11), pytest.approx(far, rel=1e-11))
    depths = [camera.near, min(camera.far, 1e15)]
    points = [camera.position - depth * camera.view[2, :3] for depth in depths]
    if camera.is_orthographic:
        centre = [camera.view[:3, :3].T @ [1.0, -0.5, -depth] for depth in depths]
        points = [camera.position + c for c in centre]
    ends = (-1.0, 1.0) if camera.depth_range == "-1..1" else (0.0, 1.0)
    ndc = pixels_of(camera, np.array(points))[3]
    expected = ends[::-1] if "reversed" in name else ends
    np.testing.assert_allclose(ndc, expected, rtol=0, atol=1e-9)  # float64 over a ratio of 1000


def test_a_margin_shows_the_same_pixels_further_in(rng: np.random.Generator) -> None:
    world = rng.uniform(-0.3, 0.3, (100, 3)) + TARGET
    for name in ("off-centre", "off-centre orthographic"):
        camera = CAMERAS[name]
        wide = camera.with_margin((3, 5))
        assert wide.size == (H + 6, W + 10)
        before, after = pixels_of(camera, world), pixels_of(wide, world)
        np.testing.assert_allclose(after[0], before[0] + 5, rtol=0, atol=1e-10)  # float64
        np.testing.assert_allclose(after[1], before[1] + 3, rtol=0, atol=1e-10)
        depth = np.full(wide.size, 2.0, np.float32)
        np.testing.assert_allclose(camera.unproject(depth), wide.unproject(depth), atol=1e-12)


def test_intrinsics_are_those_of_a_calibrated_camera() -> None:
    camera = Camera.from_intrinsics(50.0, 60.0, 20.0, 30.0, width=W, height=H)
    # x right, y down, z forward in that convention: u = fx x / z + cx.
    x, y, z = 0.3, -0.2, 2.0
    column, row, depth, _ = pixels_of(camera, np.array([[x, -y, -z]]))
    assert column[0] == pytest.approx(50.0 * x / z + 20.0)
    assert row[0] == pytest.approx(60.0 * y / z + 30.0)
    assert depth[0] == z


def test_look_at_puts_the_target_in_the_middle_and_up_upwards() -> None:
    camera = CAMERAS["perspective"]
    column, row, depth, _ = pixels_of(camera, np.array([TARGET]))
    assert (column[0], row[0]) == (pytest.approx(W / 2), pytest.approx(H / 2))
    assert depth[0] == pytest.approx(np.linalg.norm(np.subtract(EYE, TARGET)))
    np.testing.assert_allclose(camera.position, EYE, atol=1e-12)  # float64
    above = pixels_of(camera, np.array([TARGET]) + np.array([0, 0.1, 0]))
    assert above[1][0] < row[0]


def test_the_field_of_view_is_that_of_the_height_and_matrices_are_copied() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=1.0, width=W, height=H)
    edge = np.array([[0, math.tan(0.5), -1.0]])
    assert pixels_of(camera, edge)[1][0] == pytest.approx(0.0, abs=1e-12)  # float64
    assert camera.near == pytest.approx(1e-3)
    view = np.eye(4)  # of the caller, who may change it
    camera = Camera(view=view, projection=camera.projection, width=W, height=H)
    view[0, 3] = 5.0
    assert camera.view[0, 3] == 0.0


def test_far_pixels_without_surface_unproject_to_nothing() -> None:
    world = CAMERAS["perspective"].unproject(np.full((H, W), np.inf, np.float32))
    assert not np.isfinite(world).all(axis=-1).any()


GOOD = perspective_matrix(1, 1, 0, 0, 0.1, 10)


def changed(matrix: NDArray[np.float64], *items: tuple[int, int, float]) -> NDArray[np.float64]:
    copy = matrix.copy()
    for row, column, value in items:
        copy[row, column] = value
    return copy


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"view": np.eye(3)}, r"view has shape \(3, 3\)"),
        ({"view": np.eye(4) * 2}, "expected a rotation and a translation"),
        ({"view": np.diag([-1.0, 1, 1, 1])}, "expected a rotation and a translation"),
        ({"view": changed(np.eye(4), (3, 0, 1.0))}, "last row 0 0 0 1"),
        ({"view": changed(np.eye(4), (0, 3, np.nan))}, "view holds a value that is not finite"),
        ({"projection": np.zeros((4, 4))}, "projection's last row"),
        ({"projection": changed(GOOD, (3, 2, 1.0))}, "looks down -z"),
        ({"projection": changed(GOOD, (0, 1, 0.1))}, "no skew"),
        ({"projection": changed(GOOD, (2, 0, 0.1))}, "no skew"),
        ({"projection": changed(GOOD, (0, 3, 0.1))}, "no skew"),
        ({"projection": changed(GOOD, (1, 1, -1.0))}, "expected both > 0"),
        ({"projection": changed(GOOD, (2, 2, 0.0), (2, 3, 0.0))}, "depends on depth"),
        ({"projection": changed(GOOD, (2, 3, 0.2))}, "0 < near < far"),
        ({"projection": perspective_matrix(1, 1, 0, 0, 0.1, 10, reversed_z=True)}, "reversed-Z needs '0..1'"),
        ({"depth_range": "0..2"}, "depth_range is '0..2'"),
        ({"width": 0}, r"width is 0: expected an integer >= 1 and <= 16384 \(px\)"),
        ({"height": 16385}, "height is 16385"),
    ],
)
def test_bad_cameras_are_refused(changes: dict[str, Any], message: str) -> None:
    values: dict[str, Any] = {"view": np.eye(4), "projection": GOOD, "width": W, "height": H}
    with pytest.raises(ValueError, match=message):
        Camera(**{**values, **changes})


def look_at(**changes: Any) -> Camera:
    values: dict[str, Any] = {"eye": EYE, "target": TARGET, "width": W, "height": H}
    return Camera.look_at(**{**values, **changes})


def orthographic(**changes: Any) -> Camera:
    values: dict[str, Any] = {"eye": EYE, "target": TARGET, "width": W, "height": H, "view_height": 1.0}
    return Camera.orthographic(**{**values, **changes})


def intrinsic(fx: float, fy: float, cx: float, *, y: float = 0.0) -> Camera:
    return Camera.from_intrinsics(fx, fy, cx, 0.0, width=W, height=H, view=changed(np.eye(4), (1, 3, y)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: look_at(eye=TARGET), "eye and target are both"),
        (lambda: look_at(up=np.subtract(EYE, TARGET)), "not parallel to the view ray"),
        (lambda: look_at(up=(0, 0, 0)), "non-zero length"),
        (lambda: look_at(yfov=0.0), "yfov is 0.0"),
        (lambda: look_at(yfov=3.2), r"yfov is 3.2: .* \(radians\)"),
        (lambda: look_at(near=0.0), "near is 0.0: expected a number > 0"),
        (lambda: look_at(near=2.0, far=2.0), "far is 2.0: expected a number > 2"),
        (lambda: look_at(far=math.nan), "far is nan"),
        (lambda: look_at(width=0), "width is 0"),
        (lambda: look_at(eye=(0, 0, math.inf)), "eye is .*finite"),
        (lambda: look_at(eye=(0, 0, 1e31)), r"eye is .*at most 1e\+30 \(scene units\)"),
        (lambda: orthographic(view_height=0.0), "view_height is 0.0: expected a number >= 1e-28"),
        (lambda: orthographic(view_height=1e300), r"view_height is 1e\+300: .* <= 1e\+28 \(scene units\)"),
        (lambda: orthographic(near=2.0, far=1.0), "far is 1.0: expected a number > 2"),
        (lambda: orthographic(far=math.inf), "far is inf"),
        (lambda: orthographic(height=0), "height is 0"),
        (lambda: intrinsic(1.0, 1.0, 0.0, y=-1e31), r"translation of view is .*at most 1e\+30 \(scene units"),
        (lambda: intrinsic(1e300, 1.0, 0.0), r"scales are .*: expected 1e-28 to 1e\+28"),
        (lambda: intrinsic(1.0, 1e-40, 0.0), "scales are"),
        (lambda: intrinsic(1.0, 1.0, 1e300), r"shifts the image by .* of half its size: expected at most 1e"),
    ],
)
def test_bad_views_are_refused(make: Callable[[], Camera], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@every_camera
def test_a_cropped_camera_sees_the_same_through_each_pixel(name: str) -> None:
    camera = CAMERAS[name]
    depth = np.full(camera.size, 2.5, np.float32)
    whole = camera.with_margin((7, 9))
    expected = whole.unproject(np.full(whole.size, 2.5, np.float32))
    for left, top, width, height in ((2, 1, 5, 6), (-9, -7, 11, 4), (3, -2, camera.width, 8)):
        seen = camera.cropped(left, top, width, height)
        points = seen.unproject(np.full(seen.size, 2.5, np.float32))
        part = expected[7 + top : 7 + top + height, 9 + left : 9 + left + width]
        np.testing.assert_allclose(points, part, rtol=0, atol=1e-12)
    same = camera.cropped(0, 0, camera.width, camera.height).unproject(depth)
    np.testing.assert_array_equal(same, camera.unproject(depth))


def test_an_orthographic_camera_may_see_behind_its_plane() -> None:
    camera = orthographic(near=-5.0, far=5.0)
    assert camera.near == pytest.approx(-5.0)
    assert camera.far == pytest.approx(5.0)
