"""The scan of constants: what it measures beside ambient occlusion, and which settings it marks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.bench import scene_sets
from ssgi_cl.bench.experiments import scan_lights, scan_views
from ssgi_cl.bench.experiments.defaults import SCANS, front, scan_work, work_table
from ssgi_cl.bench.experiments.scan import Measured, Scan, replaced
from ssgi_cl.bench.experiments.scan_lights import multires_errors, splat_errors
from ssgi_cl.bench.experiments.scan_shadows import shadow_errors
from ssgi_cl.bench.experiments.scan_views import view_errors
from ssgi_cl.bench.scene_sets import SETS, SceneSets
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.direct import shade as reference
from ssgi_cl.techniques.multires import multires_grid
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.context import Context, TruthSettings

pytestmark = pytest.mark.usefixtures("own_store")

SIZE = (45, 60)


@pytest.fixture
def box(runtime: Runtime) -> Context:
    return Context(runtime, BUILTIN_SCENES["cornell_box"](), SIZE, TruthSettings(paths=16))


@pytest.fixture(scope="module")
def hall(runtime: Runtime) -> Context:
    """Curved surfaces, on which corners fit by halves."""
    return Context(runtime, BUILTIN_SCENES["hall"](), (90, 120))


def test_replaced_constants_come_back_and_unknown_ones_are_named() -> None:
    before = multires_grid.BEGINS
    with replaced(multires_grid, {"begins": 0.5}):
        assert multires_grid.BEGINS == 0.5
    assert before == multires_grid.BEGINS
    with (
        pytest.raises(ValueError, match=r"constant is 'magic': ssgi_cl.*multires_grid"),
        replaced(multires_grid, {"magic": 1}),
    ):
        pass


@pytest.mark.slow
def test_shadow_error_is_that_of_the_kernel_against_rays(box: Context, runtime: Runtime) -> None:
    pytest.importorskip("embreex")
    found = shadow_errors(box, {})
    # The same by the kernel and by path tracing's direct light, which is exact.
    (light,) = box.punctual_lights
    white = gi.GBuffer(
        camera=box.camera,
        depth=box.host_gbuffer.depth,
        normal=box.host_gbuffer.normal,
        albedo=np.ones((*SIZE, 3), np.float32),
    )
    rsm = gi.rasterize.rsm(box.view.scene, light, size=1024, runtime=runtime)
    full, dimmed = (gi.shade(white, [light], shadow_maps=rsms, runtime=runtime)[..., 0] for rsms in (None, [rsm]))
    lit = (full > 0) & box.seen
    pytest.importorskip("mitsuba")
    truth = box.direct().mean[..., 0][lit] > 0.0
    off = dimmed[lit] / full[lit] - truth
    # Measured: equal to 4 digits; a ray that starts at an edge may tell otherwise.
    assert found.error == pytest.approx(float(np.sqrt(np.mean(off**2))), rel=0.02)
    assert 0.0 < found.beside < 5.0


def test_wider_shadow_filter_errs_more(box: Context) -> None:
    pytest.importorskip("embreex")
    narrow, usual, wide = (shadow_errors(box, {"reach": reach}) for reach in (0, 1, 3))
    assert narrow.error < usual.error < wide.error
    assert usual == shadow_errors(box, {"reach": reference.REACH})
    assert 0.0 < usual.beside < 5.0
    assert usual.error**2 > 0.25 * usual.beside / 100.0  # wrong pixels are off by more than a half
    # The kernel's is held to the reference's by tests/techniques/direct/test_shade_shadows.py.
    assert reference.REACH == 1


def test_lights_looked_at_are_counted(box: Context) -> None:
    all_ = splat_errors(box, {"cutoff": 0.0})
    # Each pixel looks at the lights that face its tile, of the 1024: most do in a box.
    assert all_.error == pytest.approx(0.0, abs=1e-4)
    assert 512.0 < all_.beside <= 1024.0
    kept = splat_errors(box, {"cutoff": 6.0, "restore": False})
    restored = splat_errors(box, {"cutoff": 6.0})
    assert kept.beside < 0.9 * all_.beside
    # A sixteenth of the lights, 64, put back what is left out.
    assert kept.beside < restored.beside <= kept.beside + 64.0
    assert 0.0 < restored.error < kept.error
    coarser = splat_errors(box, {"cutoff": 6.0, "coarser": 64})
    assert coarser.beside <= kept.beside + 16.0
    assert coarser.error > restored.error


@pytest.mark.slow
def test_lights_looked_at_at_few_points_are_those_of_all_levels(box: Context) -> None:
    # All points are computed and nothing stands for several lights: those that face each group.
    every = multires_errors(box, {"coarsest": 1, "interpolation_error": 0.0, "light_error": 0.0})
    assert every.error == pytest.approx(0.0, abs=1e-3)
    assert 512.0 < every.beside <= 1.1 * 1024.0
    usual = multires_errors(box, {})
    # Of 45 x 60 pixels most are next to an edge.
    assert 100.0 < usual.beside < 0.8 * every.beside
    assert 0.0 < usual.error < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("name", scan_lights.GRID_CONSTANTS)
def test_every_constant_of_the_grid_reaches_the_kernels(hall: Context, name: str) -> None:
    usual = getattr(multires_grid, name.upper())
    assert multires_errors(hall, {name: 2.0 * usual}) != multires_errors(hall, {})
    assert usual == getattr(multires_grid, name.upper())


def test_taps_of_auxiliary_views_are_counted(box: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    bounce = np.where(box.seen[..., None], np.linspace(0.5, 1.5, SIZE[1])[:, None], 9.0).repeat(3, axis=-1)
    monkeypatch.setattr(box, "bounce", lambda: Truth(bounce, np.zeros_like(bounce), 2, ""))
    monkeypatch.setattr(scan_views, "_bounce", lambda context, params, cameras: bounce + 0.1 * (params.view_taps == 4))
    few, many, none = (view_errors(box, given) for given in ({"view_taps": 4}, {"view_taps": 16}, {"cameras": 0}))
    slices = SsdoParams().slices
    # Of two cameras: 2 directions of 4 taps, 4 directions of 16 taps.
    assert (few.beside, many.beside, none.beside) == (2 * slices * 2 * 4, 2 * slices * 4 * 16, 0)
    assert few.error == pytest.approx(10.0 / bounce[box.seen].mean())
    assert many.error == 0.0


@pytest.mark.slow
def test_taps_of_auxiliary_views_change_the_bounce(box: Context) -> None:
    pytest.importorskip("mitsuba")
    few, many = (view_errors(box, {"view_taps": taps}) for taps in (4, 16))
    assert few.error != many.error
    assert 0.0 < many.error < 100.0


def test_scan_takes_the_means_of_each_set_and_marks_the_front(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    sets = SceneSets(runtime, chosen={name: [view, view] for name in SETS}, size=SIZE)
    errors = iter([2.0, 8.0, 1.0, 1.0, 3.0, 3.0, 1.0, 4.0, 0.0, 1.0, 1.0, 1.0])

    def measure(context: Context, values: Mapping[str, Any]) -> Measured:
        return Measured(next(errors), 10.0 * values.get("n", 2))

    way = Scan(measure, "error", "work")
    first, second = scan_work(way, [{}, {"n": 1}], sets)
    assert first["tuning"].error == pytest.approx(4.0)
    assert first["reporting"] == Measured(pytest.approx(3.0), 20.0)
    assert second["tuning"] == Measured(pytest.approx(2.0), 10.0)
    assert second["validation"].error == pytest.approx(1e-3)  # of an error of 0, 1e-6
    assert front([first, second], "tuning") == [False, True]
    monkeypatch.setitem(SCANS, "shadow_map", Scan(lambda *_: Measured(2.0, 1.0), "e", "w"))
    table = work_table("shadow_map", [{}, {"reach": 3}], sets)
    assert [str(cell) for cell in table.columns[0].cells] == ["defaults", "reach 3"]
    assert [str(cell) for cell in table.columns[1].cells] == ["2.0000 (100.0), 1"] * 2


def test_sets_are_of_the_kinds_that_are_asked_for(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    box = BUILTIN_SCENES["cornell_box"]()
    monkeypatch.setattr(scene_sets, "views_of", lambda names, *_: {name: replace(box, name=name) for name in names})
    sets = SceneSets(runtime, size=SIZE, kinds=["chambers"])
    assert [view.name for view in sets.views["tuning"]] == ["chambers-0", "chambers-1"]
    assert [view.name for view in sets.views["validation"]] == ["chambers-100", "chambers-101"]
