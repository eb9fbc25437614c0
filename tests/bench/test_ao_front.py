"""Record of the settings that `ssgi_cl.ao` chooses from beside presets: errors of each, times over those of GTAO."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import ssgi_cl as gi
from ssgi_cl.bench import ao_front as module
from ssgi_cl.bench.ao_front import Setting, drawing, settings_of, times
from ssgi_cl.bench.scene_sets import OVERSCAN, SETS, SceneSets
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.presets.front import scans
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.trials import geometric_mean

from .documents import boxes

SETTINGS = (Setting("gtao", {"slices": 1}), Setting("bitmask_ao", {"slices": 3}, thickness=True))


@pytest.fixture
def sets(runtime: Runtime, own_store: Path, monkeypatch: pytest.MonkeyPatch) -> SceneSets:
    pytest.importorskip("embreex")
    monkeypatch.setattr(module, "SETTINGS", SETTINGS)
    chosen = {name: [boxes(f"{name} {i}", 0.3 + 0.3 * i) for i in range(2)] for name in SETS}
    return SceneSets(runtime, chosen=chosen, size=(24, 32), rays=64)


def said(monkeypatch: pytest.MonkeyPatch, *ms: float) -> None:
    """Say that runs take so long, one after the other."""
    clock = itertools.cycle(ms)

    def taken_ms(runtime: Runtime, run: Callable[[], object]) -> float:
        with runtime.frame():
            run()
        return next(clock)

    monkeypatch.setattr(module, "taken_ms", taken_ms)


def test_a_setting_has_its_errors_and_its_time_over_that_of_gtao(
    sets: SceneSets, monkeypatch: pytest.MonkeyPatch
) -> None:
    said(monkeypatch, 2.0, 3.0, 8.0)  # the defaults of GTAO, then the settings
    ratios = times(sets.contexts["tuning"], SETTINGS, 2, 3)
    first, second = settings_of(sets, 2, ratios)
    assert (first["times"], second["times"]) == (1.5, 4.0)
    assert (second["technique"], second["layers"], second["thickness"]) == ("bitmask_ao", 2, True)
    assert second["parameters"] == {"slices": 3}
    for key, of, overscan in (
        ("error", "tuning", OVERSCAN),
        ("error_cut", "tuning", 0.0),
        ("validation", "validation", OVERSCAN),
    ):
        found = []
        for context in sets.contexts[of]:
            gbuffer = context.layered(2, overscan, thickness=True)
            a = gi.bitmask_ao(gbuffer, radius=context.radius, slices=3)
            found.append(metrics.rmse(a, context.occlusion().mean, context.seen))
        assert second[key] == pytest.approx(geometric_mean(found), rel=1e-3), key  # four digits are recorded


def test_drawing_is_timed_over_the_defaults_of_gtao(sets: SceneSets, monkeypatch: pytest.MonkeyPatch) -> None:
    said(monkeypatch, 2.0, 4.0, 5.0)
    assert drawing(sets.contexts["tuning"], 2, 0.0, 2) == (2.0, 2.5)


def test_the_record_has_each_setting_for_each_number_of_layers() -> None:
    known: list[dict[str, Any]] = scans()["settings"]
    every = [(s.technique, dict(s.parameters), s.thickness, n) for n in module.LAYERS for s in module.SETTINGS]
    assert [(e["technique"], e["parameters"], e["thickness"], e["layers"]) for e in known] == every
    assert {len(scenes) for scenes in scans()["scenes"].values()} == {14}
    kinds = [(each["layers"], each["overscan"]) for each in scans()["drawn"]]
    assert kinds == [(layers, overscan) for layers in module.LAYERS for overscan in (0.0, OVERSCAN)]
