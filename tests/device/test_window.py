"""Windows: the pixels that are computed, and those that are the same as before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.device.active_region import PreviousRegion, Region, copy_region
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import Frame, render
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from tools.figures.skips import lone_object

EMPTY = Region(0, 0, 0, 0)
SIZE = (600, 200)
"""Columns and rows: two widths of a window's work-groups, six of its tiles."""


def looking(built: BuiltinScene, aside: float, up: float = 0.0, size: tuple[int, int] = SIZE) -> Camera:
    """Return a camera that sees the object `aside` of the middle, as a tangent, and higher."""
    target = (-6.0 * aside, -6.0 * up, 0.0)
    return Camera.look_at((0.0, 0.0, 6.0), target, yfov=built.yfov, width=size[0], height=size[1])


VIEWS = ((0.0, 0.0), (0.7, 0.2), (-0.7, -0.1), (-0.7, -0.1), (5.0, 0.0), (0.2, 0.3))
"""Places of the object in the picture, frame by frame; once out of it."""


# ---- windows


def test_a_window_is_cut_joined_and_moved() -> None:
    a, b = Region(2, 3, 4, 5), Region(1, 10, 2, 2)
    assert a.union(b) == Region(1, 3, 5, 9)
    assert a.union(EMPTY) == EMPTY.union(a) == a
    assert a.inside((5, 7)) == Region(2, 3, 3, 4)
    assert a.inside((9, 9), margin=(3, 4)) == Region(0, 0, 3, 4)
    assert a.inside((2, 9)) == EMPTY
    assert Region.between((4, 4), (4, 9)) == EMPTY
    assert EMPTY.empty
    assert not a.empty


def test_a_window_meets_whole_cells() -> None:
    assert Region(3, 16, 2, 17).cells((2, 16)) == ((1, 1), (2, 2))
    assert EMPTY.cells((2, 16)) == ((0, 0), (0, 0))
    assert Region(3, 5, 4, 8).reduced(4) == Region(0, 1, 2, 3)


def test_a_corner_lies_beyond_unless_a_window_is_the_whole_image() -> None:
    assert Region(0, 0, 4, 5).beyond((4, 5)) is None
    assert Region(0, 0, 4, 4).beyond((4, 5)) == (0, 4)
    assert EMPTY.beyond((4, 5)) == (0, 0)


def test_a_trace_covers_what_the_run_before_left() -> None:
    a, b = Region(0, 0, 2, 2), Region(4, 4, 1, 1)
    trace = PreviousRegion()

    def covered(region: Region | None, background: float) -> Region | None:
        with trace.over(region, background) as over:
            return over

    assert covered(a, 1.0) is None, "whatever memory holds at first"
    assert covered(b, 1.0) == a.union(b)
    assert covered(b, 1.0) == b
    assert covered(b, 2.0) is None, "another background"
    assert covered(None, 2.0) is None
    assert covered(a, 2.0) is None
    assert covered(EMPTY, 2.0) == a


def test_after_a_run_that_raised_all_is_covered() -> None:
    a, trace = Region(0, 0, 2, 2), PreviousRegion()
    with trace.over(a):
        pass
    with pytest.raises(KeyboardInterrupt), trace.over(a):
        raise KeyboardInterrupt
    with trace.over(a) as over:
        assert over is None
    with trace.over(a) as over:
        assert over == a


def test_one_pixel_stands_for_all_beyond_a_window(rng: np.random.Generator) -> None:
    source = np.full((6, 8, 3), (1, 2, 3), np.uint8)
    region = Region(1, 2, 3, 4)
    source[1:4, 2:6] = rng.integers(0, 255, (3, 4, 3))
    for given in (region, None, Region(0, 0, 6, 8)):
        target = np.zeros_like(source)
        beyond = None if given is None else given.beyond((6, 8))
        copy_region(source, target, given, beyond)
        np.testing.assert_array_equal(target, source)


# ---- what is drawn


def cut_and_whole(
    built: BuiltinScene, view: tuple[float, float], lights: Sequence[Light], **options: Any
) -> list[Frame]:
    """Return a frame that leaves out what is outside of windows, and one that computes all pixels."""
    camera = looking(built, *view)
    given = {"bounces": 0, "shadow_size": 64, **options}
    return [render(built.scene, camera, lights, skips=skips, **given) for skips in (("region",), ())]


def assert_same_contents(a: Plane, b: Plane) -> None:
    np.testing.assert_array_equal(a.download(), b.download())


def test_a_rasteriser_with_windows_draws_bit_identical_results(runtime: Runtime) -> None:
    built = lone_object()
    scene = device_scene(built.scene, runtime)
    margin = (10, 30)
    cut, whole = (Rasterizer(runtime, SIZE[::-1], margin=margin, regions=regions) for regions in (True, False))
    found = []
    for view in VIEWS:
        camera = looking(built, *view)
        a, b = cut.render(scene, camera), whole.render(scene, camera)
        for name in ("depth", "normal_world", "albedo"):
            assert_same_contents(getattr(a, name), getattr(b, name))
        found.append(a.region)
        assert b.region is None
        assert a.region is not None
        seen = np.isfinite(a.depth.download()[0])
        seen[a.region.row : a.region.end[0], a.region.column : a.region.end[1]] = False
        assert not seen.any()
    assert found[4] == EMPTY
    assert found[0] != found[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"layers": 2},
        {"ao": "ssao", "overscan": 0.1},
        {"ao": "bitmask_ao", "overscan": 0.2, "layers": 2},
        {"ao": "hbao", "multi_bounce": True},
        {"ao": False, "exposure": 1.0},
        {"ao": False, "sky": "image"},
        {"indirect": "multires"},
        {"indirect": "vpl", "vpls": 64},
        {"indirect": "gather"},
        {"indirect": "ssdo", "layers": 2, "overscan": 0.1, "auxiliary_cameras": 1},
    ],
    ids=str,
)
def test_every_frame_of_a_moving_camera_has_bit_identical_results(
    variant_runtime: Runtime, rng: np.random.Generator, options: dict[str, Any]
) -> None:
    built = lone_object()
    given: dict[str, Any] = {"ao_radius": 0.2, "gbuffer": True, "runtime": variant_runtime, **options}
    sky = rng.uniform(0.0, 1.0, (8, 16, 3)) if given.pop("sky", None) else (0.1, 0.2, 0.3)
    lights = [*built.lights, Environment(sky)]
    for number, view in enumerate(VIEWS):
        used = lights if number != 3 else lights[:1]
        cut, whole = cut_and_whole(built, view, used, **given)
        assert cut.gbuffer is not None
        assert whole.gbuffer is not None
        assert "region" in [p.name for p in cut.passes]
        for name in ("radiance", "image", "ao", "indirect"):
            a, b = getattr(cut, name), getattr(whole, name)
            assert (a is None) == (b is None), name
            if a is not None:
                np.testing.assert_array_equal(a, b, err_msg=name)
        for name in ("depth", "normal", "albedo"):
            a, b = getattr(cut.gbuffer, name), getattr(whole.gbuffer, name)
            np.testing.assert_array_equal(np.asarray(a), np.asarray(b), err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("late", ["own", "full"])
@pytest.mark.parametrize("resolution", ["half", "quarter"])
def test_occlusion_at_a_lower_resolution_has_bit_identical_results(
    runtime: Runtime, resolution: str, late: str
) -> None:
    built = lone_object()
    scene = device_scene(built.scene, runtime)
    margin = (11, 30)
    cut, whole = (
        (
            Rasterizer(runtime, SIZE[::-1], margin=margin, regions=regions),
            Gtao(runtime, SIZE[::-1], GtaoParams(radius=0.3, resolution=resolution, blur_resolution=late), margin),
        )
        for regions in (True, False)
    )
    for view in VIEWS:
        results = []
        for rasterizer, gtao in (cut, whole):
            target = rasterizer.render(scene, looking(built, *view))
            target.derive()
            results.append(gtao.run(target))
        assert_same_contents(*results)
