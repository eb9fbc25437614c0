"""The plot of a group of results."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET

import pytest

from ssgi_cl.bench import plot
from ssgi_cl.core.errors import MissingExtraError

from .documents import entry, marked, path_points, texts

pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plots')")


def test_limits_hold_all_values_above_zero_with_room() -> None:
    low, high = plot.limits([0.0, 0.02, 0.5])
    assert 0.01 < low < 0.02
    assert 0.5 < high < 1.0
    low, high = plot.limits([3.0])
    assert high / low == pytest.approx(10.0**0.48)
    assert plot.limits([0.0]) == pytest.approx((10.0**-0.24, 10.0**0.24))


@pytest.mark.parametrize(
    ("settings", "order"),
    [
        # Numbers by their value, whatever the time: 16 is the slowest here.
        (["4", "64", "16"], [0, 2, 1]),
        # Names by time.
        (["low", "high", "ultra"], [0, 1, 2]),
    ],
)
def test_settings_are_joined_in_their_order(settings: list[str], order: list[int]) -> None:
    times = [1.0, 2.0, 4.0]
    results = [entry(f"a.{s}.hall.8x6", t) for s, t in zip(settings, times, strict=True)]
    root = ET.fromstring(plot.plot(results, plot.looks(["a"], []), "a", "occlusion"))
    (line,) = marked(root, "family-a")
    across = [x for x, _ in path_points(line)]
    assert [sorted(across).index(x) for x in across] == order


def test_peers_are_dashed_unsteady_points_hollow_and_an_error_of_zero_at_the_end_of_the_axis() -> None:
    results = [
        entry("a.1.hall.8x6", 1.0),
        entry("a.2.hall.8x6", 2.0, 0.0, unsteady="it jumps"),
        entry("b.1.hall.8x6", 3.0),
        entry("b.2.hall.8x6", 4.0, 0.04),
    ]
    root = ET.fromstring(plot.plot(results, plot.looks(["a", "b"], ["b"]), "t", "occlusion"))
    lines = [marked(root, f"family-{name}")[0] for name in "ab"]
    assert ["stroke-dasharray" in ET.tostring(line, "unicode") for line in lines] == [False, True]
    assert len(marked(root, "unsteady")) == 1
    (_, high), (_, low) = path_points(lines[0])
    assert 0.0 < high < low < 400.0  # y goes down


def test_a_plot_has_a_title_axes_and_a_legend_and_is_the_same_every_time() -> None:
    results = [entry("a.1.hall.8x6", 1.0, 0.2), entry("b.few.hall.8x6", 2.0, 0.05, front=True)]
    drawn = plot.plot(results, plot.looks(["a", "b"], []), "Bounce <1>", "bounce")
    root = ET.fromstring(drawn)
    written = texts(root)
    assert {"Bounce <1>: RMSE over time, both logarithmic", "a", "b", "1", "few", "2", "0.1"} <= set(written)
    assert "median time, ms" in written
    assert "RMSE against the world, W/m²" in written
    assert len(marked(root, "front")) == 1
    assert drawn == plot.plot(results, plot.looks(["a", "b"], []), "Bounce <1>", "bounce")


def test_labels_that_would_cover_points_or_each_other_are_left_out() -> None:
    results = [entry(f"a.{i}-half.hall.8x6", 2.0 + 0.02 * i, 0.05 + 0.0005 * i) for i in range(20)]
    written = texts(ET.fromstring(plot.plot(results, plot.looks(["a"], []), "t", "occlusion")))
    assert 2 <= sum(text.endswith("-half") for text in written) < 20


def test_without_matplotlib_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'ssgi-cl\[plots\]'"):
        plot.plot([entry()], plot.looks(["ssao"], []), "t", "occlusion")
    assert plot.plot([], {}, "t", "occlusion") == ""
