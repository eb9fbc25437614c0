"""Scenes made by code, so that everything can be tried without data.

A few are built in; as many as are wanted come from a generator, as KIND-SEED. Parameters are tuned
on some (`TUNED_ON`), checked on others (`VALIDATED_ON`), and errors are reported on a third set
(`REPORTED`, and meshes from files), so that no table reports the scenes of the fit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from .builtin import BuiltinScene
from .cornell_box import cornell_box
from .generated import KINDS, MOST_SEED, NAMED, generated, is_generated
from .hall import hall
from .parlour import parlour
from .terrace import terrace
from .workshop import workshop

BUILTIN_SCENES: dict[str, Callable[[], BuiltinScene]] = {
    "cornell_box": cornell_box,
    "hall": hall,
    "parlour": parlour,
    "terrace": terrace,
    "workshop": workshop,
}
"""Functions that make the built-in scenes, by name."""

SCENE_NAMES = (
    f"{', '.join(BUILTIN_SCENES)}, or KIND-SEED with KIND one of {', '.join(NAMED)} and SEED an "
    f"integer from 0 to {MOST_SEED}, such as room-7"
)
"""Names of scenes, for messages."""

REPORTED = ("cornell_box", "hall")
"""Scenes on which errors are reported; nothing is tuned on them or validated with them."""

TUNING_SEEDS, VALIDATION_SEEDS = (0, 1), (100, 101)
"""Of each kind: the scenes on which constants are tuned, and those that tell whether what was tuned
holds elsewhere; nothing is fitted to the latter."""

TUNED_ON = tuple(f"{kind}-{seed}" for kind in KINDS for seed in TUNING_SEEDS)
"""Scenes on which parameters are tuned."""

VALIDATED_ON = tuple(f"{kind}-{seed}" for kind in KINDS for seed in VALIDATION_SEEDS)
"""Scenes that tell whether what was tuned holds elsewhere; nothing is fitted to them."""

VALIDATION_ROOMS = (
    *("panel-300", "panel-301", "panel-302", "window-300", "window-301", "window-302"),
    *("rods-300", "rods-301", "spot-300", "spot-301", "point-300", "point-301"),
)
"""Rooms on which whole frames are validated; nothing is tuned on any room of these kinds."""


def is_scene(name: str) -> bool:
    """Return whether a name is of a built-in scene, or KIND-SEED of a generated one."""
    return name in BUILTIN_SCENES or is_generated(name)


@lru_cache(maxsize=4)
def make_scene(name: str) -> BuiltinScene:
    """Return a built-in scene, or the generated scene KIND-SEED, such as "room-7".

    The latest few are kept, so that their device memory is found again too.

    Raises:
        ValueError: there is none of this name.
    """
    if name in BUILTIN_SCENES:
        return BUILTIN_SCENES[name]()
    if is_generated(name):
        return generated(name)
    raise ValueError(f"scene is {name!r}: expected one of {SCENE_NAMES}")


__all__ = [
    "BUILTIN_SCENES",
    "KINDS",
    "REPORTED",
    "SCENE_NAMES",
    "TUNED_ON",
    "TUNING_SEEDS",
    "VALIDATED_ON",
    "VALIDATION_ROOMS",
    "VALIDATION_SEEDS",
    "BuiltinScene",
    "cornell_box",
    "generated",
    "hall",
    "is_scene",
    "make_scene",
    "parlour",
    "terrace",
    "workshop",
]
