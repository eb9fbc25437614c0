"""The processor that PoCL 3.0 generates code for, with records in memory as PoCL 3.0 has them."""

from __future__ import annotations

import ctypes
import os
import struct
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ssgi_cl.device import drivers
from ssgi_cl.device.drivers import pocl_cpu
from ssgi_cl.device.runtime import Runtime

AVX2 = frozenset(("avx", *pocl_cpu._AVX2))
AVX512 = AVX2 | set(pocl_cpu._AVX512)


class Record:
    """A device's record of PoCL 3.0: two pointers to strings amid zeros."""

    def __init__(self, name: bytes, triple: bytes = b"x86_64-unknown-linux-gnu") -> None:
        self.texts = [ctypes.create_string_buffer(text) for text in (triple, name)]
        self.memory = ctypes.create_string_buffer(1024)
        struct.pack_into("=QQ", self.memory, 0x278, *map(ctypes.addressof, self.texts))
        self.device = SimpleNamespace(driver_version="3.0-rc2", int_ptr=ctypes.addressof(self.memory))

    @property
    def name(self) -> bytes:
        (address,) = struct.unpack_from("=Q", self.memory, 0x280)
        return ctypes.string_at(address)


@pytest.fixture(autouse=True)
def flags(monkeypatch: pytest.MonkeyPatch) -> None:
    """A processor with AVX2, and no build flags."""
    monkeypatch.setattr(pocl_cpu, "processor_flags", lambda: AVX2)
    monkeypatch.setenv("POCL_EXTRA_BUILD_FLAGS", "")


@pytest.mark.parametrize(
    ("name", "flags", "expected"),
    [
        ("generic", AVX2, "haswell"),
        ("generic", AVX512, "skylake-avx512"),
        ("znver3", AVX512, "skylake-avx512"),  # a Zen 4, as LLVM 14 sees it
        ("icelake-server", AVX512, "icelake-server"),
        ("znver3", AVX2, "znver3"),
        ("knl", AVX2 | {"avx512f"}, "knl"),
        ("generic", AVX2 | {"avx512f"}, "sandybridge"),
        ("generic", frozenset({"avx"}), "sandybridge"),
        ("generic", frozenset({"sse2"}), "x86-64"),
        ("generic", frozenset(), "x86-64"),
    ],
)
def test_the_name_is_one_with_the_extensions_of_the_built_in_functions(
    name: str, flags: frozenset[str], expected: str
) -> None:
    assert pocl_cpu.suitable_name(name, flags) == expected


@pytest.mark.parametrize("given", ["", "-DMINE "])
def test_an_unknown_processor_gets_a_name_that_clang_knows(monkeypatch: pytest.MonkeyPatch, given: str) -> None:
    monkeypatch.setenv("POCL_EXTRA_BUILD_FLAGS", given)
    record = Record(b"generic")
    assert pocl_cpu.name_processor(record.device) == "haswell"
    assert record.name == b"haswell"
    # What PoCL cached of other code is not read; build flags of the user stay.
    assert os.environ["POCL_EXTRA_BUILD_FLAGS"] == f"{given}-DPOCL_TARGET_CPU_haswell"
    assert pocl_cpu.name_processor(record.device) is None
    assert os.environ["POCL_EXTRA_BUILD_FLAGS"] == f"{given}-DPOCL_TARGET_CPU_haswell"


UNEXPECTED: dict[str, Callable[[Record], Any]] = {
    "another version": lambda record: setattr(record.device, "driver_version", "3.1+debian"),
    "no pointers": lambda record: ctypes.memset(record.memory, 0, 1024),
    "wild pointers": lambda record: struct.pack_into("=QQ", record.memory, 0x278, 8, 1 << 63),
    "no memory": lambda record: setattr(record.device, "int_ptr", 4096),
    "known": lambda record: record.__init__(b"znver3"),  # type: ignore[misc]
    "other triple": lambda record: record.__init__(b"generic", b"aarch64-linux-gnu"),  # type: ignore[misc]
    "no name": lambda record: record.__init__(b"Not a name!"),  # type: ignore[misc]
}


@pytest.mark.parametrize("change", UNEXPECTED.values(), ids=UNEXPECTED)
def test_what_is_not_as_expected_is_left_alone(change: Callable[[Record], Any]) -> None:
    record = Record(b"generic")
    change(record)
    before = record.memory.raw
    assert pocl_cpu.name_processor(record.device) is None
    assert record.memory.raw == before


def test_extensions_come_from_cpuinfo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    (tmp_path / "cpuinfo").write_text("model name\t: x\nflags\t\t: fpu avx2 fma\n\nflags\t: no\n")
    assert pocl_cpu.processor_flags(tmp_path / "cpuinfo") == {"fpu", "avx2", "fma"}
    assert pocl_cpu.processor_flags(tmp_path / "none") == frozenset()


def test_pocl_3_0_runs_every_form_on_buffers() -> None:
    """Of the wheel on PyPI, if it is installed: on a Zen 4 it ran no more than 8 lanes."""
    ours = [info for info in drivers.devices() if info.label.startswith("PoCL 3.0")]
    if not ours:
        pytest.skip("PoCL 3.0 is not installed")
    for variant in drivers.KERNEL_VARIANTS[1:]:
        assert isinstance(ours[0].speeds[str(variant)], float), ours[0].speeds[str(variant)]


def test_the_device_under_test_is_as_its_record_says(runtime: Runtime) -> None:
    from ssgi_cl.device.opencl import described, listed_device

    device = listed_device(runtime.info)
    found = described(device.platform, device)  # type: ignore[union-attr]
    info = runtime.info
    assert found == {"label": info.label, "kind": info.kind, "units": info.units}
