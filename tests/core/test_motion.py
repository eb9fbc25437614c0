"""Motion of pixels: its checks, that of surfaces that stand still, and how well it fits the previous depth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_band import band_of
from ssgi_cl.core.motion import MOST_MOTION, camera_motion, converted, verified

SIZE = (24, 32)


def camera_at(x: float, y: float = 0.0, z: float = 5.0, *, orthographic: bool = False, scale: int = 1) -> Camera:
    """Return a camera at a place that looks along -z."""
    size = {"width": SIZE[1] * scale, "height": SIZE[0] * scale}
    if orthographic:
        return Camera.orthographic((x, y, z), (x, y, z - 5.0), view_height=3.0, **size)
    return Camera.look_at((x, y, z), (x, y, z - 5.0), yfov=0.8, **size)


def sloped(camera: Camera, margin: int = 0) -> GBuffer:
    """Return what a camera sees of the plane z = 0.3 x + 0.1 y."""
    rows, columns = np.indices((camera.height + 2 * margin, camera.width + 2 * margin)) + 0.5 - margin
    sx, sy, ox, oy = camera.pixel_to_view
    x, y = sx * columns + ox, sy * rows + oy
    eye = camera.position
    if camera.is_orthographic:
        depth = eye[2] - 0.3 * (x + eye[0]) - 0.1 * (y + eye[1])
    else:
        depth = (eye[2] - 0.3 * eye[0] - 0.1 * eye[1]) / (1.0 + 0.3 * x + 0.1 * y)
    return GBuffer(camera=camera, depth=depth)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("margin", [0, 3])
def test_motion_leads_each_pixel_to_where_the_matrices_of_the_previous_camera_put_it(
    orthographic: bool, margin: int
) -> None:
    now, before = camera_at(0.0, orthographic=orthographic), camera_at(0.2, -0.1, 5.4, orthographic=orthographic)
    gbuffer = sloped(now, margin)
    motion = camera_motion(np.asarray(gbuffer.depth), now, before)
    world = now.unproject(np.asarray(gbuffer.depth))
    view = np.append(world, np.ones((*world.shape[:2], 1)), axis=-1) @ before.view.T
    clip = view @ before.projection.T
    rows, columns = np.indices(motion.shape[:2]) + 0.5 - margin
    # Results of up to 40 pixels are rounded to float32.
    np.testing.assert_allclose(
        columns + motion[..., 0], (clip[..., 0] / clip[..., 3] + 1) / 2 * now.width, atol=1e-5, rtol=0
    )
    np.testing.assert_allclose(
        rows + motion[..., 1], (1 - clip[..., 1] / clip[..., 3]) / 2 * now.height, atol=1e-5, rtol=0
    )
    np.testing.assert_allclose(motion[..., 2], -view[..., 2] - gbuffer.depth, atol=1e-6, rtol=0)


def test_motion_is_to_the_right_and_downwards_in_the_array() -> None:
    gbuffer = sloped(camera_at(0.0))
    # From a camera further left and further up, things lie further to the right and further down.
    motion = camera_motion(np.asarray(gbuffer.depth), gbuffer.camera, camera_at(-0.3, 0.2))
    assert (motion[..., :2] > 0.5).all()
    # From one that is further away they are deeper.
    deeper = camera_motion(np.asarray(gbuffer.depth), gbuffer.camera, camera_at(0.0, 0.0, 6.0))
    np.testing.assert_allclose(deeper[..., 2], 1.0, atol=1e-5)  # roundings of depths of about 5


def test_nothing_has_no_motion_and_what_was_behind_the_camera_has_the_longest() -> None:
    now = camera_at(0.0)
    depth = np.full(SIZE, 5.0, np.float32)
    depth[:4] = np.inf
    motion = camera_motion(depth, now, camera_at(0.0, 0.0, -1.0))  # at z = -1, beyond the plane z = 0, away from it
    assert (motion[:4] == 0.0).all()
    assert (motion[4:, :, :2] == MOST_MOTION).all()
    assert np.isfinite(motion).all()


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("margins", [(0, 0), (2, 3)])
def test_residual_of_true_motion_is_rounding_and_of_false_motion_is_not(
    orthographic: bool, margins: tuple[int, int]
) -> None:
    now, before = camera_at(0.0, orthographic=orthographic), camera_at(0.15, 0.1, orthographic=orthographic)
    gbuffer, previous = sloped(now, margins[0]), sloped(before, margins[1])
    # On a plane the interpolation is exact: what is left are the roundings of depths, 2^-24, and of motion.
    residual = gbuffer.motion_residual(previous)
    assert residual.median < 1e-6
    assert residual.share == 1.0
    assert 0.5 * now.width * now.height < residual.pixels
    true = gbuffer.with_motion(before)
    assert true.motion_residual(previous) == residual
    assert np.shape(true.motion) == (*np.shape(gbuffer.depth), 3)
    wrong = GBuffer(camera=now, depth=gbuffer.depth, motion=-np.asarray(true.motion))
    assert wrong.motion_residual(previous).median > 1e-3


def test_previous_image_may_be_of_another_size() -> None:
    gbuffer, previous = sloped(camera_at(0.0)), sloped(camera_at(0.1, scale=2))
    assert gbuffer.motion_residual(previous).median < 1e-6  # as above
    motion = np.asarray(gbuffer.with_motion(previous.camera).motion)
    same = np.asarray(gbuffer.with_motion(camera_at(0.1)).motion)
    np.testing.assert_allclose(motion, same, atol=1e-5)  # in pixels of the current image; as above


def stored(motion: NDArray[np.float32], kind: str, camera: Camera) -> NDArray[np.float32]:
    """Return motion as a program stores it, by the definitions in words."""
    across, down = motion[..., 0], motion[..., 1]
    if kind == "blender":  # previous - current, y up
        return np.stack([across, -down], axis=-1)
    if kind == "nuke":  # next - current, which is current - previous, y up
        return np.stack([-across, down], axis=-1)
    if kind == "ndc":  # -1..1 across the image, y up
        return np.stack([across * 2 / camera.width, -down * 2 / camera.height], axis=-1)
    return motion


KINDS = ("pixels", "blender", "nuke", "ndc")


@pytest.mark.parametrize("kind", KINDS)
def test_every_convention_is_converted_and_found_by_its_residual(kind: str) -> None:
    now, before = camera_at(0.0), camera_at(0.3, 0.25, 5.2)
    gbuffer, previous = sloped(now), sloped(before)
    motion = camera_motion(np.asarray(gbuffer.depth), now, before)
    wanted = motion if kind == "pixels" else motion[..., :2]
    np.testing.assert_allclose(converted(stored(motion, kind, now), kind, now), wanted, rtol=1e-6)
    found, note = verified(stored(motion, kind, now), "", gbuffer, previous)
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    assert f"motion is read as {kind!r}: median residual" in note
    for other in KINDS:
        if other != kind:
            with pytest.raises(ValueError, match=r"does not fit the previous depth .*expected motion_kind=|leads no"):
                verified(stored(motion, kind, now)[..., :2], other, gbuffer, previous)


def test_motion_that_does_not_tell_its_convention_has_to_be_said() -> None:
    gbuffer = sloped(camera_at(0.0))
    still = np.zeros((*SIZE, 2), np.float32)
    with pytest.raises(ValueError, match=r"expected motion_kind=, as it does not tell"):
        verified(still, "", gbuffer, gbuffer)
    found, _ = verified(still, "blender", gbuffer, gbuffer)
    np.testing.assert_array_equal(found, still)


def put(array: NDArray[np.float32], value: float) -> NDArray[np.float32]:
    changed = array.copy()
    changed[1, 2, 0] = value
    return changed


STILL = np.zeros((*SIZE, 2), np.float32)


@pytest.mark.parametrize(
    ("motion", "error", "message"),
    [
        (STILL[1:], ValueError, r"motion has shape \(23, 32, 2\): expected \(24, 32, 2 or 3\) as the depth"),
        (STILL[..., :1], ValueError, r"motion has shape \(24, 32, 1\)"),
        (STILL[..., 0], ValueError, r"motion has shape \(24, 32\)"),
        (put(STILL, math.nan), ValueError, r"motion\[1, 2, 0\] is nan: expected numbers"),
        (put(STILL, math.inf), ValueError, r"motion\[1, 2, 0\] is inf: .* <= 1000000 \(px\)"),
        (put(STILL, -2e6), ValueError, r"motion\[1, 2, 0\] is -2000000.0: expected numbers >= -1000000"),
        (STILL.astype(complex), TypeError, r"motion has dtype complex128"),
    ],
    ids=["rows", "channels", "flat", "nan", "inf", "beyond", "complex"],
)
def test_bad_motion_is_refused(motion: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        GBuffer(camera=camera_at(0.0), depth=np.ones(SIZE, np.float32), motion=motion)


def test_hole_in_motion_is_a_place_that_the_previous_image_does_not_show() -> None:
    depth = np.ones(SIZE, np.float32)
    gbuffer = GBuffer(camera=camera_at(0.0), depth=depth, motion=put(STILL, math.nan), nan="hole")
    assert np.asarray(gbuffer.motion)[1, 2].tolist() == [MOST_MOTION, 0.0]
    assert "motion" in repr(gbuffer)


def test_motion_that_leads_nowhere_has_no_residual() -> None:
    gbuffer = sloped(camera_at(0.0))
    away = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, motion=np.full((*SIZE, 2), MOST_MOTION, np.float32))
    with pytest.raises(ValueError, match="leads no pixel to a surface of the previous image"):
        away.motion_residual(gbuffer)


def test_band_of_a_gbuffer_has_its_motion() -> None:
    gbuffer = sloped(camera_at(0.0)).with_motion(camera_at(0.1))
    band = band_of(gbuffer, 4, 12, 2)
    np.testing.assert_array_equal(np.asarray(band.motion), np.asarray(gbuffer.motion)[2:14])
