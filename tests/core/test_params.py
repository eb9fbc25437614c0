"""Parameters: declared once, checked when made, described for help texts, and given by their names."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import check_keywords, parameter_names, unknown_name
from ssgi_cl.core.params import Params, describe, param, parameter_fields
from ssgi_cl.tuning import choose as choosing


@dataclass(frozen=True, kw_only=True)
class Example(Params):
    """An example."""

    radius: float = param(0.5, "reach", unit="m", low=0.0, high=10.0, above=True)
    count: int = param(4, "samples", low=1, high=8)
    mode: str = param("fast", "how", choices=("fast", "good"))
    flip: bool = param(True, "whether")
    limit: float = param(math.inf, "largest size", unit="px", low=1.0, high=math.inf)


def test_defaults_are_allowed_and_numbers_become_those_of_python() -> None:
    made = Example()
    assert dataclasses.astuple(made) == (0.5, 4, "fast", True, math.inf)
    made = Example(radius=np.float32(0.5), count=np.int64(3))  # type: ignore[arg-type]
    assert (type(made.radius), type(made.count)) == (float, int)
    assert Example(radius=2).radius == 2.0


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0 and <= 10 \(m\)"),
        ({"radius": 10.1}, ValueError, "radius is 10.1"),
        ({"radius": math.nan}, ValueError, "radius is nan"),
        ({"radius": math.inf}, ValueError, "radius is inf"),
        ({"radius": "1"}, TypeError, "radius is '1'"),
        ({"radius": True}, TypeError, "radius is True"),
        ({"count": 0}, ValueError, "count is 0: expected an integer >= 1 and <= 8"),
        ({"count": 9}, ValueError, "count is 9"),
        ({"count": 2.0}, TypeError, "count is 2.0: expected an integer"),
        ({"count": True}, TypeError, "count is True"),
        ({"mode": "slow"}, ValueError, "mode is 'slow': expected one of 'fast', 'good'"),
        ({"flip": 1}, TypeError, "flip is 1: expected True or False"),
        ({"limit": 0.5}, ValueError, r"limit is 0.5: expected a number >= 1 \(px\)"),
        ({"limit": -math.inf}, ValueError, "limit is -inf"),
        ({"limit": math.nan}, ValueError, "limit is nan"),
    ],
)
def test_values_out_of_range_are_refused_with_the_range_and_unit(
    values: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        Example(**values)


def test_help_texts_tell_range_and_unit() -> None:
    assert describe(Example) == [
        ("radius", "0.5", "reach (0 to 10; m)"),
        ("count", "4", "samples (1 to 8)"),
        ("mode", "fast", "how (fast, good)"),
        ("flip", "True", "whether"),
        ("limit", "inf", "largest size (1 or more; px)"),
    ]


TYPED: dict[Callable[..., Any], tuple[type[Params], ...]] = {
    gi.ssao: (gi.SsaoParams,),
    gi.hbao: (gi.HbaoParams,),
    gi.gtao: (gi.GtaoParams,),
    gi.bitmask_ao: (gi.BitmaskParams,),
    gi.bilateral_blur: (gi.BilateralParams,),
    gi.ssdo: (gi.SsdoParams,),
    gi.rsm_gather: (gi.RsmGatherParams, gi.RsmPublishedParams),
    gi.multires_splat: (gi.MultiresSplatParams, gi.MultiresPublishedParams),
    gi.vpl_splat: (gi.VplSplatParams,),
    gi.radiosity: (gi.RadiosityParams,),
    gi.reflections: (gi.ReflectionsParams,),
    gi.sampled_lights: (gi.SampledLightsParams,),
    gi.sky_rays: (gi.SkyRaysParams,),
    gi.area_lights: (gi.AreaLightsParams,),
    gi.accumulate: (gi.AccumulateParams,),
}
"""Functions with `**params`, and the dataclasses of what these may be."""

PUBLIC = [value for name in dir(gi) if inspect.isfunction(value := getattr(gi, name, None))]


def fields(*kinds: type[Params]) -> dict[str, Any]:
    """Return the type of each parameter that any of the dataclasses has."""
    return {name: get_type_hints(kind)[name] for kind in kinds for name in parameter_fields(kind)}


@pytest.mark.parametrize("function", TYPED, ids=lambda f: f.__name__)
def test_keywords_are_those_of_the_parameters(function: Callable[..., Any]) -> None:
    hints = get_type_hints(function)
    keywords = get_type_hints(get_args(hints["params"])[0])
    named = set(inspect.signature(function).parameters)
    assert not named & set(keywords)
    expected = fields(*TYPED[function])
    assert keywords == {name: kind for name, kind in expected.items() if name not in named}
    assert set(expected) <= named | set(keywords)


@pytest.mark.parametrize("function", TYPED, ids=lambda f: f.__name__)
def test_help_of_a_function_tells_meaning_range_unit_and_default_of_each_parameter(
    function: Callable[..., Any],
) -> None:
    text = " ".join((inspect.getdoc(function) or "").split())
    arguments = text.split("Args:")[1].split("Returns:")[0]
    named = inspect.signature(function).parameters
    for kind in TYPED[function]:
        for name, default, meaning in describe(kind):
            if name in named:
                assert re.search(rf"\b{name}(, \w+)*: ", arguments), name
            else:
                assert " ".join(f"{name}: {meaning}; by default {default}".split()) in arguments
    assert max(map(len, (inspect.getdoc(function) or "").splitlines())) <= 110


def test_keywords_of_choose_are_those_of_the_parameters() -> None:
    for keywords, kind in (
        (choosing._Ssao, gi.SsaoParams),
        (choosing._Hbao, gi.HbaoParams),
        (choosing._Gtao, gi.GtaoParams),
        (choosing._Bitmask, gi.BitmaskParams),
    ):
        asked = get_type_hints(choosing._Asked)
        assert get_type_hints(keywords) == fields(kind) | asked
    assert asked.items() <= get_type_hints(gi.choose).items()


@pytest.mark.parametrize("function", PUBLIC, ids=lambda f: f.__name__)
def test_no_public_function_takes_any_name_and_a_misspelt_one_is_named(function: Callable[..., Any]) -> None:
    own = parameter_names(function)
    assert own is not None or function is gi.choose
    if own is not None:
        check_keywords(function, own)
    for name in sorted(own or ()):
        with pytest.raises(TypeError, match=rf"^{function.__name__}\(\) has no .*: did you mean '"):
            function(**{f"{name}s": 1})


def test_messages() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=4, height=3)
    gbuffer = GBuffer(camera=camera, depth=np.ones((3, 4), np.float32))
    with pytest.raises(TypeError, match=r"^gtao\(\) has no .* 'radios': did you mean 'radius'\? It has bent_"):
        gi.gtao(gbuffer, radios=1)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match=r"^SsaoParams\(\) has no parameter 'sample': did you mean 'samples'\?"):
        gi.SsaoParams(sample=4)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"^render\(\) .*'exposur': did you mean 'exposure'\?"):
        gi.render(None, camera, [], bounces=0, exposur=1.0)  # type: ignore[call-arg, arg-type]
    with pytest.raises(TypeError, match=r"^choose\(\) of 'hbao' .*'attenuate': did you mean 'attenuation'\?"):
        gi.choose("hbao", (3, 4), preset="low", attenuate=1.0)  # type: ignore[call-overload]
    with pytest.raises(ValueError, match=r"'published'; did you mean 'published'\?$"):
        gi.SsdoParams(method="publish")
    assert unknown_name("it", "qqqq", ("b", "a")) == "it has no parameter 'qqqq': it has a, b"
