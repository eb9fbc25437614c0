"""kernels/common/camera.clh and surface.clh: pixels, points of view space, and planes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, camera_values

from .expression import run_expressions

W, H = 640, 480
CAMERAS = {
    "perspective": Camera.look_at((0, 0, 0), (0, 0, -1), yfov=1.0, width=W, height=H),
    "off-centre": Camera.from_intrinsics(500.0, 450.0, 100.0, 400.0, width=W, height=H),
    "orthographic": Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=3.0, width=W, height=H),
}
MARGINS = [(0, 0), (6, 9)]
PLANE = "ssgi_tangent_plane(camera, x, y, depth, nx, ny, nz)"


def evaluate(
    runtime: Runtime, camera: Camera, margin: tuple[int, int], expressions: dict[str, str], **lanes: NDArray[Any]
) -> dict[str, NDArray[Any]]:
    """Return what expressions with the camera give, element by element."""
    values = {"camera": (CAMERA, CAMERA.pack(camera_values(camera, margin)))}
    return run_expressions(runtime, "common/surface.clh", expressions, values=values, **lanes)


def positions(
    rng: np.random.Generator, camera: Camera, margin: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Positions all over the arrays, their corners among them."""
    columns, rows = camera.width + 2 * margin[1], camera.height + 2 * margin[0]
    x = np.concatenate([[0, columns, 0, columns], rng.uniform(0, columns, 1000)])
    y = np.concatenate([[0, 0, rows, rows], rng.uniform(0, rows, 1000)])
    return x.astype(np.float32), y.astype(np.float32)


@pytest.mark.parametrize("margin", MARGINS)
@pytest.mark.parametrize("name", CAMERAS)
def test_slopes_are_those_of_the_camera_and_their_inverse_leads_back(
    variant_runtime: Runtime, name: str, margin: tuple[int, int], rng: np.random.Generator
) -> None:
    camera = CAMERAS[name]
    x, y = positions(rng, camera, margin)
    result = evaluate(
        variant_runtime,
        camera,
        margin,
        {
            "slope x": "ssgi_slope_x(camera, x)",
            "slope y": "ssgi_slope_y(camera, y)",
            "column": "ssgi_column(camera, ssgi_slope_x(camera, x))",
            "row": "ssgi_row(camera, ssgi_slope_y(camera, y))",
        },
        x=x,
        y=y,
    )
    sx, sy, ox, oy = camera.pixel_to_view
    # Three roundings of 6e-8 each, of slopes below 2 and of columns below 1000 and their offset.
    np.testing.assert_allclose(result["slope x"], sx * (x - margin[1]) + ox, rtol=0, atol=5e-7)
    np.testing.assert_allclose(result["slope y"], sy * (y - margin[0]) + oy, rtol=0, atol=5e-7)
    np.testing.assert_allclose(result["column"], x, rtol=0, atol=5e-4)
    np.testing.assert_allclose(result["row"], y, rtol=0, atol=5e-4)


@pytest.mark.parametrize("margin", MARGINS)
@pytest.mark.parametrize("name", CAMERAS)
def test_every_plane_is_flat(
    variant_runtime: Runtime, name: str, margin: tuple[int, int], rng: np.random.Generator
) -> None:
    camera = CAMERAS[name]
    x, y = positions(rng, camera, margin)
    normal = rng.standard_normal((x.size, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    dx, dy = (rng.integers(-8, 9, x.size).astype(np.float32) for _ in range(2))
    depth = np.exp2(rng.uniform(-20, 20, x.size)).astype(np.float32)

    def view_ray(column: NDArray[Any], row: NDArray[Any]) -> NDArray[np.float64]:
        sx, sy, ox, oy = camera.pixel_to_view
        across = sx * (column.astype(np.float64) - margin[1]) + ox
        down = sy * (row.astype(np.float64) - margin[0]) + oy
        return np.stack([across, down, -np.ones_like(across)], axis=-1)

    own, other = view_ray(x, y), view_ray(x + dx, y + dy)
    wide = depth.astype(np.float64)
    if camera.is_orthographic:
        flip = normal[:, 2] < 0
        normal[flip] *= -1
        facing = normal[:, 2]
        # n . (x, y, -depth) is the same on the whole plane.
        step = np.einsum("ij,ij->i", normal[:, :2], other[:, :2] - own[:, :2])
        there = wide + step / normal[:, 2]
    else:
        facing = -np.einsum("ij,ij->i", normal, own)
        flip = facing < 0
        normal[flip] *= -1
        facing = np.abs(facing) / np.linalg.norm(own, axis=1)
        there = wide * np.einsum("ij,ij->i", normal, own) / np.einsum("ij,ij->i", normal, other)
    # Not edge-on, where the tangent plane is cut off, and not so steep that it passes the eye.
    good = (facing > 0.05) & (there > 0.5 * wide) & (there < 2 * wide)
    assert good.sum() > 300
    arrays = {"x": x, "y": y, "depth": depth, "dx": dx, "dy": dy, "there": there.astype(np.float32)}
    arrays |= dict(zip(("nx", "ny", "nz"), normal.astype(np.float32).T, strict=True))
    result = evaluate(
        variant_runtime,
        camera,
        margin,
        {
            "off": f"ssgi_off_plane({PLANE}, dx, dy, ssgi_linear(camera, there))",
            "behind": f"ssgi_off_plane({PLANE}, dx, dy, ssgi_linear(camera, there * 1.01f))",
            "back": "ssgi_linear(camera, ssgi_linear(camera, depth))",
            "k": "ssgi_k(camera, depth)",
        },
        **{name: array[good] for name, array in arrays.items()},
    )
    # Of an orthographic camera they are shares of the view's height; below, all are of the depth.
    share = camera.view_height / depth[good] if camera.is_orthographic else 1.0
    result["off"], result["behind"] = result["off"] * share, result["behind"] * share
    # Roundings of 6e-8: of the depths (relative to u at most 2 each), of a normal at an angle with
    # cosine 0.05 (20 times as much), times the plane's rise, which is at most 1 here.
    assert result["off"].max() < 8e-6
    # 1 % further away is 1 % of the other pixel's depth, which is 0.5 to 2 of this one's.
    assert result["behind"].min() > 0.0049
    assert result["behind"].max() < 0.0201
    np.testing.assert_allclose(result["back"], depth[good], rtol=1.2e-7)  # two divisions
    np.testing.assert_array_equal(result["k"], 1.0 if camera.is_orthographic else depth[good])


def test_a_normal_that_faces_away_gives_a_finite_plane(variant_runtime: Runtime) -> None:
    camera = CAMERAS["perspective"]
    n = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 0, 0], [-1, 0, 0]], np.float32).T
    x = np.full(5, 320.0, np.float32)
    off = f"ssgi_off_plane({PLANE}, v_splat(1.0f), v_splat(1.0f), 1.0f / depth)"
    arrays = {"x": x, "y": x, "depth": np.ones(5, np.float32), "nx": n[0], "ny": n[1], "nz": n[2]}
    result = evaluate(variant_runtime, camera, (0, 0), {"off": off}, **arrays)
    assert np.isfinite(result["off"]).all()
