"""Sequences as test cases: their measures in closed form, what the shots show, and the table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from ssgi_cl.bench.experiments import pans, steadiness
from ssgi_cl.bench.experiments.history import alternated, film, main, measured, told
from ssgi_cl.bench.experiments.shots import SHOTS, shots_of
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene

SIZE = (30, 40)
ALL = np.ones(SIZE, bool)


def flat(value: float) -> NDArray[np.float64]:
    return np.full(SIZE, value)


def test_static_error_is_an_error_but_no_temporal_noise() -> None:
    references = [flat(0.1 * n) for n in range(5)]
    images = [reference + 0.25 for reference in references]
    assert steadiness.rmse(images, references, [ALL] * 5) == pytest.approx(0.25)
    assert steadiness.temporal_noise(images, references, [ALL] * 5) == pytest.approx(0.0, abs=1e-12)


def test_flicker_is_temporal_noise_and_a_true_change_is_none() -> None:
    references = [flat(float(n % 2)) for n in range(6)]
    assert steadiness.temporal_noise(references, references, [ALL] * 6) == 0.0
    images = [reference + 0.1 * (-1) ** n for n, reference in enumerate(references)]
    assert steadiness.temporal_noise(images, references, [ALL] * 6) == pytest.approx(0.2)
    still = [flat(0.0)] * 6  # lags behind all changes
    assert steadiness.temporal_noise(still, references, [ALL] * 6) == pytest.approx(1.0)


def test_flicker_is_change_beyond_that_of_the_reference() -> None:
    camera = Camera.orthographic((0, 0, 5), (0, 0, 0), view_height=3.0, width=SIZE[1], height=SIZE[0])
    motion = np.zeros((*SIZE, 3), np.float32)
    motion[..., 0] = 1.5  # everything was 1.5 pixels further right
    gbuffers = [GBuffer(camera=camera, depth=np.full(SIZE, 5.0, np.float32), motion=motion) for _ in range(6)]

    def shown(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radiance whose logarithm, of itself + .01, are the values."""
        return np.repeat((np.exp(values) - 0.01)[..., None], 3, axis=-1)

    slope = np.broadcast_to(0.05 * np.arange(SIZE[1]), SIZE)  # a pattern that moves along, linear in between
    still = [shown(slope + 0.05 * 1.5 * n) for n in range(6)]
    assert steadiness.flicker(still, still, gbuffers) == pytest.approx(0.0, abs=1e-12)
    noisy = [shown(slope + 0.05 * 1.5 * n + 0.1 * (-1) ** n) for n in range(6)]
    assert steadiness.flicker(noisy, still, gbuffers) == pytest.approx(0.2)
    assert steadiness.flicker(noisy, noisy, gbuffers) == pytest.approx(0.0, abs=1e-12)
    assert steadiness.flicker(still, noisy, gbuffers) == pytest.approx(0.0, abs=1e-12)
    hidden = [replace(g, depth=np.full(SIZE, 5.0 + n, np.float32)) for n, g in enumerate(gbuffers)]
    assert math.isnan(steadiness.flicker(noisy, still, hidden))  # nothing that the image before showed


def test_pops_are_changes_of_pixels_that_stand_in_the_reference() -> None:
    camera = Camera.orthographic((0, 0, 5), (0, 0, 0), view_height=3.0, width=SIZE[1], height=SIZE[0])
    motion = np.zeros((*SIZE, 3), np.float32)
    gbuffers = [GBuffer(camera=camera, depth=np.full(SIZE, 5.0, np.float32), motion=motion) for _ in range(4)]
    still = [np.ones((*SIZE, 3)) for _ in gbuffers]
    popping = [image.copy() for image in still]
    popping[2][:3] += 0.02  # and back in the next frame
    popping[2][3:6] += 0.005
    assert steadiness.pops(popping, still, gbuffers) == pytest.approx(2 / 3 * 3 / SIZE[0])
    assert steadiness.pops(still, still, gbuffers) == 0.0
    assert steadiness.pops(still, popping, gbuffers) == 0.0
    assert steadiness.pops(popping, popping, gbuffers) == 0.0


def test_a_pan_turns_about_the_vertical_by_what_it_says(runtime: Runtime) -> None:
    made = pans.pan("cornell_box", SIZE, 5, runtime)
    first, last = made[0].camera, made[-1].camera
    np.testing.assert_allclose(first.view, make_scene("cornell_box").camera(*SIZE[::-1]).view, atol=1e-12)
    np.testing.assert_allclose(last.position, first.position, atol=1e-9)
    assert math.acos(float(last.view[2, :3] @ first.view[2, :3])) == pytest.approx(4 * pans.TURN, rel=1e-3)
    assert last.view[0, 1] == pytest.approx(first.view[0, 1], abs=1e-12)  # upright


def test_whole_frames_with_a_history_flicker_less(runtime: Runtime) -> None:
    pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed (extra 'truth')")
    text = pans.table(["cornell_box"], (45, 60), 12, 8, runtime)
    one, history = (float(line.split("|")[3]) for line in text.splitlines()[2:])
    # A slow pan of 8 measured frames; at 240 x 180 it is a fifth to two fifths.
    assert 0.0 < history < 0.7 * one


def test_masks_choose_pixels_and_colours_count_as_their_mean() -> None:
    mask = np.zeros(SIZE, bool)
    mask[3, 4] = True
    image = np.zeros((*SIZE, 3))
    image[3, 4] = (0.3, 0.0, 0.0)
    assert steadiness.rmse([image], [np.zeros((*SIZE, 3))], [mask]) == pytest.approx(0.3 / math.sqrt(3.0))
    assert math.isnan(steadiness.rmse([image], [image], [~ALL]))


@pytest.mark.parametrize(("share", "frames"), [(0.0, 0), (0.5, 3), (0.8, 10)])
def test_lag_is_the_frames_until_nine_tenths_of_a_step_are_followed(share: float, frames: int) -> None:
    references = [flat(1.0)] * 4 + [flat(0.2)] * 20
    # After n frames share^(n + 1) of the step is left: 10 % after 3 frames of .5, 10 of .8.
    images = [flat(1.0)] * 4 + [flat(0.2 + 0.8 * share ** (n + 1)) for n in range(20)]
    assert steadiness.lag(images, references, 4) == frames
    assert steadiness.lag([flat(1.0)] * 24, references, 4) == -1


def test_uncovered_pixels_are_those_that_something_moved_away_from() -> None:
    camera = Camera.orthographic((0, 0, 5), (0, 0, 0), view_height=3.0, width=SIZE[1], height=SIZE[0])
    gbuffers = []
    for number in range(12):
        depth = np.full(SIZE, 5.0, np.float32)
        motion = np.zeros((*SIZE, 3), np.float32)
        left = 10 + min(number, 1) * 4
        depth[10:20, left : left + 8] = 4.0
        if number == 1:
            motion[10:20, left : left + 8, 0] = -4.0
        gbuffers.append(GBuffer(camera=camera, depth=depth, motion=motion))
    masks = steadiness.uncovered(gbuffers)
    wanted = np.zeros(SIZE, bool)
    wanted[10:20, 10:14] = True
    for number, mask in enumerate(masks):
        # It moves in frame 1, and what it uncovers counts for 8 frames.
        np.testing.assert_array_equal(mask, wanted if 1 <= number < 1 + steadiness.UNCOVERED else np.zeros(SIZE, bool))
    with pytest.raises(ValueError, match="no motion of three components"):
        steadiness.uncovered([gbuffers[0], GBuffer(camera=camera, depth=gbuffers[0].depth)])


@pytest.mark.parametrize("name", SHOTS)
def test_a_shot_moves_what_it_says(runtime: Runtime, name: str) -> None:
    shots = list(SHOTS[name](SIZE, 6))
    assert len(shots) == 6
    scenes, cameras = ({id(getattr(shot, part)) for shot in shots} for part in ("scene", "camera"))
    places = {tuple(shot.camera.position) for shot in shots}
    assert len(scenes) == (6 if name in ("turning object", "door that opens", "foliage in wind") else 1)
    assert len(places) == {"path through the hall": 6, "hard cut": 2}.get(name, 1)
    assert cameras
    lights = [len(shot.lights) for shot in shots]
    wanted = {"light switched off": [2, 2, 2, 1, 1, 1], "door that opens": [2] * 6, "foliage in wind": [1] * 6}
    assert lights == wanted.get(name, [0] * 6)
    assert {shot.bounce for shot in shots} == {name == "light switched off"}
    assert [shot.switched for shot in shots] == [name == "light switched off" and n == 3 for n in range(6)]


@pytest.mark.parametrize(("name", "share"), [("door that opens", 0.05), ("foliage in wind", 0.5)])
def test_parts_of_a_scene_move_and_the_rest_stands(name: str, share: float) -> None:
    first, second, *_ = (np.asarray(shot.scene.positions) for shot in SHOTS[name](SIZE, 6))
    went = np.linalg.norm(second - first, axis=-1)
    assert 0.0 < went.max() < 0.1  # scene units a frame
    assert (went > 0.0).mean() > share
    assert (went == 0.0).any()


def test_foliage_comes_back_after_a_swing() -> None:
    first, *_, last = (np.asarray(shot.scene.positions) for shot in SHOTS["foliage in wind"](SIZE, 25))
    np.testing.assert_allclose(last, first, atol=1e-5)


def test_a_walk_goes_ahead_through_any_scene(runtime: Runtime) -> None:
    shots = list(shots_of("cornell_box", SIZE, 3, runtime))
    room = make_scene("cornell_box")
    way = [np.linalg.norm(shot.camera.position - room.eye) for shot in shots]
    # .6 % of the way to the target a frame
    reach = float(np.linalg.norm(np.subtract(room.target, room.eye)))
    np.testing.assert_allclose(way, [0.0, 0.006 * reach, 0.012 * reach], atol=1e-9)


def test_model_one_frame_old_is_exact_where_nothing_moves_and_not_on_a_path(runtime: Runtime) -> None:
    still = measured(film(SHOTS["still camera"](SIZE, 10), 0, runtime))
    # Means of the same 64 patterns of the same view.
    assert still["model, one frame old"]["model"] < 1e-6
    path = measured(film(SHOTS["path through the hall"](SIZE, 10), 0, runtime))
    assert path["model, one frame old"]["model"] > 0.01


def test_history_errs_less_than_one_frame_and_a_cut_leaves_no_trail(runtime: Runtime) -> None:
    found = measured(film(SHOTS["path through the hall"](SIZE, 14), 0, runtime))
    one, history = found["1 slice"], found["1 slice, history"]
    assert history["model"] < 0.8 * one["model"]
    assert history["noise"] < 0.8 * one["noise"]
    assert 0.0 < history["flip"] < 0.9 * one["flip"]
    cut = film(SHOTS["hard cut"](SIZE, 10), 0, runtime)
    mask = [np.isfinite(np.asarray(cut.gbuffers[5].depth))]
    alone, after = (
        steadiness.rmse([cut.images[name][5]], [cut.model[5]], mask) for name in ("1 slice", "1 slice, history")
    )
    # The frame of the cut itself: pixels that show what the other view showed may have a history, no other.
    assert after < 1.02 * alone


def test_still_camera_converges_to_the_model(runtime: Runtime) -> None:
    made = film(SHOTS["still camera"](SIZE, 32), 0, runtime)
    mask = [np.isfinite(np.asarray(made.gbuffers[0].depth))]
    one, four, last = (
        steadiness.rmse([made.images[name][n]], [made.model[n]], mask)
        for name, n in (("1 slice", 31), ("1 slice, history", 3), ("1 slice, history", 31))
    )
    # Independent frames would give 1 / sqrt(32) = .18; a sequence that is spread evenly, and moved in few pixels, less.
    assert last < 0.15 * one
    assert last < 0.6 * four


def test_light_that_switches_off_is_followed_at_once(runtime: Runtime) -> None:
    made = film(SHOTS["light switched off"](SIZE, 12), 0, runtime)
    found = measured(made)
    assert made.switched == 6
    assert 0 <= found["64 samples, history"]["lag"] <= 4
    slow = measured(film(SHOTS["light switched off"](SIZE, 12), 0, runtime, clamp="none"))
    assert slow["64 samples, history"]["lag"] == -1


def test_the_table_has_a_row_for_each_method() -> None:
    text = told(
        {"path": {"1 slice": {"model": 0.25, "flip": 0.125, "noise": 0.5}, "history": {"model": 0.1, "lag": -1.0}}}
    )
    rows = text.splitlines()
    assert len(rows) == 4
    assert rows[2] == "| path | 1 slice | - | 0.2500 | 0.1250 | 0.5000 | - | - |"
    assert rows[3].endswith("| - | - | never |")


def test_methods_take_turns(runtime: Runtime) -> None:
    order: list[str] = []
    found = alternated({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, 2, runtime)
    assert order == ["a", "b"] * 3
    assert found == {"a": 0.0, "b": 0.0}  # nothing ran on the device


@pytest.mark.slow
def test_the_command_prints_the_table() -> None:
    given = ["--size", "40", "30", "--frames", "10", "--rays", "8", "--repeats", "1"]
    done = CliRunner().invoke(main, [*given, "--whole", "cornell_box", "--samples", "2"])
    assert done.exit_code == 0, done.output
    assert done.output.count("history") == 2 * len(SHOTS) + 2
    assert "never" not in done.output
    assert "| cornell_box | one frame |" in done.output
