"""Parts of the window: pace, poses, lights, references, wipe and error, chart, code, files."""

from __future__ import annotations

import io
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.io import exr
from ssgi_cl.viewer.accumulation import MOST_FRAMES, Accumulation
from ssgi_cl.viewer.call_code import code
from ssgi_cl.viewer.compose import RAMP, false_colours, relative_error, wiped
from ssgi_cl.viewer.gbuffer_file import load_gbuffer
from ssgi_cl.viewer.light_panel import with_environment
from ssgi_cl.viewer.light_settings import LightState, colour_of, handle_place, moved, power_of, with_colour, with_power
from ssgi_cl.viewer.outputs import Drawn
from ssgi_cl.viewer.pass_chart import chart
from ssgi_cl.viewer.pose import Pose
from ssgi_cl.viewer.quality import COARSE, SCALES, START, TARGET_MS, Pace, moving_params, quick_params
from ssgi_cl.viewer.reference import Estimate
from ssgi_cl.viewer.saved import exr_bytes, png_bytes
from ssgi_cl.viewer.settings import AO, FRAME, PRESET
from ssgi_cl.viewer.source import Source, open_source

from .conftest import first_look


def test_the_pace_follows_the_time_of_frames() -> None:
    pace = Pace()
    for _ in range(2):
        pace.note(2.0 * TARGET_MS)
    assert pace.scale == SCALES[START + 1]
    for _ in range(100):
        pace.note(0.1 * TARGET_MS)
    assert pace.scale == 1.0
    for _ in range(100):
        pace.note(0.95 * TARGET_MS)
    assert pace.scale == 1.0  # neither slow nor to and fro
    assert pace.size(640, 400) == (640, 400)


def test_moving_frames_are_never_finer_than_what_was_asked_for() -> None:
    fine, low = moving_params(FrameParams()), moving_params(FrameParams(preset="low", shadow_size=64))
    assert fine.whole is not None
    assert {name: getattr(fine.whole, name) for name in COARSE} == COARSE
    assert low.shadow_size == 64
    assert moving_params(FrameParams(bounces=0)).kind == "direct"
    assert quick_params(FrameParams(indirect="ssdo", auxiliary_cameras=4)).kind == "direct"


def test_refinement_starts_with_render_and_is_then_the_mean_of_its_samples() -> None:
    camera = gi.Camera.look_at((0, 0, 1), (0, 0, 0), width=4, height=3)
    accumulation = Accumulation()
    assert accumulation.camera(camera) is camera
    first = np.full((3, 4, 3), 100.0, np.float32)
    assert accumulation.add(first, camera) is first  # and no part of the mean
    assert not accumulation.count
    for value in range(MOST_FRAMES):
        image = accumulation.camera(camera)
        assert image.size == (6, 7)
        np.testing.assert_array_equal(image.view, camera.view)
        mean = accumulation.add(np.full((*image.size, 3), value, np.float32), camera)
        assert mean.shape == (3, 4, 3)
    assert accumulation.done
    np.testing.assert_allclose(mean, 0.5 * (MOST_FRAMES - 1))


def test_a_pose_gives_its_camera_back() -> None:
    camera = gi.Camera.look_at((1, 2, 5), (0, 1, 0), yfov=0.7, width=64, height=48)
    again = Pose.of(camera, 3.0).camera(64, 48)
    np.testing.assert_allclose(again.view, camera.view, atol=1e-12)
    np.testing.assert_allclose(again.projection[:2], camera.projection[:2], atol=1e-12)


def test_power_and_colour_of_lights_are_apart() -> None:
    sky = Environment(np.linspace(0.1, 2.0, 24).reshape(2, 4, 3))
    for light in (
        PointLight((0, 1, 0), (1.0, 2.0, 4.0)),
        DirectionalLight((0, -1, 0), 3.0),
        sky,
        PointLight((0, 0, 0), 0),
    ):
        brighter = with_power(light, 8.0)
        assert power_of(brighter) == pytest.approx(8.0)
        np.testing.assert_allclose(colour_of(brighter), colour_of(light))
        red = with_colour(brighter, np.array([1.0, 0.5, 0.25]))
        np.testing.assert_allclose(colour_of(red), (1.0, 0.5, 0.25))
        assert power_of(red) == pytest.approx(8.0)
        assert power_of(with_colour(brighter, np.zeros(3))) == pytest.approx(8.0)
    with pytest.raises(ValueError, match=r"power \(intensity\) is -1"):
        with_power(PointLight((0, 0, 0), 1.0), -1.0)


def test_a_dragged_light_shines_from_its_handle() -> None:
    centre = np.array([1.0, 2.0, 3.0])
    sun = DirectionalLight((0, -1, 0), 3.0)
    np.testing.assert_allclose(handle_place(sun, centre, 4.0), (1.0, 4.0, 3.0))
    dragged = moved(sun, centre + np.array([2.0, 0.0, 0.0]), centre)
    np.testing.assert_allclose(dragged.direction, (-1.0, 0.0, 0.0))  # type: ignore[union-attr]
    lamp = moved(PointLight((0, 0, 0), 1.0), np.ones(3), centre)
    np.testing.assert_allclose(lamp.position, (1.0, 1.0, 1.0))  # type: ignore[union-attr]
    with pytest.raises(ValueError, match="direction"):
        moved(sun, centre, centre)


def test_an_environment_of_a_file_takes_the_place_of_the_first() -> None:
    own = PointLight((0, 0, 0), 1.0), Environment(1.0), Environment(2.0)
    states = tuple(LightState(light=light) for light in own)
    other = Environment(3.0)
    changed = with_environment(states, own, other)
    assert [state.light for state in changed] == [own[0], other, own[2]]
    assert [state.on for state in changed] == [True, True, False]
    back = with_environment(changed, own, None)
    assert [(state.light, state.on) for state in back] == [(light, True) for light in own]
    assert with_environment(states[:1], own[:1], other)[1].light is other


def test_the_standard_error_is_that_of_the_mean(rng: np.random.Generator) -> None:
    estimate = Estimate()
    estimate.add(np.ones((2, 2), np.float32))
    assert math.isinf(estimate.standard_error)
    estimate = Estimate()
    for _ in range(64):
        estimate.add(rng.normal(1.0, 0.5, (200, 200)).astype(np.float32))
    # 0.5 / sqrt(64), known to 1 / sqrt(2 * 64 * 40000) of itself.
    assert estimate.standard_error == pytest.approx(0.5 / 8.0, rel=0.01)
    np.testing.assert_allclose(estimate.mean.mean(), 1.0, atol=0.01)


def test_a_wipe_joins_pictures_of_any_two_sizes() -> None:
    left, right = np.zeros((8, 10, 3), np.uint8), np.full((4, 5, 3), 100, np.uint8)
    both = wiped(left, right, 0.5)
    assert both.shape == left.shape
    assert (both[:, :4] == 0).all()
    assert (both[:, 4:6] == 255).all()
    assert (both[:, 6:] == 100).all()
    assert (wiped(left, right, 0.0) == 100).all()
    assert (wiped(left, right, 1.0) == 0).all()


def test_errors_are_shares_of_the_reference() -> None:
    reference = np.full((2, 2, 3), 2.0, np.float32)
    error = relative_error(reference * 1.5, reference)
    np.testing.assert_allclose(error, 1.0 / 2.02, rtol=1e-5)
    colours = false_colours(np.array([[0.0, 1.0, np.inf, np.nan]], np.float32))
    np.testing.assert_array_equal(colours[0], RAMP[[0, -1, -1, -1]].astype(np.uint8))
    assert np.isfinite(relative_error(np.ones((2, 2)), np.zeros((2, 2)))).all()


def test_the_code_makes_the_same_picture(box: Source, runtime: Runtime) -> None:
    look = first_look(box, (64, 48))
    settings = look.settings.changed(AO, "slices", 3).changed(PRESET, "surfels", 64).changed(FRAME, "curve", "clip")
    lamp = LightState(light=PointLight((0.2, 0.4, 0.3), (0.1, 0.2, 0.1)))
    look = look.__class__(pose=look.pose, size=look.size, settings=settings, lights=(lamp,))
    text = code(box, look).replace('frame.save("picture.png")', "")
    found: dict[str, object] = {}
    exec(compile(text, "code", "exec"), found)
    assert box.scene is not None
    values = {name: getattr(settings.params, name) for name in ("ao", "preset", "curve")}
    expected = gi.render(box.scene, box.pose.camera(64, 48), look.shining, runtime=runtime, **values)
    # Numbers are written with six digits: a pixel at an edge may differ.
    difference = found["frame"].image.astype(int) - expected.image  # type: ignore[attr-defined]
    assert (np.abs(difference) > 2).mean() < 0.01


def test_the_chart_has_a_bar_for_each_stage_and_escapes_names(box: Source, runtime: Runtime) -> None:
    assert box.scene is not None
    frame = gi.render(box.scene, box.pose.camera(32, 24), box.lights, runtime=runtime)
    text = chart(frame.graph, frame.wall_ms)
    for stage in frame.graph.stages:
        assert (stage.name in text) == (stage.state in ("ran", "reused", "idle")), stage.name
    record = frame.graph
    stage = record.stages[0]._replace(name="<script>")
    hostile = chart(type(record)(**{**vars(record), "stages": (stage,)}), 1.0)
    assert "<script>" not in hostile


def test_saved_pictures_are_files(tmp_path: Path) -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    with Image.open(io.BytesIO(png_bytes(picture))) as image:
        np.testing.assert_array_equal(np.asarray(image), picture)
    values = np.linspace(0.0, 9.0, 24, dtype=np.float32).reshape(2, 4, 3)
    path = tmp_path / "a.exr"
    path.write_bytes(exr_bytes(Drawn(kind="light", values=values)))
    np.testing.assert_array_equal(exr.read(path)["R"], values[..., 0])
    with pytest.raises(ValueError, match="expected a still one"):
        exr_bytes(Drawn(kind="light", values=None, picture=picture))


def test_gbuffers_of_npz_files(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    depth = np.full((6, 8), 2.0, np.float32)
    depth[0, 0] = np.nan
    np.savez(path, depth=depth, albedo=np.full((6, 8, 3), 0.5), K=np.array([[8.0, 0, 3.5], [0, 8.0, 2.5], [0, 0, 1]]))
    gbuffer = load_gbuffer(path)
    assert np.isinf(gbuffer.first("depth")[0, 0])  # type: ignore[index]
    np.testing.assert_allclose(gbuffer.camera.pixel_to_view, (1 / 8, -1 / 8, -0.5, 0.375))
    np.savez(path, normal=np.zeros((6, 8, 3)))
    with pytest.raises(ValueError, match="expected 'depth'"):
        load_gbuffer(path)
    path.write_bytes(b"no zip")
    with pytest.raises(ValueError, match="expected a file of arrays"):
        load_gbuffer(path)
    np.savez(path, depth=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="expected a file of arrays"):
        load_gbuffer(path)


def test_a_process_may_end_while_pictures_are_drawn() -> None:
    text = (
        "from ssgi_cl.bench.experiments.window import Stand; stand = Stand('cornell_box'); "
        "stand.wait(lambda: stand.shown); stand.orbit(0.1)"
    )
    assert subprocess.run([sys.executable, "-c", text], check=False, timeout=120).returncode == 0


def test_a_file_that_vanished_is_named(tmp_path: Path, runtime: Runtime) -> None:
    for name in ("gone.npz", "gone.exr", "gone.glb"):
        with pytest.raises((OSError, ValueError), match="gone"):
            open_source(str(tmp_path / name), runtime)


def test_an_exr_of_a_render_is_shown(box: Source, tmp_path: Path, runtime: Runtime) -> None:
    assert box.scene is not None
    frame = gi.render(box.scene, box.pose.camera(32, 24), box.lights, gbuffer=True, runtime=runtime)
    path = tmp_path / "box.exr"
    frame.save(path)
    source = open_source(str(path), runtime)
    assert source.gbuffer is not None
    assert source.gbuffer.size == (24, 32)
    assert source.reload is not None
    assert source.reload().gbuffer is not None
