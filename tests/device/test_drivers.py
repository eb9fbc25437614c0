"""Drivers: which device is chosen, and what is said where none runs."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from ssgi_cl.cli import command
from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import drivers, opencl
from ssgi_cl.device.drivers import probing, records
from ssgi_cl.device.drivers.info import KERNEL_VARIANTS, DeviceInfo, Found
from ssgi_cl.device.runtime import Runtime

FORM = "16 lanes, buffer"
WHY = "it does not compile:\nerror: unknown target CPU 'generic'"


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A single driver file and an empty cache folder; what was found before is forgotten."""
    driver = tmp_path / "test.icd"
    driver.write_text("libnone.so")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(driver))
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(drivers, "_fleeting", {})
    monkeypatch.setattr(drivers, "devices", drivers.devices.__wrapped__)
    return driver


def info(driver: Path | str = "", speed: float | str = 5.0, label: str = "Test 1: a") -> DeviceInfo:
    return DeviceInfo(str(driver), 0, 0, label, "cpu", 1, {FORM: speed})


def finds(monkeypatch: pytest.MonkeyPatch, *found: Found) -> list[Path]:
    """Let probes find this, the last one for ever; return the list of what was probed."""
    probed: list[Path] = []

    def run(driver: Path) -> Found:
        probed.append(driver)
        return found[min(len(probed), len(found)) - 1]

    monkeypatch.setattr(probing, "probe", run)
    return probed


def test_what_was_found_is_recorded(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    probed = finds(monkeypatch, Found([info(alone)]))
    assert drivers.choose(None) == info(alone)
    drivers._fleeting.clear()  # another process
    assert drivers.choose(None) == info(alone)
    assert probed == [alone]


def test_failures_in_doubt_are_tried_again_by_the_next_process(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A memory limit or a full disk at the first use was "the driver crashes" for ever."""
    probed = finds(monkeypatch, Found([info(alone, WHY)], lasting=False), Found([info(alone)]))
    monkeypatch.setattr(probing, "doubtful", lambda: "memory is limited to 9 MiB by `ulimit -v`")
    with pytest.raises(DeviceError, match=r"is not recorded.*next process: memory is limited"):
        drivers.choose(None)
    with pytest.raises(DeviceError):  # not thrice in one process
        drivers.choose(None)
    assert len(probed) == 1
    drivers._fleeting.clear()
    assert drivers.choose(None) == info(alone)


def test_a_recorded_failure_names_its_file_and_how_to_try_again(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    probed = finds(monkeypatch, Found([info(alone, WHY)]), Found([info(alone)]))
    with pytest.raises(DeviceError, match="test: no kernel runs on it") as caught:
        drivers.choose("test")
    message = str(caught.value)
    (record,) = drivers.cache_folder().glob("*.json")
    install = ("pip install 'ssgi-cl[pocl]'", "pip install 'ssgi-cl[intel]'", "pocl-opencl-icd")
    for words in ("Test 1: a", FORM, WHY, str(record), "for 24 hours", "ssgi devices --refresh", *install):
        assert words in message
    result = CliRunner().invoke(command.main, ["devices"])
    assert result.exit_code == 0
    shown = " ".join(result.output.split())
    advice = ("ssgi devices --refresh", "No kernel runs on any of these. Install a driver")
    for words in ("error: unknown target CPU 'generic'", str(record), *advice):
        assert words in shown
    assert len(probed) == 1
    result = CliRunner().invoke(command.main, ["devices", "--refresh"])
    assert len(probed) == 2
    assert "used by default" in result.output
    assert "refresh" not in result.output


def test_why_a_driver_lists_nothing_is_said(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    probed = finds(monkeypatch, Found([], reason=f"{alone}: libnone.so: not found"))
    for _ in range(2):
        with pytest.raises(DeviceError, match=r"any device: no such(.|\n)*none\n.*libnone.so: not"):
            drivers.choose(None)
        result = CliRunner().invoke(command.main, ["devices"])
        assert result.exit_code == 1
        assert "pip install 'ssgi-cl[pocl]'" in result.output
        assert "libnone.so: not found" in result.output
        drivers._fleeting.clear()  # another process, which reads the record
    assert len(probed) == 1


def test_a_driver_without_a_device_is_listed_after_those_with_one(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = alone.with_name("other.icd")
    other.touch()
    monkeypatch.setattr(drivers, "driver_files", lambda: [alone, other])
    finds(monkeypatch, Found([], reason=f"{alone}: libnone.so: not found"), Found([info(other)]))
    result = CliRunner().invoke(command.main, ["devices"])
    assert result.exit_code == 0
    assert "used by default" in result.output
    assert "libnone.so: not found" in result.output


def test_looking_again_forgets_records(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finds(monkeypatch, Found([info(alone)]), Found([info(alone, 7.0)]))
    assert drivers.choose(None).speed == 5.0
    drivers.look_again()
    assert drivers.choose(None).speed == 7.0


def test_a_process_keeps_its_driver_when_another_turns_out_faster(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = alone.with_name("other.icd")
    monkeypatch.setattr(drivers, "devices", lambda: (info(alone, 5.0), info(other, 7.0), info(alone, 6.0, "Test 2: b")))
    assert drivers.choose(None) == info(other, 7.0)
    assert drivers.choose(None, str(alone)).speed == 6.0
    assert drivers.choose_variant(None, None, None, str(alone))[0].speed == 6.0
    # One that is asked for by name is that one, and the caller is told of the clash.
    monkeypatch.setattr(drivers, "devices", lambda: (info(alone, 5.0), info(other, 7.0, "Test 2: b")))
    assert drivers.choose("test 2", str(alone)) == info(other, 7.0, "Test 2: b")


# ---- records of another configuration


def listing(monkeypatch: pytest.MonkeyPatch, *labels: str) -> None:
    """Let the loaded driver list these devices now."""
    listed = [SimpleNamespace(label=label, driver_version="1") for label in labels]
    platform = SimpleNamespace(get_devices=lambda: listed)
    monkeypatch.setattr(
        opencl,
        "opencl",
        lambda: SimpleNamespace(get_platforms=lambda: [platform] if labels else [], Error=RuntimeError),
    )
    monkeypatch.setattr(
        opencl, "described", lambda platform, device: {"label": device.label, "kind": "cpu", "units": 1}
    )


def test_a_device_counts_only_as_what_the_driver_reports_now(monkeypatch: pytest.MonkeyPatch) -> None:
    listing(monkeypatch, "Test 1: a", "Test 1: b")
    assert opencl.listed_device(info("x.icd")).label == "Test 1: a"  # type: ignore[union-attr]
    assert opencl.listed_device(info("x.icd", label="Test 1: b")) is None  # cards were swapped
    listing(monkeypatch)  # none is visible
    assert opencl.listed_device(info("x.icd")) is None


def test_a_record_that_the_driver_contradicts_is_made_anew(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the driver in use: its devices as they are, and as a record of other ones says."""
    true = runtime.info
    for stale in (
        DeviceInfo(true.driver, true.platform, true.device + 7, true.label, true.kind, true.units, true.speeds),
        DeviceInfo(true.driver, true.platform, true.device, "Another", true.kind, true.units, true.speeds),
    ):
        known = [stale]
        monkeypatch.setattr("ssgi_cl.device.runtime._OPENED", {})
        monkeypatch.setattr(drivers, "choose", lambda name, loaded, known=known: known[-1])
        monkeypatch.setattr(drivers, "look_again", lambda driver, known=known: known.append(true))
        monkeypatch.setattr(drivers, "confirm", lambda info, variant, speed: None)
        assert Runtime.open().info == true
        assert len(known) == 2


def test_a_device_that_is_gone_is_an_error_that_says_how_to_look_again(runtime: Runtime) -> None:
    gone = DeviceInfo(runtime.info.driver, 9, 9, "Gone", "cpu", 1, {FORM: 1.0})
    with pytest.raises(DeviceError, match=r"Gone: the driver does not list.*--refresh"):
        Runtime(gone, KERNEL_VARIANTS[3])


# ---- speeds that use shows to be wrong


@pytest.mark.parametrize(("speed", "kept"), [(5.0, True), (3.4, True), (3.3, False), (2.5, False), (50.0, True)])
def test_a_speed_that_use_does_not_confirm_is_measured_again(alone: Path, speed: float, kept: bool) -> None:
    records.save(alone, Found([info(alone)]))
    drivers.confirm(info(alone), KERNEL_VARIANTS[3], lambda: speed)
    assert (records.load(alone) is not None) == kept


def test_a_speed_is_confirmed_a_few_times_only(alone: Path) -> None:
    records.save(alone, Found([info(alone)]))
    timed: list[int] = []
    for _ in range(5):
        drivers.confirm(info(alone), KERNEL_VARIANTS[3], lambda: timed.append(1) or 5.0)
    assert len(timed) == records.USES_TO_CONFIRM


# ---- choice


def test_the_fastest_device_that_has_every_word_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    found = (
        info(speed=5.0, label="PoCL 3.0: a"),
        info(speed=9.0, label="PoCL 3.1: b"),
        info(speed=99.0, label="Other 3: b"),
        info(speed="broken", label="PoCL 4: b"),
    )
    monkeypatch.setattr(drivers, "devices", lambda: found)
    assert drivers.choose(None) is found[2]
    assert drivers.choose("pocl") is found[1]
    assert drivers.choose("POCL a") is found[0]
    assert drivers.choose("pocl:3.0") is found[0]
    with pytest.raises(DeviceError, match="pocl 4: no kernel runs on it"):
        drivers.choose("pocl 4")


def test_a_folder_or_a_file_can_be_named_as_the_drivers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("b.icd", "a.icd", "notes.txt"):
        (tmp_path / name).touch()
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    assert [path.name for path in drivers.driver_files()] == ["a.icd", "b.icd"]
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path / "b.icd"))
    assert drivers.driver_files() == [tmp_path / "b.icd"]


def test_drivers_of_the_python_environment_are_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("OCL_ICD_VENDORS", raising=False)
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    before = drivers.driver_files()
    vendors = tmp_path / "etc" / "OpenCL" / "vendors"
    vendors.mkdir(parents=True)
    (vendors / "a.icd").write_text("liba.so\n")
    (vendors / "b.icd").write_text("/where/it/was/built/lib/libb.so\n")
    (vendors / "c.icd").write_text("/where/it/was/built/lib/libc.so\n")
    library = tmp_path / "lib" / "libb.so"
    library.parent.mkdir()
    library.touch()
    for _ in range(2):
        found = [path for path in drivers.driver_files() if path not in before]
        assert found[0] == vendors / "a.icd"
        assert [path.read_text() for path in found[1:]] == [f"{library}\n"]  # c has no library


@pytest.mark.slow
def test_a_busy_machine_gets_the_same_form() -> None:
    quiet = drivers.choose(None)
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        found = probing.probe(Path(quiet.driver)).devices
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    (busy,) = [one for one in found if one.label == quiet.label]
    assert busy.best == quiet.best
    # Time of the processor, not of the clock: caches and hyperthreads are all that is shared.
    assert 0.5 < busy.speed / quiet.speed < 2.0


def test_only_one_of_those_who_would_probe_a_driver_does(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    probed: list[Path] = []

    def slow(driver: Path) -> Found:
        probed.append(driver)
        time.sleep(0.3)
        return Found([info(driver)])

    monkeypatch.setattr(probing, "probe", slow)
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(drivers._looked_at, [alone] * 3))
    assert len(probed) == 1
    assert [len(each.devices) for each in found] == [1, 1, 1]
