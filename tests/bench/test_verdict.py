"""Verdicts on the rows of a group, held to the rows themselves."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ssgi_cl.bench.verdict import comparable, guides, leader, mark, verdict

from .documents import entry, spread, whole

STATIC = "The mesh does not move"
MOVING = "The mesh moves"
TOLD = re.compile(r"(\S+) \(RMSE (\S+), (\S+) ms\)")
RUN = re.compile(r"(this library|rays against the mesh) from (\S+) ms on, ")


def row(name: str, ms: float, rmse: float | None, **changes: Any) -> dict[str, Any]:
    """A result whose wall time is `ms`; that of the device is a tenth and must not count."""
    return entry(f"{name}.hall.8x6", rmse=rmse, wall_ms=spread(ms), device_ms=spread(0.1 * ms), **changes)


def is_own(name: str) -> bool:
    return not name.startswith(("embree", "mitsuba", "xegtao", "vtk"))


def time_of(result: dict[str, Any]) -> float:
    return float(result["wall_ms"]["median"])


def rmse_of(result: dict[str, Any]) -> float:
    return float(result["errors"]["world"]["rmse"])


def shown(value: float) -> float:
    """A number as a sentence has it: three digits, from 1000 on all before the point."""
    return float(f"{value:.3g}" if value < 999.5 else f"{value:.0f}")


def check(results: list[dict[str, Any]]) -> None:
    """Assert that no sentence contradicts a row, as far as three digits tell."""
    said = " ".join(verdict(results))
    by_name = {f"{r['family']}.{r['setting']}": r for r in results if r.get("timed", True)}
    for name, error, ms in TOLD.findall(said):
        assert float(error) == shown(rmse_of(by_name[name]))
        assert float(ms) == shown(time_of(by_name[name]))
    for case, moving in ((STATIC, False), (MOVING, True)):
        sentence = re.search(rf"{case} \(.*?\. Least error: .*?\.(?= [A-Z]|$)", said)
        if sentence is None:
            continue
        rows = [
            r
            for name, r in by_name.items()
            if is_own(name) or (not name.startswith(("xegtao", "vtk")) and ("moving" in name) == moving)
        ]
        runs = [(float(ms), side == "this library") for side, ms in RUN.findall(sentence[0])]
        for result in rows:
            within = [r for r in rows if time_of(r) <= time_of(result)]
            least = min(map(rmse_of, within))
            sides = {is_own(r["family"]) for r in within if rmse_of(r) == least}
            started = [run for run in runs if run[0] <= shown(time_of(result))]
            claimed = {started[-1][1]}
            if started[-1][0] == shown(time_of(result)) != time_of(result):  # but for rounding
                claimed |= {own for _, own in started[-2:]}
            assert claimed & sides, (sentence[0], result["name"])
    published = r"High setting: (\S+) .*? In that time(.*?)\.(?= [A-Z]|$)"
    for name, text in re.findall(published, said):
        others = [r for r in by_name.values() if time_of(r) <= time_of(by_name[name])]
        best = TOLD.search(text)
        found = rmse_of(by_name[best[1]]) if best else rmse_of(by_name[name])
        assert found == min(map(rmse_of, others))


NAMES = [
    "gtao.2x9",
    "gtao.4x9",
    "bitmask_ao.2x14",
    "bitmask_ao.2x14-4",
    "xegtao.high",
    "embree.1",
    "mitsuba-ao-blur.1",
    "mitsuba-ao-blur.4",
    "mitsuba-ao-moving-blur.1",
    "vtk-ssao.64",
]


@st.composite
def tables(draw: st.DrawFn) -> list[dict[str, Any]]:
    rows = []
    for name in draw(st.lists(st.sampled_from(NAMES), unique=True, min_size=1)):
        ms = float(draw(st.integers(1, 30)))
        rmse = draw(st.integers(1, 30)) / 100.0
        unsteady = draw(st.sampled_from(["", "the machine was busy"]))
        wide = draw(st.sampled_from([0.0, 0.1, 0.5]))
        rows.append(row(name, ms, rmse, unsteady=unsteady))
        rows[-1]["wall_ms"] = spread(ms, wide)
    return rows


@given(tables())
def test_no_sentence_and_no_cell_of_the_guide_contradicts_a_row(results: list[dict[str, Any]]) -> None:
    check(results)
    for case, (_, *rows) in guides(whole(*results)).items():
        allowed = {
            "There is no mesh": lambda name: is_own(name) or name.startswith("xegtao"),
            "The mesh does not move": lambda name: "moving" not in name,
            "The mesh moves": lambda name: not name.startswith(("embree", "mitsuba")) or "moving" in name,
        }[case]
        for ms, cell in rows:
            errors = [rmse_of(r) for r in results if allowed(r["family"]) and time_of(r) <= float(ms)]
            assert (cell == "-") == (not errors)
            if errors:
                assert float(cell.split()[1]) == pytest.approx(min(errors))


def test_a_dearer_and_worse_row_is_not_called_best_because_the_better_one_is_unsteady() -> None:
    rows = [
        row("bitmask_ao.2x14-4", 79.3, 0.0935),
        row("mitsuba-ao-blur.4", 132.0, 0.0669),
        row("mitsuba-ao-blur.1", 63.0, 0.0923, unsteady="the machine was busy"),
    ]
    assert verdict(rows) == [
        "The mesh does not move (tree built once, not counted). Least error: rays against the mesh "
        "from 63.0 ms on, mitsuba-ao-blur.1 (RMSE 0.0923, 63.0 ms) to mitsuba-ao-blur.4 (RMSE 0.0669, 132 ms)."
    ]
    check(rows)


def test_sides_that_change_are_told_in_turn() -> None:
    rows = [
        row("gtao.2x9", 3.0, 0.2),
        row("embree.1", 10.0, 0.1),
        row("bitmask_ao.2x14", 20.0, 0.05),
        row("mitsuba-ao-blur.4", 90.0, 0.04),
        row("floor.1", 0.0, 0.01, timed=False),
    ]
    assert RUN.findall(*verdict(rows)) == [
        ("this library", "3.00"),
        ("rays against the mesh", "10.0"),
        ("this library", "20.0"),
        ("rays against the mesh", "90.0"),
    ]


def test_times_that_overlap_are_called_so() -> None:
    apart = [row("gtao.2x9", 10.0, 0.2), row("embree.1", 11.0, 0.1)]
    assert "overlap" not in verdict(apart)[0]
    close = [dict(apart[0], wall_ms=spread(10.0, 0.2)), apart[1]]
    assert verdict(close)[0].endswith("Their times overlap, so that their order is not certain: gtao.2x9 and embree.1.")
    # Beaten, but by one that may be slower.
    beaten = [row("embree.1", 10.0, 0.1), dict(row("gtao.2x9", 11.0, 0.2), wall_ms=spread(11, 0.2))]
    assert "not certain: embree.1 and gtao.2x9." in verdict(beaten)[0]


def test_a_moving_mesh_is_told_of_with_its_own_rays_alone() -> None:
    rows = [row("gtao.2x9", 3.0, 0.2), row("mitsuba-ao-blur.1", 2.0, 0.1), row("mitsuba-ao-moving-blur.1", 50.0, 0.1)]
    still, moving = verdict(rows)
    assert "rays against the mesh from 2.00 ms on" in still
    assert "this library" not in still
    assert RUN.findall(moving) == [("this library", "3.00"), ("rays against the mesh", "50.0")]


def test_a_published_setting_is_held_to_every_row_that_is_no_slower() -> None:
    published = row("xegtao.high", 10.0, 0.08)
    assert verdict([published, row("gtao.2x9", 9.0, 0.07), row("gtao.4x9", 10.4, 0.01)]) == [
        "XeGTAO's High setting: xegtao.high (RMSE 0.0800, 10.0 ms). In that time gtao.2x9 (RMSE 0.0700, 9.00 ms) "
        "has the least error."
    ]
    assert "no row has less error" in verdict([published, row("gtao.2x9", 9.0, 0.09)])[0]
    assert verdict([published]) == []


def test_without_rays_or_without_ours_nothing_is_said() -> None:
    assert verdict([row("embree.1", 10.0, 0.4)]) == []
    assert verdict([row("ssao.4", 1.0, 0.4)]) == []
    assert verdict([row("embree.1", 10.0, 0.4), row("ssao.4", 1.0, None)]) == []


def test_the_leader_is_the_fastest_of_those_with_the_least_error() -> None:
    rows = comparable([row("a.1", 5.0, 0.1), row("b.1", 4.0, 0.1), row("c.1", 9.0, 0.01)])
    assert leader(rows, 5.0)["family"] == "b"
    assert leader(rows, 3.0) is None


# ---- the front


def marked(results: list[dict[str, Any]]) -> list[str]:
    mark(results)
    return [result["setting"] for result in results if result["front"]]


def case(setting: str, ms: float, rmse: float | None, **changes: Any) -> dict[str, Any]:
    return entry(f"a.{setting}.hall.8x6", ms, rmse, **changes)


@pytest.mark.parametrize(
    ("results", "front"),
    [
        (
            [case("slow", 9.0, 0.01), case("beaten", 5.0, 0.3), case("fast", 1.0, 0.4), case("middle", 4.0, 0.2)],
            ["slow", "fast", "middle"],
        ),
        ([case("slow", 9.0, 0.01), case("worst", 10.0, 0.5)], ["slow"]),
        ([case("a", 1.0, 0.2), case("b", 1.0, 0.2), case("c", 2.0, 0.1), case("d", 2.0, 0.1)], ["a", "b", "c", "d"]),
        ([case("a", 1.0, 0.2), case("as bad in more time", 2.0, 0.2), case("worse in as much", 1.0, 0.3)], ["a"]),
        ([case("no error", 0.5, None), case("a", 1.0, 0.2), case("none at all", 0.1, 0.1, errors={})], ["a"]),
        ([case("a pass", 1.0, 0.2, quantity="")], []),
        ([case("y", 2.0, 0.2), entry("a.x.box.8x6", 1.0, 0.1)], ["y", "x"]),
        ([case("y", 2.0, 0.2), entry("a.x.hall.6x8", 1.0, 0.1)], ["y", "x"]),
        ([case("y", 2.0, 0.2), case("x", 1.0, 0.1, quantity="direct")], ["y", "x"]),
        ([case("by the wall", 2.0, 0.2, device_ms=spread(0.1)), case("fast", 1.0, 0.1, device_ms=None)], ["fast"]),
        ([case("exact", 1.0, 0.0), case("marked before", 2.0, 0.0, front=True)], ["exact"]),
        ([case("busy", 1.0, 0.1, unsteady="the machine was busy"), case("sure", 2.0, 0.2)], ["busy"]),
        ([], []),
    ],
)
def test_what_nothing_of_its_group_beats_is_on_the_front(results: list[dict[str, Any]], front: list[str]) -> None:
    assert marked(results) == front


def test_what_is_beaten_only_by_results_that_overlap_with_it_in_time_is_near() -> None:
    wide = {"median": 2.2, "low": 1.9, "high": 2.6}
    results = [case("best", 2.0, 0.1), case("near", 2.2, 0.2, wall_ms=wide), case("beaten", 2.2, 0.3)]
    assert marked(results) == ["best"]
    assert [result["setting"] for result in results if result["near"]] == ["near"]
