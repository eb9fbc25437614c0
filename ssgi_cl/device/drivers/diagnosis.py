"""Why graphics processors and drivers do not work, and how to mend it: what the system says without OpenCL."""

from __future__ import annotations

import grp
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ssgi_cl.device.drivers.info import DeviceInfo


@dataclass(frozen=True)
class Maker:
    """A maker of graphics processors.

    Attributes:
        name: as in labels of devices.
        words: in lower case, one of which is in the name of its drivers' .icd files or in labels of its devices.
        nodes: device nodes besides those of /dev/dri, which its driver opens.
        renders: whether its drivers open /dev/dri/renderD*.
        driver: how to get its OpenCL driver.
    """

    name: str
    words: tuple[str, ...]
    nodes: tuple[str, ...]
    renders: bool
    driver: str


MAKERS = {
    0x10DE: Maker(
        "NVIDIA",
        ("nvidia",),
        ("dev/nvidiactl", "dev/nvidia0"),
        False,
        "install NVIDIA's driver with its OpenCL part (Debian: nvidia-opencl-icd), or write libnvidia-opencl.so.1 to "
        "/etc/OpenCL/vendors/nvidia.icd; containers need --gpus all and NVIDIA_DRIVER_CAPABILITIES=compute,utility",
    ),
    0x1002: Maker(
        "AMD",
        ("amd", "rusticl"),
        ("dev/kfd",),
        True,
        "install ROCm's OpenCL runtime (rocm-opencl-runtime), or Mesa's (Debian: mesa-opencl-icd) with the variable "
        "RUSTICL_ENABLE=radeonsi",
    ),
    0x8086: Maker(
        "Intel", ("intel", "rusticl"), (), True, "install Intel's compute runtime (Debian: intel-opencl-icd)"
    ),
}
"""PCI vendor -> maker."""


@dataclass(frozen=True)
class Card:
    """A graphics processor or accelerator on the bus.

    Attributes:
        address: on the PCI bus.
        maker: who made it.
        module: the kernel's driver that it has; empty if none.
    """

    address: str
    maker: Maker
    module: str


@dataclass(frozen=True)
class Problem:
    """Something that does not work, and how to mend it."""

    what: str
    mend: str


def cards(root: Path = Path("/")) -> list[Card]:
    """Return the cards of known makers that the system lists.

    Args:
        root: of the file system, for tests.
    """
    found = []
    for path in sorted((root / "sys/bus/pci/devices").glob("*")):
        with suppress(OSError, ValueError):
            if not (path / "class").read_text().startswith(("0x03", "0x12")):  # display, accelerator
                continue
            maker = MAKERS.get(int((path / "vendor").read_text(), 16))
            if maker is not None:
                module = (path / "driver").resolve().name if (path / "driver").exists() else ""
                found.append(Card(path.name, maker, module))
    return found


def card_problems(devices: Sequence[DeviceInfo], drivers: Sequence[Path], root: Path = Path("/")) -> list[Problem]:
    """Return why cards are not among the devices: one problem for each maker, the first that is in the way.

    Args:
        devices: that were found.
        drivers: the .icd files.
        root: of the file system, for tests.
    """
    problems = []
    for maker in {card.maker.name: card.maker for card in cards(root)}.values():
        named = [info for info in devices if info.kind != "cpu" and _of(maker, info.label)]
        if not named:
            own = [card for card in cards(root) if card.maker == maker]
            problems.append(_problem(maker, own, drivers, root))
    return problems


def _problem(maker: Maker, own: Sequence[Card], drivers: Sequence[Path], root: Path) -> Problem:
    where = f"{maker.name}'s card at {', '.join(card.address for card in own)}"
    if not any(card.module for card in own):
        return Problem(f"{where} has no driver of the kernel", f"install the driver of the card: {maker.driver}")
    nodes = [root / node for node in maker.nodes]
    if maker.renders:
        rendering = sorted((root / "dev/dri").glob("renderD*"))
        nodes += rendering or [root / "dev/dri/renderD128"]
    for node in nodes:
        if not node.exists():
            return Problem(
                f"{where} has no device node {_shown(node, root)}",
                f"in a container pass it on (docker run --device {_shown(node, root)}, for NVIDIA --gpus all); "
                "else load the kernel's module of the card",
            )
        if not os.access(node, os.R_OK | os.W_OK):
            return Problem(
                f"no permission to read and write {_shown(node, root)}, which {where} needs",
                f"add the user to the group that has it and log in again: sudo usermod -aG {_group(node)} $USER",
            )
    if not any(_of(maker, f"{path.name} {_text(path)}") for path in drivers):
        return Problem(f"{where} has no OpenCL driver: no .icd file names one", maker.driver)
    return Problem(
        f"{where} has an OpenCL driver, which lists no such device",
        f"see what its driver says above; versions of the kernel's module ({own[0].module}) and of the OpenCL driver "
        "may differ, as after an update without a restart",
    )


def driver_problem(reason: str) -> Problem:
    """Return the problem of a driver that lists no device, from `drivers.problems`."""
    if "cannot open shared object file" in reason:
        mend = "install the package that has this library anew, or remove the .icd file"
    elif "lists no device" in reason:
        mend = "nothing, if no device of this driver is there; else see the problems of cards below"
    else:
        mend = "install the newest version of the driver"
    return Problem(reason, mend)


def failure_problem(info: DeviceInfo, variant: str, why: str) -> Problem:
    """Return the problem of a kernel variant that does not run."""
    what = f"{info.label}: {variant} does not run: {why.strip().splitlines()[0]}"
    if "has no images" in why or "image" in variant:
        return Problem(what, "nothing: variants on buffers do the same")
    return Problem(what, "install the newest version of the driver; `ssgi devices --refresh` tries again")


def _of(maker: Maker, text: str) -> bool:
    return any(word in text.lower() for word in maker.words)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""


def _shown(node: Path, root: Path) -> str:
    return f"/{node.relative_to(root)}"


def _group(node: Path) -> str:
    group = node.stat().st_gid
    try:
        return grp.getgrgid(group).gr_name
    except KeyError:
        return str(group)
