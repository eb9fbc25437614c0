"""What techniques of ambient occlusion share: every combination of resolution and blur."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ao.ssao import ssao_reference
from ssgi_cl.techniques.ao.ssao import SsaoParams, ssao

from ..analytic import camera, scene, tilted, trace

BLURS = [
    *((blur, (3, 5)) for blur in ((0, 1), (7, 1), (7, 2))),
    ((7, 2), (0, 0)),
    *(
        pytest.param(blur, margin, marks=pytest.mark.slow)
        for blur, margin in (((0, 1), (0, 0)), ((7, 1), (0, 0)), ((4, 2), (3, 5)))
    ),
]
"""(Radius, passes) of the blur and the G-buffer's margin."""


@pytest.mark.parametrize("resolution", ["full", "half", "quarter"])
@pytest.mark.parametrize("blur_resolution", ["own", "full"])
@pytest.mark.parametrize(("blur", "margin"), BLURS, ids=str)
def test_every_combination_of_resolution_and_blur_agrees_with_numpy_reference(
    runtime: Runtime,
    rng: np.random.Generator,
    resolution: str,
    blur_resolution: str,
    blur: tuple[int, int],
    margin: tuple[int, int],
) -> None:
    gbuffer = scene("bumpy", camera(size=(35, 51)), rng, margin=margin)
    params = {
        "radius": 0.4,
        "samples": 4,
        "resolution": resolution,
        "blur_resolution": blur_resolution,
        "blur_radius": blur[0],
        "blur_passes": blur[1],
    }
    found = ssao(gbuffer, runtime=runtime, **params)
    wanted = ssao_reference(gbuffer, SsaoParams(**params))
    # A sample that falls to the other side of an edge by rounding is 1/4 of A in its pixel, and so
    # may change the 15 x 15 round it. Measured: none.
    assert np.mean(np.abs(found - wanted) > 1e-3) <= 0.005


@pytest.mark.parametrize("resolution", ["half", "quarter"])
@pytest.mark.parametrize("degrees", [0.0, 60.0])
def test_plane_is_open_exactly_when_blurred_at_full_size(
    variant_runtime: Runtime, resolution: str, degrees: float
) -> None:
    made = Camera.look_at((0, 0, 5), (0, 0, 0), yfov=0.3, width=71, height=33)
    gbuffer = trace(made, [tilted(made, degrees)])
    a = ssao(gbuffer, radius=0.3, resolution=resolution, blur_radius=7, blur_resolution="full", runtime=variant_runtime)
    np.testing.assert_array_equal(a, 1.0)


def test_bad_blur_resolution_is_refused() -> None:
    with pytest.raises(ValueError, match=r"blur_resolution is 'half': expected"):
        SsaoParams(blur_resolution="half")
