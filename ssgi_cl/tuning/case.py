"""Cases of the benchmark, by name, and subjects: cases made ready to run."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import Size
from ssgi_cl.truth import Truth

if TYPE_CHECKING:
    from ssgi_cl.tuning.context import Context

_WORD = r"[A-Za-z0-9_-]+"
_NAME = re.compile(rf"({_WORD})\.({_WORD})\.({_WORD})\.([1-9]\d*)x([1-9]\d*)")


@dataclass(frozen=True, order=True)
class Case:
    """A technique with a setting, on a scene, at a size: `ssao.16.hall.800x600`.

    Attributes:
        family: key in `FAMILIES`.
        setting: what the family makes of it, such as a number of samples.
        scene: name of a built-in scene or of one given by its file.
        size: (rows, columns).
    """

    family: str
    setting: str
    scene: str
    size: Size

    @property
    def name(self) -> str:
        """family.setting.scene.COLUMNSxROWS."""
        return f"{self.family}.{self.setting}.{self.scene}.{self.size[1]}x{self.size[0]}"

    @classmethod
    def parse(cls, name: str) -> Self:
        """Return the case of a name.

        Raises:
            ValueError: not of the form family.setting.scene.COLUMNSxROWS.
        """
        match = _NAME.fullmatch(name)
        if match is None:
            raise ValueError(
                f"case is {name!r}: expected family.setting.scene.COLUMNSxROWS, such as ssao.16.hall.800x600"
            )
        family, setting, scene, columns, rows = match.groups()
        return cls(family, setting, scene, (int(rows), int(columns)))


@dataclass(frozen=True, kw_only=True)
class Subject:
    """A case made ready: everything is loaded and compiled, `run` does the work once.

    Attributes:
        run: one repetition, timed by the wall clock until the device has finished: everything that
            a caller pays for the result beyond the base G-buffer (one layer, no overscan), the
            copy of the result to the host included.
        image: the result of the latest run, [rows, columns] or [rows, columns, 3] float32; None
            for a pass without a result of its own.
        setup: what is done before each run and not timed, or None.
        on_device: whether the runtime's device does the work, so that its clock is read too.
        quantity: what the result is: "occlusion" (A in [0, 1]), "model" (the same, held to its own
            model alone), "bent" (angles to true bent normals, degrees), "direct" or "bounce"
            (irradiance by direct light or one bounce, W/m^2), "cut" and "mirrored" (bounces
            held to all of their lights alone), "radiance" (of whole frames, W m^-2 sr^-1, of all
            pixels), or empty where the world has no truth for it.
        samples: scattered reads or rays of a run, over all pixels that show something; 0 where
            that says nothing.
        moved: bytes that a run must read and write at least; 0 where that says nothing.
        truths: "world" and "assumption" -> what to call for that truth.
        counted: what the time includes beside the technique itself, in a few words.
        note: what else there is to say of the case or its time.
        timed: whether its time says anything; False for a bound that no program is.
    """

    run: Callable[[], object]
    image: Callable[[], NDArray[np.float32]] | None = None
    setup: Callable[[], object] | None = None
    on_device: bool = True
    quantity: str = ""
    samples: float = 0.0
    moved: float = 0.0
    truths: Mapping[str, Callable[[], Truth]] = field(default_factory=dict)
    counted: str = ""
    note: str = ""
    timed: bool = True

    @classmethod
    def of_image(cls, image: Callable[[], NDArray[np.float32]], **others: Any) -> Self:
        """Return a subject whose runs return the image."""
        return cls(run=image, image=image, **others)


@dataclass(frozen=True)
class Family:
    """One way to compute something, with many settings.

    Attributes:
        prepare: makes one setting ready, and raises ValueError if there is no such setting.
        SETTINGS: what is measured unless asked otherwise.
        missing: returns why it can't run here, in one line that says how to mend it; "" if it can.
    """

    prepare: Callable[[Context, str], Subject]
    SETTINGS: tuple[str, ...]
    missing: Callable[[], str] = lambda: ""


def count_of(setting: str, meaning: str, low: int, high: int) -> int:
    """Return a setting that is a whole number.

    Raises:
        ValueError: it is none in [low, high].
    """
    if not setting.isdecimal() or not low <= int(setting) <= high:
        raise ValueError(f"setting is {setting!r}: expected {meaning}, {low} to {high}")
    return int(setting)


def counts_of(setting: str, pattern: re.Pattern[str], expected: str) -> list[str]:
    """Return the groups of a setting that a pattern fits; "" for those that are left out.

    Raises:
        ValueError: it does not fit.
    """
    match = pattern.fullmatch(setting)
    if match is None:
        raise ValueError(f"setting is {setting!r}: expected {expected}")
    return [group or "" for group in match.groups()]
