"""Probes: what is believed of processes that die, hang or measure wrongly."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from ssgi_cl.device import drivers, probe
from ssgi_cl.device.drivers import probing
from ssgi_cl.device.drivers.info import KERNEL_VARIANTS, DeviceInfo
from ssgi_cl.device.drivers.probe_timer import speed_in_use
from ssgi_cl.device.drivers.probing import Answers, consensus
from ssgi_cl.device.runtime import Runtime

ENTRY = {"platform": 0, "device": 0, "label": "Test 1.0: chip", "kind": "cpu", "units": 2}
DRIVER = Path("/nowhere/test.icd")
NAMES = [str(variant) for variant in KERNEL_VARIANTS]
Rounds = Callable[..., list[list[str]]]


@pytest.fixture(autouse=True)
def no_damage(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is wrong with caches or memory."""
    monkeypatch.setattr(probing, "clear_damaged", list)
    monkeypatch.setattr(probing, "doubtful", lambda: "")


@pytest.fixture
def rounds(monkeypatch: pytest.MonkeyPatch) -> Rounds:
    """A function that sets what each form does in each process; it gives what was asked for."""

    def set_rounds(*speeds: Sequence[float | str]) -> list[list[str]]:
        asked: list[list[str]] = []

        def run(environment: dict[str, str], arguments: Sequence[str]) -> Answers:
            if not arguments:
                return Answers([ENTRY])
            variants = list(arguments[2:])
            asked.append(variants)
            does = dict(zip(NAMES, speeds[min(len(asked), len(speeds)) - 1], strict=True))
            said = []
            for variant in variants:
                if does[variant] == "dies":
                    return Answers(said, "was ended by SIGBUS")
                said.append({"variant": variant, "speed": does[variant]})
            return Answers(said)

        monkeypatch.setattr(probing, "run_probe", run)
        return asked

    return set_rounds


def probed() -> DeviceInfo:
    (info,) = probing.probe(DRIVER).devices
    return info


def test_a_form_that_kills_twice_is_reported_with_how(rounds: Rounds) -> None:
    asked = rounds([10.0, "dies", 80.0, "dies"])
    crash = "the driver crashes or hangs on it: it was ended by SIGBUS"
    assert probed().speeds == dict(zip(NAMES, [10.0, crash, 80.0, crash], strict=True))
    assert probed().best == KERNEL_VARIANTS[2]
    assert probed().driver == str(DRIVER)
    assert asked[0] == asked[1] == NAMES  # what may have been the machine is tried again


def test_a_form_that_kills_once_runs(rounds: Rounds) -> None:
    rounds([10.0, 20.0, 80.0, "dies"], [10.0, 20.0, 80.0, 90.0])
    assert probed().speeds == dict(zip(NAMES, [10.0, 20.0, 80.0, 90.0], strict=True))


def test_a_process_that_died_of_a_damaged_cache_does_not_count(rounds: Rounds, monkeypatch: pytest.MonkeyPatch) -> None:
    rounds(["dies"] * 4, [1.0, 2.0, 3.0, "dies"], [1.0, 2.0, 3.0, 4.0])
    cleared = []
    monkeypatch.setattr(probing, "clear_damaged", lambda: cleared.append(1) or [DRIVER])
    assert probed().failures == {}
    assert len(cleared) == 1


@pytest.mark.parametrize(("doubt", "processes"), [("", 8), ("memory is limited", 4)])
def test_whatever_dies_ends(rounds: Rounds, monkeypatch: pytest.MonkeyPatch, doubt: str, processes: int) -> None:
    monkeypatch.setattr(probing, "doubtful", lambda: doubt)
    asked = rounds(["dies"] * 4)
    found = probed()
    assert found.failures.keys() == set(NAMES)
    assert found.best is None
    assert len(asked) == processes  # where failures are in doubt one is enough: drivers that hang take long


TRUE = [100.0, 550.0, 1000.0, 1900.0]
DOUBLE = [100.0, 550.0, 2000.0, 1900.0]
"""8 lanes at twice the rate that they have, which would make them the fastest form."""


@pytest.mark.parametrize(
    "speeds", [[DOUBLE, TRUE, TRUE], [TRUE, DOUBLE, TRUE], [DOUBLE, [50.0, 550.0, 1000.0, 1900.0], TRUE, TRUE, TRUE]]
)
def test_an_outlier_is_outvoted(rounds: Rounds, speeds: list[list[float]]) -> None:
    rounds(*speeds)
    info = probed()
    assert info.speeds == dict(zip(NAMES, TRUE, strict=True))
    assert info.best == KERNEL_VARIANTS[3]


def test_two_processes_that_agree_are_enough(rounds: Rounds) -> None:
    asked = rounds(TRUE, [speed * 1.1 for speed in TRUE])
    assert probed().speed == pytest.approx(1900 * 1.05)
    assert len(asked) == 2
    asked = rounds(*([speed * factor for speed in TRUE] for factor in (1, 2, 4, 8, 16)))
    assert probed().speed == 4 * 1900.0  # the medians, if nothing agrees
    assert len(asked) == probing.MOST_ROUNDS


def test_consensus_takes_two_and_a_majority() -> None:
    assert consensus([{"a": 1.0}]) is None
    assert consensus([{"a": 1.0}, {"a": 2.0}]) is None
    assert consensus([{"a": 1.0}, {"a": 2.0}, {"a": 1.1}]) == {"a": 1.1}
    assert consensus([{"a": 1.0, "b": 3.0}, {"a": 1.0}]) is None  # b was found once


def test_failures_in_doubt_do_not_last(rounds: Rounds, monkeypatch: pytest.MonkeyPatch) -> None:
    rounds([1.0, 2.0, 3.0, "dies"])
    assert probing.probe(DRIVER).lasting
    monkeypatch.setattr(probing, "doubtful", lambda: "memory is limited")
    assert not probing.probe(DRIVER).lasting
    rounds([1.0, 2.0, 3.0, 4.0])
    assert probing.probe(DRIVER).lasting  # it runs all the same
    nothing = Answers([{"reason": "libx.so: not found"}])
    monkeypatch.setattr(probing, "run_probe", lambda *_: nothing)
    found = probing.probe(DRIVER)
    assert not found.lasting
    assert found.reason == (f"{DRIVER}: the driver lists no device; libx.so: not found; memory is limited")


def test_a_driver_that_dies_when_asked_for_devices_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probing, "run_probe", lambda *_: Answers([], "was ended by SIGABRT"))
    found = probing.probe(DRIVER)
    assert (found.devices, found.lasting) == ([], False)
    assert found.reason == f"{DRIVER}: the driver was ended by SIGABRT"


@pytest.mark.parametrize("limit", ["RLIMIT_AS", "RLIMIT_DATA", "RLIMIT_FSIZE"])
def test_limits_put_failures_in_doubt(monkeypatch: pytest.MonkeyPatch, limit: str) -> None:
    monkeypatch.undo()
    free = {name: resource.RLIM_INFINITY for name in ("RLIMIT_AS", "RLIMIT_DATA", "RLIMIT_FSIZE")}
    limits = {getattr(resource, name): value for name, value in {**free, limit: 1 << 30}.items()}
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (limits[kind], limits[kind]))
    monkeypatch.setattr(probing, "replaced_caches", dict)
    monkeypatch.setattr(probing, "_free_memory", lambda: 1 << 40)
    assert "limited" in probing.doubtful()
    limits[getattr(resource, limit)] = resource.RLIM_INFINITY
    assert probing.doubtful() == ""
    monkeypatch.setattr(probing, "replaced_caches", lambda: {"POCL_CACHE_DIR": "/tmp/x"})
    assert "disk is full" in probing.doubtful()
    monkeypatch.setattr(probing, "replaced_caches", dict)
    monkeypatch.setattr(probing, "_free_memory", lambda: 100 << 20)
    assert "100 MiB" in probing.doubtful()


def script(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    """Let a shell script stand for Python."""
    path = folder / "python"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(path))


def test_a_probe_that_hangs_keeps_its_answers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    script(tmp_path, monkeypatch, 'echo \'{"variant": "a", "speed": 1.0}\'\nexec sleep 60')
    monkeypatch.setattr(probing, "PROBE_SECONDS", 0.5)
    answers = probing.run_probe(dict(os.environ), ["0", "0", "a", "b"])
    assert answers.lines == [{"variant": "a", "speed": 1.0}]
    assert answers.ending == "hangs (for 1 s)"


def test_the_last_words_of_a_probe_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    script(tmp_path, monkeypatch, "echo '{cut'; echo 'LLVM ERROR: bad' >&2; kill -ABRT $$")
    answers = probing.run_probe(dict(os.environ), [])
    assert answers.lines == []
    assert answers.ending == "was ended by SIGABRT; it wrote: LLVM ERROR: bad"
    script(tmp_path, monkeypatch, "exit 3")
    assert probing.run_probe(dict(os.environ), []).ending == "ended with status 3"
    script(tmp_path, monkeypatch, "echo warning >&2")
    assert probing.run_probe(dict(os.environ), []).ending == ""


def test_a_form_is_timed_by_the_median_of_its_turns(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    turns = iter([1e-3, *[1e-3, 0.1e-3, 5e-3] * probe.REPEATS])  # a third at ten times the speed
    monkeypatch.setattr(probe, "timer", lambda runtime: lambda: next(turns))
    probe.time_variants(runtime.info.platform, runtime.info.device, [str(runtime.variant)])
    last = capsys.readouterr().out.splitlines()[-1]
    assert f'"speed": {300 * 400 * 16 / 1e-3 / 1e6}' in last


def test_a_library_that_does_not_load_is_named(tmp_path: Path) -> None:
    driver = tmp_path / "x.icd"
    driver.write_text("libnone.so.7\n")
    assert "libnone.so.7" in probe._why_not_loaded(driver)
    driver.write_text("libc.so.6\n")
    assert probe._why_not_loaded(driver) == ""


@pytest.mark.slow
def test_the_probe_answers_for_a_real_driver() -> None:
    info = drivers.choose(None)
    environment = {**os.environ, "OCL_ICD_VENDORS": info.driver}
    listed = probing.run_probe(environment, []).lines
    assert info.label in [entry["label"] for entry in listed]
    where = [str(info.platform), str(info.device)]
    first, last = probing.run_probe(environment, [*where, str(info.best)]).lines
    assert first["variant"] == last["variant"] == str(info.best)
    assert 0.3 < last["speed"] / info.speed < 3.0


def test_a_speed_in_use_is_that_of_the_record(runtime: Runtime) -> None:
    if runtime.info.kind != "cpu":
        pytest.skip("only speeds of processors are held to their record")
    speed = speed_in_use(Runtime(runtime.info, runtime.variant))
    recorded = runtime.info.speeds[str(runtime.variant)]
    assert isinstance(recorded, float)
    # Time of the processor, not of the clock: caches and hyperthreads are all that is shared.
    assert 0.4 < speed / recorded < 2.5


@pytest.mark.parametrize(("doubt", "seconds"), [("", 240), ("memory is limited", 60)])
def test_a_driver_has_less_time_where_limits_may_hang_it(
    monkeypatch: pytest.MonkeyPatch, doubt: str, seconds: int
) -> None:
    monkeypatch.setattr(probing, "doubtful", lambda: doubt)

    def run(command: list[str], **options: float) -> None:
        raise subprocess.TimeoutExpired(command, options["timeout"])

    monkeypatch.setattr(subprocess, "run", run)
    ending = probing.run_probe({}, ["0", "0", *NAMES]).ending
    assert ending == f"hangs (for {seconds} s)"


def test_the_widest_form_within_15_percent_of_the_fastest_is_best() -> None:
    for best, speeds in ((3, (10.0, 20.0, 100.0, 86.0)), (2, (10.0, 20.0, 100.0, 84.0)), (1, (10.0, 90.0, 50.0, 40.0))):
        info = DeviceInfo("", 0, 0, "", "cpu", 1, dict(zip(NAMES, speeds, strict=True)))
        assert info.best == KERNEL_VARIANTS[best]


@pytest.mark.parametrize(
    ("best", "speeds"),
    [
        (1, (100.0, 100.0, 190.0, 199.0)),
        (1, (100.0, 86.0, 100.0, 100.0)),
        (0, (100.0, 84.0, 180.0, 180.0)),
        (2, (100.0, 90.0, 201.0, 150.0)),
    ],
)
def test_a_gpu_gets_one_lane_unless_more_are_twice_as_fast(best: int, speeds: tuple[float, ...]) -> None:
    named = dict(zip(map(str, KERNEL_VARIANTS), speeds, strict=True))
    assert DeviceInfo("", 0, 0, "a card", "gpu", 1, named).best == KERNEL_VARIANTS[best]
    assert DeviceInfo("", 0, 0, "a processor", "cpu", 1, named).best in KERNEL_VARIANTS[2:]


def test_a_gpu_that_runs_wide_kernels_alone_gets_those() -> None:
    named: dict[str, float | str] = dict.fromkeys(map(str, KERNEL_VARIANTS), "crashes")
    named |= {str(KERNEL_VARIANTS[2]): 10.0}
    assert DeviceInfo("", 0, 0, "a card", "gpu", 1, named).best == KERNEL_VARIANTS[2]
