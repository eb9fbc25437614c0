"""Settings and their controls: made from declarations, checked when changed."""

from __future__ import annotations

import math

import pytest

from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.frame.params import BOUNCES, FrameParams, WholeFrameParams
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.viewer.controls import HIDDEN, Control, controls
from ssgi_cl.viewer.settings import AO, BOUNCE, FRAME, PRESET, Settings

RADIUS = 0.25


def by_name(params: Params) -> dict[str, Control]:
    return {control.name: control for control in controls(params, RADIUS)}


UNLISTED = {"outside", "falloff"}
"""Of SSAO: a number or a word, or a curve, which have no control."""
EVERY = [
    *(technique.params(radius=RADIUS) for technique in TECHNIQUES.values()),
    WholeFrameParams(),
    *(Settings(RADIUS, {FRAME: {"indirect": name}}).of(BOUNCE) for name in BOUNCES),
]


@pytest.mark.parametrize("params", EVERY, ids=lambda params: type(params).__name__)
def test_every_parameter_has_a_control_whose_ends_are_allowed(params: Params) -> None:
    found = by_name(params)
    hidden = {name for kind, names in HIDDEN.items() if isinstance(params, kind) for name in names}
    missing = set(parameter_fields(type(params))) - set(found) - hidden
    # A choice of one, such as a method that has no other, is no choice.
    assert not {name for name in missing if getattr(params, name) is not None} - UNLISTED, missing
    for control in found.values():
        declared = parameter_fields(type(params))[control.name].metadata
        assert declared["doc"] in control.hint
        if control.kind == "slider":
            for end in (control.low, control.high):
                value = control.value(end)
                assert declared["low"] <= value <= declared["high"]
                assert control.low <= control.shown <= control.high
        if control.kind == "choice":
            assert control.shown in control.words


def test_what_a_control_shows_stands_for_the_present_value() -> None:
    for params in EVERY:
        for control in by_name(params).values():
            value = getattr(params, control.name)
            value = value[0] if isinstance(value, tuple) else value
            if value is not None and not (isinstance(value, float) and math.isinf(value)):
                assert control.value(control.shown) == pytest.approx(value), control


def test_parameters_that_others_exclude_have_no_control() -> None:
    assert "ao_samples" not in by_name(FrameParams())
    assert "ao_samples" in by_name(FrameParams(ao="ssao"))
    assert "auxiliary_cameras" not in by_name(FrameParams())
    assert "auxiliary_cameras" in by_name(FrameParams(indirect="ssdo"))


def test_values_of_a_technique_reach_the_frame() -> None:
    settings = Settings(RADIUS).changed(AO, "slices", 5).changed(PRESET, "surfels", 64)
    params = settings.params
    assert params.ao == TECHNIQUES["gtao"].params(radius=RADIUS, slices=5)
    assert params.whole is not None
    assert params.whole.surfels == 64


def test_a_choice_puts_back_what_it_excludes() -> None:
    settings = Settings(RADIUS).changed(FRAME, "preset", "low").changed(PRESET, "vpls", 64)
    one = settings.changed(FRAME, "indirect", "ssdo").changed(BOUNCE, "slices", 3)
    assert one.params.bounce_name == "ssdo"
    assert one.of(PRESET) is None
    assert one.changed(FRAME, "bounces", 0).params.kind == "direct"
    assert one.changed(FRAME, "preset", "low").params.whole == WholeFrameParams.low()
    assert settings.changed(AO, "slices", 5).changed(FRAME, "ao", "hbao").params.ao == "hbao"


@pytest.mark.parametrize(
    ("group", "name", "value", "message"),
    [
        (FRAME, "layers", 99, "layers is 99"),
        (AO, "radius", -1.0, "radius is -1"),
        (AO, "slices", math.nan, "slices"),
        (FRAME, "no_such", 1, "no such parameter"),
        (BOUNCE, "vpls", 8, "no such parameter"),
    ],
)
def test_a_value_out_of_range_is_refused_by_name(group: str, name: str, value: float, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        Settings(RADIUS).changed(group, name, value)


def test_a_word_that_is_no_choice_is_refused() -> None:
    with pytest.raises(ValueError, match="preset is 'best'"):
        by_name(FrameParams())["preset"].value("best")
