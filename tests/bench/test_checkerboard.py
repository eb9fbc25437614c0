"""Error over time of scans of every other pixel: as numbers and as a table."""

from __future__ import annotations

import pytest

from ssgi_cl.bench.experiments.checkerboard import SETTINGS, Found, found, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.tuning.context import Context, TruthSettings

pytestmark = pytest.mark.usefixtures("own_store")


def test_table_has_means_of_ratios_and_the_greatest_error() -> None:
    made = []
    for name in SETTINGS:
        error, ms = (0.02, 2.0) if name == "bitmask_ao" else (0.04, 4.0)
        alone = 1.0 if name == "gtao" else ms
        made += [Found(name, "a", error, alone, 2.0 * alone), Found(name, "b", 4.0 * error, 1.0, 3.0)]
    head, _, *rows = table(made).splitlines()
    assert "| greatest | greatest of the best's |" in head
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(SETTINGS)
    assert "| gtao | 0.0800 | 2.000 | 2.00 | 2.00 | 1.00 | 1.00 |" in rows
    assert "| bitmask_ao | 0.0400 | 1.000 | 1.00 | 1.00 | 1.41 | 1.41 |" in rows


def test_every_setting_of_a_view_is_measured(runtime: Runtime) -> None:
    context = Context(runtime, make_scene("rods-302"), (60, 80), TruthSettings(rays=64))
    all_found = found(context, 1)
    assert [one.setting for one in all_found] == list(SETTINGS)
    assert all(one.ms > 0.0 and 0.01 < one.error < 0.2 for one in all_found)
    errors = {one.setting: one.error for one in all_found}
    assert errors["bitmask_ao, checkerboard"] != errors["bitmask_ao"]
    assert errors["bitmask_ao, thickness"] < errors["bitmask_ao"]
    assert all(one.drawn_ms > one.ms for one in all_found)
