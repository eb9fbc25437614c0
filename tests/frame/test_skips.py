"""Skips of a frame: no bit of any output changes, and the table of passes has the reasons."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light, PointLight, SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Frame, Renderer, render
from ssgi_cl.frame.skips import OUTPUTS, SKIPS, chosen_outputs, chosen_skips
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.techniques.ao.gtao import GtaoParams
from tools.figures.skips import SKIP_SCENES

from ..cli.commands import DIRECT, answer, succeeds

GLOW = Environment((0.3, 0.2, 0.4))
SIZE = (64, 48)
MOVING = frozenset(SKIPS) - {"unchanged"}


def drawn(
    runtime: Runtime, built: BuiltinScene, skips: Any, lights: tuple[Light, ...] | None = None, **options: Any
) -> Frame:
    given: dict[str, Any] = {
        "bounces": 0, "ao_radius": built.ao_radius, "layers": 2, "shadow_size": 64, "gbuffer": True, **options
    }  # fmt: skip
    return render(
        built.scene,
        built.camera(*SIZE),
        (*built.lights, GLOW) if lights is None else lights,
        skips=skips,
        runtime=runtime,
        **given,
    )


def same(a: Frame, b: Frame) -> None:
    """Assert that two frames hold bit-identical results."""
    for name in ("radiance", "image", "ao", "indirect"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    np.testing.assert_array_equal(np.asarray(a.gbuffer.depth), np.asarray(b.gbuffer.depth))
    assert a.exposure == b.exposure


def reasons(frame: Frame) -> dict[str, str]:
    return {p.name: p.skipped for p in frame.passes if p.skipped}


# ---- no bit changes

SLOW = pytest.mark.slow
ALL_SCENES = [
    pytest.param(make, marks=() if name in ("cornell_box", "lone_object") else SLOW, id=name)
    for name, make in (*BUILTIN_SCENES.items(), *((m.__name__, m) for m in SKIP_SCENES))
]


@pytest.mark.parametrize("make", ALL_SCENES)
def test_each_skip_leaves_the_bits_of_every_scene(runtime: Runtime, make: Any) -> None:
    built = make()
    expected = drawn(runtime, built, False)
    for skips in (*([name] for name in SKIPS if name != "dark"), True):
        for _ in range(2 if skips is True or {"unchanged", "maps"} & set(skips) else 1):
            same(drawn(runtime, built, skips), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        *({"indirect": name} for name in ("vpl", "multires", "gather", "ssdo")),
        {"ao": "ssao", "layers": 1},
        {"ao": "bitmask_ao", "overscan": 0.2},
        {"ao": "hbao", "multi_bounce": True},
    ],
    ids=str,
)
def test_skips_leave_the_bits_of_every_technique(runtime: Runtime, options: dict[str, Any]) -> None:
    built = BUILTIN_SCENES["cornell_box"]()
    expected = drawn(runtime, built, False, **options)
    same(drawn(runtime, built, True, **options), expected)
    same(drawn(runtime, built, True, **options), expected)


def test_a_renderer_keeps_nothing_of_another_scene_view_or_light(runtime: Runtime) -> None:
    built, other = SKIP_SCENES[0](), BUILTIN_SCENES["cornell_box"]()
    kept, fresh = (
        Renderer(runtime, SIZE[::-1], FrameParams(bounces=0, ao=GtaoParams(radius=0.1), shadow_size=64, skips=skips))
        for skips in (set(SKIPS) - {"dark"}, False)
    )
    punctual_light = SpotLight((0.0, 3.0, 0.0), (0.0, -1.0, 0.0), 0.5, 10.0)
    moved = Camera.look_at((1.0, 2.0, 5.0), built.target, width=SIZE[0], height=SIZE[1])
    for scene, camera, lights, options in (
        (built.scene, built.camera(*SIZE), built.lights, {}),
        (built.scene, moved, built.lights, {}),
        (built.scene, moved, [punctual_light, GLOW], {}),
        (built.scene, moved, [GLOW], {}),
        (built.scene, moved, [Environment(0.7)], {}),
        (built.scene, moved, [Environment(0.7)], {"exposure": 2.0}),
        (other.scene, moved, [punctual_light, GLOW], {}),
        (built.scene, built.camera(*SIZE), built.lights, {}),
    ):
        options_: dict[str, Any] = {"gbuffer": True, **options}
        same(kept(scene, camera, lights, **options_), fresh(scene, camera, lights, **options_))


# ---- what is left out


def test_a_frame_whose_inputs_stay_runs_no_pass(runtime: Runtime) -> None:
    built = SKIP_SCENES[0]()
    drawn(runtime, built, True)
    frame = drawn(runtime, built, True)
    assert [p.name for p in frame.passes if not p.skipped] == []
    assert {"G-buffer", "bitmask_ao", "direct light", "combine", "picture"} <= set(reasons(frame))
    assert all(p.saved >= 0.0 for p in frame.passes)
    assert next(p.saved for p in frame.passes if p.name == "G-buffer") > 0.0


@pytest.mark.parametrize("bounces", [0, 1])
def test_occlusion_without_ambient_light_is_the_skip_called_dark(runtime: Runtime, bounces: int) -> None:
    built = BUILTIN_SCENES["cornell_box"]()
    lights = (PointLight((0.3, 0.4, 0.3), 1.0),)
    left_out, done = (drawn(runtime, built, skips, lights, bounces=bounces) for skips in (["dark"], False))
    assert left_out.ao is None
    assert done.ao is not None
    np.testing.assert_array_equal(left_out.radiance, done.radiance)


@pytest.mark.parametrize(
    ("outputs", "absent"),
    [
        (["ao"], ("shade_light", "light_shadows", "shade_combine", "tonemap", "raster_depth")),
        (["gbuffer"], ("bitmask_ao", "shade_light", "light_shadows", "shade_combine", "tonemap")),
        (["radiance"], ("tonemap",)),
        (["indirect"], ("bitmask_ao", "shade_light", "light_shadows", "shade_combine", "tonemap")),
    ],
    ids=str,
)
def test_outputs_pull_in_only_what_they_need(runtime: Runtime, outputs: list[str], absent: tuple[str, ...]) -> None:
    built = BUILTIN_SCENES["cornell_box"]()
    options: dict[str, Any] = {"gbuffer": False, "indirect": "vpl", "vpls": 64}
    frame = drawn(runtime, built, MOVING, outputs=outputs, **options)
    ran = {p.name for p in frame.passes if not p.skipped}
    assert not ran & set(absent)
    whole = drawn(runtime, built, MOVING, **options)
    assert set(absent) & {p.name for p in whole.passes if not p.skipped}
    for name in ("ao", "indirect", "gbuffer"):
        assert (getattr(frame, name) is not None) == (name in outputs), name
    if "ao" in outputs:
        np.testing.assert_array_equal(frame.ao, whole.ao)
    for name in ("image", "radiance"):
        if name in outputs:
            np.testing.assert_array_equal(getattr(frame, name), getattr(whole, name))
        else:
            with pytest.raises(ValueError, match=f"expected '{name}' among its outputs"):
                getattr(frame, name)


def test_the_command_line_explains_what_was_left_out_and_can_leave_nothing_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "150")
    arguments = ("render", "cornell_box", *DIRECT, "--width", 128, "--height", 96, "--ambient", 0.3)
    arguments = (*arguments, "-o", tmp_path / "a.exr")
    assert "saves ms, by estimate" in succeeds(*arguments, "--explain").stdout
    reports = [answer(*arguments, *more) for more in ([], ["--no-skips"])]
    left_out = [[p["name"] for p in r["passes"] if p["skipped"]] for r in reports]
    assert left_out == [["map spot"], []]
    assert reports[0]["passes"][-1]["saved_ms"] == 0.0


# ---- arguments


def test_skips_and_outputs_are_names() -> None:
    assert chosen_skips(True) == set(SKIPS)
    assert chosen_skips(False) == set()
    assert chosen_skips(["maps"]) == {"maps"}
    assert chosen_outputs(None) is None
    assert chosen_outputs(OUTPUTS) == set(OUTPUTS)
    for chosen, wrong, error, message in (
        (chosen_skips, "maps", TypeError, r"skips is 'maps': expected names out of 'outputs'"),
        (chosen_skips, 3, TypeError, r"skips is 3"),
        (chosen_skips, ["tiles"], ValueError, r"skips has 'tiles': expected names out of"),
        (chosen_outputs, "ao", TypeError, r"outputs is 'ao': expected names out of 'image'"),
        (chosen_outputs, ["colour"], ValueError, r"outputs has 'colour'"),
        (chosen_outputs, [], ValueError, r"outputs is \[\]: expected at least one of 'image'"),
    ):
        with pytest.raises(error, match=message):
            chosen(wrong)
