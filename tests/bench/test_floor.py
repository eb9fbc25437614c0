"""The floor as a family of cases: a bound without a time."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import pytest

from ssgi_cl.bench import suite, summary, table
from ssgi_cl.bench.plot import looks, plot
from ssgi_cl.bench.verdict import mark
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.tuning.case import Case
from ssgi_cl.tuning.context import TruthSettings

from .documents import entry, marked, path_points, printed, texts, whole

pytestmark = pytest.mark.usefixtures("own_store")

pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")

FLOOR = {"timed": False, "device_ms": None}


def test_more_layers_have_a_lower_floor_and_no_time(runtime: Runtime) -> None:
    cases = [Case("floor", setting, "cornell_box", (45, 60)) for setting in ("1", "4-10")]
    found = suite.measure(cases, {"cornell_box": cornell_box()}, runtime, truths=TruthSettings(rays=64), runs=4)
    assert found.skipped == []
    one, four = found.results
    assert not one["timed"]
    assert one["errors"]["world"]["rmse"] > 1.3 * four["errors"]["world"]["rmse"] > 0.0
    assert sorted(found.pictures) == sorted(case.name for case in cases)


def documented() -> list[dict[str, Any]]:
    results = [
        entry("floor.1.hall.8x6", 0.0, 0.07, **FLOOR),
        entry("floor.2.hall.8x6", 0.0, 0.03, **FLOOR),
        entry("gtao.2x9.hall.8x6", 2.0, 0.08),
        entry("embree.16.hall.8x6", 9.0, 0.05),
    ]
    mark(results)
    return results


def test_a_floor_is_not_on_the_front_but_a_level_line_in_the_plot() -> None:
    results = documented()
    assert [result["front"] for result in results] == [False, False, True, True]
    drawn = plot(results, looks(["embree", "floor", "gtao"], ["embree"]), "title", "occlusion")
    root = ET.fromstring(drawn)
    assert len(marked(root, "bound")) == 2
    assert {"floor.1", "floor.2"} <= set(texts(root))
    (level,) = {y for _, y in path_points(marked(root, "bound")[0])}
    ((_, gtao),) = path_points(marked(root, "family-gtao")[0])
    assert gtao < level  # y goes down: gtao has more error than the floor
    assert plot(results[:2], looks(["floor"], []), "title", "occlusion") == ""


def test_a_floor_has_errors_and_no_time_in_every_table(tmp_path: Any) -> None:
    document = whole(*documented())
    (shown,) = (line for line in printed(table.show, document, 140).splitlines() if "floor.1" in line)
    assert shown.split()[:3] == ["floor.1", "-", "-"]
    assert "0.0700" in shown
    page, *_ = summary.write(tmp_path / "page.md", document, {})
    assert "| floor.1 | - | - | - | 0.0700 |" in page.read_text(encoding="utf-8")
