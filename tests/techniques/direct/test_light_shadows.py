"""Screen-space shadows: against the numpy reference, where they must fall, and where they must
not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.direct.light_shadows import light_shadows_reference
from ssgi_cl.techniques.direct.light_data import PunctualLights
from ssgi_cl.techniques.direct.light_shadows import LightShadowParams, LightShadows, cone_misses

from ..analytic import CAMERAS, Ball, Plane, camera, scene, tilted, trace, uploaded

LIGHTS: tuple[Light, ...] = (
    DirectionalLight((-0.5, -1.0, -0.3), (1.0, 2.0, 3.0), angle=0.1),
    PointLight((0.5, 1.2, 0.4), (2.0, 1.0, 0.5), radius=0.2),
    SpotLight((1.5, 2.0, 1.0), (-1.0, -1.2, -0.8), 0.6, (3.0, 3.0, 1.0), radius=0.1),
    Environment(1.0),
)
PARAMS = LightShadowParams(radius=0.8)
ROUNDING = 2e-4
"""Relative to the light: a position rounds to some 1e-6 radii, which a shadow's onset multiplies
by 50."""
FLIPS = 4e-3
"""Share of pixels in which one of 12 taps to each light falls to the other side of a pixel's edge:
ways to lights run along rows and columns more often than at random."""


def lit(
    runtime: Runtime, gbuffer: GBuffer, lights: tuple[Light, ...], params: LightShadowParams = PARAMS
) -> NDArray[np.float32]:
    """Return irradiance [rows, columns, 3] from the kernel."""
    plane = LightShadows(runtime, gbuffer.size, params).run(uploaded(runtime, gbuffer), lights)
    assert plane is not None
    return np.moveaxis(plane.download(), 0, -1)


def assert_alike(a: NDArray[Any], b: NDArray[Any]) -> None:
    """Check that but for a few flips both are the same up to roundings."""
    assert np.isfinite(a).all()
    off = np.abs(a - b) > ROUNDING * np.maximum(1.0, np.abs(b))
    assert off.any(axis=-1).mean() <= FLIPS


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("name", ["corner", "bumpy"])
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = scene(name, camera(kind), rng, margin=(3, 5))
    assert_alike(lit(runtime, gbuffer, LIGHTS), light_shadows_reference(gbuffer, LIGHTS, PARAMS))


def test_every_kernel_variant_agrees_with_numpy_reference_with_two_layers(
    runtime: Runtime, variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    made = camera(size=(39, 53))
    front, floor = (scene(name, made, rng) for name in ("bumpy", "corner"))
    depth, behind = np.asarray(front.depth), np.asarray(floor.depth)
    deep = np.where(behind > depth + 1e-3, behind, np.inf)
    gbuffer = GBuffer(
        camera=made,
        depth=np.stack([depth, deep]),
        normal=front.normal,
        thickness=rng.uniform(0.0, 1.6, depth.shape).astype(np.float32),
    )
    params = LightShadowParams(radius=0.8, taps=7, thickness=2.0)
    found = lit(variant_runtime, gbuffer, LIGHTS, params)
    assert_alike(found, light_shadows_reference(gbuffer, LIGHTS, params))
    # Contraction is off: bit-identical results.
    np.testing.assert_array_equal(found, lit(runtime, gbuffer, LIGHTS, params))


def test_ball_casts_its_shadow_where_geometry_says(runtime: Runtime) -> None:
    # From above, with the sun at 45 degrees: the shadow on the floor is an ellipse beside the ball.
    made = Camera.look_at((0, 6, 0), (0, 0, 0), up=(0, 0, -1), width=160, height=160)
    ball = Ball((0.0, 0.5, 0.0), 0.5)
    gbuffer = trace(made, [Plane((0, 0, 0), (0, 1, 0)), ball])
    sun = DirectionalLight((1.0, -1.0, 0.0), 1.0)
    params = LightShadowParams(radius=2.0, taps=64, thickness=0.5)
    found = lit(runtime, gbuffer, (sun,), params)[..., 0]
    depth = np.asarray(gbuffer.depth)
    point = made.unproject(depth)
    to_sun = -np.asarray(sun.direction)
    way = np.asarray(ball.centre) - point
    beside = np.linalg.norm(way - (way @ to_sun)[..., None] * to_sun, axis=-1)
    floor = np.abs(point[..., 1]) < 1e-3
    # But for the rim, some px wide, where the onset of 0.04 units and the lower half of the ball,
    # which is not seen, count.
    pixel = 6.0 / 160
    dark = floor & (beside < ball.radius - 4 * pixel) & (point[..., 0] > 0.4)
    bright = floor & (beside > ball.radius + 2 * pixel)
    assert dark.sum() > 60
    assert found[dark].mean() < 0.05
    # Beside the rim, a tap may fall into a pixel half of which is the ball.
    assert np.mean(np.abs(found[bright] - np.sqrt(0.5)) > 1e-5) < 1e-3


@pytest.mark.parametrize("kind", CAMERAS)
def test_what_is_not_shadowed_is_lit_exactly(runtime: Runtime, kind: str) -> None:
    made = camera(kind)
    for degrees in (0.0, 45.0, 80.0):
        gbuffer = trace(made, [tilted(made, degrees)], margin=(2, 3))
        device = uploaded(runtime, gbuffer)
        without = PunctualLights(runtime, gbuffer.size).run(device, LIGHTS)
        assert without is not None
        found = LightShadows(runtime, gbuffer.size, PARAMS).run(device, LIGHTS)
        assert found is not None
        np.testing.assert_array_equal(found.download(), without.download())


def test_scale_of_the_world_does_not_matter(runtime: Runtime) -> None:
    results = []
    for scale in (1.0, 1e3):
        rng = np.random.default_rng(1)
        gbuffer = scene("bumpy", camera(scale=scale), rng, scale=scale)
        punctual_light = PointLight(scale * np.array([0.5, 1.2, 0.4]), scale**2, radius=0.2 * scale)
        results.append(lit(runtime, gbuffer, (punctual_light,), LightShadowParams(radius=0.8 * scale)))
    assert_alike(*results)


def test_larger_light_has_a_softer_shadow(runtime: Runtime) -> None:
    made = camera()
    gbuffer = scene("ball", made, np.random.default_rng(1))
    shares = []
    for radius in (0.0, 0.4):
        punctual_light = PointLight((0.3, 2.5, 0.2), 4.0, radius=radius)
        plain = lit(
            runtime,
            gbuffer,
            (PointLight(punctual_light.position, punctual_light.intensity),),
            LightShadowParams(radius=1e-3),
        )[..., 0]
        found = lit(runtime, gbuffer, (punctual_light,), LightShadowParams(radius=2.0, taps=32))[..., 0]
        share = np.divide(found, plain, where=plain > 0.0, out=np.zeros_like(found))
        tiles = share[:44, :60].reshape(11, 4, 15, 4).mean(axis=(1, 3))
        shares.append(np.mean((tiles > 0.1) & (tiles < 0.9)))
    assert shares[1] > 1.3 * shares[0]


def test_lights_that_reach_nothing_are_skipped_and_say_why(runtime: Runtime) -> None:
    made = camera()
    gbuffer = trace(made, [tilted(made, 20.0)])
    device = uploaded(runtime, gbuffer)
    behind = SpotLight((1.0, 2.0, 8.0), (0.1, 0.1, 1.0), 0.5, 1.0)
    towards = SpotLight((1.0, 2.0, 8.0), (-0.2, -0.4, -1.0), 0.5, 1.0)
    assert cone_misses(device, behind)
    assert not cone_misses(device, towards)
    with runtime.frame():
        shadows = LightShadows(runtime, gbuffer.size)
        assert shadows.run(device, (behind, PointLight((0, 0, 0), 0.0))) is None
    assert [(time.name, time.skipped) for time in runtime.times()] == [
        ("light spot", "its cone misses all that is seen"),
        ("light point", "it emits nothing"),
    ]


@pytest.mark.parametrize("kind", CAMERAS)
def test_cone_that_is_said_to_miss_lights_nothing(runtime: Runtime, kind: str) -> None:
    rng = np.random.default_rng(3)
    gbuffer = scene("bumpy", camera(kind), rng, margin=(2, 2))
    device = uploaded(runtime, gbuffer)
    punctual_lights = PunctualLights(runtime, gbuffer.size)
    missed = 0
    for _ in range(40):
        light = SpotLight(rng.uniform(-8.0, 8.0, 3), rng.normal(size=3), rng.uniform(0.1, 1.2), 1.0)
        if cone_misses(device, light):
            missed += 1
            plane = punctual_lights.run(device, (light,))
            assert plane is not None
            assert not plane.download().any()
    assert missed > 5


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"radius": 0.0}, r"radius is 0.0: expected a number > 0.*scene units"),
        ({"taps": 0}, r"taps is 0: expected an integer >= 1 and <= 256"),
        ({"thickness": -1.0}, r"thickness is -1.0: expected a number >= 0.*radii"),
        ({"bias": 2.0}, r"bias is 2.0: expected a number >= 0 and <= 1"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(params: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LightShadowParams(**params)
