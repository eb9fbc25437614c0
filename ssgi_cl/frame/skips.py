"""What a frame is asked for: outputs and skips; and when two inputs are the same."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.core.params import Params

_VALUES = (Camera, SpotLight, PointLight, DirectionalLight, Environment)
_PLAIN = (bool, int, float, str, frozenset, type(None))

OUTPUTS = ("image", "radiance", "ao", "indirect", "gbuffer")
"""What a frame can hold; by default all but the G-buffer, of AO and indirect light what is needed
for the image."""

SKIPS = {
    "outputs": "passes whose results no requested output reads, such as light where only AO is requested",
    "dark": "ambient occlusion in frames without ambient light",
    "maps": "shadow maps and reflective shadow maps whose light and scene did not change, and "
    "reads of kept shadow maps where a block of 8 x 8 texels is proven all lit or all in shadow",
    "unchanged": "passes all of whose inputs equal those of the previous frame: G-buffer, ambient "
    "occlusion, light, image",
    "region": "pixels outside the active region: the rectangle of tiles that triangles may cover",
}
"""Skips by name, and the work that each leaves out. Results are bit-identical with and without."""


def chosen_skips(skips: object) -> frozenset[str]:
    """Return the names of the skips that are on.

    Args:
        skips: True for all, False for none, or names from `SKIPS`.

    Raises:
        TypeError, ValueError: anything else.
    """
    if isinstance(skips, bool):
        return frozenset(SKIPS) if skips else frozenset()
    if isinstance(skips, Iterable) and not isinstance(skips, str):
        skips = list(skips)
    return frozenset(_names("skips", skips, tuple(SKIPS)))


def chosen_outputs(outputs: object) -> frozenset[str] | None:
    """Return the names of the outputs asked for, or None for those of a picture.

    Raises:
        TypeError, ValueError: neither None nor at least one name from `OUTPUTS`.
    """
    if outputs is None:
        return None
    names = frozenset(_names("outputs", outputs, OUTPUTS))
    if not names:
        raise ValueError(f"outputs is {outputs!r}: expected at least one of {_listed(OUTPUTS)}")
    return names


def _names(argument: str, names: object, allowed: tuple[str, ...]) -> list[str]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise TypeError(f"{argument} is {names!r}: expected names out of {_listed(allowed)}")
    found = list(names)
    for name in found:
        if name not in allowed:
            raise ValueError(f"{argument} has {name!r}: expected names out of {_listed(allowed)}")
    return found


def _listed(names: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in names)


@dataclass(frozen=True)
class Needs:
    """What the outputs of a frame need.

    Attributes:
        outputs: names asked for.
        ao: whether A is asked for by itself, be there ambient light or not.
        light, picture: whether the light of all pixels, and its tone mapping, are computed.
        given: outputs that a frame gets if they are there.
    """

    outputs: frozenset[str]
    ao: bool
    light: bool
    picture: bool
    given: frozenset[str]

    @classmethod
    def of(cls, outputs: object, skips: frozenset[str]) -> Self:
        """Return what outputs need, given by name or None for those of a picture."""
        chosen = chosen_outputs(outputs)
        names = chosen or frozenset({"image", "radiance"})
        all_ = "outputs" not in skips
        picture = all_ or "image" in names
        light = picture or "radiance" in names
        return cls(
            names,
            ao=chosen is not None and "ao" in names,
            light=light,
            picture=picture,
            given=names | ({"ao", "indirect"} if chosen is None else set()),
        )


def same(a: object, b: object) -> bool:
    """Return whether two inputs are the same: cameras, lights, parameters and plain values by their
    values, all else, such as a scene, as objects."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, np.ndarray):
        return np.array_equal(a, np.asarray(b))
    if isinstance(a, _VALUES):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    return isinstance(a, (*_PLAIN, Params)) and bool(a == b)
