"""G-buffers from depth maps of every kind are those of the arrays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_maps import ASSUMED_RANGE, ray_lengths
from ssgi_cl.core.errors import AssumedWarning
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_batch import GBufferBatch

SIZE = ROWS, COLUMNS = 6, 8
CAMERA = Camera.from_intrinsics(7.0, 9.0, 3.6, 3.2, width=COLUMNS, height=ROWS)
K = [[7.0, 0.0, 3.1], [0.0, 9.0, 2.7], [0.0, 0.0, 1.0]]  # pixel centres at integers


@pytest.fixture
def depth(rng: np.random.Generator) -> Any:
    return rng.uniform(1.0, 4.0, SIZE).astype(np.float32)


def made(depth: Any, **given: Any) -> GBuffer:
    gbuffer = GBuffer.from_depth(depth, **{"K": K, **given})
    assert isinstance(gbuffer, GBuffer)
    return gbuffer


def test_intrinsics_are_those_of_opencv(depth: Any) -> None:
    # OpenCV: u = fx X / Z + cx with the first pixel's centre at 0.
    camera = made(depth).camera
    np.testing.assert_allclose(camera.projection, CAMERA.projection)
    flat = made(depth, K=[7.0, 9.0, 3.1, 2.7]).camera
    np.testing.assert_array_equal(flat.projection, camera.projection)
    point = camera.unproject(np.full(SIZE, 2.0, np.float32))[2, 5]  # row 2, column 5; y up, z towards the viewer
    np.testing.assert_allclose(point, [(5 - 3.1) / 7 * 2, -(2 - 2.7) / 9 * 2, -2.0])


def test_intrinsics_in_units_of_the_image(depth: Any) -> None:
    scaled = [7.0 / COLUMNS, 9.0 / ROWS, 3.6 / COLUMNS, 3.2 / ROWS]  # from edge to edge: no half pixel
    np.testing.assert_allclose(made(depth, K=scaled, K_unit="image").camera.projection, CAMERA.projection)
    with pytest.raises(ValueError, match=r"principal point at \(0.45, 0.53.*expected pixels, or K_unit='image'"):
        made(depth, K=scaled)


def test_every_kind_is_the_same_depth(depth: Any) -> None:
    x, y = (np.arange(COLUMNS) - 3.1) / 7, (np.arange(ROWS) - 2.7)[:, None] / 9
    kinds = {
        "planar": depth,
        "ray": depth * np.sqrt(1 + x**2 + y**2),
        "inverse": 40.0 / depth,
        "relative": (1.0 / depth - 0.1) / 0.02,
    }
    given = {"inverse": {"scale": 40.0}, "relative": {"scale": 0.02, "shift": 0.1}}
    for kind, values in kinds.items():
        found = made(values, kind=kind, **given.get(kind, {}))
        np.testing.assert_allclose(found.depth, depth, rtol=1e-6, err_msg=kind)  # rounding of float32
        assert found.notes == ()
    np.testing.assert_allclose(ray_lengths(CAMERA), np.sqrt(1 + x**2 + y**2))


def test_millimetres_and_relative_depth_are_said_to_be_assumed(depth: Any) -> None:
    with pytest.warns(AssumedWarning, match="uint16 is taken for millimetres: scale=0.001"):
        found = made((depth * 1000).astype(np.uint16))
    np.testing.assert_allclose(found.depth, depth, atol=1e-3)  # a millimetre
    assert len(found.notes) == 1
    with pytest.warns(AssumedWarning, match="reach from 1 to 10 scene units: give scale and shift"):
        relative = made(1.0 / depth, kind="relative")
    assert (np.min(relative.depth), np.max(relative.depth)) == pytest.approx(ASSUMED_RANGE)
    with pytest.warns(AssumedWarning, match="taken for 50 degrees: give K, yfov or orthographic"):
        camera = made(depth, K=None).camera
    assert camera.projection[1, 1] == pytest.approx(1.0 / math.tan(math.radians(25.0)))


def test_an_elevation_model_has_parallel_rays(depth: Any) -> None:
    camera = made(depth, K=None, orthographic=12.0).camera
    assert camera.is_orthographic
    assert camera.pixel_to_view[:2] == pytest.approx((2.0, -2.0))  # scene units a pixel: 12 over 6 rows
    np.testing.assert_array_equal(made(depth, K=None, orthographic=12.0, kind="ray").depth, depth)


def test_holes_are_what_invalid_lists(depth: Any) -> None:
    depth[0, :4] = 0.0, np.nan, np.inf, 1e10
    found = made(depth).depth
    np.testing.assert_array_equal(np.isinf(found[0, :5]), [True] * 4 + [False])  # type: ignore[index]
    depth[3, 2] = -1.0
    with pytest.raises(ValueError, match=r"depth\[3, 2\] is -1.0: expected a number > 0, or one of invalid"):
        made(depth)
    assert np.isinf(made(depth, invalid=(0, -1, math.nan, math.inf, 1e10)).depth[3, 2])  # type: ignore[index]
    farthest = made(np.arange(48.0).reshape(SIZE), kind="relative", scale=0.1, shift=0.01)
    assert np.isfinite(farthest.depth).all()  # 0 is the farthest there


def test_normals_come_to_world_space_and_colours_to_reflectance(depth: Any) -> None:
    view = np.eye(4)
    view[:3, :3] = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    depth[1, 1] = 0.0
    down = np.tile([0.0, -2.0, 0.0], (*SIZE, 1))  # up, as OpenCV has it, and not of unit length
    color = np.full((*SIZE, 3), 128, np.uint8)
    found = made(depth, normal=down, normal_space="opencv", color=color, view=view)
    expected = np.tile([0.0, 1.0, 0.0], (*SIZE, 1))
    expected[1, 1] = 0.0
    np.testing.assert_allclose(found.normal, expected, atol=1e-7)
    np.testing.assert_allclose(found.albedo, 0.2158605, rtol=1e-5)  # sRGB 128, IEC 61966-2-1
    front = made(depth, normal=np.tile([0.0, 0.0, 1.0], (*SIZE, 1)), normal_space="camera", view=view)
    np.testing.assert_allclose(front.normal[0, 0], [1.0, 0.0, 0.0], atol=1e-7)  # type: ignore[index]
    assert "'camera'" in front.notes[0]


def test_a_batch_has_a_camera_each_or_one(depth: Any) -> None:
    batch = GBuffer.from_depth(np.stack([depth, 2 * depth]), K=np.stack([K, np.diag([1.0, 1.0, 1.0]) @ K]))
    assert isinstance(batch, GBufferBatch)
    np.testing.assert_array_equal(batch[1].depth, 2 * depth)
    with pytest.raises(ValueError, match=r"K has shape \(3, 3, 3\): expected \(3, 3\) or .*or 2 of them"):
        GBuffer.from_depth(np.stack([depth, depth]), K=np.stack([K] * 3))
    with pytest.raises(ValueError, match=r"camera is a list of 1: expected one Camera, or 2"):
        GBuffer.from_depth(np.stack([depth, depth]), camera=[CAMERA])


def test_channels_first_is_said_and_never_guessed(depth: Any) -> None:
    normal = np.moveaxis(np.tile([0.0, 0.0, 1.0], (*SIZE, 1)), -1, 0)
    found = made(depth[None], normal=normal, normal_space="camera", layout="CHW")
    np.testing.assert_array_equal(found.depth, depth)
    assert np.shape(found.normal) == (*SIZE, 3)
    with pytest.raises(ValueError, match=r"normal has shape \(3, 6, 8\): expected \(6, 8, 3\) as the depth"):
        made(depth, normal=normal, normal_space="camera")
    with pytest.raises(ValueError, match=r"depth has shape \(6, 8\): expected \(\.\.\., 1, rows, columns\)"):
        made(depth, layout="CHW")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"yfov": 1.0}, "K and yfov are given: expected one of K, yfov, orthographic, camera"),
        ({"kind": "metric"}, "kind is 'metric': expected one of 'planar', 'ray', 'inverse', 'relative'"),
        ({"shift": 1.0}, "shift is 1.0: expected None with kind='planar'"),
        ({"kind": "relative", "shift": 1.0}, "shift is 1.0: expected scale too"),
        ({"K": np.ones((3, 3))}, "expected no skew, and 0 0 1 in the last row"),
        ({"color": np.ones((2, 2, 3))}, r"color has shape \(2, 2, 3\): expected \(6, 8, 3\)"),
    ],
)
def test_bad_arguments_are_named(depth: Any, given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        made(depth, **given)


def test_notes_go_to_the_logger(depth: Any, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", logger="ssgi_cl")
    with pytest.warns(AssumedWarning):
        found = made((depth * 1000).astype(np.uint16))
    assert [record.getMessage() for record in caplog.records] == list(found.notes)
