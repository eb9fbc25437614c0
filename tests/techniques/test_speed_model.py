"""Device speed models: measured, kept, and what they predict."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.ao.ssao import Ssao
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.presets import speed_model as pacing
from ssgi_cl.techniques.presets.speed_model import SpeedModel, measured, predicted_ms, rolling_ground, speed_model_of

from .test_presets import RECORDED

PACE = SpeedModel(call_ms=0.1, pixel_ns=20.0)
"""Of a device that is made up."""


def test_prediction_grows_with_pixels_and_with_the_pace(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = presets.record("ssao")
    call_ms, defaults_ms = recorded["pace"]["call_ms"], recorded["layers"][0]["default"]["ms"]
    monkeypatch.setattr(pacing, "speed_model_of", lambda runtime, technique: PACE)
    ms = 2.0
    ratio = (ms - call_ms) / (defaults_ms - call_ms)
    expected = 0.1 + ratio * 480_000 * 20e-6  # PACE: 0.1 ms a call, 20 ns a pixel
    assert predicted_ms(runtime, Ssao, ms, (600, 800)) == pytest.approx(expected)
    same = predicted_ms(runtime, Ssao, defaults_ms, (600, 800))
    assert same == pytest.approx(0.1 + 480_000 * 20e-6)  # as measured here with the defaults


def test_pace_is_measured_once_and_kept_in_the_cache(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    calls = []

    def once(*arguments: object) -> tuple[SpeedModel, bool]:
        calls.append(arguments)
        return PACE, True

    monkeypatch.setattr(pacing, "measured", once)
    assert speed_model_of(runtime, Ssao) == PACE
    assert speed_model_of(runtime, Ssao) == PACE
    assert len(calls) == 1
    (file,) = tmp_path.iterdir()
    assert json.loads(file.read_text()) == {"call_ms": 0.1, "pixel_ns": 20.0}
    # Another process finds the file.
    file.write_text('{"call_ms": 0.5, "pixel_ns": 2.0}')
    runtime._prepared.pop((SpeedModel, file))
    assert speed_model_of(runtime, Ssao) == SpeedModel(0.5, 2.0)
    # A damaged one is made anew.
    file.write_text("{")
    runtime._prepared.pop((SpeedModel, file))
    assert speed_model_of(runtime, Ssao) == PACE
    assert len(calls) == 2


def test_pace_is_found_where_no_file_can_be_written(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "file" / "below"))
    monkeypatch.setattr(pacing, "measured", lambda *arguments: (PACE, True))
    assert speed_model_of(runtime, Ssao) == PACE


def test_pace_of_a_busy_machine_is_kept_in_no_file(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    monkeypatch.setattr(pacing, "measured", lambda *arguments: (PACE, False))
    assert speed_model_of(runtime, Ssao) == PACE
    assert list(tmp_path.iterdir()) == []


def test_pace_is_made_of_a_small_and_a_large_picture_and_knows_a_busy_machine(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    for share, expected in ((0.9, True), (0.3, False)):
        # 1 ms and 100 ms at best, for 3072 and 480,000 pixels.
        times = iter([[1.0, 1.1], [100.0, 130.0]])
        monkeypatch.setattr(pacing, "_times_ms", lambda *arguments, times=times: next(times))
        spent = share * runtime.info.units * 0.230
        clock = iter([0.0, 0.0, 0.0, spent])
        monkeypatch.setattr(pacing.time, "process_time", lambda clock=clock: next(clock))
        speed, alone = measured(runtime, Ssao, {})
        # The clock of a GPU knows nothing of this process.
        assert alone == (expected or runtime.info.kind != "cpu")
        assert speed.pixel_ns == pytest.approx(99e6 / (480_000 - 3072))
        assert speed.call_ms + 1e-6 * speed.pixel_ns * 3072 == pytest.approx(1.0)


@pytest.mark.slow
def test_measured_pace_is_that_of_more_work_in_more_time(runtime: Runtime) -> None:
    # What else the machine does only slows both down, so the least of several turns is its own.
    few, many = (
        min(
            (measured(runtime, Ssao, {"samples": samples, "blur_radius": 0})[0] for _ in range(3)),
            key=lambda speed: speed.pixel_ns,
        )
        for samples in (4, 64)
    )
    assert 0.0 <= few.call_ms < 50.0
    # 16 times the samples; measured 12 times. Half of that leaves room for a busy machine.
    assert many.pixel_ns > 6.0 * few.pixel_ns > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("technique", RECORDED)
def test_predicted_time_is_near_the_measured_one(
    technique: str, runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = (384, 512)
    gbuffer = on_device(rolling_ground(size), runtime)
    curve, function = presets.curve(technique), TECHNIQUES[technique].function
    kind = TECHNIQUES[technique].technique
    settings = [curve[round(share * (len(curve) - 1))] for share in (0.3, 1.0)]
    parameters = presets.record(technique)["pace"]["parameters"]
    speeds: list[SpeedModel] = []
    least, quiet = [np.inf, np.inf], False
    monkeypatch.setattr(pacing, "speed_model_of", lambda *_: min(speeds, key=lambda speed: speed.pixel_ns))
    # What else the machine does only slows both down, so the least of several turns is its own.
    for _turn in range(4):
        speed, alone = measured(runtime, kind, parameters)
        speeds.append(speed)
        quiet |= alone
        for index, setting in enumerate(settings):
            for _ in range(6):
                with runtime.frame():
                    function(gbuffer, runtime=runtime, **setting.parameters)
                    least[index] = min(least[index], sum(entry.ms for entry in runtime.times()))
        predicted = [predicted_ms(runtime, kind, setting.ms, size) for setting in settings]
        # Recorded on scenes with sky and with other radii in pixels.
        near = [p / 1.5 < ms < p * 1.5 for p, ms in zip(predicted, least, strict=True)]
        if all(near):
            return
    if not quiet:
        pytest.skip("other work kept the device busy")
    raise AssertionError(f"predicted {predicted} ms, took {least} ms")
