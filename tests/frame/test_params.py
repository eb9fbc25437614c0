"""Parameters of frames: their checks, their defaults, and that only stages that read a changed one run."""

from __future__ import annotations

from typing import Any

import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import PRESETS, FrameParams, WholeFrameParams
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.catalogue import TECHNIQUES

from .scenes import MAPS


def test_another_radius_runs_occlusion_and_what_reads_it(runtime: Runtime) -> None:
    view = make_scene("cornell_box")
    camera = view.camera(48, 36)
    lights = [*view.lights, gi.Environment((0.3, 0.4, 0.5))]

    def states(radius: float) -> dict[str, str]:
        given = {"indirect": "multires", "vpls": 64, "exposure": 1.0, "runtime": runtime, **MAPS}
        frame = gi.render(view.scene, camera, lights, ao_radius=radius, **given)
        return {stage.name: stage.state for stage in frame.graph.stages}

    states(0.3)
    same = states(0.3)
    other = states(0.6)
    assert "ran" not in {same[name] for name in ("G-buffer", "bitmask_ao", "bounce", "combine")}
    for name in ("G-buffer", "direct light", "bounce"):
        assert other[name] == "reused", name
    assert other["bitmask_ao"] == other["combine"] == "ran"


@pytest.mark.parametrize(
    ("params", "given", "error", "message"),
    [
        (FrameParams, {"bounces": -1}, ValueError, r"bounces is -1: expected .* 0"),
        (FrameParams, {"bounces": 1.5}, TypeError, r"bounces is 1\.5: expected an integer"),
        (FrameParams, {"bounces": "some"}, ValueError, r"bounces is 'some': expected .*'all'"),
        (FrameParams, {"preset": "best"}, ValueError, r"preset is 'best': expected .*'low'.*'ultra'"),
        (FrameParams, {"bounces": 0, "preset": "low"}, ValueError, r"preset is 'low': expected None without bounces"),
        (FrameParams, {"bounces": 2, "indirect": "vpl"}, ValueError, r"bounces is 2: expected None or 0 with indirect"),
        (WholeFrameParams, {"vpls": -5}, ValueError, r"vpls is -5: expected an integer >= 16 and <= 65536"),
        (WholeFrameParams, {"surfels": 0}, ValueError, r"surfels is 0: expected an integer"),
        (WholeFrameParams, {"error": -1}, ValueError, r"error is -1: expected a number"),
        (WholeFrameParams, {"bounces": 0}, ValueError, r"bounces is 0: expected an integer >= 1 and <= 1000 \(reflec"),
    ],
    ids=str,
)
def test_bad_parameters_are_refused(params: Any, given: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        params(**given)


@pytest.mark.parametrize("name", ["ssao", "hbao", "gtao", "bitmask_ao"])
def test_ambient_occlusion_is_that_of_the_name(name: str) -> None:
    chosen = FrameParams(ao=name, ao_radius=0.3).techniques(1.0)[0]
    assert type(chosen) is TECHNIQUES[name].params
    assert chosen.radius in (0.3, (0.3,))


def test_by_default_ambient_light_is_dimmed_by_the_bitmask_and_contact_by_horizons() -> None:
    for given in ({"bounces": 0}, {"indirect": "vpl"}):
        params = FrameParams(**given)
        assert params.techniques(0.3)[0] == gi.BitmaskParams(radius=0.3, checkerboard=True, blur_radius=3, taps=16)
        assert params.draws_thickness
        assert FrameParams(ao="bitmask_ao", **given).techniques(0.3)[0] == gi.BitmaskParams(radius=0.3)
        assert not FrameParams(ao="gtao", **given).draws_thickness
    whole = FrameParams()
    assert whole.techniques(0.3)[0] == gi.GtaoParams(radius=0.3)
    for params in (whole, FrameParams(ao="bitmask_ao"), FrameParams(indirect="ssdo")):
        assert not params.draws_thickness


def test_arguments_choose_the_whole_picture_or_a_technique() -> None:
    assert FrameParams().whole == PRESETS["high"]()
    for given in ({"bounces": 0}, {"indirect": "multires"}, {"indirect": False}):
        assert FrameParams(**given).whole is None
    assert FrameParams(bounces=1, preset="low").whole == PRESETS["low"](1)
    assert FrameParams(preset=WholeFrameParams.low(2)).whole == PRESETS["low"](2)


@pytest.mark.parametrize(
    ("given", "needs"),
    [
        ({}, True),
        ({"ao": False}, False),
        ({"ao": "hbao", "bounces": 0}, True),
        ({"ao_radius": 0.5}, False),
        ({"ao": gi.GtaoParams(radius=0.5)}, False),
        ({"indirect": "ssdo"}, True),
        ({"indirect": gi.SsdoParams(radius=0.5)}, False),  # its own, and no other occlusion
        ({"indirect": gi.VplSplatParams(vpls=16)}, True),
        ({"indirect": gi.VplSplatParams(vpls=16), "ao": gi.SsaoParams(radius=0.5)}, False),
    ],
    ids=str,
)
def test_a_radius_is_chosen_from_the_view_where_none_is_given(given: dict[str, Any], needs: bool) -> None:
    assert gi.FrameParams(**given).needs_radius == needs
