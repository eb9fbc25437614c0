"""Choice of a technique's parameters by a preset, an expected error or a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.presets.speed_model import predicted_ms
from ssgi_cl.techniques.radius import sensible_radius

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique

ASKED = ("preset", "error", "budget_ms")
"""The ways to ask, of which a call has at most one."""

MARGIN_SLACK = 0.9
"""Part of the recorded overscan from which on a margin counts as that much."""


@dataclass(frozen=True)
class Choice:
    """Technique and parameters, with their expected error and time.

    Attributes:
        params: of the technique, for its class.
        error: RMSE against cast rays that the recorded setting had on the scenes for tuning; of `ssgi_cl.ao`, on those
            for validation if it is greater there.
        ms: predicted device time of a picture here; None unless `ssgi_cl.choose` was asked for a time.
        technique: its name.
        parameters: those that were chosen.
        layers, overscan: depth layers of the G-buffer, and its margin as a share of the image where that counts.
        thickness: whether the thickness of the G-buffer is read.
        wall_ms: wall time that calls of `ssgi_cl.ao` took here; None unless a time was asked for.
        why: the reason, in words.
    """

    params: Any
    error: float
    ms: float | None = None
    technique: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    layers: int = 1
    overscan: float = 0.0
    thickness: bool = False
    wall_ms: float | None = None
    why: str = ""


def choice_for(
    technique: type[OcclusionTechnique],
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
    """Choose among the recorded settings of a technique, given by its class.

    The rest is as in `ssgi_cl.choose`, which takes its name.
    """
    name = technique.name
    for index in (0, 1):
        checks.integer(f"size[{index}]", size[index], low=1, high=16384, unit="px")
    checks.integer("layers", layers, low=1, high=16)
    asked = {"preset": preset, "error": error, "budget_ms": budget_ms}
    check_single(asked, least=1)
    has_margin = reaches(margin, size, presets.record(name)["overscan"])

    def error_of(setting: presets.Setting) -> float:
        return setting.error if has_margin else setting.error_cut

    ms = None
    if preset is not None:
        setting = _named(name, preset, layers)
    elif error is not None:
        wanted = checks.number("error", error, low=0.0, above=True)
        settings = presets.curve(name, layers)
        good = [setting for setting in settings if error_of(setting) <= wanted]
        if not good:
            raise ValueError(
                f"error is {wanted:g}: the best recorded setting of {name} with {layers} "
                f"depth layer{'s' if layers > 1 else ''} is expected to reach "
                f"{min(map(error_of, settings)):.3f}"
            )
        setting = min(good, key=lambda setting: setting.ms)
    else:
        budget = checks.number("budget_ms", budget_ms, low=0.0, above=True, unit="ms")
        runtime = runtime or Runtime.open()
        timed = [
            (predicted_ms(runtime, technique, with_layers(name, setting.ms, layers), size), setting)
            for setting in presets.curve(name, layers)
        ]
        fast = [pair for pair in timed if pair[0] <= budget]
        if not fast:
            least, fastest = min(timed, key=lambda pair: pair[0])
            named = ", ".join(f"{key}={value!r}" for key, value in fastest.parameters.items())
            raise ValueError(
                f"budget_ms is {budget:g}: cannot be met: the fastest setting of {name}, {named}, takes "
                f"about {least:.2g} ms here at {size[1]} x {size[0]}"
            )
        ms, setting = min(fast, key=lambda pair: error_of(pair[1]))
    params = technique.defaults(**{**setting.parameters, **given})
    return Choice(params, error_of(setting), ms)


def params_for(
    technique: type[OcclusionTechnique], gbuffer: GBuffer | DeviceGBuffer, runtime: Runtime | None, **given: Any
) -> Any:
    """Return the parameters of a call of a technique's function.

    Args:
        technique: its class.
        gbuffer, runtime: as the function got them.
        **given: parameters, and at most one of `preset`, `error` and `budget_ms`; what is None is
            not given.

    Raises:
        TypeError, ValueError: as `choice_for`, and as the technique's parameters.
    """
    given = {name: value for name, value in given.items() if value is not None}
    given["radius"] = sensible_radius(gbuffer, given.get("radius"))
    asked = {name: given.pop(name) for name in ASKED if name in given}
    if not asked:
        return technique.defaults(**given)
    check_single(asked)
    if isinstance(gbuffer, DeviceGBuffer):
        runtime = gbuffer.runtime
    chosen = choice_for(
        technique, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin, runtime=runtime, **asked, **given
    )
    return chosen.params


def check_single(asked: Mapping[str, Any], least: int = 0) -> None:
    """Raise ValueError unless at most one thing is asked for, and at least so many."""
    given = [f"{name} is {value!r}" for name, value in asked.items() if value is not None]
    if not least <= len(given) <= 1:
        how_many = "exactly" if least else "at most"
        raise ValueError(
            f"{' and '.join(given) or 'nothing is asked for'}: expected {how_many} one of {', '.join(ASKED)}"
        )


def reaches(margin: Size, size: Size, overscan: float) -> bool:
    """Return whether a margin is about as wide as the recorded one."""
    return all(part >= MARGIN_SLACK * overscan * whole for part, whole in zip(margin, size, strict=True))


def _named(technique: str, name: str, layers: int) -> presets.Setting:
    known = presets.recorded_for(technique, layers)["presets"]
    values = dict(known[checks.choice("preset", name, presets.NAMES)])
    del values["by_scene"]
    return presets.Setting(**values)


def with_layers(technique: str, ms: float, layers: int) -> float:
    """Return a time recorded for the next lower number of layers as one of `layers`.

    Between recorded numbers, and beyond them, the defaults' time tells how it grows.
    """
    entries = presets.record(technique)["layers"]
    times = {entry["layers"]: entry["default"]["ms"] for entry in entries}
    numbers = sorted(times)
    lower = max(number for number in numbers if number <= layers)
    if lower == layers or len(numbers) == 1:
        return ms
    a, b = next(((lower, number) for number in numbers if number > layers), tuple(numbers[-2:]))
    growth = (times[b] - times[a]) / (b - a)
    return float(ms * (1.0 + growth * (layers - lower) / times[lower]))
