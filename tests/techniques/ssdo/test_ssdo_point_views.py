"""Auxiliary cameras of SSDO with directions: numpy reference, and views that must change nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ssdo.ssdo_points import Gathered, ssdo_point_views_reference, ssdo_points_reference
from ssgi_cl.techniques.direct.layer_shading import SenderRecords
from ssgi_cl.techniques.ssdo.ssdo_points import POINT_METHODS, PointsParams, SsdoPoints
from ssgi_cl.techniques.ssdo.ssdo_views import add_point_view

from ..analytic import camera, scene, slow_but
from .cases import as_gathered, aside, assert_alike, layered, planar, uploaded
from .test_ssdo_points import FLIPS, SKY

Doubles = NDArray[np.float64]

SIZE = (17, 35)
RADIUS = 0.9
PARAMS = PointsParams(radius=RADIUS)


def records_of(runtime: Runtime, device: DeviceGBuffer, sent: Doubles) -> SenderRecords:
    """Return radiance [layers, rows, columns, 3] with the normals of a G-buffer."""
    records = SenderRecords(runtime, device.whole, len(sent))
    records.pack(device, planar(runtime, sent))
    return records


class Case:
    """A G-buffer on the device, and its results with auxiliary cameras."""

    def __init__(
        self,
        runtime: Runtime,
        gbuffer: GBuffer,
        *,
        params: PointsParams = PARAMS,
        step: int = 1,
        own: Doubles | None = None,
        sky: Doubles | None = None,
    ) -> None:
        self.runtime = runtime
        self.gbuffer = gbuffer
        self.device = uploaded(runtime, gbuffer)
        self.points = SsdoPoints(runtime, gbuffer.size, step, params, kept=True)
        sent = None if own is None else planar(runtime, own)
        self.has_sky = sky is not None
        self.plane = self.points.run(self.device, radiance=sent, sky=SimpleNamespace(image=sky))

    def add(self, other: GBuffer, sent: Doubles | None) -> None:
        """Add a camera."""
        device = uploaded(self.runtime, other)
        records = None if sent is None else records_of(self.runtime, device, sent)
        add_point_view(self.points, self.plane, self.device, device, records)

    def found(self) -> Gathered:
        """Return the results in the form of the reference."""
        return as_gathered(self.plane.download(), sky=self.has_sky, bounce=self.points.bounces)


def assert_same(found: Gathered, expected: Gathered) -> None:
    for name in ("visibility", "sky", "bounce"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


# ---- against the numpy reference

VARIANTS: dict[str, dict[str, Any]] = {
    "perspective": {},
    "orthographic": {"step": 2, "sky": False},
    "thick": {"step": 4, "thickness": 0.3},
    "published": {"method": "published", "nearest_distance": 0.4},
}


@pytest.mark.parametrize("variant", slow_but(VARIANTS, "perspective"))
def test_every_kernel_variant_agrees_with_numpy_reference(variant_runtime: Runtime, variant: str) -> None:
    rng = np.random.default_rng(5)
    chosen = dict(VARIANTS[variant])
    step = chosen.pop("step", 1)
    sky = SKY if chosen.pop("sky", True) else None
    params = replace(PARAMS, samples=33, **chosen)
    kind = "orthographic" if variant == "orthographic" else "perspective"
    gbuffer = scene("bumpy", camera(kind, size=SIZE), np.random.default_rng(3), margin=(2, 4))
    other = layered(aside(kind), 3)
    if variant == "thick":
        thickness = rng.uniform(0.1, RADIUS, np.shape(other.depth)[1:]).astype(np.float32)
        other = replace(other, thickness=thickness)
    own, sent = rng.random((1, *np.shape(gbuffer.depth), 3)), 0.1 + rng.random((2, 31, 41, 3))
    case = Case(variant_runtime, gbuffer, params=params, step=step, own=own, sky=sky)
    case.add(other, sent)
    before = ssdo_points_reference(gbuffer, params, step=step, radiance=own, sky=sky)
    after = ssdo_point_views_reference(gbuffer, before, other, sent, params, step=step, sky=sky)
    assert (before.visibility - after.visibility).max() > 0.05
    assert (after.bounce - before.bounce).max() > 0.05
    # Two cameras, and with 33 directions of 7 taps four times as many that may flip.
    assert_alike(case.found(), after, 5.0 * FLIPS)
    # A second one at the same place finds what the first did: nothing more.
    found = case.found()
    case.add(other, sent)
    assert_same(case.found(), found)


# ---- what must not change


@pytest.mark.parametrize("method", POINT_METHODS)
def test_first_camera_again_changes_nothing(runtime: Runtime, method: str) -> None:
    rng = np.random.default_rng(5)
    gbuffer = scene("bumpy", camera(size=SIZE), np.random.default_rng(3))
    sent = rng.random((1, *SIZE, 3))
    params = replace(PARAMS, method=method)
    case = Case(runtime, gbuffer, params=params, own=sent)
    before = case.found()
    case.add(gbuffer, sent)
    # The least depth follows from the radius with a view, else from the receiver's depth.
    assert_same(case.found(), before)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_camera_that_sees_nothing_near_changes_nothing(runtime: Runtime, kind: str) -> None:
    gbuffer = scene("corner", camera(size=SIZE), np.random.default_rng(1))
    case = Case(runtime, gbuffer, own=np.ones((1, *SIZE, 3)))
    before = case.plane.download()
    away = camera(kind, size=(31, 41), eye=(20.0, 20.0, 20.0), target=(40.0, 41.0, 42.0))
    other = GBuffer(camera=away, depth=np.full((31, 41), 5.0, np.float32))
    case.add(other, np.ones((1, 31, 41, 3)))
    np.testing.assert_array_equal(case.plane.download(), before)


# ---- what is found


def test_wall_that_only_another_camera_sees_sends_its_light_once(runtime: Runtime) -> None:
    # A corner whose left wall lies outside the first camera's narrow image.
    narrow = camera(size=(48, 16), eye=(0.4, 1.0, 2.0), target=(0.0, -0.3, 0.0))
    gbuffer = scene("corner", narrow, np.random.default_rng(1))
    eyes = ((1.5, 1.5, 2.5), (1.7, 1.3, 2.4))
    wide = [scene("corner", camera(size=(60, 80), eye=eye), np.random.default_rng(1)) for eye in eyes]
    params = replace(PARAMS, radius=1.0)
    case = Case(runtime, gbuffer, params=params, own=np.zeros((1, 48, 16, 3)))
    before = case.found()
    sums = []
    for other in wide:
        is_left = np.asarray(other.normal)[..., 0] > 0.5
        assert is_left.any()
        case.add(other, np.where(is_left[None, ..., None], [2.0, 1.0, 0.5], 0.0))
        found = case.found()
        np.testing.assert_allclose(found.bounce[..., 1], 0.5 * found.bounce[..., 0], rtol=1e-5)
        sums.append(found.bounce[..., 0].mean())
        # The wall hides a good part of the half ball over its foot, a few per cent of the image.
        assert found.visibility.mean() < before.visibility.mean() - 0.01
    assert sums[0] > before.bounce.mean() + 0.05
    assert sums[1] > sums[0]
    # What the second one adds is at the edges of what the first of the two shows.
    assert sums[1] == pytest.approx(sums[0], rel=0.1)


# ---- bad input


def test_empty_gbuffer_and_points_that_keep_nothing_are_refused(runtime: Runtime) -> None:
    gbuffer = scene("corner", camera(size=SIZE), np.random.default_rng(1))
    case = Case(runtime, gbuffer, own=np.ones((1, *SIZE, 3)))
    with pytest.raises(ValueError, match="a device G-buffer is empty: draw or upload something"):
        add_point_view(case.points, case.plane, case.device, DeviceGBuffer(runtime, SIZE), None)
    points = SsdoPoints(runtime, SIZE, 1, PARAMS)
    with pytest.raises(ValueError, match="points keeps no directions: expected one that"):
        add_point_view(points, case.plane, case.device, case.device, None)
