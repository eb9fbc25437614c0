"""Cost of a pixel-sample, as numbers and as a table."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from ssgi_cl.bench.experiments.cost import Cost, costs, main, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box


@pytest.mark.slow
def test_every_technique_has_a_cost_at_every_place(runtime: Runtime) -> None:
    places = [((30, 40), 1.0), ((30, 40), 2.0), ((45, 60), 1.0)]
    found = costs(cornell_box(), runtime, ["gtao", "hbao"], places, runs=4)
    assert [(cost.size, cost.radii, cost.technique) for cost in found] == [
        (*place, name) for place in places for name in ("gtao", "hbao")
    ]
    assert all(0.0 < cost.ms < 1e3 for cost in found)
    for cost in found:
        # 36 samples in at most all pixels, of which the box fills more than a third.
        rows, columns = cost.size
        all_pixels = 1e6 * cost.ms / (36 * rows * columns)
        assert all_pixels <= cost.ns < 3.0 * all_pixels


def test_a_table_has_a_row_for_each_technique_and_marks_what_is_unsteady() -> None:
    found = [
        Cost("gtao", (600, 800), 1.0, 8.0, 0.5, ""),
        Cost("hbao", (600, 800), 1.0, 9.0, 0.6, ""),
        Cost("gtao", (600, 800), 2.0, 8.0, 0.55, "busy"),
        Cost("hbao", (600, 800), 2.0, 9.0, 0.66, ""),
    ]
    assert table(found).splitlines() == [
        "| ns a pixel-sample | 800 x 600, radius x 1 | 800 x 600, radius x 2 |",
        "|---|---:|---:|",
        "| gtao | 0.500 | 0.550~ |",
        "| hbao | 0.600 | 0.660 |",
    ]


def test_an_unknown_scene_or_technique_is_refused_in_a_line() -> None:
    shown = CliRunner().invoke(main, ["--scene", "attic"])
    assert shown.exit_code == 1
    assert shown.output.startswith("Error: scene is 'attic': expected a file or one of")
    assert CliRunner().invoke(main, ["--technique", "sao"]).exit_code == 2


@pytest.mark.slow  # every size up to 3840 x 2160
def test_the_command_prints_both_tables() -> None:
    shown = CliRunner().invoke(main, ["--scene", "cornell_box", "--seconds", "0.01"])
    assert shown.exit_code == 0
    assert "3840 x 2160, radius x 1" in shown.output
    assert "800 x 600, radius x 4" in shown.output
