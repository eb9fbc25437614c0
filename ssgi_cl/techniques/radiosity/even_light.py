"""Even light: what surfaces send, parted into what rays to all sides find with little noise and a bright rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.vpls import LUMINANCE, PARTS, Vpls
from ssgi_cl.techniques.radiosity.light_volume import LightVolume
from ssgi_cl.techniques.vpl.world_vpls import WorldVpls

EVEN = 4.0
"""Most exitance of even light, in means of all surfaces. With 3, 4 and 6 FLIP at 400 x 300 against 256 paths is .121,
.123 and .127 in `hall`, .092, .095 and .097 in `workshop`, .092, .090 and .088 in `panel-300`, and alike elsewhere; a
kept frame of `hall` takes .81 and .79 times the processor time with 4 and 6, of `workshop` .98 and .95."""


class EvenLight(NamedTuple):
    """Light that surfaces send, in two parts whose sum it is."""

    volume: LightVolume
    """Up to an exitance of `EVEN` means of all surfaces."""
    bright: WorldVpls | None
    """What some send beyond it; None where none does."""


def even_and_bright(
    vpls: Vpls, hidden: NDArray[np.bool_] | None = None, *, all_lights: bool = False
) -> tuple[NDArray[np.float64], Vpls]:
    """Return the flux [parts, 3] that the parts of lights send up to an exitance of `EVEN` means of all, and lights
    that send the rest; with `all_lights` those that have no rest too, so that they keep their places from frame to
    frame.

    Both have the colours of the light given, of which they are the sum but for what parts that are `hidden` [parts]
    send beyond that: a ray to the middle of their light does not tell what hides them.
    """
    parts = vpls.parts
    assert parts is not None  # noqa: S101  those of surfels have some
    luminance = parts.flux @ LUMINANCE
    most = EVEN * luminance.sum() / max(float(parts.area.sum()), 1e-300) * parts.area
    even = parts.flux * np.minimum(1.0, most / np.maximum(luminance, 1e-300))[:, None]
    rest = (parts.flux - even).reshape(-1, PARTS, 3)
    if hidden is not None:
        rest[hidden.reshape(-1, PARTS)] = 0.0
    chosen = rest.any(axis=(1, 2)) | all_lights
    own = np.repeat(chosen, PARTS)
    few = Vpls(parts.position[own], parts.normal[own], rest[chosen].reshape(-1, 3), parts.area[own])
    bright = Vpls(vpls.position[chosen], vpls.normal[chosen], rest[chosen].sum(axis=1), vpls.area[chosen], few)
    return even, bright
