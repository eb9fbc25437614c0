"""Words and digits of results, the same in the terminal and on pages."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .document import Group, clock, metric, timed

NOTHING = "-"
"""In place of a number that there is none of."""

_QUANTITIES = {
    "occlusion": "Ambient occlusion",
    "model": "Ambient occlusion, held to its own model",
    "bent": "Angle between bent normals and those of rays",
    "direct": "Direct light",
    "bounce": "One bounce of light",
    "cut": "One bounce of light, held to the same lights without a cutoff",
    "mirrored": "Light that glossy surfaces mirror, without walls",
    "radiance": "Whole frames",
    "": "Passes without a world truth",
}
_UNITS = {"bent": "degrees", **dict.fromkeys(("direct", "bounce", "cut", "mirrored"), "W/m²"), "radiance": "W/m²/sr"}


def number(value: float | None, sign: str = "") -> str:
    """Return a number with three significant digits; from 1000 on, all before the point.

    Numbers below 0.001 and from a million on have two digits and a power of ten.

    Args:
        sign: "+" to show it of positive numbers too.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    size = abs(value)
    if size == 0.0:
        return "0"
    if not 1e-3 <= size < 1e6:
        return f"{value:{sign}.1e}"
    # Digits as those of the rounded number, so that 9.996 is 10.0.
    magnitude = math.floor(math.log10(float(f"{size:.3g}")))
    return f"{value:{sign}.{max(0, 2 - magnitude)}f}"


def percent(share: float | None) -> str:
    """Return a share in whole per cent."""
    return NOTHING if share is None else f"{100.0 * share:.0f} %"


def title(group: Group) -> str:
    """Return what a group of results has in common."""
    quantity, scene, (rows, columns) = group
    return f"{_QUANTITIES.get(quantity, quantity)}, {scene}, {columns} x {rows}"


def unit(quantity: str) -> str:
    """Return the unit of a quantity with a blank before it; "" if it has none."""
    return f" {_UNITS[quantity]}" if quantity in _UNITS else ""


def short_name(result: Mapping[str, Any]) -> str:
    """Return the part of a case's name that differs within a group."""
    return f"{result['family']}.{result['setting']}"


def median(result: Mapping[str, Any]) -> str:
    """Return a result's median wall time in ms; `NOTHING` for a bound."""
    return number(clock(result)["median"]) if timed(result) else NOTHING


def milliseconds(result: Mapping[str, Any]) -> str:
    """Return `median`, marked ~ if it is unsteady."""
    return median(result) + ("~" if timed(result) and result["unsteady"] else "")


def quartiles(result: Mapping[str, Any]) -> str:
    """Return the quartiles of a result's wall time; `NOTHING` for a bound."""
    if not timed(result):
        return NOTHING
    return f"{number(clock(result)['low'])}..{number(clock(result)['high'])}"


def device_milliseconds(result: Mapping[str, Any]) -> str:
    """Return a result's median time by the device's clock; `NOTHING` if it runs elsewhere."""
    spread = result.get("device_ms")
    return number(spread["median"]) if spread and timed(result) else NOTHING


def star(result: Mapping[str, Any]) -> str:
    """Return the mark of a result on the front, *, or near it, +."""
    return "*" if result.get("front") else "+" if result.get("near") else ""


def rmse(result: Mapping[str, Any], truth: str) -> str:
    """Return a result's error against a truth; that of light as a share of the truth's mean too."""
    error, mean = metric(result, truth, "rmse"), metric(result, truth, "mean")
    if error is None or not mean or not unit(result["quantity"]).startswith(" W"):
        return number(error)
    return f"{number(error)} ({100.0 * error / mean:.3g} %)"


def ratio(result: Mapping[str, Any]) -> str:
    """Return a result's time over that of the reference; `NOTHING` for a bound."""
    return number(result["ratio"]["median"]) if timed(result) else NOTHING


def ceiling(result: Mapping[str, Any], calibration: Mapping[str, float]) -> tuple[float, str]:
    """Return the greatest share of a ceiling of the device that a result reaches, and which.

    (0, "") for what does not run on the device, and where neither reads nor bytes are known.
    """
    shares = []
    if result.get("device_ms") is not None:
        for rate, limit, word in (("samples_g_s", "gathers_g_s", "reads"), ("moved_gb_s", "bandwidth_gb_s", "memory")):
            if result.get(rate) and calibration[limit] > 0.0:
                shares.append((result[rate] / calibration[limit], word))
    return max(shares, default=(0.0, ""))


def calibration_line(calibration: Mapping[str, float]) -> str:
    """Return the device's ceilings in one line."""
    return (
        f"ceilings: memory {number(calibration['bandwidth_gb_s'])} GB/s, scattered reads "
        f"{number(calibration['gathers_g_s'])} G/s, arithmetic "
        f"{number(calibration['multiply_adds_gflop_s'])} GFLOP/s"
    )


def revision(document: Mapping[str, Any]) -> str:
    """Return git's revision, and whether files differed from it."""
    name = document.get("revision")
    if name is None:
        return "not a checkout"
    return f"{name}{', modified' if document.get('modified') else ''}"


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]], align: str) -> list[str]:
    """Return the lines of a table in Markdown; `align`: for each column l or r, to the left or the right."""
    rule = "|".join("---:" if side == "r" else "---" for side in align)
    return [f"| {' | '.join(head).lstrip()} |", f"|{rule}|", *(f"| {' | '.join(row)} |" for row in rows)]
