"""Frames with a history: what becomes a mean, when it begins anew, and what is told of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.bench.drawn import with_holes
from ssgi_cl.core.camera import Camera
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.history import Shown, pattern_shift
from ssgi_cl.rasterize import moved
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.vpl.kept_order import KeptOrder

from .scenes import MAPS, cube, inside, matt, scene_of

BOX = make_scene("cornell_box")
SIZE = (36, 48)
FAST: dict[str, Any] = {"preset": "low", "shadow_size": 128, "rsm_size": 64, "exposure": 1.0}


def camera(right: float = 0.0, size: tuple[int, int] = SIZE) -> Camera:
    """Return a camera of the box that stands `right` scene units right of where it usually stands."""
    return Camera.look_at(np.add(BOX.eye, (right, 0, 0)), BOX.target, yfov=BOX.yfov, width=size[1], height=size[0])


def sequence(runtime: Runtime, frames: int, limit: int = 32, **params: Any) -> list[gi.Frame]:
    """Return frames of a still camera."""
    history = gi.FrameHistory(limit)
    return [
        gi.render(BOX.scene, camera(), BOX.lights, history=history, runtime=runtime, **params) for _ in range(frames)
    ]


def test_patterns_lie_at_all_sixteen_places_in_turn() -> None:
    assert len({pattern_shift(number) for number in range(16)}) == 16
    assert pattern_shift(0) == (0, 0)
    assert pattern_shift(17) == pattern_shift(1)


def test_the_picture_lies_where_its_camera_sees_it(runtime: Runtime) -> None:
    wanted = gi.rasterize.gbuffer(BOX.scene, camera(), runtime=runtime)
    for number in (0, 6):
        shown = Shown.of(number, SIZE)
        image = gi.rasterize.gbuffer(BOX.scene, shown.camera(camera()), runtime=runtime)
        found = shown.gbuffer(image, camera(), (0, 0))
        # The same rays by another matrix: depths differ by rounding, but for pixels at edges.
        off = ~np.isclose(found.depth, wanted.depth, rtol=1e-5)
        assert off.mean() < 0.01
        np.testing.assert_array_equal(np.shape(found.normal), np.shape(wanted.normal))


def test_direct_light_of_a_still_camera_is_that_of_one_frame(runtime: Runtime) -> None:
    given: dict[str, Any] = {"bounces": 0, "ao": False, "exposure": 1.0, "shadow_size": 256}
    alone = gi.render(BOX.scene, camera(), BOX.lights, runtime=runtime, **given)
    for frame in sequence(runtime, 3, **given):
        off = np.abs(frame.radiance - alone.radiance).max(axis=-1) > 1e-3 * alone.radiance.max()
        # Texels of shadow maps and triangles at edges of pixels alone: maps are fitted to what the image shows.
        assert off.mean() < 0.02
        assert frame.counts is None  # nothing has noise


@pytest.mark.parametrize("holes", [False, True])
def test_lights_keep_their_order_where_no_view_chooses_them(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, holes: bool
) -> None:
    """Others at the places of those before would be sorted by the axes of these: in a mesh with leaves reflected light
    was 4 to 7 % too dark."""
    kept: list[int] = []
    axes = KeptOrder.axes
    monkeypatch.setattr(KeptOrder, "axes", lambda *given: (found := axes(*given), kept.append(found[1]))[0])
    scene, history = with_holes(BOX.scene) if holes else BOX.scene, gi.FrameHistory()
    for step in range(2):
        gi.render(scene, camera(0.05 * step), BOX.lights, history=history, runtime=runtime, **FAST)
    assert kept == ([] if holes else [1, 2])


def test_before_a_still_camera_the_result_is_the_mean_of_frames(runtime: Runtime) -> None:
    frames, single = sequence(runtime, 16, **FAST), sequence(runtime, 16, limit=1, **FAST)
    there = np.isfinite(np.asarray(gi.rasterize.gbuffer(BOX.scene, camera(), runtime=runtime).depth))
    there[:4], there[-4:], there[:, :4], there[:, -4:] = False, False, False, False  # frames begin before the picture
    for number in (1, 2, 16):
        frame = frames[number - 1]
        assert frame.counts is not None
        assert np.all(frame.counts[there] == number)
        mean = np.mean([each.indirect for each in single[:number]], axis=0)
        assert frame.indirect is not None
        # Roundings of 16 steps, and of places, a 1000th of a pixel.
        np.testing.assert_allclose(frame.indirect[there], mean[there], rtol=2e-3, atol=1e-5)
    values = np.stack([each.indirect for each in single])[:, there]
    assert np.median(values.std(axis=0) / values.mean(axis=0)) > 1e-3  # frames differ
    assert frames[0].resets is not None
    assert np.all(frames[0].resets[there] == gi.Reset.FIRST)


@pytest.mark.parametrize(
    "params",
    [
        {"bounces": 0, "ao": "gtao"},
        {"bounces": 0, "ao": "ssao"},
        {"indirect": "multires", "vpls": 64},
        {"indirect": "vpl", "vpls": 64},
        {"indirect": "gather"},
        {"indirect": "ssdo", "layers": 2},
        {"preset": "low", "layers": 2, "overscan": 0.1, "gbuffer": True},
    ],
)
def test_every_kind_of_frame_has_a_history(runtime: Runtime, params: dict[str, Any]) -> None:
    lights = (*BOX.lights, gi.Environment((0.2, 0.2, 0.3)))
    history = gi.FrameHistory()
    there = np.isfinite(np.asarray(gi.rasterize.gbuffer(BOX.scene, camera(0.04), runtime=runtime).depth))
    for number in range(3):
        frame = gi.render(
            BOX.scene, camera(0.02 * number), lights, history=history, exposure=1.0, runtime=runtime, **MAPS, **params
        )
        assert frame.image.shape == (*SIZE, 3)
        assert np.isfinite(frame.radiance).all()
        assert frame.counts is not None
        # A pixel in a frame comes into view, and some more at edges of things.
        assert np.mean(frame.counts[there] == number + 1) > 0.8
    alone = gi.render(BOX.scene, camera(0.04), lights, exposure=1.0, runtime=runtime, **MAPS, **params)
    # Methods err by less than a fifth of the mean on average; that means have their level is meant.
    assert frame.radiance.mean() == pytest.approx(alone.radiance.mean(), rel=0.03)
    if frame.gbuffer is not None:
        assert alone.gbuffer is not None
        assert frame.gbuffer.depth.shape == alone.gbuffer.depth.shape


def test_reset_and_other_scenes_and_sizes_begin_anew(runtime: Runtime) -> None:
    history = gi.FrameHistory()

    def mean_count(scene: Any, size: tuple[int, int]) -> float:
        frame = gi.render(scene, camera(size=size), BOX.lights, history=history, runtime=runtime, **FAST)
        assert frame.counts is not None
        return float(frame.counts.mean())

    assert [mean_count(BOX.scene, SIZE) for _ in range(2)][1] > 1.5
    assert mean_count(cube(0.5), SIZE) == 1.0
    assert mean_count(BOX.scene, SIZE) == 1.0
    assert mean_count(BOX.scene, (20, 30)) == 1.0
    assert mean_count(BOX.scene, (20, 30)) > 1.5
    history.reset()
    assert history.number == 0
    assert history.download() == {}
    assert mean_count(BOX.scene, (20, 30)) == 1.0
    history.reset()  # right after the first frame, nothing of which is taken for the next
    assert mean_count(BOX.scene, (20, 30)) == 1.0


def test_a_picture_of_one_pixel_has_a_history(runtime: Runtime) -> None:
    history = gi.FrameHistory()
    for number in range(3):
        frame = gi.render(BOX.scene, camera(size=(1, 1)), BOX.lights, history=history, runtime=runtime, **FAST)
        assert frame.counts is not None
        assert frame.counts.tolist() == [[number + 1.0]]
        assert np.isfinite(frame.radiance).all()


def test_downloaded_moments_are_those_of_the_result(runtime: Runtime) -> None:
    history = gi.FrameHistory(limit=2)
    for _ in range(4):
        frame = gi.render(BOX.scene, camera(), BOX.lights, history=history, runtime=runtime, **FAST)
    held = history.download()["indirect irradiance"]
    assert frame.indirect is not None
    np.testing.assert_array_equal(held.mean, frame.indirect)
    assert frame.counts is not None
    assert frame.counts.max() == 2.0
    assert np.all(held.variance >= 0.0)
    assert held.variance.max() > 0.0


def test_a_light_that_goes_out_is_gone_in_its_frame(runtime: Runtime) -> None:
    lights = (*BOX.lights, gi.SpotLight((0.1, 0.3, 0.1), (1.0, -0.6, 0.8), 0.7, (2.0, 2.0, 2.0)))
    history = gi.FrameHistory()

    def frame(shining: Any) -> gi.Frame:
        return gi.render(BOX.scene, camera(), shining, history=history, runtime=runtime, **FAST)

    for _ in range(10):
        lit = frame(lights)
    off = frame(BOX.lights)
    alone = gi.render(BOX.scene, camera(), BOX.lights, runtime=runtime, **FAST)
    step = lit.radiance.mean() - alone.radiance.mean()
    assert step > 0.05 * alone.radiance.mean()
    assert abs(off.radiance.mean() - alone.radiance.mean()) < 0.1 * step


def test_a_thing_that_moves_keeps_its_history_and_leaves_no_shadow_behind(runtime: Runtime) -> None:
    floor = [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]]
    tile = [[-0.4, 0.3, 0.4], [0.4, 0.3, 0.4], [0.4, 0.3, -0.4], [-0.4, 0.3, -0.4]]
    scene = scene_of([*floor, *tile], [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)], matt(0.7))
    light = gi.DirectionalLight((-1.0, -1.0, 0.0), (3.0, 3.0, 3.0))
    eye = Camera.look_at((0.0, 2.5, 2.5), (0, 0, 0), yfov=0.9, width=64, height=48)
    history = gi.FrameHistory()
    for number in range(8):
        shift = np.eye(4)
        shift[:2, 3] = 0.05 * number, 0.18 * number  # more than two footprints of a pixel, .07 each
        now = moved(scene, shift, vertices=np.arange(8) >= 4)
        frame = gi.render(now, eye, [light], history=history, runtime=runtime, **FAST)
    alone = gi.render(now, eye, [light], gbuffer=True, runtime=runtime, **FAST)
    assert alone.gbuffer is not None
    assert frame.counts is not None
    there = np.isfinite(np.asarray(alone.gbuffer.depth))
    assert np.median(frame.counts[there]) >= 4.0  # what is moved by its neighbourhood stands for four from then on
    plane = gi.rasterize.gbuffer(scene_of(floor, [(0, 1, 2), (0, 2, 3)], matt(0.7)), eye, runtime=runtime)
    tile_seen = np.asarray(alone.gbuffer.depth) < 0.99 * np.asarray(plane.depth)
    assert tile_seen.any()
    assert np.median(frame.counts[tile_seen]) >= 4.0
    off = np.abs(frame.radiance - alone.radiance).max(axis=-1) > 0.1 * alone.radiance.max()
    # Shadows of two sets of maps at a row of pixels along the edge; a trail of 7 frames would be a tenth of the image.
    assert off.mean() < 0.03


def test_patterns_stay_while_things_move_or_lights_change(runtime: Runtime) -> None:
    history, patterns = gi.FrameHistory(), []
    lifted = np.eye(4)
    lifted[1, 3] = 1e-3
    other = moved(BOX.scene, lifted, vertices=np.arange(len(BOX.scene.positions)) >= len(BOX.scene.positions) - 8)
    dimmed = [gi.SpotLight((0.1, 0.9, 0.1), (0.0, -1.0, 0.0), 0.7, (2.0, 2.0, 2.0))]
    for scene, lights in (
        (BOX.scene, BOX.lights), (BOX.scene, BOX.lights), (other, BOX.lights), (BOX.scene, BOX.lights),
        (BOX.scene, BOX.lights), (BOX.scene, dimmed), (BOX.scene, dimmed),
    ):  # fmt: skip
        gi.render(scene, camera(), lights, history=history, runtime=runtime, **FAST)
        patterns.append(history.pattern)
    assert patterns == [0, 1, 1, 1, 2, 2, 3]
    assert history.number == 7


def test_light_of_a_thing_that_hardly_moves_is_steadier_than_without_a_history(runtime: Runtime) -> None:
    chosen = np.arange(len(BOX.scene.positions)) >= len(BOX.scene.positions) - 8
    history, frames = gi.FrameHistory(), {True: [], False: []}
    for number in range(4):
        stretched = np.eye(4)
        stretched[0, 0] = 1.0 + 1e-3 * number
        scene = moved(BOX.scene, stretched, vertices=chosen)
        for steady, found in frames.items():
            given = {"history": history} if steady else {}
            found.append(gi.render(scene, camera(), BOX.lights, runtime=runtime, **given, **FAST).indirect)
    change = {steady: np.abs(found[3] - found[2]).mean() for steady, found in frames.items()}
    assert change[True] < 0.5 * change[False]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"history": True}, TypeError, "history is bool: expected an ssgi_cl.FrameHistory, or None"),
        ({"history": "yes"}, TypeError, "history is str"),
        ({"history": gi.FrameHistory(), "samples": 2}, ValueError, "samples is 2: expected 1 with a history"),
        ({"history": gi.FrameHistory(), "max_memory": 1 << 28}, ValueError, "max_memory is .*: expected None with a"),
    ],
)
def test_bad_histories_are_named(runtime: Runtime, given: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        gi.render(BOX.scene, camera(), BOX.lights, runtime=runtime, **FAST, **given)


@pytest.mark.parametrize(("limit", "error"), [(0, ValueError), (4097, ValueError), (2.5, TypeError), (True, TypeError)])
def test_bad_limits_are_named(limit: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="limit is"):
        gi.FrameHistory(limit)


def test_bad_renderers_are_named(runtime: Runtime) -> None:
    bad: Any = 1
    with pytest.raises(TypeError, match="history is 1: expected True or False"):
        gi.Renderer(runtime, SIZE, history=bad)
    with pytest.raises(ValueError, match=r"history is asked for with a picture of \(16384, 1\) pixels"):
        gi.Renderer(runtime, (16384, 1), history=True)
    renderer = gi.Renderer(runtime, SIZE, bounces=0)
    with pytest.raises(ValueError, match="history is given: expected None"):
        renderer(BOX.scene, camera(), BOX.lights, history=gi.FrameHistory())
    steady = gi.Renderer(runtime, SIZE, bounces=0, history=True)
    with pytest.raises(ValueError, match=r"camera has size \(20, 30\)"):
        steady(BOX.scene, camera(size=(20, 30)), BOX.lights)


def test_a_renderer_has_a_history_of_its_own(runtime: Runtime) -> None:
    renderer = gi.Renderer(runtime, SIZE, history=True, **FAST)
    assert renderer.graph().stages
    for number in range(3):
        frame = renderer(BOX.scene, camera(), BOX.lights)
        assert frame.counts is not None
        assert np.median(frame.counts) == number + 1
    alone = sequence(runtime, 3, **FAST)[-1]
    np.testing.assert_array_equal(frame.radiance, alone.radiance)
    assert renderer.history is not None
    assert renderer.history.number == 3
    assert gi.Renderer(runtime, SIZE).history is None


def test_a_frame_without_the_history_is_not_changed_by_one(runtime: Runtime) -> None:
    before = gi.render(BOX.scene, inside(32, 24), BOX.lights, runtime=runtime, **FAST)
    sequence(runtime, 2, **FAST)
    after = gi.render(BOX.scene, inside(32, 24), BOX.lights, runtime=runtime, **FAST)
    np.testing.assert_array_equal(before.radiance, after.radiance)
    assert after.counts is None
    assert after.resets is None
