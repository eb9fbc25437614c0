"""What stands between a card and its use, on systems that are made up."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ssgi_cl.device.drivers.diagnosis import card_problems, cards, driver_problem, failure_problem
from ssgi_cl.device.drivers.info import DeviceInfo

AMD, NVIDIA, INTEL, OTHER = "0x1002", "0x10de", "0x8086", "0x1a03"


def system(
    root: Path, vendor: str, *, module: str = "driver", nodes: tuple[str, ...] = (), kind: str = "0x030000"
) -> Path:
    card = root / "sys/bus/pci/devices/0000:01:00.0"
    card.mkdir(parents=True)
    (card / "class").write_text(kind)
    (card / "vendor").write_text(vendor)
    if module:
        (root / "sys/bus/pci/drivers" / module).mkdir(parents=True)
        (card / "driver").symlink_to(root / "sys/bus/pci/drivers" / module)
    for node in nodes:
        path = root / node
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    return root


def icd(folder: Path, name: str) -> Path:
    path = folder / name
    path.write_text("/usr/lib/libsomething.so.1\n")
    return path


RENDER = "dev/dri/renderD128"
NODES = {AMD: ("dev/kfd", RENDER), NVIDIA: ("dev/nvidiactl", "dev/nvidia0"), INTEL: (RENDER,)}


@pytest.mark.parametrize("vendor", NODES)
def test_each_thing_in_the_way_is_named_in_its_turn(tmp_path: Path, vendor: str) -> None:
    bare = system(tmp_path / "bare", vendor, module="")
    (problem,) = card_problems([], [], bare)
    assert "has no driver of the kernel" in problem.what
    assert "0000:01:00.0" in problem.what
    for missing in NODES[vendor]:
        root = system(tmp_path / Path(missing).name, vendor, nodes=tuple(n for n in NODES[vendor] if n != missing))
        (problem,) = card_problems([], [], root)
        assert f"no device node /{missing}" in problem.what
        assert f"--device /{missing}" in problem.mend
    root = system(tmp_path / "whole", vendor, nodes=NODES[vendor])
    (problem,) = card_problems([], [icd(tmp_path, "pocl.icd")], root)
    assert "no .icd file names one" in problem.what
    name = {AMD: "amdocl64.icd", NVIDIA: "nvidia.icd", INTEL: "intel.icd"}[vendor]
    (problem,) = card_problems([], [icd(tmp_path, name)], root)
    assert "which lists no such device" in problem.what
    label = {AMD: "AMD Accelerated Parallel Processing 1: gfx1030", NVIDIA: "NVIDIA CUDA 5: A", INTEL: "Intel 2: Arc"}
    assert card_problems([DeviceInfo("", 0, 0, label[vendor], "gpu", 8)], [], root) == []
    # A processor of the maker is not the card.
    assert card_problems([DeviceInfo("", 0, 0, label[vendor], "cpu", 8)], [], root) != []


def test_a_node_that_may_not_be_opened_names_the_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = system(tmp_path, INTEL, nodes=NODES[INTEL])
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # tests may run as root, whom nothing is forbidden
    (problem,) = card_problems([], [], root)
    assert problem.what.startswith(f"no permission to read and write /{RENDER}")
    assert "usermod -aG" in problem.mend


def test_other_cards_and_other_makers_are_no_problem(tmp_path: Path) -> None:
    assert cards(system(tmp_path / "network", INTEL, kind="0x020000")) == []
    assert cards(system(tmp_path / "other", OTHER)) == []
    assert cards(tmp_path / "nothing") == []


@pytest.mark.parametrize(
    ("reason", "mend"),
    [
        ("/x.icd: the driver lists no device; libx.so: cannot open shared object file", "remove the .icd file"),
        ("/x.icd: the driver lists no device", "nothing, if no device"),
        ("/x.icd: the driver was ended by SIGSEGV", "newest version"),
    ],
)
def test_drivers_that_do_not_load_get_the_way_to_mend_them(reason: str, mend: str) -> None:
    assert mend in driver_problem(reason).mend


def test_a_variant_that_does_not_run_is_a_problem_of_its_device() -> None:
    info = DeviceInfo("", 0, 0, "X 1: chip", "gpu", 8)
    old = failure_problem(info, "1 lane, buffer", "X 1: chip has OpenCL 1.1: expected 1.2 or later\nmore")
    assert old.what == "X 1: chip: 1 lane, buffer does not run: X 1: chip has OpenCL 1.1: expected 1.2 or later"
    assert "newest version" in old.mend
    assert "nothing" in failure_problem(info, "1 lane, image", "X has no images: use storage 'buffer'").mend
