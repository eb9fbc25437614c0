"""Keyword parameters: typed as the dataclass declares them, and a misspelt one is named."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import check_keywords, parameter_names, unknown_name
from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.tuning import choose as choosing

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
