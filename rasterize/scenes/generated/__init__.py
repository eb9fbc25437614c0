"""Generated scenes: as many as are wanted, each from the name of a kind and a seed."""

from __future__ import annotations

import re
from collections.abc import Callable

from ..builtin import BuiltinScene
from .chambers import chambers
from .chance import Chance
from .colonnade import colonnade
from .draft import Draft
from .foliage import foliage
from .lit_rooms import LIT_ROOMS
from .machine import machine
from .room import room
from .street import street
from .terrain import terrain
from .views import Surroundings, chosen

KINDS: dict[str, Callable[[Chance], Draft]] = {
    "room": room,
    "colonnade": colonnade,
    "foliage": foliage,
    "machine": machine,
    "street": street,
    "terrain": terrain,
    "chambers": chambers,
}
"""Functions that make a scene of each kind, by name."""

NAMED = {**KINDS, **LIT_ROOMS}
"""The same with rooms that nothing is tuned on."""

VIEWS = 3
"""Views of each scene."""
MOST_SEED = 999_999

_NAME = re.compile(r"([a-z]+)-(0|[1-9]\d{0,5})")


def is_generated(name: str) -> bool:
    """Return whether a name is of the form KIND-SEED with a known kind."""
    match = _NAME.fullmatch(name)
    return match is not None and match[1] in NAMED


def generated(name: str) -> BuiltinScene:
    """Make the scene KIND-SEED, such as "room-7": the same bits each time.

    Raises:
        ValueError: there is no such kind, or the seed is none.
    """
    match = _NAME.fullmatch(name)
    if match is None or match[1] not in NAMED:
        raise ValueError(
            f"scene is {name!r}: expected KIND-SEED with KIND one of {', '.join(NAMED)} and SEED "
            f"an integer from 0 to {MOST_SEED}, such as room-7"
        )
    draft = NAMED[match[1]](Chance(match[1], int(match[2])))
    parts = draft.model.parts()
    limits = {"yfov": draft.yfov, "clearance": draft.clearance, "coverage": draft.coverage}
    (eye, target), *more = chosen(Surroundings(parts), draft.candidates, VIEWS, **limits)
    return BuiltinScene(
        name=name,
        scene=draft.model.scene(),
        eye=eye,
        target=target,
        yfov=draft.yfov,
        lights=draft.lights,
        ao_radius=draft.ao_radius,
        more_views=tuple((view.eye, view.target) for view in more),
        closed=all(closed for _, closed in parts),
    )
