"""Streaks of GTAO: as numbers and as a table."""

from __future__ import annotations

import math

from ssgi_cl.bench.experiments.streaks import SETTINGS, Streaks, found, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.tuning.context import Context


def test_table_has_means_and_leaves_out_views_without_smooth_surfaces() -> None:
    made = []
    for name in SETTINGS:
        made += [Streaks(name, 0.1, 0.8, 0.01, 0.02), Streaks(name, 0.3, 0.9, math.nan, math.nan)]
    assert table(made).splitlines()[2] == "| blur radius 2 | 0.200 | 0.850 | 0.0100 | 0.0200 |"


def test_a_blur_that_cancels_the_tile_leaves_less_of_the_pattern(runtime: Runtime) -> None:
    context = Context(runtime, make_scene("cornell_box").views()[0], (150, 200))
    by = {one.setting: one for one in found(context, 0.15, 32)}
    assert list(by) == list(SETTINGS)
    assert by["blur radius 3 that cancels the tile"].pattern < by["blur radius 2"].pattern
    assert all(0.0 < one.error < 0.3 and 0.0 < one.ssim < 1.0 for one in by.values())
