"""The catalogue: the list by which the command line and tuning find techniques."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ssgi_cl.core.params import Params
from ssgi_cl.techniques.ao.bitmask_ao import BitmaskAo, BitmaskParams, bitmask_ao
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams, hbao
from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams, ssao


@dataclass(frozen=True)
class Entry:
    """A technique that turns a G-buffer into an image.

    Attributes:
        function: called with a G-buffer, `runtime` and the parameters.
        params: the dataclass that declares them.
        technique: the class, to prepare once and run often.
        channel: name of the result in a file.
        quantity: what the result is, a method of the benchmark's `Context` that gives its truth.
        tunable: parameters by which presets differ, each with the list of its values; what tuning
            varies by default.
        layers: numbers of depth layers that presets are recorded for.
    """

    function: Callable[..., Any]
    params: type[Params]
    technique: type[OcclusionTechnique]
    channel: str
    quantity: str = "occlusion"
    tunable: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    layers: tuple[int, ...] = (1,)


# Presets differ in how much they sample, not in what they take for an occluder, and in nothing that
# depends on the scene: more slices err less on all sets of scenes. More taps err less where what is
# tuned on is thick, and more where horizons take thin rods for walls.
_SLICES: dict[str, Sequence[Any]] = {
    "slices": [1, 2, 3, 4, 8],
    "resolution": ["full", "half"],
}

_LAYERS = (1, 2, 4)

TECHNIQUES: dict[str, Entry] = {
    "ssao": Entry(
        ssao,
        SsaoParams,
        Ssao,
        "ao",
        tunable={
            "samples": [4, 8, 16, 32, 64],
            "resolution": ["full", "half"],
            "blur_radius": [1, 2],
        },
    ),
    "hbao": Entry(hbao, HbaoParams, Hbao, "ao", tunable=_SLICES, layers=_LAYERS),
    "gtao": Entry(gtao, GtaoParams, Gtao, "ao", tunable=_SLICES, layers=_LAYERS),
    "bitmask_ao": Entry(
        bitmask_ao, BitmaskParams, BitmaskAo, "ao", tunable=_SLICES, layers=_LAYERS
    ),
}
