"""Drivers: looked at in processes of their own, which may die."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl import drivers
from ssgi_cl.drivers import FORMS, DeviceInfo
from ssgi_cl.errors import DeviceError

ENTRY = {"platform": 0, "device": 0, "label": "Test 1.0: chip", "kind": "cpu", "units": 2}


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A single driver file and an empty cache folder; what was found before is forgotten."""
    driver = tmp_path / "test.icd"
    driver.write_text("libnone.so")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(driver))
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(drivers, "devices", lambda: tuple(drivers._devices_of(driver)))
    return driver


def answers(*speeds: float | str) -> Any:
    """A stand-in for the probe that answers so for each form asked for, then dies."""
    left = dict(zip([str(form) for form in FORMS], speeds, strict=True))

    def run(environment: dict[str, str], arguments: list[str]) -> list[dict[str, Any]]:
        if not arguments:
            return [ENTRY]
        said = []
        for form in arguments[2:]:
            if left[form] == "dies":
                break
            said.append({"form": form, "speed": left[form]})
        return said

    return run


def test_a_driver_that_crashes_is_reported_as_such(
    alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drivers, "_run_probe", answers(10.0, "dies", 80.0, "dies"))
    (info,) = drivers._devices_of(alone)
    crash = "the driver crashes or hangs on it"
    assert info.speeds == {
        "1 lane, image": 10.0, "1 lane, buffer": crash, "8 lanes, buffer": 80.0,
        "16 lanes, buffer": crash,
    }
    assert info.best == FORMS[2]
    assert info.driver == str(alone)


def test_a_driver_that_dies_at_everything_is_not_chosen(
    alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drivers, "_run_probe", answers(*["dies"] * 4))
    with pytest.raises(DeviceError, match=r"test: no kernel runs on it(.|\n)*Test 1.0: chip"):
        drivers.choose("test")


def test_without_a_driver_the_message_says_how_to_get_one(
    alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drivers, "_run_probe", lambda environment, arguments: [])
    with pytest.raises(DeviceError, match=r"any device: no such(.|\n)*none\n.*pip install"):
        drivers.choose(None)


def test_a_second_look_comes_from_the_cache(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers, "_run_probe", answers(1.0, 2.0, 3.0, "refused"))
    first = drivers._devices_of(alone)

    def fail(environment: dict[str, str], arguments: list[str]) -> list[dict[str, Any]]:
        raise AssertionError("probed again")

    monkeypatch.setattr(drivers, "_run_probe", fail)
    assert drivers._devices_of(alone) == first
    (record,) = drivers.cache_folder().iterdir()
    assert json.loads(record.read_text())[0]["speeds"]["16 lanes, buffer"] == "refused"


@pytest.mark.parametrize("damage", ["", "{", "[1]", '[{"driver": 1}]'])
def test_a_damaged_cache_is_made_anew(
    alone: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    monkeypatch.setattr(drivers, "_run_probe", answers(1.0, 2.0, 3.0, 4.0))
    first = drivers._devices_of(alone)
    (record,) = drivers.cache_folder().iterdir()
    record.write_text(damage)
    assert drivers._devices_of(alone) == first
    assert json.loads(record.read_text())


def test_a_changed_driver_is_looked_at_again(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = drivers._fingerprint(alone)
    alone.write_text("libother.so")
    assert drivers._fingerprint(alone) != before


def test_the_fastest_device_that_has_every_word_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    def info(label: str, speed: float | str) -> DeviceInfo:
        return DeviceInfo("", 0, 0, label, "cpu", 1, {"8 lanes, buffer": speed})

    found = (info("PoCL 3.0: a", 5.0), info("PoCL 3.1: b", 9.0), info("Other 3: b", 99.0),
             info("PoCL 4: b", "broken"))
    monkeypatch.setattr(drivers, "devices", lambda: found)
    assert drivers.choose(None) is found[2]
    assert drivers.choose("pocl") is found[1]
    assert drivers.choose("POCL a") is found[0]
    assert drivers.choose("pocl:3.0") is found[0]
    with pytest.raises(DeviceError, match="pocl 4: no kernel runs on it"):
        drivers.choose("pocl 4")


def test_the_probe_answers_for_a_real_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    info = drivers.choose(None)
    environment = {**os.environ, "OCL_ICD_VENDORS": info.driver}
    listed = drivers._run_probe(environment, [])
    assert info.label in [entry["label"] for entry in listed]
    where = [str(info.platform), str(info.device)]
    first, last = drivers._run_probe(environment, [*where, str(info.best)])
    assert first["form"] == last["form"] == str(info.best)
    assert last["speed"] >= first["speed"] > 0


@pytest.mark.slow
def test_a_busy_machine_gets_the_same_form() -> None:
    quiet = drivers.choose(None)
    loops = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(2 * (os.cpu_count() or 1))
    ]
    try:
        (busy,) = [
            info for info in drivers._probe(Path(quiet.driver)) if info.label == quiet.label
        ]
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    assert busy.best == quiet.best
    # Time of the processor, not of the clock: caches and hyperthreads are all that is shared.
    assert 0.5 < busy.speed / quiet.speed < 2.0


def test_a_probe_that_hangs_keeps_its_answers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script = tmp_path / "python"
    script.write_text('#!/bin/sh\necho \'{"form": "a", "speed": 1.0}\'\nexec sleep 60\n')
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script))
    monkeypatch.setattr(drivers, "PROBE_SECONDS", 0.5)
    assert drivers._run_probe(dict(os.environ), ["0", "0", "a", "b"]) == [
        {"form": "a", "speed": 1.0}
    ]


def test_a_driver_that_hangs_at_once_is_asked_again_by_the_next_process(
    alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def hang(environment: dict[str, str], arguments: list[str]) -> list[dict[str, Any]]:
        raise TimeoutError

    monkeypatch.setattr(drivers, "_run_probe", hang)
    assert drivers._devices_of(alone) == []
    monkeypatch.setattr(drivers, "_run_probe", answers(1.0, 2.0, 3.0, 4.0))
    assert len(drivers._devices_of(alone)) == 1


def test_a_folder_or_a_file_can_be_named_as_the_drivers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("b.icd", "a.icd", "notes.txt"):
        (tmp_path / name).touch()
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    assert [path.name for path in drivers.driver_files()] == ["a.icd", "b.icd"]
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path / "b.icd"))
    assert drivers.driver_files() == [tmp_path / "b.icd"]
