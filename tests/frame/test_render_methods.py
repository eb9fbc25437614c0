"""`method=`: published methods by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams, bounce_methods
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.multires import multires_splat as multires
from ssgi_cl.techniques.rsm import rsm_gather as gather

from .scenes import MAPS


def rendered(runtime: Runtime, **options: Any) -> gi.Frame:
    made = BUILTIN_SCENES["cornell_box"]()
    return gi.render(
        made.scene,
        made.camera(48, 36),
        made.lights,
        bounces=0,
        runtime=runtime,
        ao=False,
        skips=False,
        outputs=("image", "indirect", "gbuffer"),
        **MAPS,
        **options,
    )


@pytest.mark.parametrize("indirect", [pytest.param("multires", marks=pytest.mark.slow), "gather"])
def test_render_gives_the_light_of_the_method_asked_for(runtime: Runtime, indirect: str) -> None:
    frame = rendered(runtime, indirect=indirect, method="published")
    own = rendered(runtime, indirect=indirect)
    made = BUILTIN_SCENES["cornell_box"]()
    lights = [light for light in made.lights if not isinstance(light, gi.Environment)]
    maps = [gi.rasterize.rsm(made.scene, light, size=64, runtime=runtime) for light in lights]
    function: Any = gi.multires_splat if indirect == "multires" else gi.rsm_gather
    wanted = function(frame.gbuffer, maps, method="published", runtime=runtime)
    # Positions of the maps' texels round differently on their way through host memory.
    np.testing.assert_allclose(frame.indirect, wanted, rtol=1e-3, atol=1e-3 * float(wanted.mean()))
    assert np.abs(frame.indirect - own.indirect).mean() > 1e-3 * wanted.mean()


def bounce(name: str, method: str | None = None) -> Any:
    """Return the parameters of a technique of one bounce in frames."""
    return FrameParams(indirect=name, method=method).techniques(0.5)[1]


def test_a_method_of_ssdo_comes_from_its_own_parameters() -> None:
    choices = bounce_methods("ssdo")
    assert set(choices) >= {"bitmask", "points"}
    for method in choices:
        assert isinstance(bounce("ssdo", method), gi.SsdoParams)
        assert bounce("ssdo", method).method == method
        assert bounce("ssdo", method).radius == 0.5
    assert bounce("ssdo") == bounce("ssdo", choices[0])


def test_the_default_method_is_the_first() -> None:
    for name, methods in (("multires", multires.METHODS), ("gather", gather.METHODS)):
        assert bounce_methods(name) == tuple(methods)
        for method, kind in methods.items():
            assert type(bounce(name, method)) is kind.params
        assert type(bounce(name)) is next(iter(methods.values())).params


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"indirect": "multires", "method": "points"}, r"method is 'points': expected one of 'adaptive', 'published'"),
        ({"indirect": True, "method": 3}, r"method is 3: expected one of 'adaptive', 'published'"),
        ({"indirect": "gather", "method": "flux"}, r"method is 'flux': expected one of 'unbiased', 'published'"),
        ({"indirect": "ssdo", "method": "slices"}, r"method is 'slices': expected one of 'bitmask', 'points'"),
        (
            {"indirect": "vpl", "method": "published"},
            r"method is 'published': expected None with indirect='vpl', which has no methods",
        ),
        ({"method": "published"}, r"method is 'published': expected None with indirect=None, which has no methods"),
    ],
    ids=str,
)
def test_a_method_that_the_technique_has_not_is_refused(
    runtime: Runtime, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        rendered(runtime, **options)
