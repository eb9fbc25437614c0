"""Outputs and skips that a frame is asked for, and the comparison of its inputs with those of the frame before."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.core.params import Params

_VALUES = (Camera, SpotLight, PointLight, DirectionalLight, Environment)
_PLAIN = (bool, int, float, str, frozenset, type(None))

OUTPUTS = ("image", "radiance", "ao", "indirect", "gbuffer")
"""Names of what a frame can hold. By default it holds all but the G-buffer; AO and indirect light where the image
needs them."""

SKIPS = {
    "outputs": "passes whose results no requested output reads, such as light where only AO is requested",
    "dark": "ambient occlusion in frames without ambient light",
    "maps": "shadow maps and reflective shadow maps whose light and scene did not change, and "
    "reads of kept shadow maps where a block of 8 x 8 texels is proven all lit or all in shadow",
    "unchanged": "passes all of whose inputs equal those of the previous frame: G-buffer, ambient "
    "occlusion, light, image",
    "region": "pixels outside the active region: the rectangle of tiles that triangles may cover",
}
"""Work that each skip leaves out, by its name. Results are bit-identical with and without."""

ONE_PICTURE = frozenset(SKIPS) - {"unchanged"}
"""Skips of a picture that is to take as long as a first one, though it is drawn a second time."""


def chosen_skips(skips: object) -> frozenset[str]:
    """Return the names of the skips that are on.

    Args:
        skips: True for all, False for none, or names from `SKIPS`.

    Raises:
        TypeError, ValueError: anything else.
    """
    if isinstance(skips, bool):
        return frozenset(SKIPS) if skips else frozenset()
    return _names("skips", skips, tuple(SKIPS))


def chosen_outputs(outputs: object) -> frozenset[str] | None:
    """Return the names of the outputs asked for, or None for those of a picture.

    Raises:
        TypeError, ValueError: neither None nor at least one name from `OUTPUTS`.
    """
    if outputs is None:
        return None
    names = _names("outputs", outputs, OUTPUTS)
    if not names:
        raise ValueError(f"outputs is {outputs!r}: expected at least one of {', '.join(map(repr, OUTPUTS))}")
    return names


def _names(argument: str, names: object, allowed: tuple[str, ...]) -> frozenset[str]:
    expected = f"expected names out of {', '.join(map(repr, allowed))}"
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise TypeError(f"{argument} is {names!r}: {expected}")
    found = tuple(names)
    for name in found:
        if name not in allowed:
            raise ValueError(f"{argument} has {name!r}: {expected}")
    return frozenset(found)


def same(a: object, b: object) -> bool:
    """Return whether two inputs are the same.

    Cameras, lights, parameters and plain values are compared by value, all else by identity.
    """
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
