"""Controls of parameters, made from their declarations: range, unit, choices and meaning are said there alone."""

from __future__ import annotations

import math
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from ssgi_cl.core import checks
from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.frame.params import FrameParams, WholeFrameParams, bounce_methods

Kind = Literal["switch", "choice", "slider", "number"]

HIDDEN = {
    Params: frozenset(("gbuffer", "outputs", "skips", "bent_normals")),
    FrameParams: frozenset(("vpls", "glossy_vpls")),
    WholeFrameParams: frozenset(("bounces",)),
}
"""Parameters without a control: what they say is returned, not seen, or another group has them."""
LONGEST_UNIT = 16
"""Letters of a unit in a label; longer ones are in the hint."""

MOST_STEPS = 256
"""Of a slider of integers; wider ranges are chosen from powers of two."""
MOST_POWER = 1 << 16
WIDE = 64.0
"""Times its default that a range may reach up to for a slider over all of it; else it reaches `REACH` times as far."""
REACH = 8.0
STOPS = 10
"""Of factors without a range: 2^-10 to 2^10."""
AUTOMATIC = "automatic"


@dataclass(frozen=True, kw_only=True)
class Control:
    """A control of one parameter.

    Attributes:
        name: of the parameter.
        label: with its unit.
        hint: what it means, its range and its default.
        kind: of control.
        shown: what it shows now: a bool, a word of `words`, or a number.
        low, high, step: of sliders.
        words: what each word of a choice stands for.
        power: whether the number is an exponent of 2.
        whole: whether it is an integer.
    """

    name: str
    label: str
    hint: str
    kind: Kind
    shown: Any
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    words: Mapping[str, Any] = field(default_factory=dict)
    power: bool = False
    whole: bool = False

    def value(self, shown: Any) -> Any:
        """Return the parameter's value that stands behind what is shown.

        Raises:
            ValueError: a word that is none of the control's.
        """
        if self.kind == "choice":
            return self.words[checks.choice(self.name, shown, tuple(self.words))]
        if self.kind == "switch":
            return bool(shown)
        number = 2.0 ** float(shown) if self.power else float(shown)
        return round(number) if self.whole else number


def controls(params: Params, lengths: float, *, only: frozenset[str] | None = None) -> Iterator[Control]:
    """Return the controls of parameters, in their order, those of `only` or all that change a picture.

    Args:
        params: with the values that are shown.
        lengths: a length that suits the scene, scene units, for parameters whose range or default tells none.
    """
    kinds = get_type_hints(type(params))
    hidden = frozenset().union(*(names for kind, names in HIDDEN.items() if isinstance(params, kind)))
    for name, declared in parameter_fields(type(params)).items():
        if name in hidden or (only is not None and name not in only):
            continue
        found = _control(params, name, kinds[name], declared.metadata, declared.default, lengths)
        if found is not None and _applies(params, found):
            yield found


def _applies(params: Params, control: Control) -> bool:
    """Return whether a parameter of a frame may have another value beside the present ones of the others."""
    if not isinstance(params, FrameParams):  # those of techniques depend on each other in both directions
        return True
    if control.kind in ("choice", "number") and not control.whole:
        return True
    other: dict[str, Any] = {
        control.name: not control.shown if control.kind == "switch" else control.value(control.high or 1)
    }
    try:
        replace(params, **other)
    except ValueError:
        return False
    return True


def _control(
    params: Params, name: str, kind: Any, rule: Mapping[str, Any], default: Any, lengths: float
) -> Control | None:
    parts = set(_parts(kind))
    value, unit = getattr(params, name), rule["unit"]
    about: dict[str, Any] = {"name": name, "label": f"{name} ({unit})" if unit and len(unit) <= LONGEST_UNIT else name}
    limits = _range(rule["low"], rule["high"])
    said = ", ".join(part for part in (limits, unit) if part)
    about["hint"] = f"{rule['doc']}{f' [{said}]' if said else ''}; by default {default}"
    words = _words(params, name, parts, rule)
    if words is not None:
        if len(words) < 2:
            return None
        shown = next((word for word, each in words.items() if each == value and type(each) is type(value)), None)
        return Control(kind="choice", words=words, shown=shown or _said(params, name, value, words), **about)
    if parts == {bool}:
        return Control(kind="switch", shown=bool(value), **about)
    if not parts & {int, float} or isinstance(value, str):  # a number or a word that nothing lists
        return None
    return _number(value, default, rule, int in parts and float not in parts, lengths, about)


def _number(
    value: Any, default: Any, rule: Mapping[str, Any], whole: bool, lengths: float, about: dict[str, Any]
) -> Control:
    low, high = rule["low"], rule["high"]
    value = value[0] if isinstance(value, tuple) else value  # several radii
    if whole:
        return _integer(value, default, low, high, about)
    if default is None and rule["unit"] != "scene units":  # a factor
        shown = 0.0 if value is None else math.log2(value)
        span: dict[str, Any] = {"low": min(-STOPS, shown), "high": max(STOPS, shown), "step": 0.125}
        about["label"] = f"{about['label']}, 2^x"
        return Control(kind="slider", shown=shown, power=True, **span, **about)
    usual = lengths if rule["unit"] == "scene units" else default
    if usual is None or not math.isfinite(usual) or (usual == 0.0 and not math.isfinite(high)):
        return Control(kind="number", shown=_finite(value if value is not None else lengths), **about)
    shown = usual if value is None else float(value)
    bounded = math.isfinite(high) and (usual == 0.0 or high <= WIDE * abs(usual))
    top = high if bounded else min(REACH * abs(usual), high)
    # Lengths are positive, whether declared so or not.
    least = low if math.isfinite(low) else top / 200.0 if rule["unit"] == "scene units" else -top
    top, bottom = max(top, shown), min(least, shown)
    step = (top - bottom) / 200.0
    return Control(kind="slider", low=bottom, high=top, step=step, shown=shown, **about)


def _integer(value: Any, default: Any, low: float, high: float, about: dict[str, Any]) -> Control:
    shown = value if value is not None else default
    if math.isfinite(high) and high - low <= MOST_STEPS:
        span: dict[str, Any] = {"low": int(low), "high": int(high), "step": 1}
        return Control(kind="slider", shown=int(low) if shown is None else shown, whole=True, **span, **about)
    if not math.isfinite(low):
        return Control(kind="number", shown=16 if shown is None else shown, whole=True, **about)
    top = min(high, MOST_POWER)
    powers = [1 << exponent for exponent in range(MOST_POWER.bit_length()) if low <= 1 << exponent <= top]
    numbers = sorted({*powers, *(() if shown is None else (int(shown),)), int(low)})
    words = {str(number): number for number in numbers}
    return Control(kind="choice", shown=str(shown), words=words, **about)


def _words(params: Params, name: str, parts: set[Any], rule: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what each word of a choice stands for; None of what is no choice."""
    names = [*rule["choices"]] or sorted((p for p in parts if isinstance(p, str)), key=_order(params, name))
    if name == "method" and isinstance(params, FrameParams):
        names = list(bounce_methods(params.bounce_name))
    if not names:
        return None
    words: dict[str, Any] = {AUTOMATIC: None} if type(None) in parts else {}
    if bool in parts and type(None) not in parts:
        words["none"] = False
    words |= {each: each for each in names}
    if int in parts:
        words |= {str(number): number for number in (0, 1, 2, 3, 4, 8)}
    return words


def _order(params: Params, name: str) -> Any:
    listed = [part for part in _ordered(get_type_hints(type(params))[name]) if isinstance(part, str)]
    return listed.index


def _said(params: Params, name: str, value: Any, words: Mapping[str, Any]) -> str:
    """Return the word for a value that is none of those that words stand for, such as True or parameters."""
    if isinstance(params, FrameParams) and name in ("ao", "indirect"):
        chosen = params.ao_name if name == "ao" else params.bounce_name
        if chosen in words:
            return str(chosen)
    return next(iter(words))


def _parts(kind: Any) -> Iterator[Any]:
    return iter(_ordered(kind))


def _ordered(kind: Any) -> list[Any]:
    """Return the members of unions and literals."""
    if get_origin(kind) in (Union, types.UnionType):
        return [part for each in get_args(kind) for part in _ordered(each)]
    return list(get_args(kind)) if get_origin(kind) is Literal else [kind]


def _range(low: float, high: float) -> str:
    if not math.isfinite(low) and not math.isfinite(high):
        return ""
    if not math.isfinite(high):
        return f"{checks.limit(low)} or more"
    return f"up to {checks.limit(high)}" if not math.isfinite(low) else f"{checks.limit(low)} to {checks.limit(high)}"


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 1e6
