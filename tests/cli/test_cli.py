"""The command line: devices, help, and what it says when it can't start or a name is no scene."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl import __main__ as program
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.device import drivers
from ssgi_cl.device.drivers import DeviceInfo
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.tuning.calibration import Calibration

from .commands import answer, fails, ssgi, succeeds

# ---- devices


def invented(**changes: Any) -> DeviceInfo:
    speeds = {"1 lane, image": 234.0, "1 lane, buffer": 856.0, "8 lanes, buffer": 3500.0, "16 lanes, buffer": 3400.0}
    entry = {
        "driver": "/some/driver.icd",
        "platform": 0,
        "device": 0,
        "kind": "cpu",
        "units": 2,
        "label": "A Platform 1.2: a processor with a long name",
        "speeds": speeds,
    }
    return DeviceInfo(**{**entry, **changes})


def test_devices_lists_what_there_is_and_the_speed_of_each_form(runtime: Runtime) -> None:
    listed = succeeds("devices").stdout
    assert runtime.info.label in listed.replace("\n", " ")
    assert listed.count("used by default") == 1
    ours = next(entry for entry in answer("devices") if entry["label"] == runtime.info.label)
    assert ours["variant"] in ours["million_reads_per_second"]
    assert ours["units"] >= 1


@pytest.mark.parametrize("columns", [60, 80])
def test_devices_fit_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    reason = "kernels/probe/probe_gather.cl does not compile on it: " + "why not " * 20
    broken = invented(label="Broken", speeds={variant: reason for variant in invented().speeds})
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(drivers, "devices", lambda: (invented(), broken))
    lines = succeeds("devices").stdout.splitlines()
    assert max(map(len, lines)) <= columns
    # A device, what it is, and a line for each form: no row is torn apart.
    assert lines[0] == "A Platform 1.2: a processor with a long name"
    assert lines[1].split() == ["cpu,", "2", "compute", "units,", "used", "by", "default"]
    assert [line.split()[-1] for line in lines[2:4]] == ["234", "856"]
    assert lines[5].split()[:5] == ["*", "16", "lanes,", "buffer", "3400"]
    assert lines[5].endswith("in use: widest within 15 %")
    assert any("no kernel variant runs on it" in line for line in lines)


def test_no_device_is_an_error_that_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(drivers, "devices", lambda: ())
    assert "pip install" in fails(tmp_path, "devices")
    assert answer("devices") == []


# ---- help


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ("render", "apply", "devices")),
        (("render",), ("Pixels", "degrees", "cene units", "W m^-2 sr^-1", "horizontal", "world space")),
        (("render",), ("Texels", "milliseconds", "cornell_box")),
        (("apply",), ("degrees", "scene units", "in pixels", "+z towards the viewer", "--set")),
        (("devices",), ("--json",)),
    ],
)
def test_help_names_units(arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    text = " ".join(succeeds(*arguments, "--help").stdout.split())
    for word in words:
        assert word in text
    assert ssgi(*arguments, "-h").stdout == ssgi(*arguments, "--help").stdout
    assert re.fullmatch(r"ssgi, version \d+\.\d+\S*\n", succeeds("--version").stdout)


# ---- errors


def test_deeply_nested_json_is_refused(corner: Path, tmp_path: Path) -> None:
    deep = tmp_path / "deep.json"
    deep.write_text('{"camera": ' * 100_000)
    assert "deep.json is not JSON" in fails(tmp_path, "render", corner, "--camera", deep, "-o", tmp_path / "a.png")
    assert "deep.json is not JSON" in fails(tmp_path, "bench", "--compare", deep, deep)
    assert "deep.json is not JSON" in fails(tmp_path, "bench", "gtao", "--scene", deep, "--list")


@pytest.mark.parametrize("name", [".", "nothing", "nothing.xyz"])
def test_a_name_that_is_no_scene_is_answered_with_those_that_are(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bench = ("bench", "gtao", "--scene", name, "--list")
    for arguments in (("render", name, "-o", "a.png"), bench):
        message = fails(tmp_path, *arguments)
        assert f"scene is '{name}'" in message
        assert "cornell_box, hall" in message
        assert "KIND-SEED" in message
    assert ("it is a folder" in fails(tmp_path, "render", name, "-o", "a.png")) == (name == ".")


def test_a_bench_that_measures_nothing_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = replace(FAMILIES["ssao"], missing=lambda: "it is not installed")
    monkeypatch.setattr(Calibration, "of", lambda _: Calibration(1.0, 1.0, 1.0))
    monkeypatch.setitem(FAMILIES, "ssao", absent)  # type: ignore[arg-type]
    result = ssgi("bench", "ssao.16.cornell_box", "--size", "64x48", "--seconds", 0.01)
    assert result.exit_code == 1
    assert "Error: nothing was measured: it is not installed" in result.stderr


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (KeyboardInterrupt(), "Aborted!"),
        (MemoryError(), "Error: ssgi can't start: out of memory (see ulimit -v)"),
        (
            ImportError("x.so: failed to map segment from shared object"),
            "Error: ssgi can't start: out of memory (see ulimit -v)",
        ),
        (ImportError("No module named 'rich'"), "Error: ssgi can't start: No module named 'rich'"),
    ],
)
def test_an_import_that_is_interrupted_ends_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: BaseException, line: str
) -> None:
    class Interrupted:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            if name == "ssgi_cl.cli.command":
                raise error

    monkeypatch.delitem(sys.modules, "ssgi_cl.cli.command")
    monkeypatch.setattr(sys, "meta_path", [Interrupted, *sys.meta_path])
    assert program.main() == 1
    assert capsys.readouterr().err == f"{line}\n"


@pytest.mark.slow
def test_a_process_that_is_interrupted_as_it_starts_says_so(tmp_path: Path) -> None:
    code = "import ssgi_cl.__main__ as c, sys; print(flush=True); sys.exit(c.main())"
    started = subprocess.Popen(
        [sys.executable, "-c", code, "render", "hall", "-o", str(tmp_path / "a.png")],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert started.stdout is not None
    started.stdout.readline()
    time.sleep(0.3)
    started.send_signal(signal.SIGINT)
    _, errors = started.communicate(timeout=60)
    assert started.returncode == 1
    assert errors.strip() == "Aborted!"
