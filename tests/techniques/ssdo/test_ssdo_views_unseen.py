"""Surfaces that no earlier view shows: against the numpy reference, and of known scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ssdo.ssdo_views import unseen_reference
from ssgi_cl.techniques.ssdo.ssdo_views import UnseenDepth

from ..analytic import CAMERAS, camera, scene
from .test_ssdo_views import aside, layered, uploaded

RADIUS = 0.8
FLIPS = 0.002
"""Share of pixels in which float32 may find another pixel, or another side of the tolerance."""


def assert_agrees(runtime: Runtime, kind: str) -> None:
    first = scene("bumpy", camera(kind, size=(39, 53)), np.random.default_rng(3), margin=(2, 4))
    second = layered(aside("perspective", (40, 50)), 3)
    third = layered(aside(kind, (31, 41)), 3)
    unseen = UnseenDepth(runtime, RADIUS)
    unseen.begin(uploaded(runtime, first))
    shown = []
    for view, earlier in ((second, [first]), (third, [first, second])):
        found = unseen.of(uploaded(runtime, view)).download()
        expected = unseen_reference(view, earlier, 1e-3 * RADIUS)
        assert np.mean(np.isfinite(found) != np.isfinite(expected)) <= FLIPS
        left = np.isfinite(found)
        np.testing.assert_array_equal(found[left], np.asarray(view.depth)[left])
        shown.append(np.mean(np.isfinite(np.asarray(view.depth)) & ~left))
        assert 0.05 < shown[-1] < 0.95
    # The third stands near the second, which shows more of it than the first does.
    assert shown[1] > shown[0]
    counts = runtime.allocated_bytes, runtime.builds
    unseen.begin(uploaded(runtime, first))
    unseen.of(uploaded(runtime, second))
    assert runtime.builds == counts[1]


@pytest.mark.parametrize("kind", CAMERAS)
def test_kernel_agrees_with_numpy_reference_for_every_camera(runtime: Runtime, kind: str) -> None:
    assert_agrees(runtime, kind)


def test_every_kernel_variant_agrees_with_numpy_reference(variant_runtime: Runtime) -> None:
    assert_agrees(variant_runtime, "perspective")


def test_view_itself_shows_all_and_one_from_elsewhere_nothing(runtime: Runtime) -> None:
    made = scene("bumpy", camera(size=(39, 53)), np.random.default_rng(3))
    device = uploaded(runtime, made)
    unseen = UnseenDepth(runtime, RADIUS)
    np.testing.assert_array_equal(unseen.of(device).download()[0], made.depth)
    assert np.isinf(unseen.of(device).download()).all()
    away = camera(size=(31, 41), eye=(20.0, 20.0, 20.0), target=(40.0, 41.0, 42.0))
    unseen.begin(uploaded(runtime, scene("ball", away, np.random.default_rng(1))))
    np.testing.assert_array_equal(unseen.of(device).download()[0], made.depth)


def test_side_next_to_a_side_that_is_shown_is_not(runtime: Runtime) -> None:
    # The first camera looks along the floor, just above it, and shows the walls alone: their lowest
    # pixels lie within a pixel of the floor's plane, next to which all of the floor has its image.
    level = camera(size=(48, 64), eye=(0.6, -0.299, 3.0), target=(0.6, -0.299, -1.0))
    corner = scene("corner", camera(size=(48, 64)), np.random.default_rng(1))
    walls = scene("corner", level, np.random.default_rng(1))
    on_floor, facing = (np.asarray(each.normal)[..., 1] > 0.9 for each in (walls, corner))
    depth = np.where(on_floor, np.float32(np.inf), np.asarray(walls.depth))
    unseen = UnseenDepth(runtime, RADIUS)
    unseen.begin(uploaded(runtime, replace(walls, depth=depth)))
    left = np.isfinite(unseen.of(uploaded(runtime, corner)).download()[0])
    assert left[facing].mean() > 0.95
    assert left[~facing].mean() < 0.9


def test_empty_gbuffer_is_refused(runtime: Runtime) -> None:
    unseen = UnseenDepth(runtime, RADIUS)
    empty = DeviceGBuffer(runtime, (8, 8))
    for call in (unseen.begin, unseen.of):
        with pytest.raises(ValueError, match="a device G-buffer is empty: draw or upload"):
            call(empty)
