"""Calibration of confidence: counted and as a table."""

from __future__ import annotations

from itertools import pairwise

import pytest

from ssgi_cl.bench.experiments.confidence import LAYERS, SURE, Counted, counted, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.tuning.context import Context, TruthSettings

pytestmark = pytest.mark.usefixtures("own_store")


def test_table_is_over_the_pixels_of_all_views() -> None:
    found = [Counted("gtao", 2, 0.9, 30, 100, 0.03), Counted("gtao", 2, 0.9, 10, 100, 0.01)]
    assert table(found).splitlines()[2:] == ["| gtao | 2 | 20% | 0.0316 |"]
    assert table([Counted("gtao", 2, 0.9, 0, 100, 0.0)]).splitlines()[2:] == ["| gtao | 2 | 0% | - |"]


def test_more_confidence_is_of_fewer_pixels(runtime: Runtime) -> None:
    found = list(counted(Context(runtime, make_scene("rods-302"), (30, 40), TruthSettings(rays=16))))
    assert len(found) == len(LAYERS) * len(of_kind("ao")) * len(SURE)
    for one, other in pairwise(found):
        if (one.technique, one.layers) == (other.technique, other.layers):
            assert one.pixels >= other.pixels
