"""What known ends of surfaces are worth: as numbers and as a table."""

from __future__ import annotations

import pytest

from ssgi_cl.bench.experiments.thickness import Drawn, Worth, ratios, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.tuning.context import Context, TruthSettings

pytestmark = pytest.mark.usefixtures("own_store")


def test_table_has_geometric_means_and_the_scene_of_the_greatest_ratio() -> None:
    found = [Worth("a", 2, 0.01, 0.02, 0.01), Worth("b", 2, 0.04, 0.08, 0.16), Worth("a", 1, 0.5, 0.5, 0.25)]
    assert table(found).splitlines()[2:] == [
        "| 1 | 0.500 | 0.500 | 1.00 | 0.250 | 0.50 | 0.50 | a |",
        "| 2 | 0.0200 | 0.0400 | 2.00 | 0.0400 | 2.00 | 4.00 | b |",
    ]


def test_rods_in_a_closed_room_err_less_where_their_ends_are_known(runtime: Runtime) -> None:
    context = Context(runtime, make_scene("rods-302"), (60, 80), TruthSettings(rays=64))
    guessed, known = (Drawn(context, 1, thickness=given).error() for given in (False, True))
    assert known < 0.9 * guessed  # .78 at 320 x 240


def test_taps_are_those_of_known_ends_alone(runtime: Runtime) -> None:
    context = Context(runtime, make_scene("rods-302"), (30, 40), TruthSettings(rays=16))
    for given in (False, True):
        few, many = (Drawn(context, 1, thickness=given, taps=taps).error() for taps in (3, None))
        assert (few != many) == given


def test_ratios_are_positive(runtime: Runtime) -> None:
    context = Context(runtime, make_scene("rods-302"), (30, 40), TruthSettings(rays=16))
    assert all(ratio > 0.0 for ratio in ratios(context, 1))
