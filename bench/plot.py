"""The plot of error over time of one group of results, as SVG."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from ssgi_cl.core.errors import MissingExtraError

from .document import clock, metric, timed
from .peers.extras import missing_package
from .wording import short_name, unit

COLORS = ("#0072b2", "#c04a00", "#00815c", "#b0568b", "#946800", "#6b4fc0", "#4c4c4c")
MARKERS = ("o", "s", "D", "^", "v")
_STYLE: Any = {
    "svg.hashsalt": "ssgi",
    "svg.fonttype": "none",
    "font.size": 9.0,
    "axes.grid": True,
    "grid.color": "#e7e7e2",
}
_SIZE = (7.6, 4.8)  # inches
_PLACES = (
    ("left", 6, 4),
    ("left", 6, -10),
    ("right", -6, 4),
    ("right", -6, -10),
    ("center", 0, 7),
    ("center", 0, -14),
    ("left", 8, -3),
    ("right", -8, -3),
)
"""Of a label beside its point: alignment and offset, points."""

Result = Mapping[str, Any]
Look = Mapping[str, tuple[str, str, bool]]


def require_plots() -> None:
    """Raise MissingExtraError unless there is what draws plots."""
    why = missing_package("matplotlib", "plots")
    if why:
        raise MissingExtraError(why)


def looks(families: Sequence[str], peers: Sequence[str]) -> dict[str, tuple[str, str, bool]]:
    """Return family -> (colour, marker, whether its line is dashed); dashed are peers."""
    return {
        family: (COLORS[index % len(COLORS)], MARKERS[index % len(MARKERS)], family in peers)
        for index, family in enumerate(families)
    }


def limits(values: Sequence[float]) -> tuple[float, float]:
    """Return the ends of a logarithmic axis that holds all values > 0, a factor of 3 or more apart."""
    positive = [value for value in values if value > 0.0] or [1.0]
    low, high = math.log10(min(positive)), math.log10(max(positive))
    room = max(0.5 * (0.48 - (high - low)), 0.07 * (high - low))
    return 10.0 ** (low - room), 10.0 ** (high + room)


def has_plot(results: Sequence[Result]) -> bool:
    """Return whether any result has both a time and an error against the world's truth."""
    return any(timed(result) and metric(result, "world", "rmse") is not None for result in results)


def plot(results: Sequence[Result], look: Look, title: str, quantity: str) -> str:
    """Return an SVG file; "" without a plot, see `has_plot`.

    Args:
        results: of one group, the fastest first.
        look: see `looks`.
        title: names the plot to those who don't see it.
        quantity: whose unit the errors have.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    if not has_plot(results):
        return ""
    require_plots()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(_SIZE, dpi=72, layout="constrained")  # an SVG has 72
        axes = figure.add_subplot()
        _draw(axes, results, look)
        axes.set_xlabel("median time, ms")
        axes.set_ylabel(f"RMSE against the world{unit(quantity) and ',' + unit(quantity)}")
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside lower left", ncols=4, frameon=False)
        _write(axes, results)
        file = io.StringIO()
        about = {"Title": f"{title}: RMSE over time, both logarithmic", "Date": None, "Creator": None}
        figure.savefig(file, format="svg", metadata=about)
    return "\n".join(line.rstrip() for line in file.getvalue().splitlines()) + "\n"


def _draw(axes: Any, results: Sequence[Result], look: Look) -> None:
    errors = [rmse for result in results if (rmse := metric(result, "world", "rmse")) is not None]
    times = [clock(result)[name] for result in results if has_plot([result]) for name in ("low", "median", "high")]
    _scale(axes, "x", *limits(times))
    _scale(axes, "y", *limits(errors))
    points, bounds = _places(axes, results)
    front = sorted((ms, rmse) for ms, rmse, result in points if result.get("front"))
    if front:  # the least error that can be had within a time
        front.append((axes.get_xlim()[1], front[-1][1]))
        style = {"color": "#8a8d92", "alpha": 0.35, "linewidth": 6.0, "gid": "front"}
        axes.plot(*zip(*front, strict=True), drawstyle="steps-post", **style)
    for family, (color, marker, dashed) in look.items():
        own = [point for point in points if point[2]["family"] == family]
        if all(str(result["setting"]).isdecimal() for *_, result in own):
            own.sort(key=lambda point: int(point[2]["setting"]))  # names stay in order of time
        line = {"linestyle": "--" if dashed else "-", "marker": marker, "markersize": 5.5}
        across, up = [ms for ms, *_ in own], [rmse for _, rmse, _ in own]
        axes.plot(across, up, color=color, label=family, gid=f"family-{family}", **line)
        for ms, rmse, result in own:
            axes.plot([clock(result)["low"], clock(result)["high"]], [rmse, rmse], color=color, linewidth=1.0)
            if result["unsteady"]:
                axes.plot(ms, rmse, marker=marker, color=color, markerfacecolor="white", gid="unsteady")
        for rmse, result in bounds:
            if result["family"] == family:
                axes.axhline(rmse, color=color, linewidth=1.0, gid="bound")


def _places(
    axes: Any, results: Sequence[Result]
) -> tuple[list[tuple[float, float, Result]], list[tuple[float, Result]]]:
    """Return time and error of each point, and the error of each bound, which has no time.

    An error of 0 is drawn at the end of the axis.
    """
    least = axes.get_ylim()[0]
    found = [(max(rmse, least), r) for r in results if (rmse := metric(r, "world", "rmse")) is not None]
    points = [(clock(result)["median"], rmse, result) for rmse, result in found if timed(result)]
    return points, [(rmse, result) for rmse, result in found if not timed(result)]


def _scale(axes: Any, axis: str, low: float, high: float) -> None:
    """Make an axis logarithmic and name 1, 2 and 5 of each decade, or 1 alone of many decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set(**{f"{axis}scale": "log", f"{axis}lim": (low, high)})
    shown = getattr(axes, f"{axis}axis")
    shown.set_major_locator(LogLocator(subs=(1.0,) if math.log10(high / low) > 2.5 else (1.0, 2.0, 5.0), numticks=50))
    shown.set_minor_locator(NullLocator())
    shown.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _write(axes: Any, results: Sequence[Result]) -> None:
    """Name points and bounds, each beside it where no text covers a point or another text.

    Without such a place the text is left out; the table of the page has it too.
    """
    from matplotlib.transforms import Bbox

    points, bounds = _places(axes, results)
    axes.figure.draw_without_rendering()  # places all but the text
    at = axes.transData.transform([(ms, rmse) for ms, rmse, _ in points])
    taken = [Bbox.from_bounds(x - 4.0, y - 4.0, 8.0, 8.0) for x, y in at]
    inside = axes.get_window_extent()
    named: list[tuple[float, float, str, Any]] = [
        (axes.get_xlim()[1], rmse, short_name(result), (("right", -2, 2),)) for rmse, result in bounds
    ]
    named += [(ms, rmse, str(result["setting"]), _PLACES) for ms, rmse, result in points]
    for x, y, text, places in named:
        for align, *offset in places:
            label = axes.annotate(text, (x, y), offset, textcoords="offset points", ha=align, fontsize=8)
            box = label.get_window_extent()
            if inside.contains(box.x0, box.y0) and inside.contains(box.x1, box.y1) and not box.count_overlaps(taken):
                taken.append(box)
                break
            label.remove()
