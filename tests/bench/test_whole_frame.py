"""Whole frames as cases, ours and a path tracer's, held to all light."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.bench import suite
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.bench.cases.frame import MODES
from ssgi_cl.bench.drawn import STEPS, moving_cameras
from ssgi_cl.bench.errors import picture_flip
from ssgi_cl.bench.peers.frame_blur import FrameBlur
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.tuning.case import Case
from ssgi_cl.tuning.context import Context, TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed (extra 'truth')")

pytestmark = pytest.mark.usefixtures("own_store")

SIZE = (30, 40)
SPOT = "cornell_box-spot"


@pytest.fixture
def context(runtime: Runtime) -> Context:
    """The Cornell box by its spot light."""
    return Context(runtime, spot_lit(runtime), SIZE, TruthSettings(paths=8))


def spot_lit(runtime: Runtime) -> BuiltinScene:
    return views_of([SPOT], runtime)[SPOT]


def measured(runtime: Runtime, views: dict[str, BuiltinScene], *cases: str, paths: int = 64) -> suite.Measurements:
    """Return what the benchmark finds of "family.setting" on every view."""
    parsed = [Case(*case.split("."), view, SIZE) for view in views for case in cases]
    return suite.measure(parsed, views, runtime, truths=TruthSettings(paths=paths), runs=4)


@pytest.mark.slow
def test_frames_and_peers_are_cases_with_time_and_error(runtime: Runtime) -> None:
    own = ["frame.default", "frame.multires", "frame.direct", "frame-first.default"]
    found = measured(runtime, {SPOT: spot_lit(runtime)}, *own, "mitsuba-frame.1", "mitsuba-frame.16")
    flips = {r["name"].removesuffix(f".{SPOT}.40x30"): r["errors"]["world"]["flip"] for r in found.results}
    assert all(result["wall_ms"]["median"] > 0.0 for result in found.results)
    assert {result["quantity"] for result in found.results} == {"radiance"}
    # All bounces are nearer than one, and one is than none.
    assert flips["frame.default"] < flips["frame.multires"] < flips["frame.direct"]
    assert flips["frame-first.default"] == flips["frame.default"]
    assert all(pictures.result.shape == (*SIZE, 3) for pictures in found.pictures.values())
    if FAMILIES["mitsuba-frame"].missing():
        assert {entry["name"].split(".")[0] for entry in found.skipped} == {"mitsuba-frame"}
    else:
        assert flips["mitsuba-frame.16"] < flips["mitsuba-frame.1"]


@pytest.mark.parametrize("family", ["frame", pytest.param("mitsuba-frame", marks=pytest.mark.slow)])
def test_the_camera_moves_unless_each_frame_is_a_first_one(family: str, context: Context) -> None:
    if FAMILIES[family].missing():
        pytest.skip(FAMILIES[family].missing())
    setting = "direct" if family == "frame" else "1"
    moving, first = (FAMILIES[name].prepare(context, setting) for name in (family, f"{family}-first"))
    assert moving.setup is None
    assert first.setup is not None
    one, other = (np.asarray(moving.run()) for _ in range(2))
    assert not np.array_equal(one, other)
    first.setup()
    assert np.asarray(first.run()).shape == (*SIZE, 3)


def test_the_blur_of_frames_keeps_textures_and_takes_noise_of_their_light(
    runtime: Runtime, rng: np.random.Generator
) -> None:
    view = views_of(["cornell_box"], runtime)["cornell_box"]  # which emits
    context = Context(runtime, view, (60, 80))
    seen = context.host_gbuffer
    albedo, emission = (np.asarray(array, np.float32) for array in (seen.albedo, seen.emission))
    there = np.isfinite(np.asarray(seen.depth))[..., None]
    sky = np.float32(9.0)
    blur = FrameBlur(runtime, context.size, view.scene, 1)
    even = np.where(there, np.float32(0.7) * albedo + emission, sky)
    # Roundings of a quotient, a mean and a product; a black surface keeps no more than it sends.
    np.testing.assert_allclose(blur.run(even, context.camera), even, rtol=1e-5, atol=1e-6)
    noise = rng.uniform(0.0, 2.0, albedo.shape).astype(np.float32)
    found = blur.run(np.where(there, noise * albedo + emission, sky), context.camera)
    matt = there & (emission == 0.0) & (albedo > 0.05)
    left = (found / np.maximum(albedo, 1e-3))[matt]
    # Deviation .58 of the light; of a hundred pixels and more that are averaged .06, at edges of fewer.
    assert left.std() < 0.15
    assert left.mean() == pytest.approx(1.0, abs=0.02)
    np.testing.assert_array_equal(found[~there[..., 0]], sky)


def test_peers_of_frames_are_paths_alone_blurred_and_denoised() -> None:
    names = {name for name in FAMILIES if name.startswith("mitsuba-frame")}
    endings = {"", "-blur", "-oidn", "-oidn-high"}
    assert names == {f"mitsuba-frame{ending}{first}" for ending in endings for first in ("", "-first")}
    assert all(tuple(FAMILIES[name].SETTINGS) == ("1", "2", "4", "8") for name in names)


@pytest.mark.slow
@pytest.mark.parametrize("then", ["blur", "oidn", "oidn-high"])
def test_frames_of_peers_that_are_smoothed_err_less(then: str, runtime: Runtime) -> None:
    family = FAMILIES[f"mitsuba-frame-{then}"]
    if family.missing():
        pytest.skip(family.missing())
    context = Context(runtime, spot_lit(runtime), (225, 300), TruthSettings(paths=64))
    truth = context.radiance().mean
    plain, smoothed = (FAMILIES[name].prepare(context, "1") for name in ("mitsuba-frame", f"mitsuba-frame-{then}"))
    assert plain.image is not None
    assert smoothed.image is not None
    errors = [picture_flip(subject.image(), truth) for subject in (plain, smoothed)]
    assert errors[1] < 0.7 * errors[0]
    one, other = (np.asarray(smoothed.run()) for _ in range(2))  # the camera moves
    assert one.shape == (225, 300, 3)
    assert not np.array_equal(one, other)


def test_a_first_frame_draws_what_a_later_one_has_kept(context: Context) -> None:
    first = FAMILIES["frame-first"].prepare(context, "direct")
    assert first.setup is not None

    def passes() -> list[str]:
        with context.runtime.frame():
            first.run()
        return [entry.name for entry in context.runtime.times() if not entry.skipped]

    first.setup()
    anew = passes()
    again = passes()
    first.setup()
    assert passes() == anew
    assert len(again) < len(anew)


def test_cameras_go_aside_in_equal_steps_and_start_again(context: Context) -> None:
    cameras = moving_cameras(context)
    places = np.array([next(cameras).position for _ in range(STEPS + 1)])
    steps = np.linalg.norm(np.diff(places[:STEPS], axis=0), axis=-1)
    way = np.linalg.norm(np.subtract(context.view.target, context.view.eye))
    np.testing.assert_allclose(steps, 1e-3 * way, rtol=1e-5)
    np.testing.assert_allclose(places[STEPS], places[0])
    assert np.linalg.norm(places[0] - context.camera.position) == pytest.approx(1e-3 * way, rel=1e-5)


def test_a_light_that_stands_in_for_emission_is_a_scene_of_its_own(runtime: Runtime) -> None:
    box, spot = views_of(["cornell_box", SPOT], runtime).values()
    assert box.own_lights == ()
    assert len(spot.own_lights) == 1
    assert not any(any(m.emission) for m in spot.scene.materials)
    with pytest.raises(ValueError, match="'parlour-spot': the lights of parlour stand in for no emission"):
        views_of(["parlour-spot"], runtime)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(BUILTIN_SCENES))
def test_every_scene_has_its_reference_and_frames(name: str, runtime: Runtime) -> None:
    found = measured(runtime, views_of([name], runtime), *(f"frame.{mode}" for mode in MODES), paths=16)
    assert [result["setting"] for result in found.results] == list(MODES)
    assert all(np.isfinite(result["errors"]["world"]["flip"]) for result in found.results)
    assert all(pictures.world is not None and pictures.world.max() > 0.0 for pictures in found.pictures.values())
