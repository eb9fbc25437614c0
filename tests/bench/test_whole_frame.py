"""Whole frames as cases, ours and a path tracer's, held to all light."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.bench import suite
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.bench.cases.frame import MODES
from ssgi_cl.bench.drawn import STEPS, moving_cameras
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
