"""What is measured, called and shown is found without lists: a new module is enough."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from ssgi_cl.bench import calls, cases, figure_tables
from ssgi_cl.bench.discover import declared
from ssgi_cl.bench.experiments import defaults
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.technique import Bench


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package of three modules, one of which declares nothing."""
    folder = tmp_path / "found_here"
    folder.mkdir()
    texts = {"__init__": "", "b": "PARTS = {'b': 1}", "a": "PARTS = {'a': 2}", "other": ""}
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield folder
    for name in [name for name in sys.modules if name.split(".")[0] == "found_here"]:
        del sys.modules[name]


def test_modules_are_joined_in_order_and_others_by_name(package: Path) -> None:
    assert list(declared("found_here", "PARTS").items()) == [("a", 2), ("b", 1)]
    assert list(declared("found_here", "PARTS", ("b",))) == ["b", "a"]
    assert list(declared("found_here", "PARTS", prefix="b")) == ["b"]
    (package / "a_new_one.py").write_text("PARTS = {'new': 3}")
    assert list(declared("found_here", "PARTS", ("b", "a"))) == ["b", "a", "new"]


def test_what_is_declared_twice_or_missing_is_an_error(package: Path) -> None:
    with pytest.raises(ValueError, match="order names 'c': found_here has no such module"):
        declared("found_here", "PARTS", ("a", "c"))
    (package / "again.py").write_text("PARTS = {'b': 3}")
    with pytest.raises(ValueError, match=r"PARTS of found_here.b: 'b' is declared already"):
        declared("found_here", "PARTS")


def test_every_technique_is_measured_called_and_shown() -> None:
    for name, each in CATALOGUE.items():
        assert set(each.bench.families) <= set(cases.FAMILIES), name
        for _, figures in each.bench.rows.values():
            shown = {case.split(".")[0] for _, case in figures}
            assert shown <= set(cases.FAMILIES), name
        stem = each.function.__module__.rpartition(".")[2]
        assert each.kind == "ao" or (Path(calls.__path__[0]) / f"{stem}.py").exists(), name
    assert {name.replace("_", " ") for name in CATALOGUE if CATALOGUE[name].kind == "ao"} <= set(calls.CALLS)
    assert set(defaults.SCANS) == {"shadow_map", "vpl_splat", "multires_splat", "ssdo_views"}


def test_a_technique_has_rows_and_a_page_by_its_descriptor_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    before = figure_tables.rows()
    assert [call for call, _, _ in before] == list(figure_tables.ORDER)
    new = replace(CATALOGUE["ssao"], name="new", bench=Bench(rows={"new": ("what", (("", "ssao.4"),))}))
    monkeypatch.setitem(CATALOGUE, "new", new)
    assert figure_tables.rows() == [*before, ("new", "what", (("", "ssao.4"),))]
