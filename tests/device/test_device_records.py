"""Records of devices: for a configuration, and failures for a time."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.device.drivers import records
from ssgi_cl.device.drivers.info import DeviceInfo, Found
from ssgi_cl.device.drivers.records import load, machine_description, record_file, save

RUNS = DeviceInfo("x.icd", 0, 0, "Test 1", "cpu", 2, {"1 lane, buffer": 1.0})
FAILS = DeviceInfo("x.icd", 0, 0, "Test 1", "cpu", 2, {"1 lane, buffer": "it dies"})


@pytest.fixture
def driver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A driver's file; records lie beside it."""
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "x.icd"
    path.write_text("libx.so")
    return path


@pytest.mark.parametrize(
    ("found", "limited"),
    [
        (Found([RUNS]), False),
        (Found([FAILS]), True),
        (Found([RUNS, FAILS]), True),
        (Found([], reason="no device"), True),
    ],
)
def test_a_record_with_a_failure_holds_for_a_day(
    driver: Path, monkeypatch: pytest.MonkeyPatch, found: Found, limited: bool
) -> None:
    save(driver, found)
    assert load(driver) == found
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 23 * 3600)
    assert load(driver) == found
    monkeypatch.setattr(time, "time", lambda: now + 25 * 3600)
    assert load(driver) == (None if limited else found)
    monkeypatch.setattr(time, "time", lambda: now - 3600)  # the clock was wrong
    assert load(driver) == (None if limited else found)


@pytest.mark.parametrize("damage", ["", "{", "[1]", "{}", '{"devices": [{"driver": 1}]}'])
def test_a_damaged_record_is_none(driver: Path, damage: str) -> None:
    save(driver, Found([RUNS]))
    record_file(driver).write_text(damage)
    assert load(driver) is None
    assert not records.unconfirmed(driver)
    records.confirm(driver)
    assert record_file(driver).read_text() == damage


@pytest.mark.parametrize("name", ["POCL_DEVICES", "CUDA_VISIBLE_DEVICES", "ROCR_VISIBLE_DEVICES", "RUSTICL_ENABLE"])
def test_variables_that_choose_devices_have_records_of_their_own(
    driver: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.delenv(name, raising=False)
    save(driver, Found([RUNS]))
    for other in ("POCL_EXTRA_BUILD_FLAGS", "POCL_CACHE_DIR", "EDITOR"):
        monkeypatch.setenv(other, "x")
    assert load(driver) is not None
    monkeypatch.setenv(name, "0")
    assert load(driver) is None


def test_other_machines_and_other_drivers_have_records_of_their_own(
    driver: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(driver, Found([RUNS]))
    with monkeypatch.context() as patch:
        patch.setattr(records, "machine_description", lambda: ["another processor"])
        assert load(driver) is None
    assert load(driver) is not None
    driver.write_text("libother.so")
    assert load(driver) is None


def machine(root: Path, **cards: str) -> Path:
    (root / "proc").mkdir(parents=True)
    (root / "proc" / "cpuinfo").write_text("model name\t: A\nflags\t\t: avx\n\nmodel name\t: A\n")
    for place, name in cards.items():
        card = root / "sys" / "bus" / "pci" / "devices" / place
        card.mkdir(parents=True)
        (card / "class").write_text("0x020000\n" if name == "network" else "0x030200\n")
        (card / "vendor").write_text("0x10de\n")
        (card / "device").write_text(f"{name}\n")
    return root


def test_facts_of_a_machine_are_its_processor_and_its_cards(tmp_path: Path) -> None:
    one = machine_description(machine(tmp_path / "1", a="0x1111", b="0x2222", c="network"))
    assert any("model name" in fact for fact in one)
    assert "a 0x10de 0x1111" in one
    assert not any("network" in fact for fact in one)
    swapped = machine_description(machine(tmp_path / "2", a="0x2222", b="0x1111"))
    assert swapped != one
    again = machine_description(machine(tmp_path / "3", a="0x1111", b="0x2222", d="network"))
    assert again == one
    assert machine_description(tmp_path / "none")  # as where there is no /proc


def test_a_record_is_confirmed_by_its_first_uses(driver: Path) -> None:
    assert not records.unconfirmed(driver)  # there is none
    save(driver, Found([RUNS]))
    for _ in range(records.USES_TO_CONFIRM):
        assert records.unconfirmed(driver)
        records.confirm(driver)
    assert not records.unconfirmed(driver)
    assert load(driver) == Found([RUNS])
    records.forget(driver)
    assert load(driver) is None
    records.forget(driver)  # gone already


def test_what_cannot_be_written_is_not_recorded(driver: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", "/proc/nowhere")
    save(driver, Found([RUNS]))
    assert load(driver) is None


def test_a_record_is_json_that_people_can_read(driver: Path) -> None:
    save(driver, Found([FAILS]))
    record: dict[str, Any] = json.loads(record_file(driver).read_text())
    assert record["devices"][0]["speeds"] == {"1 lane, buffer": "it dies"}
