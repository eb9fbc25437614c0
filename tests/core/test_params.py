"""Parameters: declared once, checked when made, described for help texts."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.params import Params, describe, param


@dataclass(frozen=True, kw_only=True)
class Example(Params):
    """An example."""

    radius: float = param(0.5, "reach", unit="m", low=0.0, high=10.0, above=True)
    count: int = param(4, "samples", low=1, high=8)
    mode: str = param("fast", "how", choices=("fast", "good"))
    flip: bool = param(True, "whether")
    limit: float = param(math.inf, "largest size", unit="px", low=1.0)


def test_defaults_are_allowed() -> None:
    made = Example()
    assert dataclasses.astuple(made) == (0.5, 4, "fast", True, math.inf)


def test_numbers_become_those_of_python() -> None:
    made = Example(radius=np.float32(0.5), count=np.int64(3))  # type: ignore[arg-type]
    assert (type(made.radius), type(made.count)) == (float, int)
    assert Example(radius=2).radius == 2.0


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0 and <= 10 \(m\)"),
        ({"radius": 10.1}, ValueError, "radius is 10.1"),
        ({"radius": math.nan}, ValueError, "radius is nan"),
        ({"radius": math.inf}, ValueError, "radius is inf"),
        ({"radius": "1"}, TypeError, "radius is '1'"),
        ({"radius": True}, TypeError, "radius is True"),
        ({"count": 0}, ValueError, "count is 0: expected an integer >= 1 and <= 8"),
        ({"count": 9}, ValueError, "count is 9"),
        ({"count": 2.0}, TypeError, "count is 2.0: expected an integer"),
        ({"count": True}, TypeError, "count is True"),
        ({"mode": "slow"}, ValueError, "mode is 'slow': expected one of 'fast', 'good'"),
        ({"flip": 1}, TypeError, "flip is 1: expected True or False"),
        ({"limit": 0.5}, ValueError, r"limit is 0.5: expected a number >= 1 \(px\)"),
        ({"limit": -math.inf}, ValueError, "limit is -inf"),
        ({"limit": math.nan}, ValueError, "limit is nan"),
    ],
)
def test_values_out_of_range_are_refused_with_the_range_and_unit(
    values: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        Example(**values)


def test_help_texts_tell_range_and_unit() -> None:
    assert describe(Example) == [
        ("radius", "0.5", "reach (0 to 10; m)"),
        ("count", "4", "samples (1 to 8)"),
        ("mode", "fast", "how (fast, good)"),
        ("flip", "True", "whether"),
        ("limit", "inf", "largest size (1 or more; px)"),
    ]
