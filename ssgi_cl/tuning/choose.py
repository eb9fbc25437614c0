"""Recorded settings of techniques by the technique's name."""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Unpack, overload

from ssgi_cl.core import checks
from ssgi_cl.core.keywords import check_names
from ssgi_cl.core.names import Preset
from ssgi_cl.core.params import parameter_fields
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.bitmask import BitmaskKeywords
from ssgi_cl.techniques.ao.gtao import GtaoKeywords
from ssgi_cl.techniques.ao.hbao import HbaoKeywords
from ssgi_cl.techniques.ao.ssao import SsaoKeywords
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.presets.choose import Choice, choice_for


class _Asked(TypedDict, total=False):
    """Keywords of the request, and of the pictures."""

    preset: Preset | None
    error: float | None
    budget_ms: float | None
    layers: int
    margin: Size
    runtime: Runtime | None


class _Slices(_Asked, total=False):
    """The parameters that functions of slices name."""

    radius: float
    slices: int
    taps: int


class _Ssao(SsaoKeywords, _Asked, total=False):
    radius: float | tuple[float, ...]
    samples: int


class _Hbao(HbaoKeywords, _Slices, total=False):
    pass


class _Gtao(GtaoKeywords, _Slices, total=False):
    bent_normals: bool


class _Bitmask(BitmaskKeywords, _Slices, total=False):
    pass


@overload
def choose(technique: Literal["ssao"], size: Size, **given: Unpack[_Ssao]) -> Choice: ...
@overload
def choose(technique: Literal["hbao"], size: Size, **given: Unpack[_Hbao]) -> Choice: ...
@overload
def choose(technique: Literal["gtao"], size: Size, **given: Unpack[_Gtao]) -> Choice: ...
@overload
def choose(technique: Literal["bitmask_ao"], size: Size, **given: Unpack[_Bitmask]) -> Choice: ...
@overload
def choose(technique: str, size: Size, **given: Any) -> Choice: ...
def choose(
    technique: str,
    size: Size,
    *,
    preset: Preset | None = None,
    error: float | None = None,
    budget_ms: float | None = None,
    layers: int = 1,
    margin: Size = (0, 0),
    runtime: Runtime | None = None,
    **given: Any,
) -> Choice:
    """Choose among a technique's recorded settings by name, by error or by time.

    Errors are those on the scenes that the settings were tuned on; how they carry over to others
    depends on the scene. Times are predicted: the recorded one, by how fast this device is at the
    technique, which is measured once (half a second) and kept.

    Args:
        technique: its name, such as "gtao".
        size: (rows, columns) of the picture.
        preset: "low", "medium", "high" or "ultra".
        error: the fastest setting is chosen that is expected to reach this RMSE against cast rays.
        budget_ms: the best setting is chosen that is expected to take at most this device time.
        layers: depth layers of the G-buffers; more give less error, and take longer.
        margin: (rows, columns) by which they exceed the picture; it gives less error.
        runtime: the device whose time counts; by default the fastest found.
        **given: parameters that keep these values whatever is chosen; the radius, which is the
            scene's and in no setting, is one. What is expected does not know of them.

    Raises:
        TypeError, ValueError: not exactly one of `preset`, `error` and `budget_ms` is given, an
            argument is wrong, the technique has no presets, or no recorded setting does what is
            asked for; the message says what the best or fastest one does.
    """
    checks.choice("technique", technique, sorted(TECHNIQUES))
    fields = parameter_fields(TECHNIQUES[technique].params)
    check_names(f"choose() of {technique!r}", given, {*fields, *_Asked.__annotations__})
    return choice_for(
        TECHNIQUES[technique].technique,
        size,
        preset=preset,
        error=error,
        budget_ms=budget_ms,
        layers=layers,
        margin=margin,
        runtime=runtime,
        **given,
    )
