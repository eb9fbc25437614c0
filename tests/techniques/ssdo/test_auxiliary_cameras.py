"""Placement of auxiliary cameras."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.ssdo.ssdo_views import auxiliary_cameras


@pytest.fixture(scope="module", params=["cornell_box", "hall"])
def seen(request: pytest.FixtureRequest) -> GBuffer:
    made = BUILTIN_SCENES[request.param]()
    return gi.rasterize.gbuffer(made.scene, made.camera(96, 64), overscan=0.1)


def depth_of(gbuffer: GBuffer) -> np.ndarray:
    depth = gbuffer.first("depth")
    assert depth is not None
    return gbuffer.inner(depth)


def test_each_stands_where_the_camera_sees_nothing_in_the_way(seen: GBuffer) -> None:
    camera, depth = seen.camera, depth_of(seen)
    sx, sy, ox, oy = camera.pixel_to_view
    for extra in auxiliary_cameras(camera, seen, 6):
        x, y, z = camera.view[:3, :3] @ extra.position + camera.view[:3, 3]
        column, row = int((x / -z - ox) / sx), int((y / -z - oy) / sy)
        assert 0 <= row < camera.height
        assert 0 <= column < camera.width
        assert -z < depth[row, column]


def test_directions_spread_round_the_median_point(seen: GBuffer) -> None:
    extras = auxiliary_cameras(seen.camera, seen, 4)
    assert len(extras) == 4
    # All look at one point, along -z of their view space.
    axes = [extra.view[2, :3] for extra in extras]
    point, *_ = np.linalg.lstsq(
        np.concatenate([np.eye(3) - np.outer(a, a) for a in axes]),
        np.concatenate([(np.eye(3) - np.outer(a, a)) @ e.position for a, e in zip(axes, extras, strict=True)]),
    )
    ways = [seen.camera.position - point, *(extra.position - point for extra in extras)]
    ways = [way / np.linalg.norm(way) for way in ways]
    apart = [math.degrees(math.acos(np.clip(a @ b, -1, 1))) for i, a in enumerate(ways) for b in ways[:i]]
    # Six even directions would be 90 degrees apart; free places allow less.
    assert min(apart) > 30.0
    assert max(math.degrees(math.acos(np.clip(ways[0] @ w, -1, 1))) for w in ways[1:]) > 90.0


def test_a_gbuffer_its_depth_and_device_memory_give_the_same(runtime: Runtime, seen: GBuffer) -> None:
    views = [
        [extra.view for extra in auxiliary_cameras(seen.camera, source)]
        for source in (seen, depth_of(seen), on_device(seen, runtime))
    ]
    np.testing.assert_array_equal(views[0], views[1])
    np.testing.assert_array_equal(views[0], views[2])


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(seen: GBuffer, scale: float) -> None:
    camera, depth = seen.camera, depth_of(seen)
    view = camera.view.copy()
    view[:3, 3] *= scale
    scaled = replace(camera, view=view)
    for one, other in zip(
        auxiliary_cameras(camera, depth), auxiliary_cameras(scaled, depth * np.float32(scale)), strict=True
    ):
        np.testing.assert_allclose(other.position, one.position * scale, rtol=1e-5)


def test_the_place_of_the_origin_does_not_matter(seen: GBuffer) -> None:
    camera, depth, shift = seen.camera, depth_of(seen), np.array([-3.0, 7.0, 5.0])
    view = camera.view.copy()
    view[:3, 3] -= view[:3, :3] @ shift
    moved = replace(camera, view=view)
    for one, other in zip(auxiliary_cameras(camera, depth), auxiliary_cameras(moved, depth), strict=True):
        np.testing.assert_allclose(other.position, one.position + shift, atol=1e-5)


def test_sizes_are_parts_of_the_cameras() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=31, height=17)
    depth = np.full((17, 31), 2.0)
    assert {c.size for c in auxiliary_cameras(camera, depth)} == {(8, 16)}
    assert {c.size for c in auxiliary_cameras(camera, depth, size=1.0)} == {(17, 31)}
    assert auxiliary_cameras(camera, depth, 0) == []
    one = Camera.look_at((0, 0, 0), (0, 0, -1), width=1, height=1)
    assert all(c.size == (1, 1) for c in auxiliary_cameras(one, [[1.0]]))


def test_places_fill_the_view_in_both_directions() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.8, width=80, height=60)
    at = np.array([e.position for e in auxiliary_cameras(camera, np.full((60, 80), 2.0), 40)])
    # In parts of the view at their distance; centres of 12 rows and 16 columns end at 11/12, 15/16.
    across, up = (np.abs(at[:, axis] / at[:, 2]) / math.tan(0.4) for axis in (0, 1))
    assert 0.85 < across.max() * 60 / 80 < 1.0
    assert 0.85 < up.max() < 1.0


def test_where_nothing_is_seen_none_is_placed() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=9, height=7)
    assert auxiliary_cameras(camera, np.full((7, 9), np.inf)) == []


def test_wrong_arguments_are_refused() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=9, height=7)
    depth = np.ones((7, 9))
    with pytest.raises(TypeError, match="camera is 'left'"):
        auxiliary_cameras("left", depth)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"gbuffer has size \(9, 7\): expected \(7, 9\)"):
        auxiliary_cameras(camera, depth.T)
    with pytest.raises(ValueError, match="count is 65"):
        auxiliary_cameras(camera, depth, 65)
    with pytest.raises(ValueError, match=r"size is 1\.5"):
        auxiliary_cameras(camera, depth, size=1.5)
    with pytest.raises(ValueError, match="nan"):
        auxiliary_cameras(camera, depth * np.nan)
