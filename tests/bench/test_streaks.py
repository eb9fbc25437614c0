"""Streaks of ambient occlusion: as numbers and as a table."""

from __future__ import annotations

import math

import pytest

from ssgi_cl.bench.experiments.streaks import FLOOR, SETTINGS, Streaks, found, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.tuning.context import Context


def test_table_has_means_and_leaves_out_views_without_smooth_surfaces() -> None:
    made = []
    for name in (FLOOR, *SETTINGS):
        pattern = math.nan if name == FLOOR else 0.02
        made += [Streaks(name, 0.1, 0.8, 0.04, 0.01, pattern), Streaks(name, 0.3, 0.9, math.nan, math.nan, math.nan)]
    lines = table(made).splitlines()
    assert lines[2] == "| rays against the layer | 0.200 | 0.850 | 0.0400 | 0.0100 | - |"
    assert lines[3] == "| blur radius 2 | 0.200 | 0.850 | 0.0400 | 0.0100 | 0.0200 |"


@pytest.mark.parametrize("technique", ["gtao", "bitmask_ao"])
def test_a_blur_that_cancels_the_tile_leaves_less_of_the_pattern(runtime: Runtime, technique: str) -> None:
    context = Context(runtime, make_scene("cornell_box").views()[0], (150, 200))
    by = {one.setting: one for one in found(context, technique, 0.15, 32)}
    assert list(by) == [FLOOR, *SETTINGS]
    assert by["blur radius 3 that cancels the tile"].pattern < by["blur radius 2"].pattern
    assert all(0.0 < one.error < 0.3 and 0.0 < one.ssim < 1.0 for one in by.values())
    # What the layer does not hold no setting tells.
    assert by[FLOOR].flip < min(by[name].flip for name in SETTINGS)
