"""Whole frames against path tracing: errors, verdict, ablation, and the command."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from ssgi_cl.bench.frame import command, report
from ssgi_cl.bench.frame.ablation import DIRECT, EDGES, EMISSION, FIRST, GLOSSY, LATER, NOISE, NOTHING, SKY, ablation
from ssgi_cl.bench.frame.command import mesh_names
from ssgi_cl.bench.frame.error import FrameError, encoded, frame_error
from ssgi_cl.bench.frame.measure import Row, measure, reference, variants, without_emission
from ssgi_cl.bench.frame.modes import DEFAULT, MODES, Mode
from ssgi_cl.bench.frame.verdict import verdict
from ssgi_cl.bench.peers import mitsuba_frame
from ssgi_cl.cli.command import main
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, make_scene
from ssgi_cl.truth import store

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed (extra 'truth')")

SIZE = (30, 40)


@pytest.fixture(autouse=True)
def _own_store(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(store, "truth_folder", lambda: tmp_path / "truth")


# ---- errors


def test_an_image_has_no_error_against_itself_and_more_the_farther_it_is(rng: np.random.Generator) -> None:
    image = rng.random((24, 32, 3)).astype(np.float32)
    assert frame_error(image, image) == (0.0, 0.0, 0.0)
    near, far = (frame_error(image * np.float32(k), image) for k in (1.1, 2.0))
    assert 0.0 < near.flip < far.flip
    assert 0.0 < near.mrse < far.mrse
    assert near.bias == pytest.approx(0.1, rel=1e-5)
    assert far.bias == pytest.approx(1.0, rel=1e-5)


def test_error_is_the_same_at_any_exposure_of_both(rng: np.random.Generator) -> None:
    image = rng.random((24, 32, 3)).astype(np.float32) + 0.1
    other = image * rng.uniform(0.5, 1.5, image.shape).astype(np.float32)
    flips = [frame_error(k * other, k * image).flip for k in (1.0, 64.0)]
    assert flips[1] == pytest.approx(flips[0], rel=1e-3)


def test_tone_curve_is_the_documented_one() -> None:
    # x e / (1 + x e / 4): 2 at exposure 2 is 4 / 2, clipped; 0.25 at 1 is 0.25 / 1.0625.
    np.testing.assert_allclose(encoded(np.array([2.0, -1.0, 0.0]), 2.0), [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(encoded(np.array([0.25]), 1.0), (0.25 / 1.0625) ** (1 / 2.2))


def test_relative_mse_is_the_documented_one() -> None:
    value, truth = np.full((16, 16, 3), 0.5, np.float32), np.full((16, 16, 3), 0.4, np.float32)
    assert frame_error(value, truth).mrse == pytest.approx((0.1 / 0.41) ** 2, rel=1e-5)


# ---- verdict


def row(name: str, flip: float, ms: float) -> Row:
    return Row(name, not name.startswith("path"), ms, ms, FrameError(flip, 0.0, 0.0),
               np.ones((2, 2, 3), np.float32))  # fmt: skip


@pytest.mark.parametrize(
    ("flip", "ms", "reached"), [(0.09, 99.0, True), (0.11, 99.0, False), (0.09, 101.0, False), (0.1, 50.0, False)]
)
def test_goal_is_lower_flip_in_a_third_of_the_time(flip: float, ms: float, reached: bool) -> None:
    found = verdict([row("default", flip, ms), row("path 1", 0.5, 1.0),
                     row("path 1 + OIDN", 0.1, 300.0)])  # fmt: skip
    assert found.reached is reached
    assert found.text.startswith("reached" if reached else "missed")


def test_without_the_peer_nothing_is_judged() -> None:
    found = verdict([row("default", 0.1, 1.0)])
    assert found.reached is None
    assert "path 1 + OIDN was not measured" in found.text
    assert "default was not measured" in verdict([row("path 1 + OIDN", 0.1, 1.0)]).text


# ---- scenes


def test_a_light_that_is_there_twice_makes_two_rows() -> None:
    box, spot = variants(make_scene("cornell_box"))
    assert (box.name, spot.name) == ("cornell_box", "cornell_box-spot")
    assert box.lights == ()
    assert any(any(m.emission) for m in box.scene.materials)
    assert len(spot.lights) == 1
    assert not any(any(m.emission) for m in spot.scene.materials)
    parlour = make_scene("parlour")
    assert list(variants(parlour)) == [parlour]


def test_meshes_of_a_folder_are_found_once(tmp_path: Path) -> None:
    for name in ("a/one.obj", "a/one.relative.obj", "a/one.mtl", "b/two.glb", "three.obj"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert mesh_names(tmp_path) == [str(tmp_path / "a/one.obj"), str(tmp_path / "b/two.glb")]


# ---- measurements


@pytest.mark.parametrize(
    ("own", "samples"),
    [
        (["low", "direct"], (1,)),
        pytest.param([DEFAULT, "multires", "direct"], (1, 16), marks=pytest.mark.slow),  # all: below
    ],
    ids=["low", "default"],
)
def test_frames_and_peers_are_measured(runtime: Runtime, own: list[str], samples: tuple[int, ...]) -> None:
    _, view = variants(make_scene("cornell_box"))
    expected = reference(view, SIZE, 64)
    rows, skipped = measure(
        view,
        SIZE,
        runtime,
        expected.mean,
        frames=1,
        samples=samples,
        modes={
            **{name: MODES[name] for name in own},
            "unknown": Mode({"no_such_option": 1}),
            "impossible": Mode({"bounces": -1}),
        },
    )
    assert [line.split(":")[0] for line in skipped][:2] == ["unknown", "impossible"]
    found = {row.name: row for row in rows}
    assert list(found)[: len(own)] == own
    assert all(row.first_ms > 0.0 and row.kept_ms > 0.0 for row in rows)
    assert all(row.radiance.shape == (*SIZE, 3) for row in rows)
    # More bounces are nearer to all of them than fewer.
    errors = [found[name].error.flip for name in own]
    assert errors == sorted(errors)
    assert errors[0] < errors[-1]
    if mitsuba_frame.missing():
        assert any("path: " in line for line in skipped)
        return
    assert [name for name in found if re.fullmatch(r"path \d+", name)] == [f"path {count}" for count in samples]
    if 16 in samples:
        assert found["path 16"].error.flip < found["path 1"].error.flip
        assert abs(found["path 16"].error.bias) < 0.1
    if not mitsuba_frame.missing(denoised=True):
        assert found["path 1 + OIDN"].error.flip < found["path 1"].error.flip


def test_ablation_of_the_spot_lit_box_blames_the_bounces(runtime: Runtime) -> None:
    _, view = variants(make_scene("cornell_box"))
    terms = {one.term: one for one in ablation(view, SIZE, runtime, MODES["direct"], paths=128)}
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
    terms = {one.term: one for one in ablation(view, SIZE, runtime, MODES["low"], paths=8)}
    assert abs(terms[SKY].share) < 0.001
    assert abs(terms[SKY].alone.bias - terms[NOTHING].alone.bias) < 0.01
    assert abs(terms[FIRST].alone.bias - terms[NOTHING].alone.bias) < 0.1


def test_terms_add_up_and_dark_parts_are_left_out(runtime: Runtime) -> None:
    view = replace(make_scene("cornell_box"), lights=())
    terms = [one.term for one in ablation(view, SIZE, runtime, MODES["low"], paths=4)]
    assert terms == [NOTHING, EMISSION, FIRST, LATER, EDGES, "all bounces", NOISE]
    assert without_emission(view.scene).materials[3].emission == (0.0, 0.0, 0.0)


def test_pixels_of_glossy_surfaces_are_a_term(runtime: Runtime) -> None:
    _, box = variants(make_scene("cornell_box"))
    # The second half of the triangles mirrors.
    shiny = replace(box.scene.materials[0], albedo=(0.1,) * 3, specular=(0.7,) * 3, gloss=20.0)
    ids = box.scene.material_ids.copy()
    ids[len(ids) // 2 :] = len(box.scene.materials)
    scene = replace(box.scene, materials=(*box.scene.materials, shiny), material_ids=ids)
    view = replace(box, scene=scene)
    terms = {one.term: one for one in ablation(view, SIZE, runtime, MODES["direct"], paths=128)}
    assert 0.05 < terms[GLOSSY].share < 0.95
    parts = {name: one for name, one in terms.items()
             if name not in (NOTHING, "all bounces", NOISE)}  # fmt: skip
    assert sum(one.share for one in parts.values()) == pytest.approx(1.0, abs=1e-4)
    # Frames of direct light have no lobes: true there, the frame has less error.
    assert terms[GLOSSY].alone.flip < 0.95 * terms[NOTHING].alone.flip


@pytest.mark.slow
def test_the_noise_of_the_reference_is_told(runtime: Runtime) -> None:
    view = make_scene("cornell_box")
    few, many = (
        {one.term: one for one in ablation(view, SIZE, runtime, MODES["low"], paths=paths)} for paths in (8, 128)
    )
    assert few[NOISE].alone.flip > 2.0 * many[NOISE].alone.flip > 0.0


# ---- the command


def ssgi(*arguments: str, status: int = 0) -> Result:
    result = CliRunner().invoke(main, ["bench", "frame", *arguments])
    assert result.exit_code == status, result.output
    return result


def test_the_command_writes_tables_and_strips(tmp_path: Path) -> None:
    paths = tmp_path / "found.json", tmp_path / "found.md"
    shown = ssgi(
        "--scene",
        "cornell_box",
        "--size",
        "40x30",
        "--truth-paths",
        "4",
        "--frames",
        "1",
        "--own",
        "--mode",
        "low",
        "--ablation",
        "--strips",
        str(tmp_path / "strips"),
        "-o",
        str(paths[0]),
        "--markdown",
        str(paths[1]),
    ).output
    assert "## cornell_box-spot, 40 x 30" in shown
    assert "not judged: default was not measured" in shown
    assert "Terms of `low`:" in shown
    assert "later bounces" in shown
    document = json.loads(paths[0].read_text())
    assert document["format"] == report.FORMAT
    assert [scene["scene"] for scene in document["scenes"]] == ["cornell_box", "cornell_box-spot"]
    assert [frame["name"] for frame in document["scenes"][0]["frames"]] == ["low"]
    assert document["scenes"][0]["goal"] is None
    assert "| low |" in re.sub(" +", " ", paths[1].read_text(encoding="utf-8"))
    strip = np.asarray(Image.open(tmp_path / "strips" / "frame-cornell_box-spot-low.png"))
    assert strip.shape == (30, 3 * 40, 3)


def test_ablation_is_of_the_default_frame_unless_others_are_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(command, "measure", lambda *given, **more: ([], []))
    monkeypatch.setattr(command, "ablation", lambda view, size, runtime, mode, **more: asked.append(mode) or [])
    shown = ssgi("--scene", "parlour", "--size", "24x18", "--truth-paths", "2", "--ablation").output
    assert "Terms of `default`:" in shown
    assert asked == [MODES[DEFAULT]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--size", "0x4"), "expected COLUMNSxROWS"),
        (("--mode", "best"), "'best' is not"),
        (("--scene", "moon"), "scene is 'moon'"),
        (("-o", "found.txt"), "expected a name that ends in .json"),
        (("--samples", "0"), "0 is not in the range"),
    ],
)
def test_bad_options_are_named(arguments: tuple[str, ...], message: str) -> None:
    result = CliRunner().invoke(main, ["bench", "frame", *arguments])
    assert result.exit_code != 0
    assert message in result.output


def test_bench_itself_is_as_before() -> None:
    result = CliRunner().invoke(main, ["bench", "ssao", "--list", "--scene", "cornell_box"])
    assert result.exit_code == 0, result.output
    assert "ssao.16.cornell_box.800x600" in result.output


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(BUILTIN_SCENES))
def test_every_scene_has_its_reference_and_rows(name: str, runtime: Runtime) -> None:
    for view in variants(make_scene(name)):
        expected = reference(view, SIZE, 16)
        rows, _ = measure(view, SIZE, runtime, expected.mean, frames=1, samples=())
        assert [row.name for row in rows] == list(MODES)
        assert all(np.isfinite(row.error).all() for row in rows)
