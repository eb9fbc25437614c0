"""Lights reflected by Phong lobes: against the float64 reference, closed forms, and energy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.raster.view import gbuffer as draw
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.direct.shade import shade_reference
from ssgi_cl.techniques.direct.shade import shade

from ..analytic import CAMERAS, Ball, Plane, camera, scene, trace

LIGHTS = (
    SpotLight((0.5, 3.0, 1.0), (-0.1, -1.0, -0.4), 0.6, (3, 2, 1)),
    PointLight((0.3, 1.5, 1.2), (1, 2, 3)),
    DirectionalLight((-0.3, -1.0, -0.5), (3, 2, 1)),
    Environment((0.2, 0.4, 0.6)),
)


def glossy(gbuffer: GBuffer, rng: np.random.Generator, most: float = 60.0) -> GBuffer:
    """Return the G-buffer with random albedo, specular and gloss, a fifth of it matt."""
    size = np.asarray(gbuffer.depth).shape[-2:]
    matt = rng.random(size) < 0.2
    return replace(
        gbuffer,
        albedo=rng.random((*size, 3), np.float32),
        specular=np.where(matt[..., None], 0.0, rng.random((*size, 3))).astype(np.float32),
        gloss=np.exp(rng.uniform(0.0, math.log(most), size)).astype(np.float32),
    )


def share_off(a: NDArray[np.float32], b: NDArray[np.float64], relative: float) -> float:
    """Return the share of values that differ by more than that of their own, or of the mean."""
    return float(np.mean(~(np.abs(a - b) <= relative * (np.abs(b) + b.mean()))))


@pytest.mark.parametrize("kind", CAMERAS)
def test_kernel_agrees_with_reference(variant_runtime: Runtime, rng: np.random.Generator, kind: str) -> None:
    for name in ("corner", "bumpy"):
        drawn = scene(name, camera(kind, (21, 37)), rng, margin=(2, 3))
        gbuffer = glossy(drawn, rng)
        found = shade(gbuffer, LIGHTS, runtime=variant_runtime)
        # The logarithm of a power of 60 rounds by 3e-7; pixels on a cone's edge may fall outside.
        assert share_off(found, shade_reference(gbuffer, LIGHTS), 1e-4) <= 2e-3, name
        matt = shade(replace(gbuffer, specular=None, gloss=None), LIGHTS, runtime=variant_runtime)
        assert (found >= matt).all()
        assert found.mean() > 1.02 * matt.mean()


def test_sharp_lobes_keep_their_precision(runtime: Runtime, rng: np.random.Generator) -> None:
    """A cosine near 1 in float32 is off by 6e-8, which an exponent of 1e6 would make 6 %."""
    made = Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, 1), view_height=0.02, width=64,
                               height=48)  # fmt: skip
    plane = trace(made, [Plane((0, 0, 0), (0, 1, 0))])
    gbuffer = replace(plane, albedo=np.zeros((48, 64, 3)), specular=np.ones((48, 64, 3)), gloss=np.full((48, 64), 1e6))
    light = PointLight((0.0, 4.0, 0.0), 1.0)
    found = shade(gbuffer, [light], runtime=runtime)[..., 0]
    expected = shade_reference(gbuffer, [light])[..., 0]
    # Directions round by 1e-7, of the lobe's width of 1e-3: 1e-4 of the exponent, which is 5 here.
    seen = expected > 1e-2 * expected.max()
    assert 100 < seen.sum() < seen.size
    np.testing.assert_allclose(found[seen], expected[seen], rtol=2e-3)


def test_a_highlight_on_a_small_sphere_does_not_depend_on_where_pixels_fall(runtime: Runtime) -> None:
    """A ball of 12 pixels, of which a highlight of gloss 1000 is 1/10 of a pixel wide."""
    light = DirectionalLight((-0.4, -1.0, -0.7), 1.0)
    sums = []
    for shift in np.linspace(0.0, 1.0, 7):
        made = Camera.orthographic((0.1 * shift, 0.05 * shift, 5), (0.1 * shift, 0.05 * shift, 0),
                                   view_height=2.4, width=24, height=24)  # fmt: skip
        ball = trace(made, [Ball((0, 0, 0), 0.6)])
        gbuffer = replace(
            ball, albedo=np.zeros((24, 24, 3)), specular=np.ones((24, 24, 3)), gloss=np.full((24, 24), 1000.0)
        )
        sums.append(float(shade(gbuffer, [light], runtime=runtime).sum()))
    # At 16 times the resolution it is 27, in all places; unwidened lobes give 0 to 247.
    assert min(sums) > 0.6 * 27.0
    assert max(sums) < 1.6 * 27.0


def test_shadows_hide_lights_from_lobes_too(runtime: Runtime) -> None:
    built = BUILTIN_SCENES["workshop"]()
    camera_ = built.camera(120, 90)
    gbuffer = draw(built.scene, camera_, runtime=runtime)
    assert gbuffer.specular is not None
    light = next(light for light in built.lights if not isinstance(light, Environment))
    black = replace(gbuffer, albedo=np.zeros_like(gbuffer.albedo), emission=None)
    maps = [rsm(built.scene, light, size=256, runtime=runtime)]
    found = shade(black, [light], shadow_maps=maps, runtime=runtime)
    expected = shade_reference(black, [light], shadow_maps=maps)
    # Receivers on the border of a texel's shadow may fall to either side.
    assert share_off(found, expected, 1e-3) < 5e-3
    assert found.sum() < 0.8 * shade(black, [light], runtime=runtime).sum()
