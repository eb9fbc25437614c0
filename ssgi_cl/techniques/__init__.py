"""Techniques: one module each, and the list by which the command line and tuning find them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ssgi_cl.params import Params
from ssgi_cl.techniques.bitmask_ao import BitmaskAo, BitmaskParams, bitmask_ao
from ssgi_cl.techniques.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.hbao import Hbao, HbaoParams, hbao
from ssgi_cl.techniques.occlusion import OcclusionTechnique
from ssgi_cl.techniques.ssao import Ssao, SsaoParams, ssao


@dataclass(frozen=True)
class Entry:
    """A technique that turns a G-buffer into an image.

    Attributes:
        function: called with a G-buffer, `runtime` and the parameters.
        params: the dataclass that declares them.
        technique: the class, to prepare once and run often.
        channel: name of the result in a file.
        quantity: what the result is, a method of the benchmark's `Context` that gives its truth.
        tunable: parameters that are worth tuning: a tuple (low, high), or a list of values.
        layers: numbers of depth layers that presets are recorded for.
    """

    function: Callable[..., Any]
    params: type[Params]
    technique: type[OcclusionTechnique]
    channel: str
    quantity: str = "occlusion"
    tunable: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    layers: tuple[int, ...] = (1,)


# Presets differ in how much they sample, not in what they take for an occluder: tuned parameters of
# the model make up for what few layers hold of the scenes that are tuned on, and add to the error
# of others. So do few, far taps, which miss occluders: less error where leaves count as walls.
_SLICES: dict[str, Sequence[Any]] = {
    "slices": [1, 2, 4, 8],
    "taps": [9],
    "resolution": ["full", "half"],
    "blur_radius": (0, 6),
}

_LAYERS = (1, 2, 4)

TECHNIQUES: dict[str, Entry] = {
    "ssao": Entry(
        ssao,
        SsaoParams,
        Ssao,
        "ao",
        tunable={
            "samples": [4, 6, 8, 12, 16, 24, 32, 48, 64, 96],
            "length_power": (0.15, 1.2),
            "full": (0.0, 4.0),
            "none": (0.25, 8.0),
            "power": [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6],  # 1 is faster by a third
            "bias": (0.0, 0.1),
            "contrast": (1.0, 6.0),
            "resolution": ["full", "half"],
            "blur_radius": (0, 6),
        },
    ),
    "hbao": Entry(
        hbao,
        HbaoParams,
        Hbao,
        "ao",
        # As first published, it fades by far more than what rays hit does; one value serves all.
        tunable={**_SLICES, "attenuation": [0.4]},
        layers=_LAYERS,
    ),
    "gtao": Entry(
        gtao,
        GtaoParams,
        Gtao,
        "ao",
        # Leaves reward a wider blur; rooms don't.
        tunable={**_SLICES, "blur_radius": [1, 2]},
        layers=_LAYERS,
    ),
    "bitmask_ao": Entry(
        bitmask_ao,
        BitmaskParams,
        BitmaskAo,
        "ao",
        # More taps lower its error by more than more slices do.
        tunable={**_SLICES, "slices": [1, 2, 4], "taps": [9, 14, 20]},
        layers=_LAYERS,
    ),
}
