"""Parameters of SSDO against those of its parts: the same ranges and counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any

import pytest

from ssgi_cl.core.params import Params
from ssgi_cl.techniques.direct.light_shadows import LightShadowParams
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_params import METHODS, METHODS_OF, SsdoParams
from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams

BACK_ENDS: dict[str, Callable[[SsdoParams], Params]] = {
    "bitmask": SsdoParams.bitmask,
    "points": SsdoParams.points,
    "published": SsdoParams.points,
}
COUNTS: list[tuple[str, type[Params], str]] = [
    ("slices", SsdoBitmaskParams, "slices"),
    ("taps", SsdoBitmaskParams, "taps"),
    ("samples", PointsParams, "samples"),
    ("blur_radius", BilateralParams, "radius"),
    ("blur_passes", BilateralParams, "passes"),
    ("shadow_taps", LightShadowParams, "taps"),
]
"""Counts of `SsdoParams`, and the parameters of its parts that they become."""


def declared(params: Any) -> dict[str, Any]:
    """Return the declaration of each parameter by name."""
    return {field.name: field.metadata for field in fields(params)}


def ends() -> Iterator[Any]:
    """Yield method, parameter and value at each finite end of what is allowed."""
    for name, rule in declared(SsdoParams).items():
        for method in METHODS_OF.get(name, METHODS):
            for end in ("low", "high"):
                if math.isfinite(rule[end]) and not (end == "low" and rule["above"]):
                    yield pytest.param(method, name, rule[end], id=f"{method}-{name}-{end}")


@pytest.mark.parametrize(("method", "name", "value"), list(ends()))
def test_nothing_that_is_allowed_is_refused_behind(method: str, name: str, value: float) -> None:
    params = SsdoParams(method=method, **{name: value})
    BACK_ENDS[method](params)
    assert params.blur
    if params.shadow_taps:  # without, no light casts a shadow
        params.punctual_lights()


@pytest.mark.parametrize(("name", "behind", "there"), COUNTS)
def test_counts_go_as_high_as_those_they_become(name: str, behind: type[Params], there: str) -> None:
    assert declared(SsdoParams)[name]["high"] == declared(behind)[there]["high"]
