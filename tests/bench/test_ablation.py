"""Terms of a frame that its error comes from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from ssgi_cl.bench.experiments.ablation import (
    DIRECT,
    EDGES,
    EMISSION,
    FIRST,
    GLOSSY,
    LATER,
    NOISE,
    NOTHING,
    SKY,
    ablation,
    main,
)
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BuiltinScene, make_scene
from ssgi_cl.truth import store
from ssgi_cl.tuning.measured_scenes import views_of

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed (extra 'truth')")

SIZE = (30, 40)


@pytest.fixture(autouse=True)
def _own_store(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(store, "truth_folder", lambda: tmp_path / "truth")


def spot_lit(runtime: Runtime) -> BuiltinScene:
    """The Cornell box without emission."""
    return views_of(["cornell_box-spot"], runtime)["cornell_box-spot"]


@pytest.mark.slow
def test_ablation_of_the_spot_lit_box_blames_the_bounces(runtime: Runtime) -> None:
    view = spot_lit(runtime)
    terms = {one.term: one for one in ablation(view, SIZE, runtime, "direct", paths=128)}
    assert list(terms) == [NOTHING, DIRECT, FIRST, LATER, EDGES, "all bounces", NOISE]
    whole = terms[NOTHING].alone.flip
    assert terms["all bounces"].alone.flip < 0.5 * whole
    assert terms[DIRECT].alone.flip > 0.8 * whole
    # Shadow maps apart, direct light is the reference's.
    assert terms[DIRECT].kept is not None
    assert terms[DIRECT].kept.flip < 0.05
    shares = [terms[name].share for name in (DIRECT, FIRST, LATER, EDGES)]
    assert sum(shares) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.slow
def test_the_skys_light_is_what_the_frame_has_of_it(runtime: Runtime) -> None:
    # In the room `parlour` no sky is seen, neither by paths nor by the frame; a frame of direct
    # light alone has an ambient term there.
    view = make_scene("parlour")
    terms = {one.term: one for one in ablation(view, SIZE, runtime, "low", paths=8)}
    assert abs(terms[SKY].share) < 0.001
    assert abs(terms[SKY].alone.bias - terms[NOTHING].alone.bias) < 0.01
    assert abs(terms[FIRST].alone.bias - terms[NOTHING].alone.bias) < 0.1


@pytest.mark.slow
def test_terms_add_up_and_dark_parts_are_left_out(runtime: Runtime) -> None:
    view = make_scene("cornell_box")
    terms = [one.term for one in ablation(view, SIZE, runtime, "low", paths=4)]
    assert terms == [NOTHING, EMISSION, FIRST, LATER, EDGES, "all bounces", NOISE]


@pytest.mark.slow
def test_pixels_of_glossy_surfaces_are_a_term(runtime: Runtime) -> None:
    box = spot_lit(runtime)
    # The second half of the triangles mirrors.
    shiny = replace(box.scene.materials[0], albedo=(0.1,) * 3, specular=(0.7,) * 3, gloss=20.0)
    ids = box.scene.material_ids.copy()
    ids[len(ids) // 2 :] = len(box.scene.materials)
    scene = replace(box.scene, materials=(*box.scene.materials, shiny), material_ids=ids)
    view = replace(box, scene=scene)
    terms = {one.term: one for one in ablation(view, SIZE, runtime, "direct", paths=128)}
    assert 0.05 < terms[GLOSSY].share < 0.95
    parts = {name: one for name, one in terms.items()
             if name not in (NOTHING, "all bounces", NOISE)}  # fmt: skip
    assert sum(one.share for one in parts.values()) == pytest.approx(1.0, abs=1e-4)
    # Frames of direct light have no lobes: true there, the frame has less error.
    assert terms[GLOSSY].alone.flip < 0.95 * terms[NOTHING].alone.flip


@pytest.mark.slow
def test_the_noise_of_the_reference_is_told(runtime: Runtime) -> None:
    view = make_scene("cornell_box")
    few, many = ({one.term: one for one in ablation(view, SIZE, runtime, "low", paths=paths)} for paths in (8, 128))
    assert few[NOISE].alone.flip > 2.0 * many[NOISE].alone.flip > 0.0


def test_the_command_prints_a_row_for_each_term() -> None:
    given = ("--scene", "cornell_box-spot", "--size", "40x30", "--truth-paths", "4", "--mode", "low")
    shown = CliRunner().invoke(main, given)
    assert shown.exit_code == 0, shown.output
    assert "## cornell_box-spot, 40 x 30, `low`" in shown.output
    rows = [line.split(" | ")[0] for line in shown.output.splitlines() if line.startswith("| ")]
    assert rows == ["| replaced by its truth", *(f"| {name}" for name in (
        NOTHING, DIRECT, FIRST, LATER, EDGES, "all bounces", NOISE))]  # fmt: skip
