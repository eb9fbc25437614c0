"""Passes of a frame: declared resources, a pass more, and one set of defaults."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.graph import Graph
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import INDIRECT
from ssgi_cl.frame.passes.tonemap import pixels
from ssgi_cl.frame.pipeline import PIPELINES
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.rasterize.scenes import make_scene

BOX = make_scene("cornell_box")
CAMERA = BOX.camera(48, 36)


def test_a_pass_reads_what_it_declares_alone(runtime: Runtime) -> None:
    def run(values: Declared) -> Any:
        return values[name]

    graph = Graph(runtime, [Stage(name="a", reads=("number",), writes=("sum",), run=run)], keep=False)
    name = "number"
    assert graph.run({"number": 1, "other": 2}, ["sum"]).values["sum"] == 1
    name = "other"
    with pytest.raises(LookupError, match=r"stage 'a' asks for 'other', which it does not declare: .* 'number'$"):
        graph.run({"number": 1, "other": 2}, ["sum"])


def indirect_only(build: Build) -> Stage:
    """Return a pass that shows indirect light alone: all that a new pass takes."""
    return Stage(
        name="indirect only", reads=(INDIRECT,), writes=("indirect only",), run=lambda r: pixels(r[INDIRECT]) / np.pi
    )


def test_a_new_pass_is_one_record_and_one_line_of_the_list(runtime: Runtime) -> None:
    params = FrameParams(preset="low", rsm_size=64, shadow_size=64)
    build = Build(runtime, CAMERA.size, params)
    passes = [*PIPELINES[params.kind](build), indirect_only(build)]
    frame = gi.render(BOX.scene, CAMERA, BOX.lights, preset="low", rsm_size=64, shadow_size=64, runtime=runtime)
    occlusion, _ = FrameParams(ao_radius=0.1).techniques(1.0)
    given = {
        "scene": BOX.scene,
        "surfaces that light meets": scene_parts(BOX.scene).casting,
        "camera": CAMERA,
        "lights": BOX.lights,
        "lights as the background shows them": BOX.lights,
        "multi_bounce": False,
        "parameters of occlusion": occlusion,
    }
    run = Graph(runtime, passes).run(given, ["indirect only"])
    np.testing.assert_array_equal(run.values["indirect only"], frame.indirect / np.pi)
    states = {each.name: each.state for each in run.record.stages}
    assert states["gtao"] == states["combine"] == states["picture"] == "culled"


@pytest.mark.parametrize("given", [{}, {"bounces": 0}, {"indirect": "ssdo"}], ids=str)
def test_a_renderer_has_the_defaults_of_render(runtime: Runtime, given: dict[str, Any]) -> None:
    frame = gi.render(BOX.scene, CAMERA, BOX.lights, runtime=runtime, **given)
    other = gi.Renderer(runtime, CAMERA.size, FrameParams(**given) if given else None)(BOX.scene, CAMERA, BOX.lights)
    np.testing.assert_array_equal(other.radiance, frame.radiance)
    np.testing.assert_array_equal(other.image, frame.image)


def test_a_renderer_takes_parameters_of_its_shape_alone(runtime: Runtime) -> None:
    renderer = gi.Renderer(runtime, CAMERA.size, FrameParams(bounces=0, shadow_size=32))
    with pytest.raises(ValueError, match="Renderer was prepared for"):
        renderer.params = FrameParams(bounces=0, shadow_size=64)
    with pytest.raises(ValueError, match="shadow_size: expected values"):
        renderer(BOX.scene, CAMERA, BOX.lights, shadow_size=64)
