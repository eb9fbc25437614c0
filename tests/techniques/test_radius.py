"""The radius follows what is seen, and one that does not suit the picture is warned of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import RadiusWarning
from ssgi_cl.core.seen_extent import RADIUS_SHARE, seen_extent
from ssgi_cl.device.runtime import Runtime

SIZE = (30, 40)
PINHOLE = gi.Camera.from_intrinsics(50.0, 50.0, 20.0, 15.0, width=40, height=30)
PARALLEL = gi.Camera.orthographic((0, 0, 1), (0, 0, 0), view_height=30.0, width=40, height=30)


def stepped(scale: float = 1.0) -> Any:
    """A wall with a step in it, at a distance of 100."""
    depth = np.full(SIZE, 100.0 * scale, np.float32)
    depth[:, 20:] *= 1.02
    return depth


def test_the_extent_is_the_pictures_diagonal_at_the_mean_of_what_is_near() -> None:
    wall = np.full(SIZE, 100.0)
    assert seen_extent(PINHOLE, wall) == pytest.approx(100.0)  # of 50 pixels with a focal length of 50
    wall[:, :20] = np.inf
    wall[0, 30] = 1e-3  # a leaf before the lens
    assert seen_extent(PINHOLE, wall) == pytest.approx(100.0)
    assert seen_extent(PARALLEL, wall) == pytest.approx(50.0)
    assert seen_extent(PINHOLE, np.full(SIZE, np.inf)) == np.inf


def calls() -> list[Any]:
    def lit(gbuffer: Any, **given: Any) -> Any:
        return gi.ssdo(gbuffer, [gi.Environment(1.0)], **given)[0]

    return [pytest.param(f, id=name) for name, f in {"gtao": gi.gtao, "ssao": gi.ssao, "ssdo": lit}.items()]


@pytest.mark.parametrize("call", calls())
def test_the_default_is_a_share_of_what_is_seen(runtime: Runtime, call: Callable[..., Any]) -> None:
    # The same picture in metres and in millimetres.
    for scale in (1.0, 1000.0):
        gbuffer = gi.GBuffer(camera=PINHOLE, depth=stepped(scale))
        radius = RADIUS_SHARE * seen_extent(PINHOLE, stepped(scale))
        found = call(gbuffer, runtime=runtime)
        np.testing.assert_array_equal(found, call(gbuffer, radius=radius, runtime=runtime))
        assert found.min() < 0.99 * found.max()  # the step is seen
    device = gi.DeviceGBuffer(runtime, SIZE)
    device.upload(gbuffer)
    np.testing.assert_array_equal(call(device, runtime=runtime), found)


@pytest.mark.parametrize(("radius", "pixels"), [(0.5, "0.000247"), (2e5, "99")])
def test_a_radius_below_a_pixel_or_over_the_image_is_warned_of(runtime: Runtime, radius: float, pixels: str) -> None:
    gbuffer = gi.GBuffer(camera=PINHOLE, depth=stepped(1000.0))  # millimetres, taken for metres
    with pytest.warns(RadiusWarning, match=rf"scene units, {pixels} pixels .* expected 1 to 50 .*radius=5.05e\+03"):
        gi.gtao(gbuffer, radius=radius, runtime=runtime)


def test_an_empty_image_takes_any_radius(runtime: Runtime) -> None:
    nothing = gi.GBuffer(camera=PINHOLE, depth=np.full(SIZE, np.inf))
    np.testing.assert_array_equal(gi.gtao(nothing, runtime=runtime), 1.0)
