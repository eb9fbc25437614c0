"""Cost of a pixel-sample, and gain of far more samples: as numbers and as tables."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from click import Command
from click.testing import CliRunner

from ssgi_cl.bench.experiments import cost, gain
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.ao.gtao import GtaoParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.context import Context

pytestmark = pytest.mark.usefixtures("own_store")


def test_gain_is_the_part_of_the_error_that_is_gone_with_the_most_samples(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = Context(runtime, cornell_box(), (30, 40))
    truth = np.full((30, 40), 0.5, np.float32)
    monkeypatch.setattr(context, "occlusion", lambda: Truth(truth, 0.0 * truth, 2, ""))

    def make(runtime: Runtime, size: tuple[int, int], params: GtaoParams) -> Any:
        assert (size, params.radius) == ((30, 40), context.radius)
        return lambda gbuffer: np.where(context.seen, truth + np.float32(0.5 / params.slices), 9.0)

    monkeypatch.setitem(gain.TECHNIQUES, "gtao", (make, GtaoParams))
    (found,) = gain.gains(context, ["gtao"], most=8)
    assert (found.technique, found.scene, found.most) == ("gtao", "cornell_box", 0.0625)
    assert found.usual == pytest.approx(0.5 / GtaoParams().slices)
    assert found.share == pytest.approx(1.0 - GtaoParams().slices / 8.0)


def test_a_table_of_gains_has_a_row_for_each_technique_and_scene() -> None:
    assert gain.table([gain.Gain("gtao", "hall", 0.08, 0.076)]).splitlines()[2:] == [
        "| gtao | hall | 0.0800 | 0.0760 | 5.0 % |"
    ]


@pytest.mark.slow
def test_every_technique_has_a_cost_at_every_place(runtime: Runtime) -> None:
    places = [((30, 40), 1.0), ((30, 40), 2.0), ((45, 60), 1.0)]
    found = cost.costs(cornell_box(), runtime, ["gtao", "hbao"], places, runs=4)
    assert [(one.size, one.radii, one.technique) for one in found] == [
        (*place, name) for place in places for name in ("gtao", "hbao")
    ]
    assert all(0.0 < one.ms < 1e3 for one in found)
    for one in found:
        # 36 samples in at most all pixels, of which the box fills more than a third.
        rows, columns = one.size
        all_pixels = 1e6 * one.ms / (36 * rows * columns)
        assert all_pixels <= one.ns < 3.0 * all_pixels


def test_a_table_has_a_row_for_each_technique_and_marks_what_is_unsteady() -> None:
    found = [
        cost.Cost("gtao", (600, 800), 1.0, 8.0, 0.5, ""),
        cost.Cost("hbao", (600, 800), 1.0, 9.0, 0.6, ""),
        cost.Cost("gtao", (600, 800), 2.0, 8.0, 0.55, "busy"),
        cost.Cost("hbao", (600, 800), 2.0, 9.0, 0.66, ""),
    ]
    assert cost.table(found).splitlines() == [
        "| ns a pixel-sample | 800 x 600, radius x 1 | 800 x 600, radius x 2 |",
        "|---|---:|---:|",
        "| gtao | 0.500 | 0.550~ |",
        "| hbao | 0.600 | 0.660 |",
    ]


@pytest.mark.parametrize("main", [cost.main, gain.main])
def test_an_unknown_scene_or_technique_is_refused_in_a_line(main: Command) -> None:
    shown = CliRunner().invoke(main, ["--scene", "attic"])
    assert shown.exit_code == 1
    assert shown.output.startswith("Error: scene is 'attic': expected a file or one of")
    assert CliRunner().invoke(main, ["--technique", "sao"]).exit_code == 2


@pytest.mark.slow  # every size up to 3840 x 2160
def test_the_command_prints_both_tables() -> None:
    shown = CliRunner().invoke(cost.main, ["--scene", "cornell_box", "--seconds", "0.01"])
    assert shown.exit_code == 0
    assert "3840 x 2160, radius x 1" in shown.output
    assert "800 x 600, radius x 4" in shown.output
