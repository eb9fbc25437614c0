"""Results of every technique and form: finite and within their range for all allowed inputs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.multi_bounce import multi_bounce
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.filters.bilateral import bilateral_blur
from ssgi_cl.techniques.filters.tonemap import tonemap
from ssgi_cl.techniques.filters.upsample import coarse_size, upsample
from ssgi_cl.techniques.multires.multires_splat import multires_splat
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather
from ssgi_cl.techniques.ssdo.ssdo import ssdo
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.techniques.vpl.vpl_splat import vpl_splat

from .inputs import gbuffers, hdr, lights, maps, radii, seeds

Draw = Callable[[st.SearchStrategy[Any]], Any]
FEW_SAMPLES: dict[str, Any] = {"slices": 1, "taps": 4, "samples": 4, "shadow_taps": 4}
ROUNDINGS = 1e-5
"""By which a weighted mean of at most 33 x 33 values may pass them."""


def within(result: NDArray[Any], low: float = 0.0, high: float = np.inf) -> None:
    assert np.isfinite(result).all()
    assert result.min() >= low
    assert result.max() <= high


def chosen(draw: Draw, **options: tuple[Any, ...]) -> dict[str, Any]:
    """Draw one of each option."""
    return {name: draw(st.sampled_from(values)) for name, values in options.items()}


def nothing(gbuffer: GBuffer) -> NDArray[np.bool_]:
    """Return where nothing is."""
    empty: NDArray[np.bool_] = np.isinf(gbuffer.inner(np.asarray(gbuffer.first("depth"))))
    return empty


def occlusion(technique: Technique) -> Any:
    """Return the check of a technique of ambient occlusion with one of each of its variants."""

    def check(draw: Draw, runtime: Runtime) -> None:
        gbuffer, params = draw(gbuffers()), chosen(draw, **technique.variants)
        a = technique.function(gbuffer, draw(radii), runtime=runtime, **params)
        if params.get("bent_normals"):
            a, bent = a
            within(bent, -1.0 - ROUNDINGS, 1.0 + ROUNDINGS)
        within(a, 0.0, 1.0)
        assert (a[nothing(gbuffer)] == 1.0).all()

    return check


def directional(method: str) -> Any:
    def check(draw: Draw, runtime: Runtime) -> None:
        gbuffer = draw(gbuffers())
        both = ssdo(
            gbuffer,
            draw(lights()),
            draw(radii),
            runtime=runtime,
            method=method,
            bounce=draw(st.booleans()),
            **FEW_SAMPLES,
        )
        for irradiance in both:
            within(irradiance)
            assert not irradiance[nothing(gbuffer)].any()

    return check


def one_bounce(technique: Callable[..., Any], **options: tuple[Any, ...]) -> Any:
    def check(draw: Draw, runtime: Runtime) -> None:
        gbuffer = draw(gbuffers())
        given, params = draw(maps()), chosen(draw, **options)
        try:
            irradiance = technique(gbuffer, given, runtime=runtime, **params)
        except ValueError as refused:  # all surfaces are nearer than 1e-15, or farther than 1e9
            if "scale the scene" not in str(refused):
                raise
            return
        within(irradiance)
        assert not irradiance[nothing(gbuffer)].any()

    return check


def shading(draw: Draw, runtime: Runtime) -> None:
    gbuffer, punctual_lights, rsms = draw(gbuffers()), draw(lights()), None
    if draw(st.booleans()):
        own = draw(maps())
        punctual_lights, rsms = [own.light], [own]
    rng = np.random.default_rng(draw(seeds))
    ao = rng.random(gbuffer.size) if draw(st.booleans()) else None
    indirect = hdr(rng, (*gbuffer.size, 3)) if draw(st.booleans()) else None
    bounces = draw(st.booleans())
    options = {"shadow_maps": rsms, "ao": ao, "indirect": indirect, "multi_bounce": bounces}
    within(shade(gbuffer, punctual_lights, runtime=runtime, **options))


def blurring(draw: Draw, runtime: Runtime) -> None:
    gbuffer = draw(gbuffers())
    image = hdr(np.random.default_rng(draw(seeds)), (*gbuffer.size, 3))
    image = image if draw(st.booleans()) else image[..., 0]
    blurred = bilateral_blur(image, gbuffer, runtime=runtime, separable=draw(st.booleans()))
    within(blurred, image.min() * (1.0 - ROUNDINGS), image.max() * (1.0 + ROUNDINGS))
    np.testing.assert_array_equal(blurred[nothing(gbuffer)], image[nothing(gbuffer)])


def upsampling(draw: Draw, runtime: Runtime) -> None:
    gbuffer, step = draw(gbuffers()), draw(st.sampled_from((1, 2, 4)))
    image = hdr(np.random.default_rng(draw(seeds)), (*coarse_size(gbuffer.size, step), 3))
    fine = upsample(image, gbuffer, step=step, runtime=runtime)
    within(fine, 0.0, image.max() * (1.0 + ROUNDINGS))
    assert not fine[nothing(gbuffer)].any()


def view_normals(draw: Draw, runtime: Runtime) -> None:
    gbuffer = draw(gbuffers())
    device = on_device(gbuffer, runtime)
    there = np.isfinite(np.asarray(gbuffer.first("depth")))
    length = np.linalg.norm(device.normal.download()[:3].astype(np.float64), axis=0)
    np.testing.assert_allclose(length, there, atol=1e-4)  # of a turned float32 vector
    assert (np.isfinite(device.linear.download()[0]) == there).all()


def tone_mapping(draw: Draw, runtime: Runtime) -> None:
    image = hdr(np.random.default_rng(draw(seeds)), (5, 19, 3))
    params = chosen(draw, curve=("filmic", "clip"), exposure=(None, 1e-20, 1e20))
    picture = tonemap(image, runtime=runtime, **params)
    assert picture.shape == image.shape
    assert not picture[~image.any(axis=-1)].any()  # black stays so


def bouncing(draw: Draw, runtime: Runtime) -> None:
    rng = np.random.default_rng(draw(seeds))
    a = rng.random((5, 19), np.float32) * draw(st.sampled_from((1.0, 1e-40, 0.0)))
    within(multi_bounce(a, rng.random((5, 19, 3))) - a[..., None], 0.0, 1.0)


CHECKS: dict[str, Callable[[Draw, Runtime], None]] = {
    "view normals": view_normals,
    **{name.replace("_", " "): occlusion(each) for name, each in of_kind("ao").items()},
    "ssdo bitmask": directional("bitmask"),
    "ssdo points": directional("points"),
    "ssdo published": directional("published"),
    "rsm gather": one_bounce(
        rsm_gather, samples=(1, 50), pattern=("flux", "fixed", "rotated", "all"), resolution=("full", "adaptive")
    ),
    "rsm gather as published": one_bounce(
        rsm_gather, method=("published",), samples=(1, 50), spacing=(1, 2, 8), radius=(0.1, 2.0)
    ),
    "vpl splat": one_bounce(
        vpl_splat,
        vpls=(1, 100),
        cutoff=(0.0, 0.01),
        near=("disk", "clamped"),
        interleave=(False, True),
        unit_distance=(1.0, 1e-3, 1e5),
    ),
    "multires splat": one_bounce(multires_splat, vpls=(1, 100), near=("disk", "clamped"), coarsest=(1, 16)),
    "multires splat as published": one_bounce(
        multires_splat, method=("published",), vpls=(1, 100), levels=(1, 2, 7), depth_threshold=(0.0, 1.0)
    ),
    "shade": shading,
    "blur": blurring,
    "upsample": upsampling,
    "tonemap": tone_mapping,
    "multiple bounces": bouncing,
}

QUICK = ("view normals", "upsample", "tonemap", "multiple bounces")
"""Checks whose kernels take a second or two to compile; the others are for the slow tests."""


def examples(count: int) -> Any:
    """Return settings of hypothesis: the same examples in every run."""
    return settings(
        max_examples=count, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
    )


@pytest.mark.parametrize("name", QUICK)
@examples(20)
@given(data=st.data())
def test_results_are_finite_and_in_range(runtime: Runtime, name: str, data: Any) -> None:
    CHECKS[name](data.draw, runtime)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
@examples(60)
@given(data=st.data())
def test_many_results_are_finite_and_in_range(variant_runtime: Runtime, name: str, data: Any) -> None:
    try:
        CHECKS[name](data.draw, variant_runtime)
    except DeviceError as refused:
        # Images have only so many rows; layers and channels lie one below the other in them.
        images = variant_runtime.variant.storage == "image"
        if not images or "has images of at most" not in str(refused):
            raise
