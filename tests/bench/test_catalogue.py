"""Every technique is measured, called and shown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ssgi_cl.bench import calls, cases
from ssgi_cl.bench.experiments import defaults
from ssgi_cl.techniques.catalogue import CATALOGUE, TECHNIQUES
from ssgi_cl.techniques.technique import Bench
from tools.figures import tables


def test_every_technique_is_measured_called_and_shown() -> None:
    assert set(TECHNIQUES) <= set(cases.FAMILIES)
    for name, each in CATALOGUE.items():
        assert set(each.bench.families) <= set(cases.FAMILIES), name
        for _, figures in each.bench.rows.values():
            shown = {case.split(".")[0] for _, case in figures}
            assert shown <= set(cases.FAMILIES), name
        assert each.kind == "ao" or getattr(calls, each.function.__name__, None) is each.function, name
    assert {name.replace("_", " ") for name in CATALOGUE if CATALOGUE[name].kind == "ao"} <= set(calls.CALLS)
    assert set(defaults.SCANS) == {"shadow_map", "vpl_splat", "multires_splat", "ssdo_views"}


def test_a_technique_has_rows_and_a_page_by_its_descriptor_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    before = tables.rows()
    assert [call for call, _, _ in before] == list(tables.ORDER)
    new = replace(CATALOGUE["ssao"], name="new", bench=Bench(rows={"new": ("what", (("", "ssao.4"),))}))
    monkeypatch.setitem(CATALOGUE, "new", new)
    assert tables.rows() == [*before, ("new", "what", (("", "ssao.4"),))]
