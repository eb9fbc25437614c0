"""Auxiliary cameras of SSDO: against numpy, the bitmask, and what they must leave alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ssdo.ssdo_views import ssdo_views_reference, unseen_reference
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_views import SsdoViews, ViewsParams

from ..analytic import CAMERAS, camera, scene

SLICES = SsdoBitmaskParams(radius=0.8, slices=2)
SIZE = (39, 53)
FLIPS = 0.02
"""Share of pixels in which one of 16 taps may fall to the other side of a pixel's edge or surface,
or a sector's end to the other side of a dither: the bitmask's quick angles are 1/500 sector off."""


def aside(kind: str, size: tuple[int, int] = (31, 41)) -> Camera:
    """Return a camera beside that of the test scenes."""
    return camera(kind, size=size, eye=(-2.5, 2.2, 3.0))


def uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    """Return the G-buffer on the device."""
    attributes = 1 if np.ndim(gbuffer.normal) < 4 else gbuffer.layers
    device = DeviceGBuffer(runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin, attributes=attributes)
    device.upload(gbuffer)
    return device


def planar(runtime: Runtime, radiance: NDArray[np.float64]) -> Plane:
    """Return radiance [layers, rows, columns, 3] on the device."""
    images = np.moveaxis(radiance, -1, 1).reshape(-1, *radiance.shape[1:3])
    plane = runtime.plane(len(images), radiance.shape[1:3])
    plane.upload(images.astype(np.float32))
    return plane


def inner(runtime: Runtime, masks: DeviceArray, slices: int, size: tuple[int, int]) -> Any:
    """Return [slices, rows, columns] uint32 of masks in the layout of a plane."""
    pitch = runtime.plane(1, size).pitch
    rows = masks.download().reshape(-1, pitch)[1 : 1 + slices * size[0], : size[1]]
    return rows.reshape(slices, *size).view(np.uint32)


def layered(made: Camera, seed: int) -> GBuffer:
    """Return what a camera sees of balls, and behind them of a corner."""
    front, behind = (scene(name, made, np.random.default_rng(seed)) for name in ("bumpy", "corner"))
    depth, deep = np.asarray(front.depth), np.asarray(behind.depth)
    deep = np.where(deep > depth + 1e-3, deep, np.inf)
    return GBuffer(
        camera=made,
        depth=np.stack([depth, deep]),
        normal=np.stack([np.asarray(front.normal), np.asarray(behind.normal)]),
    )


@pytest.mark.parametrize("kind", CAMERAS)
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
    device = uploaded(runtime, gbuffer)
    source: Any = device
    if resolution == "half":
        source = ReducedGBuffer(device, 2)
        source.update(device)
    back = SsdoBitmask(runtime, gbuffer.size, slices, gbuffer.margin, masks=True)
    light = back.run(device, source, radiance=planar(runtime, own))
    assert back.masks is not None
    before, masks = light.download(), inner(runtime, back.masks, 4, light.size).copy()
    assert masks[2:].any()
    further, radiance = uploaded(runtime, other), planar(runtime, sent)
    views = SsdoViews(runtime, slices, params)
    if normals == 2:
        views.unseen.begin(device)
    views.add(light, back.masks, device, source, further, radiance)
    after, now = light.download(), inner(runtime, back.masks, 4, light.size)
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
        views.add(light, back.masks, device, source, further, radiance)
        assert (runtime.allocated_bytes, runtime.builds) == counts


def test_every_kernel_variant_gives_the_same_result(runtime: Runtime, other_variant: Runtime) -> None:
    results = []
    for one in (runtime, other_variant):
        rng = np.random.default_rng(5)
        gbuffer = scene("bumpy", camera(size=SIZE), np.random.default_rng(3))
        device, further = uploaded(one, gbuffer), uploaded(one, layered(aside("perspective"), 3))
        back = SsdoBitmask(one, gbuffer.size, SLICES, masks=True)
        light = back.run(device, device, radiance=planar(one, rng.random((1, *SIZE, 3))))
        assert back.masks is not None
        sent = planar(one, rng.random((2, 31, 41, 3)))
        SsdoViews(one, SLICES).add(light, back.masks, device, device, further, sent)
        results.append(light.download())
    # Contraction is off, and divisions and roots are exact on both.
    np.testing.assert_array_equal(*results)


def test_first_camera_again_finds_what_the_bitmask_found(runtime: Runtime) -> None:
    # From empty masks, many strata and taps cover what the bitmask covers: sectors have the same
    # numbers, slices the same directions and weights.
    gbuffer = scene("corner", camera(size=(48, 64)), np.random.default_rng(1))
    slices = SsdoBitmaskParams(radius=0.8, slices=4, taps=32)
    device = uploaded(runtime, gbuffer)
    back = SsdoBitmask(runtime, gbuffer.size, slices, masks=True)
    sent = planar(runtime, np.ones((1, 48, 64, 3)))
    light = back.run(device, device, radiance=sent)
    assert back.masks is not None
    expected, masks = light.download(), back.masks.download()
    covered = inner(runtime, back.masks, 4, light.size).copy()
    start = np.zeros_like(expected)
    start[0] = 1.0
    light.upload(start)
    back.masks.upload(np.zeros_like(masks))
    views = SsdoViews(runtime, slices, ViewsParams(strata=16, taps=16))
    views.add(light, back.masks, device, device, device, sent)
    found, again = light.download(), inner(runtime, back.masks, 4, light.size)
    # Receivers within two pixels of the corner have no pixel of the other wall above the bias.
    normal = np.asarray(gbuffer.normal)
    flat = np.ones(gbuffer.size, bool)
    for axis, shift in ((0, -2), (0, 2), (1, -2), (1, 2)):
        flat &= np.all(np.roll(normal, shift, axis) == normal, axis=-1)
    both = np.bitwise_count(covered & again)[:, flat].sum()
    assert both > 0.9 * np.bitwise_count(covered)[:, flat].sum()
    assert both > 0.9 * np.bitwise_count(again)[:, flat].sum()
    # Each of 16 parts is covered whole or not at all, and taps lie beside the slice's pixels.
    assert found[0][flat].mean() == pytest.approx(expected[0][flat].mean(), abs=0.01)
    assert found[1][flat].mean() == pytest.approx(expected[1][flat].mean(), rel=0.05)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_camera_that_sees_nothing_near_changes_nothing(runtime: Runtime, kind: str) -> None:
    gbuffer = scene("corner", camera(size=SIZE), np.random.default_rng(1))
    device = uploaded(runtime, gbuffer)
    back = SsdoBitmask(runtime, gbuffer.size, SLICES, masks=True)
    light = back.run(device, device, radiance=planar(runtime, np.ones((1, *SIZE, 3))))
    assert back.masks is not None
    before, masks = light.download(), back.masks.download()
    away = camera(kind, size=(31, 41), eye=(20.0, 20.0, 20.0), target=(40.0, 41.0, 42.0))
    depth = np.full((31, 41), 5.0, np.float32)
    further = uploaded(runtime, GBuffer(camera=away, depth=depth))
    SsdoViews(runtime, SLICES).add(light, back.masks, device, device, further, planar(runtime, np.ones((1, 31, 41, 3))))
    np.testing.assert_array_equal(light.download(), before)
    np.testing.assert_array_equal(back.masks.download(), masks)


def test_wall_that_only_another_camera_sees_sends_its_light(runtime: Runtime) -> None:
    # A corner whose left wall lies outside the first camera's narrow image.
    narrow = camera(size=(48, 16), eye=(0.4, 1.0, 2.0), target=(0.0, -0.3, 0.0))
    gbuffer = scene("corner", narrow, np.random.default_rng(1))
    wide = scene("corner", camera(size=(60, 80), eye=(1.5, 1.5, 2.5)), np.random.default_rng(1))
    device, further = uploaded(runtime, gbuffer), uploaded(runtime, wide)
    slices = SsdoBitmaskParams(radius=1.0, slices=4, taps=32)
    back = SsdoBitmask(runtime, gbuffer.size, slices, masks=True)
    light = back.run(device, device, radiance=planar(runtime, np.zeros((1, 48, 16, 3))))
    assert back.masks is not None
    before = light.download()
    is_left = np.asarray(wide.normal)[..., 0] > 0.5
    sent = np.where(is_left[None, ..., None], [2.0, 1.0, 0.5], 0.0)
    assert is_left.any()
    views = SsdoViews(runtime, slices, ViewsParams(strata=16, taps=16))
    views.add(light, back.masks, device, device, further, planar(runtime, sent))
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
    gbuffer = uploaded(runtime, scene("corner", camera(size=SIZE), np.random.default_rng(1)))
    back = SsdoBitmask(runtime, SIZE, SLICES, masks=True)
    light = back.run(gbuffer, gbuffer, radiance=planar(runtime, np.ones((1, *SIZE, 3))))
    assert back.masks is not None
    with pytest.raises(ValueError, match="a device G-buffer is empty: draw or upload something"):
        SsdoViews(runtime, SLICES).add(light, back.masks, gbuffer, gbuffer, DeviceGBuffer(runtime, SIZE), None)
