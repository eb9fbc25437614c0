"""The plot of a group of results."""

from __future__ import annotations

import re

import pytest

from ssgi_cl.bench import plot

from .documents import entry


def test_axis_names_values_within_and_puts_zero_at_its_low_end() -> None:
    axis = plot.Axis.over([0.0, 0.02, 0.5], 0.0, 100.0)
    assert axis.ticks() == pytest.approx([0.02, 0.05, 0.1, 0.2, 0.5])
    assert axis.at(0.0) == 0.0
    assert 0.0 < axis.at(0.02) < axis.at(0.1) < axis.at(0.5) < 100.0
    assert len(plot.Axis.over([3.0], 0.0, 100.0).ticks()) >= 2
    assert plot.Axis.over([1e-6, 1e3], 0.0, 100.0).ticks() == pytest.approx([10.0**power for power in range(-6, 4)])


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
    drawn = plot.plot(results, plot.looks(["a"], []), "a", "occlusion")
    line = re.search(r'class="line c0" d="M([^"]*)"', drawn)
    assert line
    across = [float(point.split()[0]) for point in line[1].split("L")]
    assert [sorted(across).index(x) for x in across] == order


def test_peers_are_dashed_and_unsteady_points_hollow() -> None:
    results = [
        entry("a.1.hall.8x6", 1.0),
        entry("a.2.hall.8x6", 2.0, 0.04, unsteady="it jumps"),
        entry("b.1.hall.8x6", 3.0),
        entry("b.2.hall.8x6", 4.0, 0.04),
    ]
    drawn = plot.plot(results, plot.looks(["a", "b"], ["b"]), "t", "occlusion")
    assert 'class="line c0"' in drawn
    assert 'class="line dashed c1"' in drawn
    assert drawn.count("point unsteady") == 1
    assert "unsteady: it jumps" in drawn


def test_labels_cover_neither_points_nor_each_other() -> None:
    points = [(300.0 + 4.0 * i, 200.0 + 3.0 * i, f"{i}-half") for i in range(20)]
    placed = [text for text in plot._labels(points) if text]
    assert 2 <= len(placed) < 20  # the rest has its title alone
    spots = []
    for text in placed:
        found = re.match(r'<text x="([\d.]+)" y="([\d.]+)" class="(\w+)">(.*)</text>', text)
        assert found
        wide = 6.4 * len(found[4])
        left = float(found[1]) - {"start": 0.0, "middle": 0.5, "end": 1.0}[found[3]] * wide
        spots.append((left, float(found[2]) - 9.0, left + wide, float(found[2]) + 2.0))
    for i, spot in enumerate(spots):
        assert not plot._overlaps(spot, spots[:i])
