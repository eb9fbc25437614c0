"""Pictures of a G-buffer's arrays."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.io.previews import depth_view, gbuffer_views, levels_view, normal_view, share_view


def test_nearest_is_white_furthest_dark_grey_and_nothing_black() -> None:
    depth = np.array([[1.0, 2.0, 4.0, np.inf]], np.float32)
    view = depth_view(depth)
    assert view.dtype == np.uint8
    assert view[0].tolist()[0] == 255
    assert view[0].tolist()[2:] == [40, 0]
    assert 40 < view[0, 1] < 255


@pytest.mark.parametrize("depth", [np.inf, 1e-30, 7.0, 1e30])
def test_any_depth_seen_straight_on_is_one_grey_without_a_warning(depth: float) -> None:
    view = depth_view(np.full((3, 4), depth, np.float32))
    assert view.shape == (3, 4)
    assert np.unique(view).size == 1
    assert (view[0, 0] >= 40) == np.isfinite(depth)
    assert depth_view(np.zeros((0, 4), np.float32)).shape == (0, 4)


def test_depth_of_an_orthographic_camera_may_be_zero_or_less() -> None:
    view = depth_view(np.array([[-1.0, 0.0, 1.0, 2.0]], np.float32))
    assert (np.diff(view[0].astype(int)) < 0).all(), "nearer is not brighter"


def test_normals_go_from_0_to_255_and_nothing_is_mid_grey() -> None:
    normal = np.array([[[-1.0, 0.0, 1.0], [2.0, -2.0, 0.0]]], np.float32)
    assert normal_view(normal).tolist() == [[[0, 128, 255], [255, 0, 128]]]


def test_shares_are_linear_and_clipped() -> None:
    share = np.array([[0.0, 0.2, 1.0, 1.5, -1.0]], np.float32)
    assert share_view(share).tolist() == [[0, 51, 255, 255, 0]]


def full_gbuffer(**arrays: np.ndarray) -> GBuffer:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=4, height=2)
    return GBuffer(camera=camera, depth=np.full((4, 6), 2.0, np.float32), **arrays)


def test_levels_have_a_colour_each_and_what_is_interpolated_none() -> None:
    steps = np.array([[16, 8, 4], [2, 1, 0]], np.int32)
    view = levels_view(steps)
    assert len({tuple(colour) for colour in view.reshape(-1, 3).tolist()}) == 6
    np.testing.assert_array_equal(view[1, 2], 0)


def test_gbuffer_views_show_what_is_there_without_its_margin() -> None:
    views = gbuffer_views(full_gbuffer())
    assert {name: view.shape for name, view in views.items()} == {"depth": (2, 4)}
    normal = np.broadcast_to(np.float32([0, 0, 1]), (4, 6, 3))
    views = gbuffer_views(full_gbuffer(normal=normal, albedo=np.full((4, 6, 3), 0.5, np.float32)))
    assert views["normal"][0, 0].tolist() == [128, 128, 255]
    assert views["albedo"][0, 0].tolist() == [186, 186, 186]  # 255 * 0.5^(1 / 2.2) = 186.08
