"""Auxiliary cameras of SSDO with the bitmask: numpy reference, views that must change nothing, placement."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.ssdo.ssdo_views import ssdo_views_reference, unseen_reference
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_views import SsdoViews, UnseenDepth, ViewsParams, auxiliary_cameras

from ..analytic import CAMERAS, camera, scene
from .cases import aside, layered, masks_of, planar, uploaded

SLICES = SsdoBitmaskParams(radius=0.8, slices=2)
SIZE = (39, 53)
FLIPS = 0.02
"""Share of pixels in which rounding may move one of 16 taps across a pixel's edge or a surface, or a
sector's end across a dither: the bitmask's fast angles are 1/500 sector off."""


def covered(
    runtime: Runtime, gbuffer: GBuffer, radiance: NDArray[np.float64], slices: SsdoBitmaskParams = SLICES
) -> tuple[DeviceGBuffer, Any, Plane, DeviceArray]:
    """Return a G-buffer on the device, it reduced if `slices` say so, result and masks of the bitmask."""
    source: Any = (device := uploaded(runtime, gbuffer))
    if slices.resolution == "half":
        source = ReducedGBuffer(device, 2)
        source.update(device)
    back = SsdoBitmask(runtime, gbuffer.size, slices, gbuffer.margin, masks=True)
    light = back.run(device, source, radiance=planar(runtime, radiance))
    assert back.masks is not None
    return device, source, light, back.masks


@pytest.mark.parametrize("kind", CAMERAS[1:])
def test_kernel_agrees_with_numpy_reference_for_every_camera(runtime: Runtime, kind: str) -> None:
    _assert_agrees(runtime, kind, "full")


@pytest.mark.parametrize("resolution", ["full", "half"])
def test_every_kernel_variant_agrees_with_numpy_reference(variant_runtime: Runtime, resolution: str) -> None:
    _assert_agrees(variant_runtime, "perspective", resolution)


def test_deeper_layers_without_normals_lie_across_the_view(runtime: Runtime) -> None:
    _assert_agrees(runtime, "perspective", "full", normals=1)


def _assert_agrees(runtime: Runtime, kind: str, resolution: str, normals: int = 2) -> None:
    rng = np.random.default_rng(5)
    gbuffer = scene("bumpy", camera(kind, size=SIZE), np.random.default_rng(3), margin=(2, 4))
    other = layered(aside("orthographic" if kind == "off-centre" else kind), 3)
    if normals == 1:
        other = replace(other, normal=np.asarray(other.normal)[0])
    sent = rng.random((normals, 31, 41, 3))
    own = rng.random((1, *np.asarray(gbuffer.depth).shape, 3))
    slices = SsdoBitmaskParams(radius=0.8, slices=2, resolution=resolution)
    params = ViewsParams(strata=3, taps=5)
    device, source, light, kept = covered(runtime, gbuffer, own, slices)
    before, masks = light.download(), masks_of(runtime, kept, 4, light.size).copy()
    assert masks[2:].any()
    further, radiance = uploaded(runtime, other), planar(runtime, sent)
    views = SsdoViews(runtime, slices, params)
    if normals == 2:
        views.unseen.begin(device)
    views.add(light, kept, device, source, further, radiance)
    after, now = light.download(), masks_of(runtime, kept, 4, light.size)
    expected = ssdo_views_reference(
        gbuffer,
        masks,
        other,
        sent,
        slices,
        params,
        step=2 if resolution == "half" else 1,
        unseen=(unseen_reference(other, [gbuffer], 1e-3 * slices.radius) if normals == 2 else None),
    )
    assert expected.hidden.max() > 0.05
    assert expected.bounce.max() > 0.05
    lost = np.minimum(expected.hidden, before[0])
    # A sector is 1/64 of A; roundings are much less.
    assert np.mean(np.abs(before[0] - after[0] - lost) > 1e-3) <= FLIPS
    added = np.moveaxis(after[1:] - before[1:], 0, -1)
    assert np.mean(np.abs(added - expected.bounce).max(axis=-1) > 3e-3) <= FLIPS
    assert np.mean(now != expected.masks) <= FLIPS
    # What was covered stays so, and A is never negative.
    assert not (masks[:2] & ~now[:2]).any()
    assert after[0].min() >= 0.0
    # Nothing is compiled or allocated the second time.
    if normals == 2:
        counts = runtime.allocated_bytes, runtime.builds
        views.unseen.begin(device)
        views.add(light, kept, device, source, further, radiance)
        assert (runtime.allocated_bytes, runtime.builds) == counts


def test_first_camera_again_finds_what_the_bitmask_found(runtime: Runtime) -> None:
    # From empty masks, many strata and taps cover what the bitmask covers: sectors have the same
    # numbers, slices the same directions and weights.
    gbuffer = scene("corner", camera(size=(48, 64)), np.random.default_rng(1))
    slices = SsdoBitmaskParams(radius=0.8)
    sent = np.ones((1, 48, 64, 3))
    device, _, light, masks = covered(runtime, gbuffer, sent, slices)
    expected, first = light.download(), masks_of(runtime, masks, 2, light.size).copy()
    start = np.zeros_like(expected)
    start[0] = 1.0
    light.upload(start)
    masks.upload(np.zeros_like(masks.download()))
    views = SsdoViews(runtime, slices, ViewsParams(strata=16, taps=16))
    views.add(light, masks, device, device, device, planar(runtime, sent))
    found, again = light.download(), masks_of(runtime, masks, 2, light.size)
    # Receivers within two pixels of the corner have no pixel of the other wall above the bias.
    normal = np.asarray(gbuffer.normal)
    flat = np.ones(gbuffer.size, bool)
    for axis, shift in ((0, -2), (0, 2), (1, -2), (1, 2)):
        flat &= np.all(np.roll(normal, shift, axis) == normal, axis=-1)
    both = np.bitwise_count(first & again)[:, flat].sum()
    assert both > 0.9 * np.bitwise_count(first)[:, flat].sum()
    assert both > 0.9 * np.bitwise_count(again)[:, flat].sum()
    # Each of 16 parts is covered whole or not at all, and taps lie beside the slice's pixels.
    assert found[0][flat].mean() == pytest.approx(expected[0][flat].mean(), abs=0.01)
    assert found[1][flat].mean() == pytest.approx(expected[1][flat].mean(), rel=0.05)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_camera_that_sees_nothing_near_changes_nothing(runtime: Runtime, kind: str) -> None:
    gbuffer = scene("corner", camera(size=SIZE), np.random.default_rng(1))
    device, _, light, kept = covered(runtime, gbuffer, np.ones((1, *SIZE, 3)))
    before, masks = light.download(), kept.download()
    away = camera(kind, size=(31, 41), eye=(20.0, 20.0, 20.0), target=(40.0, 41.0, 42.0))
    depth = np.full((31, 41), 5.0, np.float32)
    further = uploaded(runtime, GBuffer(camera=away, depth=depth))
    SsdoViews(runtime, SLICES).add(light, kept, device, device, further, planar(runtime, np.ones((1, 31, 41, 3))))
    np.testing.assert_array_equal(light.download(), before)
    np.testing.assert_array_equal(kept.download(), masks)


def test_wall_that_only_another_camera_sees_sends_its_light(runtime: Runtime) -> None:
    # A corner whose left wall lies outside the first camera's narrow image.
    narrow = camera(size=(48, 16), eye=(0.4, 1.0, 2.0), target=(0.0, -0.3, 0.0))
    gbuffer = scene("corner", narrow, np.random.default_rng(1))
    wide = scene("corner", camera(size=(60, 80), eye=(1.5, 1.5, 2.5)), np.random.default_rng(1))
    slices = SsdoBitmaskParams(radius=1.0)
    device, _, light, masks = covered(runtime, gbuffer, np.zeros((1, 48, 16, 3)), slices)
    before = light.download()
    is_left = np.asarray(wide.normal)[..., 0] > 0.5
    sent = np.where(is_left[None, ..., None], [2.0, 1.0, 0.5], 0.0)
    assert is_left.any()
    views = SsdoViews(runtime, slices, ViewsParams(strata=16, taps=16))
    views.add(light, masks, device, device, uploaded(runtime, wide), planar(runtime, sent))
    after = light.download()
    assert after[1].mean() > before[1].mean() + 0.05
    np.testing.assert_allclose(after[2], 0.5 * after[1], rtol=1e-5, atol=1e-7)
    assert (after[0] <= before[0]).all()


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"strata": 17}, r"strata is 17: expected an integer >= 1 and <= 16"),
        ({"taps": 0}, r"taps is 0: expected an integer >= 1 and <= 64"),
        ({"bias": 200.0}, r"bias is 200.0: expected a number >= 0 and <= 100"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(params: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ViewsParams(**params)


def test_empty_gbuffer_is_refused(runtime: Runtime) -> None:
    gbuffer = scene("corner", camera(size=SIZE), np.random.default_rng(1))
    device, _, light, masks = covered(runtime, gbuffer, np.ones((1, *SIZE, 3)))
    empty, views = DeviceGBuffer(runtime, SIZE), SsdoViews(runtime, SLICES)
    for call in (views.unseen.begin, views.unseen.of, lambda view: views.add(light, masks, device, device, view, None)):
        with pytest.raises(ValueError, match="a device G-buffer is empty: draw or upload something"):
            call(empty)


# ---- surfaces that no earlier view shows

UNSEEN_FLIPS = 0.002
"""Share of pixels in which rounding may change the pixel or the result of the tolerance test."""


def _assert_unseen_agrees(runtime: Runtime, kind: str) -> None:
    first = scene("bumpy", camera(kind, size=(39, 53)), np.random.default_rng(3), margin=(2, 4))
    second = layered(aside("perspective", (40, 50)), 3)
    third = layered(aside(kind, (31, 41)), 3)
    unseen = UnseenDepth(runtime, SLICES.radius)
    unseen.begin(uploaded(runtime, first))
    shown = []
    for view, earlier in ((second, [first]), (third, [first, second])):
        found = unseen.of(uploaded(runtime, view)).download()
        expected = unseen_reference(view, earlier, 1e-3 * SLICES.radius)
        assert np.mean(np.isfinite(found) != np.isfinite(expected)) <= UNSEEN_FLIPS
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
def test_unseen_depth_agrees_with_numpy_reference_for_every_camera(runtime: Runtime, kind: str) -> None:
    _assert_unseen_agrees(runtime, kind)


def test_unseen_depth_of_every_kernel_variant_agrees_with_numpy_reference(variant_runtime: Runtime) -> None:
    _assert_unseen_agrees(variant_runtime, "perspective")


def test_view_itself_shows_all_and_one_from_elsewhere_nothing(runtime: Runtime) -> None:
    made = scene("bumpy", camera(size=(39, 53)), np.random.default_rng(3))
    device = uploaded(runtime, made)
    unseen = UnseenDepth(runtime, SLICES.radius)
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
    unseen = UnseenDepth(runtime, SLICES.radius)
    unseen.begin(uploaded(runtime, replace(walls, depth=depth)))
    left = np.isfinite(unseen.of(uploaded(runtime, corner)).download()[0])
    assert left[facing].mean() > 0.95
    assert left[~facing].mean() < 0.9


# ---- placement


@pytest.fixture(scope="module", params=["cornell_box", pytest.param("hall", marks=pytest.mark.slow)])
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


@pytest.mark.parametrize(("scale", "shift"), [(1e-3, 0.0), (1e3, 0.0), (1.0, (-3.0, 7.0, 5.0))])
def test_neither_the_unit_of_length_nor_the_origin_matters(seen: GBuffer, scale: float, shift: Any) -> None:
    camera, depth = seen.camera, depth_of(seen)
    view = camera.view.copy()
    view[:3, 3] = scale * view[:3, 3] - view[:3, :3] @ np.broadcast_to(shift, 3)
    moved = replace(camera, view=view)
    for one, other in zip(
        auxiliary_cameras(camera, depth), auxiliary_cameras(moved, depth * np.float32(scale)), strict=True
    ):
        np.testing.assert_allclose(other.position, one.position * scale + shift, rtol=1e-5, atol=1e-5 * scale)


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


def test_wrong_arguments_of_placement_are_refused() -> None:
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
