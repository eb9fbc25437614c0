"""The scripts that kill parts of a farm and that run for long: what they would notice."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from ssgi_cl.bench.experiments import farm, long_run
from ssgi_cl.bench.experiments.farm_work import OUTPUTS, SECONDS, TRACE, Traced
from ssgi_cl.sequences.map_frames import map_frames


def test_what_is_lost_differs_or_is_begun_again_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inputs = farm._inputs(tmp_path, 5, 32)
    map_frames(Traced(), inputs, farm._outputs(tmp_path / "serial", inputs)).check()
    outputs = farm._outputs(tmp_path / "run", inputs)
    with farm._traced(tmp_path, "run", 0.0):
        assert not map_frames(Traced(), inputs, outputs).failed
    assert not {OUTPUTS, SECONDS, TRACE} & {*farm.os.environ}
    assert farm._checked(tmp_path, "run", inputs) == []
    assert {line.split()[2] for line in farm._lines(tmp_path / "run.txt")} == {"new"}
    with farm._traced(tmp_path, "run", 0.0):
        map_frames(Traced(), inputs[:1], outputs[:1], again=True)
    outputs[1].unlink()
    outputs[2].write_bytes(outputs[3].read_bytes())
    assert farm._checked(tmp_path, "run", inputs) == [
        "run: 0001.exr was done and was begun again",
        "run: 0002.exr is lost",
        "run: 0003.exr differs",
    ]


def test_a_long_run_tells_memory_and_handles() -> None:
    done = CliRunner().invoke(long_run.main, ["--frames", "12"])
    assert done.exit_code == 0, done.output
    assert re.search(r" 12 frames +\d+\.\d MiB +\d+ handles +\d+ threads", done.output)
    assert "12 frames: 12 skipped, the second time" in done.output
