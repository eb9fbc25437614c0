"""Presets: what is recorded, and how it reaches the caller."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from ssgi_cl import exr, presets
from ssgi_cl.camera import Camera
from ssgi_cl.cli import main
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.rasterize.scenes import REPORTED, TUNED_ON
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques import TECHNIQUES
from ssgi_cl.techniques.ssao import SsaoParams, ssao


@pytest.fixture(scope="module")
def steps() -> GBuffer:
    """A flight of steps: depth that falls by half a unit every eight columns."""
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=48, height=40)
    columns = np.arange(48) // 8
    return GBuffer(camera=camera, depth=np.tile(5.0 - 0.5 * columns, (40, 1)).astype(np.float32))


def test_every_preset_is_a_valid_set_of_parameters() -> None:
    assert tuple(presets.record("ssao")["presets"]) == presets.NAMES
    for name in presets.NAMES:
        assert isinstance(SsaoParams.preset(name), SsaoParams)


def test_each_preset_is_slower_and_better_than_the_one_before() -> None:
    recorded = [presets.record("ssao")["presets"][name] for name in presets.NAMES]
    assert all(a["ms"] < b["ms"] for a, b in pairwise(recorded))
    assert all(a["error"] > b["error"] for a, b in pairwise(recorded))


def test_presets_keep_the_time_they_were_given() -> None:
    for preset in presets.record("ssao")["presets"].values():
        # Both are rounded to 4 digits.
        assert preset["ms"] <= preset["budget_ms"] * 1.001


def test_preset_with_the_time_of_the_defaults_has_less_error() -> None:
    recorded = presets.record("ssao")
    # Its budget is just that time. Tuning on the scenes it is measured on must gain something.
    assert recorded["presets"]["medium"]["error"] < 0.95 * recorded["default"]["error"]


def test_record_says_what_the_presets_were_tuned_on() -> None:
    recorded = presets.record("ssao")
    names = [scene["name"] for scene in recorded["scenes"]]
    assert sorted(names) == sorted(TUNED_ON)
    assert not set(names) & set(REPORTED)
    assert sum(len(scene["views"]) for scene in recorded["scenes"]) >= 4
    assert all(len(scene["digest"]) == 32 and scene["radius"] > 0 for scene in recorded["scenes"])
    assert recorded["truth"]["rays"] >= 256
    for key in ("device", "form", "date", "version", "metric", "recorded by"):
        assert recorded[key]


def test_recorded_parameters_are_those_worth_tuning() -> None:
    for preset in presets.record("ssao")["presets"].values():
        assert set(preset["parameters"]) == set(TECHNIQUES["ssao"].tunable)


def test_overrides_win_over_the_preset() -> None:
    params = SsaoParams.preset("high", radius=0.7, samples=9)
    assert params.radius == (0.7,)
    assert params.samples == 9
    assert params.contrast == SsaoParams.preset("high").contrast


def test_unknown_preset_is_refused_with_the_names_that_exist() -> None:
    with pytest.raises(ValueError, match=r"preset is 'best': .*'low', 'medium', 'high', 'ultra'"):
        SsaoParams.preset("best")


def test_technique_without_presets_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'tonemap' has no presets: expected one of ssao"):
        presets.parameters("tonemap", "low")


def test_ssao_takes_what_is_not_given_from_the_preset(runtime: Runtime, steps: GBuffer) -> None:
    a = ssao(steps, 0.6, preset="low", runtime=runtime)
    params = SsaoParams.preset("low")
    values = {name: getattr(params, name) for name in TECHNIQUES["ssao"].tunable}
    np.testing.assert_array_equal(a, ssao(steps, 0.6, runtime=runtime, **values))
    assert (a != ssao(steps, 0.6, runtime=runtime)).any()


def test_what_is_given_to_ssao_wins_over_the_preset(runtime: Runtime, steps: GBuffer) -> None:
    a = ssao(steps, 0.6, 5, preset="high", blur_radius=0, runtime=runtime)
    params = SsaoParams.preset("high", samples=5, blur_radius=0)
    values = {name: getattr(params, name) for name in TECHNIQUES["ssao"].tunable}
    np.testing.assert_array_equal(a, ssao(steps, 0.6, runtime=runtime, **values))


def test_ssao_without_a_preset_takes_16_samples(runtime: Runtime, steps: GBuffer) -> None:
    np.testing.assert_array_equal(
        ssao(steps, 0.6, runtime=runtime), ssao(steps, 0.6, 16, runtime=runtime)
    )


def test_open_plane_stays_open_with_every_preset(runtime: Runtime) -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=48, height=40)
    plane = GBuffer(camera=camera, depth=np.full((40, 48), 5.0, np.float32))
    for name in presets.NAMES:
        # A plane occludes nothing; what is left is the rounding of blur and upsampling.
        np.testing.assert_allclose(
            ssao(plane, 0.6, preset=name, runtime=runtime), 1.0, rtol=0, atol=1e-6
        )


def test_command_line_takes_a_preset_and_what_is_set_wins(
    runtime: Runtime, steps: GBuffer, tmp_path: Path
) -> None:
    source, output = tmp_path / "in.exr", tmp_path / "out.exr"
    exr.write(source, {"depth": np.asarray(steps.depth)})
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(50.0), width=48, height=40)
    expected = ssao(GBuffer(camera=camera, depth=steps.depth), 0.6, 5, preset="medium",
                    runtime=runtime)
    options = ("--preset", "medium", "--set", "radius=0.6", "--set", "samples=5")
    done = CliRunner().invoke(main, ["apply", "ssao", str(source), "-o", str(output), *options])
    assert done.exit_code == 0, done.output
    np.testing.assert_array_equal(exr.read(output)["ao"], expected)


def test_command_line_names_the_presets_that_exist(steps: GBuffer, tmp_path: Path) -> None:
    source = tmp_path / "in.exr"
    exr.write(source, {"depth": np.asarray(steps.depth)})
    words = ["apply", "ssao", str(source), "-o", str(tmp_path / "out.exr"), "--preset", "best"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 1
    assert "preset is 'best': expected one of 'low', 'medium', 'high', 'ultra'" in done.output
    assert not (tmp_path / "out.exr").exists()
