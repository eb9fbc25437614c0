"""Names as types: what is checked at run time and what is typed are the same."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest

import ssgi_cl as gi
from ssgi_cl.core import names
from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.frame.params import BOUNCES, PRESETS, FrameKeywords, FrameParams, bounce_methods
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.catalogue import TECHNIQUES, of_kind


def kinds(base: type[Params] = Params) -> Iterator[type[Params]]:
    for kind in base.__subclasses__():
        if kind.__module__.startswith("ssgi_cl."):
            yield kind
        yield from kinds(kind)


def listed(kind: Any) -> set[str]:
    """The names in a type, whatever else it may be."""
    if get_origin(kind) is Literal:
        return set(get_args(kind))
    return set().union(*map(listed, get_args(kind))) if get_args(kind) else set()


def test_the_choices_of_a_parameter_are_those_of_its_type() -> None:
    typed = 0
    for kind in kinds():
        for name, hint in get_type_hints(kind).items():
            if get_origin(hint) is Literal and name in parameter_fields(kind):
                typed += 1
                assert parameter_fields(kind)[name].metadata["choices"] == get_args(hint), (kind, name)
    assert typed > 10


def test_tables_have_the_names_of_the_types_in_their_order() -> None:
    assert tuple(TECHNIQUES) == get_args(names.AoTechnique)
    assert of_kind("ao") == TECHNIQUES
    assert tuple(BOUNCES) == get_args(names.OneBounce)
    assert tuple(PRESETS) == presets.NAMES == get_args(names.Preset)
    for technique in TECHNIQUES:
        for entry in presets.record(technique)["layers"]:
            assert tuple(entry["presets"]) == presets.NAMES
    assert listed(names.BounceMethod) == {method for name in BOUNCES for method in bounce_methods(name)}


LIGHT_ITSELF = {
    ("shade", "indirect"),
    ("shade", "ao"),
    ("relight", "ao"),
    ("multi_bounce", "ao"),
    ("ao_confidence", "ao"),
}
"""Parameters that are arrays under one of the names."""


@pytest.mark.parametrize(
    ("name", "alias"),
    [
        ("preset", names.Preset),
        ("ao", names.AoTechnique),
        ("indirect", names.OneBounce),
        ("bounces", names.All),
        ("curve", names.Curve),
    ],
)
def test_public_functions_are_typed_with_them(name: str, alias: Any) -> None:
    functions = {public: value for public in gi.__all__ if inspect.isfunction(value := getattr(gi, public))}
    taking = {public for public, value in functions.items() if name in inspect.signature(value).parameters}
    taking -= {public for public, parameter in LIGHT_ITSELF if parameter == name}
    assert taking
    for public in taking:
        assert listed(get_type_hints(functions[public])[name]) == set(get_args(alias)), public


def test_keywords_of_frames_are_those_of_render_and_of_their_parameters() -> None:
    keywords, fields = get_type_hints(FrameKeywords), get_type_hints(FrameParams)
    assert list(keywords) == list(parameter_fields(FrameParams))
    render = get_type_hints(gi.render)
    for name, kind in keywords.items():
        if name != "skips":  # kept as the set of what may be skipped
            assert kind == fields[name]
        # render takes names alone, the parameters objects too.
        assert listed(kind) == listed(render[name])
