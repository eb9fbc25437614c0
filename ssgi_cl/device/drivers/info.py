"""Description of a device: its kernel variants and the speed of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class KernelVariant:
    """One build of the kernels.

    Attributes:
        lanes: pixels per work-item, 1, 8 or 16.
        storage: what kernels read, "buffer" or "image".
    """

    lanes: int
    storage: str

    def __post_init__(self) -> None:
        if (self.lanes, self.storage) not in ((1, "buffer"), (1, "image"), (8, "buffer"), (16, "buffer")):
            raise ValueError(
                f"the kernel variant is {self.lanes} lanes on {self.storage!r}: expected 1, 8 or "
                "16 lanes on 'buffer', or 1 lane on 'image'"
            )

    def __str__(self) -> str:
        return f"{self.lanes} lane{'s' if self.lanes > 1 else ''}, {self.storage}"


KERNEL_VARIANTS = (KernelVariant(1, "image"), *(KernelVariant(lanes, "buffer") for lanes in (1, 8, 16)))

GPU_WIDE_GAIN = 2.0
"""Of the probe: what more than one lane has to gain on a GPU. 8 lanes of gtao spill 558 vector registers on AMD's
gfx1030, 16 lanes 5442."""


@dataclass(frozen=True)
class DeviceInfo:
    """A device and how fast it runs each variant of the kernels.

    Attributes:
        driver: path of the driver's .icd file.
        platform, device: indices among what that driver lists when loaded alone.
        label: what names are matched against, such as "PoCL 3.1+debian: pthread-...".
        kind: "cpu", "gpu" or "accelerator".
        units: compute units.
        speeds: variant as text -> million reads per second if nothing else runs, or the reason why
            it does not run.
        facts: what reports say of it, see `requirements.facts`.
    """

    driver: str
    platform: int
    device: int
    label: str
    kind: str
    units: int
    speeds: dict[str, float | str] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)

    @property
    def best(self) -> KernelVariant | None:
        """The fastest variant, or None if none runs; the wider of two within 15 % of each other.

        Kernels compute more for each read than the probe does, which favours wide vectors. Not on GPUs, where a
        work-item is a lane already: wider kernels run out of registers, and get chosen only where the probe takes
        less than half as long with them.
        """
        speeds = {
            variant: speed for variant in KERNEL_VARIANTS if isinstance(speed := self.speeds.get(str(variant)), float)
        }
        narrow = {variant: speed for variant, speed in speeds.items() if variant.lanes == 1}
        if self.kind == "gpu" and narrow and max(speeds.values()) <= GPU_WIDE_GAIN * max(narrow.values()):
            speeds = narrow
        fastest = max(speeds.values(), default=0.0)
        close = [variant for variant, speed in speeds.items() if speed >= 0.85 * fastest]
        return max(close, key=lambda variant: (variant.lanes, variant.storage == "buffer"), default=None)

    @property
    def why(self) -> str:
        """Why `best` is the one in use; empty if none runs."""
        if self.best is None:
            return ""
        if self.speeds[str(self.best)] == self.speed:
            return "fastest"
        if self.kind == "gpu":
            return "fastest with one lane"
        return "widest within 15 %"

    @property
    def speed(self) -> float:
        """Million reads a second of the fastest variant; 0 if none runs."""
        numbers = (speed for speed in self.speeds.values() if isinstance(speed, float))
        return max(numbers, default=0.0)

    @property
    def failures(self) -> dict[str, str]:
        """Kernel variant as text -> why it does not run, for those that don't."""
        return {variant: why for variant, why in self.speeds.items() if isinstance(why, str)}


@dataclass(frozen=True)
class Found:
    """The devices that the probe of a driver found.

    Attributes:
        devices: what the driver lists; empty if it lists none or could not be asked.
        lasting: whether the next process would find the same, as far as can be told.
        reason: why there is no device; empty if there are some.
    """

    devices: list[DeviceInfo]
    lasting: bool = True
    reason: str = ""
