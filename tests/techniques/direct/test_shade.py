"""Deferred shading: against its float64 reference and formulas of light."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.direct.shade import direct_reference, shade_reference, world_surface
from ssgi_cl.techniques.direct.shade import Shade, shade

from ..analytic import CAMERAS, Plane, camera, check_second_run, scene, share_off, slow_but, tilted, trace, uploaded

ROUNDING = 1e-5
"""Relative to the brightest pixel: float32 positions and normals, a few roundings of 2^-24 each."""
FLIPS = 1e-3
"""Share of pixels that may fall to the other side of a cone's edge or of a texel of the sky.

Measured over all scenes, cameras and lights here: none of 258030. An image here may have 2.
"""


def off(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the share of values that differ by more than rounding."""
    return share_off(a, b, ROUNDING * max(float(np.abs(b).max()), 1e-30))


def painted(gbuffer: GBuffer, rng: np.random.Generator, *, emits: bool = True) -> GBuffer:
    """Return the G-buffer with random albedo and emission."""
    shape = (*np.asarray(gbuffer.depth).shape[-2:], 3)
    return replace(
        gbuffer, albedo=rng.random(shape, np.float32), emission=rng.random(shape, np.float32) if emits else None
    )


def white(gbuffer: GBuffer) -> GBuffer:
    """Return the G-buffer with albedo 1, so that radiance is irradiance / pi."""
    return replace(gbuffer, albedo=np.ones((*np.asarray(gbuffer.depth).shape[-2:], 3)))


def sky_image() -> NDArray[np.float64]:
    """Return a latitude-longitude image with a bright spot."""
    image = np.random.default_rng(3).random((8, 16, 3))
    image[2, 5] = 20.0
    return image


LIGHTS: dict[str, tuple[Light, ...]] = {
    "spot": (SpotLight((0.5, 3.0, 1.0), (-0.1, -1.0, -0.4), 0.6, (3, 2, 1)),),
    "point": (PointLight((0.3, 1.5, 1.2), (1, 2, 3)),),
    "directional": (DirectionalLight((-0.3, -1.0, -0.5), (3, 2, 1)),),
    "constant environment": (Environment((0.2, 0.4, 0.6)),),
    "image environment": (Environment(sky_image()),),
}
LIGHTS["all"] = (*(light for lights in LIGHTS.values() for light in lights), PointLight((-1.0, 0.5, 1.0), 0.5))


# ---- against the float64 reference


@pytest.mark.parametrize(
    ("kind", "lights"),
    [  # every camera with all lights at once, and one with each by itself
        pytest.param(kind, name, marks=[pytest.mark.slow] * (name != "all" and kind != "perspective"))
        for kind in CAMERAS
        for name in LIGHTS
    ],
)
def test_kernel_agrees_with_reference_for_every_light_and_camera(
    runtime: Runtime, rng: np.random.Generator, kind: str, lights: str
) -> None:
    given = LIGHTS[lights]
    for name in ("corner", "bumpy", "noisy"):
        gbuffer = painted(scene(name, camera(kind), rng), rng)
        radiance = shade(gbuffer, given, runtime=runtime)
        assert radiance.dtype == np.float32
        assert off(radiance, shade_reference(gbuffer, given)) <= FLIPS, name


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("margin", [(0, 0), (3, 5), (17, 16)], ids=str)
def test_every_kernel_variant_agrees_with_reference_with_all_inputs(
    variant_runtime: Runtime, rng: np.random.Generator, kind: str, margin: tuple[int, int]
) -> None:
    size = (21, 37)
    gbuffer = painted(scene("bumpy", camera(kind, size), rng, margin=margin), rng)
    ao = rng.random(size, np.float32)
    indirect = rng.random((*size, 3), np.float32)
    lights = LIGHTS["all"]
    radiance = shade(gbuffer, lights, ao=ao, indirect=indirect, runtime=variant_runtime)
    expected = shade_reference(gbuffer, lights, ao=ao, indirect=indirect)
    assert radiance.shape == (*size, 3)
    assert off(radiance, expected) <= FLIPS


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1, 1), (17, 31), (3, 5), (16, 64)], ids=str)
def test_every_kernel_variant_gives_bit_identical_results(
    runtime: Runtime, other_variant: Runtime, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    gbuffer = painted(scene("corner", camera(size=size), rng), rng)
    a = shade(gbuffer, LIGHTS["all"], runtime=runtime)
    b = shade(gbuffer, LIGHTS["all"], runtime=other_variant)
    # Contraction is off, so variants differ only where a device's division or root is not exact.
    np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-7)


# ---- formulas


def test_plane_under_a_point_light_has_irradiance_i_cos_over_d_squared(variant_runtime: Runtime) -> None:
    made = Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, 1), view_height=8, width=64, height=48)
    gbuffer = white(trace(made, [Plane((0, 0, 0), (0, 1, 0))]))
    position = made.unproject(np.asarray(gbuffer.depth))
    light = PointLight((0.4, 1.5, -0.3), (2.0, 1.0, 0.5))
    radiance = shade(gbuffer, [light], runtime=variant_runtime)
    to_light = np.asarray(light.position) - position
    distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
    irradiance = np.asarray(light.intensity) * to_light[..., 1:2] / distance**3
    # Depth, position and its square round by 2^-24 each, of up to 9 units.
    np.testing.assert_allclose(radiance * np.pi, irradiance, rtol=1e-5)


def test_spot_shines_within_its_cone_and_nowhere_else(variant_runtime: Runtime) -> None:
    made = Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, 1), view_height=8, width=96, height=96)
    gbuffer = white(trace(made, [Plane((0, 0, 0), (0, 1, 0))]))
    position = made.unproject(np.asarray(gbuffer.depth))
    light = SpotLight((0, 2, 0), (0, -1, 0), 0.7, 1.0)
    lit = shade(gbuffer, [light], runtime=variant_runtime)[..., 0] > 0
    radius = np.hypot(position[..., 0], position[..., 2])
    edge = 2 * math.tan(0.7)
    clear = np.abs(radius - edge) > 1e-4  # the cosine at the edge rounds by 2^-24 / sin 0.7
    np.testing.assert_array_equal(lit[clear], radius[clear] < edge)
    assert 0 < lit.sum() < lit.size


@pytest.mark.parametrize("kind", slow_but(["perspective", "orthographic"], "perspective"))
@pytest.mark.parametrize("degrees", [0.0, 60.0, 75.0])
def test_smooth_edge_of_a_cone_is_that_of_the_pixels_square(runtime: Runtime, kind: str, degrees: float) -> None:
    made, fine = camera(kind), camera(kind, (8 * 47, 8 * 61))
    plane, gbuffer = tilted(made, degrees), trace(made, [tilted(made, degrees)])
    ahead = made.position - 5.0 * made.view[2, :3]
    light = SpotLight(ahead + 3.0 * plane.normal + 0.7 * made.view[0, :3], -plane.normal, 0.4, 1.0)
    position, normal, _ = world_surface(trace(fine, [plane]))
    squares = direct_reference(light, position, normal)[..., 0].reshape(47, 8, 61, 8).mean((1, 3))
    position, normal, _ = world_surface(gbuffer)
    centres = direct_reference(light, position, normal)[..., 0]
    device = uploaded(runtime, white(gbuffer))
    lit = Shade(runtime, device.size, smooth=True).light(device, [light])
    assert lit is not None
    found = lit.download()[0]
    # The share of a square that an edge cuts falls in a line only if that runs along a side: across
    # corners a line is .06 off. Measured: .04 to .06, and .07 to .14 of what centres err by.
    brightest = squares.max()
    assert np.abs(found - squares).max() < 0.08 * brightest
    edge = np.abs(centres - squares) > 0.02 * brightest
    assert edge.sum() > 20
    assert np.abs(found - squares)[edge].mean() < 0.16 * np.abs(centres - squares)[edge].mean()


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 85.0])
def test_directional_light_gives_its_irradiance_times_the_cosine(variant_runtime: Runtime, degrees: float) -> None:
    made = camera("orthographic", (9, 20))
    plane = tilted(made, degrees, distance=100.0)
    light = DirectionalLight(made.view[2, :3] * -3.0, (5.0, 2.0, 1.0))
    radiance = shade(white(trace(made, [plane])), [light], runtime=variant_runtime)
    expected = np.asarray(light.irradiance) * math.cos(math.radians(degrees)) / np.pi
    # The normal's components round by 2^-25 each, relative to a cosine of 0.087 at least.
    np.testing.assert_allclose(radiance, np.broadcast_to(expected, radiance.shape), rtol=2e-6)


def test_constant_environment_gives_albedo_times_its_radiance(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = painted(scene("bumpy", camera(), rng), rng, emits=False)
    sky = np.array([0.2, 1.0, 7.0])
    radiance = shade(gbuffer, [Environment(sky)], runtime=variant_runtime)
    there = np.isfinite(np.asarray(gbuffer.depth))[..., None]
    # E = pi L, radiance = albedo / pi E: three roundings.
    expected = np.where(there, np.asarray(gbuffer.albedo) * sky, sky)
    np.testing.assert_allclose(radiance, expected, rtol=5e-7)


def test_back_of_a_surface_is_not_lit(runtime: Runtime) -> None:
    made = Camera.orthographic((0, -9, 0), (0, 0, 0), (0, 0, 1), view_height=8, width=20, height=9)
    gbuffer = white(trace(made, [Plane((0, 0, 0), (0, 1, 0))]))
    lights = (*LIGHTS["spot"], *LIGHTS["point"], *LIGHTS["directional"])
    np.testing.assert_array_equal(shade(gbuffer, lights, runtime=runtime), 0.0)


def test_no_light_at_all_leaves_emission(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = painted(scene("noisy", camera(), rng), rng)
    there = np.isfinite(np.asarray(gbuffer.depth))[..., None]
    radiance = shade(gbuffer, [], runtime=variant_runtime)
    np.testing.assert_array_equal(radiance, np.where(there, np.asarray(gbuffer.emission), 0.0))
    dull = replace(gbuffer, emission=None)
    np.testing.assert_array_equal(shade(dull, [], runtime=variant_runtime), 0.0)


# ---- what each input does


def test_ao_never_darkens_direct_light(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = painted(scene("bumpy", camera(size=(21, 37)), rng), rng)
    lights = (*LIGHTS["spot"], *LIGHTS["point"], *LIGHTS["directional"])
    closed = shade(gbuffer, lights, ao=np.zeros(gbuffer.size), runtime=variant_runtime)
    np.testing.assert_array_equal(closed, shade(gbuffer, lights, runtime=variant_runtime))


def test_radiance_is_direct_plus_ao_times_ambient_plus_indirect_plus_emission(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = painted(scene("bumpy", camera(size=(21, 37)), rng), rng)
    dull = replace(gbuffer, emission=None)
    there = np.isfinite(np.asarray(gbuffer.depth))[..., None]
    punctual_lights = (*LIGHTS["spot"], *LIGHTS["point"])
    skies = LIGHTS["image environment"]
    ao = rng.random(gbuffer.size, np.float32)
    indirect = rng.random((*gbuffer.size, 3), np.float32)
    parts = (
        shade(dull, punctual_lights, runtime=variant_runtime).astype(np.float64)
        + ao[..., None] * shade(dull, skies, runtime=variant_runtime)
        + shade(dull, [], indirect=indirect, runtime=variant_runtime)
        + np.asarray(gbuffer.emission)
    )
    whole = shade(gbuffer, punctual_lights + skies, ao=ao, indirect=indirect, runtime=variant_runtime)
    np.testing.assert_allclose(
        whole[there[..., 0]],
        parts[there[..., 0]],
        rtol=1e-6,  # four sums round by 2^-24
    )


def test_order_of_lights_does_not_matter(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = painted(scene("bumpy", camera(), rng), rng)
    a = shade(gbuffer, LIGHTS["all"], runtime=runtime)
    b = shade(gbuffer, LIGHTS["all"][::-1], runtime=runtime)
    np.testing.assert_allclose(a, b, rtol=1e-6)  # sums round in another order


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_radiance_is_proportional_to_the_light(runtime: Runtime, rng: np.random.Generator, factor: float) -> None:
    gbuffer = painted(scene("bumpy", camera(), rng), rng, emits=False)
    scaled: list[Light] = [
        SpotLight((0.5, 3.0, 1.0), (-0.1, -1.0, -0.4), 0.6, factor * np.array([3, 2, 1])),
        PointLight((0.3, 1.5, 1.2), factor * np.array([1, 2, 3])),
        DirectionalLight((-0.3, -1.0, -0.5), factor * np.array([3, 2, 1])),
        Environment(factor * np.array([0.2, 0.4, 0.6])),
    ]
    base = (*LIGHTS["spot"], *LIGHTS["point"], *LIGHTS["directional"], LIGHTS["all"][3])
    a = shade(gbuffer, scaled, runtime=runtime)
    np.testing.assert_allclose(a / factor, shade(gbuffer, base, runtime=runtime), rtol=2e-6)


@pytest.mark.parametrize(
    "light",
    [SpotLight((0, 3, 0), (0, -1, 0), 0.5, 0), PointLight((0, 3, 0), 0), DirectionalLight((0, -1, 0), 0)],
    ids=["spot", "point", "directional"],
)
def test_light_that_emits_nothing_is_skipped_with_a_reason(
    runtime: Runtime, rng: np.random.Generator, light: Light
) -> None:
    gbuffer = white(scene("corner", camera(), rng))
    np.testing.assert_array_equal(shade(gbuffer, [light], runtime=runtime), 0.0)
    skipped = [p for p in runtime.times() if p.skipped]
    assert [(p.name.split()[0], p.skipped) for p in skipped] == [("light", "it emits nothing")]


def test_sum_of_environments_of_different_kinds(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = painted(scene("noisy", camera(), rng), rng)
    image = sky_image()
    a = shade(gbuffer, [Environment(image), Environment(0.5)], runtime=runtime)
    expected = shade_reference(gbuffer, [Environment(image), Environment(0.5)])
    assert off(a, expected) <= FLIPS


# ---- extremes


def test_light_at_a_surface_point_gives_finite_radiance(variant_runtime: Runtime) -> None:
    made = camera(size=(9, 20))
    gbuffer = white(trace(made, [tilted(made, 40.0)]))
    position, _, _ = world_surface(gbuffer)
    for at in (position[4, 7], position[4, 7] + 1e-20, position[4, 7] + 1e-6):
        for light in (PointLight(at, 1e6), SpotLight(at, (0, -1, 0), 1.0, 1e6)):
            assert np.isfinite(shade(gbuffer, [light], runtime=variant_runtime)).all()


def test_absurdly_bright_light_gives_finite_radiance(runtime: Runtime, rng: np.random.Generator) -> None:
    brightness = 1e30  # brighter lights are refused
    gbuffer = white(scene("noisy", camera(), rng))
    for light in (
        PointLight((0.3, 1.5, 1.2), brightness),
        SpotLight((0.5, 3.0, 1.0), (-0.1, -1.0, -0.4), 0.6, brightness),
        DirectionalLight((0, -1, 0), brightness),
        Environment(brightness),
    ):
        assert np.isfinite(shade(gbuffer, [light, light], runtime=runtime)).all()


def test_scene_a_million_units_away_looks_the_same(runtime: Runtime, rng: np.random.Generator) -> None:
    shift = np.array([1e6, -1e6, 1e6])
    here = white(scene("corner", camera(), rng))
    there = white(scene("corner", camera(shift=shift), rng, shift=shift))
    near: list[Light] = [PointLight((0.3, 1.5, 1.2), 1.0), *LIGHTS["spot"]]
    spot = LIGHTS["spot"][0]
    assert isinstance(spot, SpotLight)
    far: list[Light] = [
        PointLight(np.array([0.3, 1.5, 1.2]) + shift, 1.0),
        SpotLight(np.asarray(spot.position) + shift, spot.direction, 0.6, spot.intensity),
    ]
    a, b = shade(here, near, runtime=runtime), shade(there, far, runtime=runtime)
    # A float64 position of 1e6 rounds by 1e-10, the trace's depth differences by a few of these.
    assert share_off(a, b, 1e-5 * float(a.max())) <= FLIPS


# ---- prepared once, called many times


def test_second_call_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = painted(scene("bumpy", camera(), rng), rng)
    device = uploaded(variant_runtime, gbuffer)
    technique = Shade(variant_runtime, gbuffer.size)
    check_second_run(variant_runtime, lambda: technique.run(device, LIGHTS["all"]).download())


def test_result_of_one_call_does_not_leak_into_the_next(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = painted(scene("bumpy", camera(), rng), rng)
    spot = shade(gbuffer, LIGHTS["spot"], runtime=runtime)
    size = gbuffer.size
    shade(gbuffer, LIGHTS["all"], ao=np.zeros(size), indirect=np.ones((*size, 3)), runtime=runtime)
    np.testing.assert_array_equal(shade(gbuffer, LIGHTS["spot"], runtime=runtime), spot)


# ---- bad input


def ones(size: tuple[int, int] = (4, 5)) -> GBuffer:
    """Return a small G-buffer."""
    return GBuffer(camera=camera(size=size), depth=np.ones(size), normal=None)


LAMP = PointLight((0, 3, 0), 1.0)


def rsm_of(light: Any, cameras: Any) -> ReflectiveShadowMap:
    """Return an empty map of these cameras."""
    faces = cameras if isinstance(cameras, tuple) else (cameras,)
    shape = (sum(c.height for c in faces), faces[0].width)
    zero = np.zeros((*shape, 3))
    return ReflectiveShadowMap(
        light=light, camera=cameras, depth=np.full(shape, np.inf), position=zero, normal=zero, flux=zero
    )


SQUARE = Camera.look_at((0, 3, 0.1), (0, 0, 0), width=4, height=4)
OBLONG = Camera.look_at((0, 3, 0.1), (0, 0, 0), width=4, height=6)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"lights": [None]}, TypeError, r"lights\[0\] is NoneType: expected a light"),
        ({"lights": [LAMP, "sun"]}, TypeError, r"lights\[1\] is str: expected a light"),
        ({"shadow_maps": []}, ValueError, r"shadow_maps has 0 entries: expected 1, one for each light"),
        ({"shadow_maps": [None, None]}, ValueError, r"shadow_maps has 2 entries: expected 1"),
        ({"shadow_maps": [np.ones((4, 4))]}, TypeError, r"shadow_maps\[0\] is ndarray: expected a Reflective"),
        (
            {"shadow_maps": [rsm_of(DirectionalLight((0, -1, 0), 1), SQUARE)]},
            ValueError,
            r"shadow_maps\[0\] is that of a DirectionalLight: expected.*a PointLight",
        ),
        ({"shadow_maps": [rsm_of(LAMP, SQUARE)]}, ValueError, r"shadow_maps\[0\] has 1 cameras.*expected 6"),
        ({"shadow_maps": [rsm_of(LAMP, (OBLONG,) * 6)]}, ValueError, r"shadow_maps\[0\] has 6 cameras.*square"),
        ({"ao": np.ones((5, 4))}, ValueError, r"ao has shape \(5, 4\): expected \(4, 5\)"),
        ({"ao": np.ones((4, 5, 1))}, ValueError, r"ao has shape \(4, 5, 1\)"),
        ({"ao": np.full((4, 5), 1.5)}, ValueError, r"ao\[0, 0\] is 1.5: expected.*<= 1"),
        ({"ao": np.full((4, 5), -0.1)}, ValueError, r"ao\[0, 0\] is -0.1.*: expected.*>= 0"),
        ({"ao": np.full((4, 5), np.nan)}, ValueError, r"ao\[0, 0\] is nan"),
        ({"ao": "open"}, TypeError, r"ao has dtype"),
        ({"indirect": np.ones((4, 5))}, ValueError, r"indirect has shape \(4, 5\)"),
        ({"indirect": np.ones((5, 4, 3))}, ValueError, r"indirect has shape \(5, 4\)"),
        ({"indirect": -np.ones((4, 5, 3))}, ValueError, r"indirect\[0, 0, 0\] is -1.0.*W/m\^2"),
        ({"indirect": np.full((4, 5, 3), np.inf)}, ValueError, r"indirect\[0, 0, 0\] is inf"),
        ({"gbuffer": np.ones((4, 5))}, TypeError, r"gbuffer is ndarray: expected GBuffer"),
    ],
    ids=str,
)
def test_bad_argument_is_refused_with_its_name_and_what_is_allowed(
    runtime: Runtime, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    given: dict[str, Any] = {"gbuffer": ones(), "lights": [LAMP], **arguments}
    with pytest.raises(error, match=message):
        shade(given.pop("gbuffer"), given.pop("lights"), runtime=runtime, **given)


def test_empty_device_gbuffer_is_refused(runtime: Runtime) -> None:
    with pytest.raises(ValueError, match="the device G-buffer is empty"):
        shade(DeviceGBuffer(runtime, (4, 5)), [LAMP], runtime=runtime)


def test_another_environment_takes_the_place_of_the_last_one(runtime: Runtime) -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=8, height=4)
    gbuffer = GBuffer(camera=camera, depth=np.full((4, 8), 2.0), albedo=np.ones((4, 8, 3)))
    bright, dim = Environment(2.0), Environment(0.5)
    for lights, radiance in (
        ([bright], 2.0),
        ([bright], 2.0),
        ([dim], 0.5),
        ([], 0.0),
        ([bright, dim], 2.5),
        ([bright], 2.0),
    ):
        # A white surface under a constant sky has the sky's radiance; float32 rounds pi twice.
        np.testing.assert_allclose(shade(gbuffer, lights, runtime=runtime), radiance, rtol=1e-6, atol=0)
