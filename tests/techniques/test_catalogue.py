"""Descriptors of techniques say what the techniques do."""

from __future__ import annotations

import dataclasses
import inspect
from importlib import import_module
from itertools import product
from typing import get_args, get_type_hints

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.bench.every import Inputs, inputs
from ssgi_cl.core.params import parameter_fields
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.catalogue import CATALOGUE, of_kind, table
from ssgi_cl.techniques.technique import INPUTS, KINDS, Technique
from ssgi_cl.tuning.context import Context

from .test_values import CASES, bits

every_technique = pytest.mark.parametrize("technique", CATALOGUE.values(), ids=lambda t: t.name)
EXTRA = {"ao", "ao_confidence", "multi_bounce", "ray_ao", "normals_from_depth", "relight", "shade_depth"}
"""Public functions of techniques that run on the host, or are made of others: the catalogue has them not."""


@pytest.fixture(scope="module")
def given(runtime: Runtime) -> Inputs:
    return inputs(runtime, (36, 48), 32)


@every_technique
def test_a_descriptor_is_of_public_names(technique: Technique) -> None:
    assert getattr(gi, technique.name) is technique.function
    assert technique.technique.__name__ in gi.__all__
    assert technique.kind in KINDS
    assert set(technique.reads) <= set(INPUTS)
    import_module(technique.reference)
    assert not technique.quantity or hasattr(Context, technique.quantity)
    assert technique.paper.split(" ")[0] in (inspect.getdoc(technique.function) or "")
    for name, values in (*technique.variants.items(), *technique.tunable.items()):
        for value in values:
            technique.params(**{name: value})


def test_every_technique_is_in_the_catalogue() -> None:
    functions = {
        name
        for name in gi.__all__
        if inspect.isfunction(value := getattr(gi, name)) and value.__module__.startswith("ssgi_cl.techniques.")
    }
    assert functions - EXTRA - {"auxiliary_cameras", "choose_vpls"} == set(CATALOGUE)
    assert {name for kind in KINDS for name in of_kind(kind)} == set(CATALOGUE)
    assert {name.split(",")[0] for name in CASES} == set(CATALOGUE)  # values as arguments


@every_technique
def test_a_technique_reads_what_its_descriptor_says(runtime: Runtime, given: Inputs, technique: Technique) -> None:
    case = CASES[technique.name]
    if technique.name == "tonemap":
        assert technique.reads == ("image",)
        return
    whole = given.gbuffer
    rng = np.random.default_rng(1)
    normal = np.asarray(whole.normal)
    other = {
        "depth": 1.1 * np.asarray(whole.depth),
        "normal": normal + 0.2 * (np.abs(normal) > 0.0),
        "albedo": 0.5 * np.asarray(whole.albedo),
        "emission": rng.random(np.shape(whole.albedo)),
        "thickness": rng.random(np.shape(whole.first("depth"))),
    }
    first = bits(case.call(given, runtime=runtime, **case.base))
    for name, values in other.items():
        changed = dataclasses.replace(given, gbuffer=dataclasses.replace(whole, **{name: values}))
        same = bits(case.call(changed, runtime=runtime, **case.base)) == first
        assert same == (name not in technique.reads), name


def test_lights_and_maps_are_arguments() -> None:
    for technique, name in product(CATALOGUE.values(), ("lights", "rsms", "shadow_maps", "scene", "image")):
        names = set(inspect.signature(technique.function).parameters)
        images = {"tonemap": "radiance", "reflections": "radiance", "accumulate": "plane"}
        given_name = images.get(technique.name, name) if name == "image" else name
        assert (given_name in names) == (name in technique.reads), (technique.name, name)


@pytest.mark.parametrize("technique", of_kind("ao").values(), ids=lambda t: t.name)
def test_methods_of_ambient_occlusion_have_a_radius(technique: Technique) -> None:
    assert "radius" in parameter_fields(technique.params)
    assert technique.writes[0] == "ao"


def test_the_table_has_a_row_for_each() -> None:
    lines = table().splitlines()
    assert len(lines) == 2 + len(CATALOGUE)
    assert lines[2].startswith("| `ssao` | ao | Mittring 2007")
    assert all(line.count("|") == lines[0].count("|") for line in lines)


@every_technique
def test_constructors_have_one_order(technique: Technique) -> None:
    parameters = list(inspect.signature(technique.technique).parameters.values())
    first = ["runtime", "params"] if technique is CATALOGUE["radiosity"] else ["runtime", "size", "params"]
    assert [p.name for p in parameters[: len(first)]] == first
    assert parameters[len(first) - 1].default is None
    rest = [p.name for p in parameters[len(first) :] if p.kind is p.POSITIONAL_OR_KEYWORD]
    order = ("margin", "layers", "attributes", "channels")
    assert rest == [name for name in order if name in rest]
    keywords = get_type_hints(technique.technique.__init__)
    own = getattr(technique.technique, "defaults", None)  # where the base class has the constructor
    assert technique.params in (own, keywords["params"], *get_args(keywords["params"]))


def test_shading_and_tone_mapping_take_their_parameters(runtime: Runtime, given: Inputs) -> None:
    gbuffer, size = on_device(given.gbuffer, runtime), given.gbuffer.size
    visibility, indirect = runtime.plane(1, size, 0.5), runtime.plane(3, size)
    visibility.upload(np.full((1, *size), 0.5, np.float32))
    indirect.upload(np.ones((3, *size), np.float32))
    both = {"multi_bounce": True, "indirect_ao": True}
    shown = []
    for params, switches in ((gi.ShadeParams(**both), {}), (None, both), (None, {})):
        plane = gi.Shade(runtime, size, params).run(
            gbuffer, given.lights, visibility=visibility, indirect=indirect, **switches
        )
        shown.append(plane.download())
    np.testing.assert_array_equal(shown[0], shown[1])
    assert (shown[0] != shown[2]).any()
    mapped = gi.Tonemap(runtime, size, gi.TonemapParams(exposure=0.3))
    np.testing.assert_array_equal(mapped.run(plane), mapped.run(plane, exposure=0.3))
    mapped.params = gi.TonemapParams()
    automatic = mapped.run(plane)
    radiance = np.moveaxis(plane.download(), 0, -1)
    np.testing.assert_array_equal(automatic, gi.tonemap(radiance, runtime=runtime))
