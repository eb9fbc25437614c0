"""Terms of a frame that its error comes from."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from ssgi_cl.bench.experiments import ablation as module
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
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.measured_scenes import views_of

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed (extra 'truth')")

pytestmark = pytest.mark.usefixtures("own_store")

SIZE = (30, 40)


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
    shares = [one.share for name, one in terms.items() if name not in (NOTHING, "all bounces", NOISE)]
    assert sum(shares) == pytest.approx(1.0, abs=1e-4)
    # Frames of direct light have no lobes: true there, the frame has less error.
    assert terms[GLOSSY].alone.flip < 0.95 * terms[NOTHING].alone.flip


def test_each_term_is_replaced_and_has_a_row(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    # Even light: 4 directly, 2 of one bounce, 1 of later ones and .5 less where pixels are boxes; ours 3, 2 and 2.
    def true(*given: Any, box_filter: bool = False, **_: Any) -> Truth:
        light = 6.5 if box_filter else {0: 4.0, 1: 6.0, "all": 7.0}[given[4]]
        return Truth(np.full((*SIZE, 3), light, np.float32), np.full((*SIZE, 3), 0.1, np.float32), 2, "")

    def ours(*_: Any, outputs: tuple[str, ...], bounces: Any = "all", **__: Any) -> SimpleNamespace:
        plane, colours = np.full(SIZE, np.float32(1.0)), np.full((*SIZE, 3), np.float32(0.5 * np.pi))
        if "indirect" in outputs:  # of which half is reflected
            seen = SimpleNamespace(albedo=colours, depth=plane)
            return SimpleNamespace(
                radiance=np.full((*SIZE, 3), 5.0), indirect=8.0 / np.pi * colours, ao=0.25 * plane, gbuffer=seen
            )
        return SimpleNamespace(radiance=np.full((*SIZE, 3), 5.0 if bounces == 1 else 7.0))

    monkeypatch.setattr(module.truth, "radiance", true)
    monkeypatch.setattr(module, "render", ours)
    monkeypatch.setattr(module.metrics, "smooth_surfaces", lambda _: np.ones(SIZE, np.bool_))
    monkeypatch.setattr(module, "gbuffer", lambda *_, **__: SimpleNamespace(size=SIZE, specular=None, emission=None))
    assert list(module._parts(make_scene("cornell_box"))) == [EMISSION]  # what is dark is left out
    found = module.ablation(spot_lit(runtime), SIZE, runtime, "low")
    biases = [6.5 * one.alone.bias for one in found]
    assert biases == pytest.approx([0.5, 1.5, 0.5, -0.5, 0.0, -0.5, 0.0], abs=0.01)
    assert [6.5 * one.kept.bias for one in found if one.kept] == pytest.approx([-1.0, 0.0, 1.0, 0.5, 1.0])
    assert [6.5 * one.share for one in found] == pytest.approx([6.5, 4.0, 2.0, 1.0, -0.5, 3.0, 6.5])
    assert found[0].alone.mrse == pytest.approx((0.5 / 6.51) ** 2)
    assert found[-1].alone.mrse == pytest.approx((0.1 / 6.51) ** 2, rel=0.1)  # its noise, of 3600 numbers
    # Light that is wrong everywhere alike is no mottling; noise of single pixels leaves little of itself.
    assert found[0].alone.mottling == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < found[-1].alone.mottling < 0.15 * 0.1 / 6.5
    shown = CliRunner().invoke(main, ("--scene", "cornell_box-spot", "--size", "40x30", "--mode", "low"))
    assert shown.exit_code == 0, shown.output
    assert "## cornell_box-spot, 40 x 30, `low`" in shown.output
    rows = [line.split(" | ")[0] for line in shown.output.splitlines() if line.startswith("| ")]
    assert rows == ["| replaced by its truth", *(f"| {name}" for name in (
        NOTHING, DIRECT, FIRST, LATER, EDGES, "all bounces", NOISE))]  # fmt: skip
