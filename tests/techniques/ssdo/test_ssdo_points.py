"""Directions of SSDO: numpy reference, sums over all senders, invariances, and the direction sets."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ssdo.ssdo_directions import directions
from ssgi_cl.reference.ssdo.ssdo_points import Gathered, ssdo_points_reference
from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams, SsdoPoints, cell_centres, cell_flux, direction_sets

from ..analytic import CAMERAS, camera, scene, slow_but, tilted, trace
from .cases import as_gathered, assert_alike, layered, planar, radiance_of, uploaded

Doubles = NDArray[np.float64]

RADIUS = 0.6
SKY = np.random.default_rng(3).random((8, 16, 3))
FLIPS = 4e-3
"""Share of pixels in which one direction may meet another pixel or nothing: a pixel position is
rounded to about 2^-18 px, each of 16 directions has up to four taps with two for each of two
layers, and two points of a ray agree within a limit."""


def gathered(
    runtime: Runtime,
    gbuffer: GBuffer,
    params: PointsParams,
    *,
    step: int = 1,
    radiance: NDArray[np.floating] | None = None,
    sky: Doubles | None = None,
) -> Gathered:
    """Return the kernel's results in the form of the reference, and check that it repeats them."""
    device = uploaded(runtime, gbuffer)
    sent = None if radiance is None else planar(runtime, radiance)
    technique = SsdoPoints(runtime, gbuffer.size, step, params)
    plane = technique.run(device, radiance=sent, sky=SimpleNamespace(image=sky))
    before = runtime.allocated_bytes, runtime.builds
    images = plane.download()
    again = technique.run(device, radiance=sent, sky=SimpleNamespace(image=sky)).download()
    assert (runtime.allocated_bytes, runtime.builds) == before
    np.testing.assert_array_equal(images, again)
    return as_gathered(images, sky=sky is not None, bounce=radiance is not None)


# ---- against the numpy reference


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("name", slow_but(("corner", "bumpy", "noisy"), "corner"))
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = scene(name, camera(kind, size=(33, 43)), rng, margin=(3, 5))
    params = PointsParams(radius=RADIUS)
    sent = radiance_of(gbuffer, rng)
    found = gathered(runtime, gbuffer, params, radiance=sent, sky=SKY)
    assert_alike(found, ssdo_points_reference(gbuffer, params, radiance=sent, sky=SKY), FLIPS)


VARIANTS: dict[str, dict[str, Any]] = {
    "published": {"method": "published", "strength": 2.0, "nearest_distance": 0.3, "max_radius_px": 3.0},
    "few": {"samples": 3, "max_radius_px": 3.0},
    "many": {"samples": 33, "thickness": 0.2, "bias": 0.1},
}
STEPS = (1, 2, 4)


@pytest.mark.parametrize(("variant", "step"), list(zip(VARIANTS, STEPS, strict=True)))
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, rng: np.random.Generator, variant: str, step: int
) -> None:
    gbuffer = layered(camera(size=(33, 43)), rng, margin=(2, 4))
    if variant == "few":  # the front layer alone has normals
        gbuffer = replace(gbuffer, normal=np.asarray(gbuffer.normal)[0])
    if variant == "many":  # each pixel its own
        thickness = rng.uniform(0.0, RADIUS, np.shape(gbuffer.depth)[1:])
        gbuffer = replace(gbuffer, thickness=thickness.astype(np.float32))
    params = PointsParams(radius=RADIUS, **VARIANTS[variant])
    sent = radiance_of(gbuffer, rng)[: 1 if variant == "few" else 2]
    sky = SKY if step != 2 else None
    found = gathered(variant_runtime, gbuffer, params, step=step, radiance=sent, sky=sky)
    expected = ssdo_points_reference(gbuffer, params, step=step, radiance=sent, sky=sky)
    assert_alike(found, expected, FLIPS)


# ---- invariances


@pytest.mark.parametrize("kind", CAMERAS)
def test_plane_is_open_and_dark_at_any_tilt(runtime: Runtime, kind: str) -> None:
    made = camera(kind)
    floor = scene("corner", made, np.random.default_rng(1))
    for degrees in (0.0, 40.0, 80.0):
        gbuffer = trace(made, [tilted(made, degrees)])
        sent = np.ones((1, *np.asarray(floor.depth).shape, 3))
        found = gathered(runtime, gbuffer, PointsParams(radius=RADIUS), radiance=sent)
        np.testing.assert_array_equal(found.visibility, 1.0)
        np.testing.assert_array_equal(found.bounce, 0.0)


def test_scale_of_the_world_does_not_matter(runtime: Runtime) -> None:
    results = []
    for scale in (1.0, 1e4):
        rng = np.random.default_rng(1)
        gbuffer = scene("bumpy", camera(scale=scale), rng, scale=scale)
        sent = np.ones((1, *gbuffer.size, 3))
        params = PointsParams(radius=RADIUS * scale)
        results.append(gathered(runtime, gbuffer, params, radiance=sent))
    assert_alike(*results, FLIPS)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_bounce_is_proportional_to_radiance(runtime: Runtime, factor: float) -> None:
    rng = np.random.default_rng(1)
    gbuffer = scene("corner", camera(), rng)
    sent = radiance_of(gbuffer, rng)
    params = PointsParams(radius=RADIUS)
    one = gathered(runtime, gbuffer, params, radiance=sent).bounce
    other = gathered(runtime, gbuffer, params, radiance=factor * sent).bounce
    assert one.max() > 0.0
    # float32 keeps 24 bits of each product and sum.
    np.testing.assert_allclose(other, factor * one, rtol=1e-5, atol=0.0)


# ---- the sky


def test_unhidden_sky_gives_its_irradiance(runtime: Runtime) -> None:
    made = camera()
    gbuffer = trace(made, [tilted(made, 30.0)])
    sky = np.zeros((32, 64, 3))
    sky[:, :, 0] = 1.0
    sky[6, 40, 1] = 1e4  # a sun
    sky[:16, :, 2] = np.linspace(0.0, 1.0, 64)
    sent = np.zeros((1, *np.shape(gbuffer.depth), 3))
    found = gathered(runtime, gbuffer, PointsParams(radius=RADIUS), radiance=sent, sky=sky)
    normal = np.asarray(gbuffer.normal)[0, 0].astype(np.float64)
    normal *= -np.sign(normal @ (made.view[2, :3] * -1.0)) or 1.0
    cosine = np.maximum(cell_centres() @ normal, 0.0)
    expected = (cell_flux(sky) * cosine[..., None]).sum(axis=(0, 1))
    # A pixel has 32 directions for the whole sphere, half of them where the sun is.
    np.testing.assert_allclose(found.sky[:44, :60].mean(axis=(0, 1)), expected, rtol=0.06)


# ---- direction sets


@pytest.mark.parametrize("count", [1, 5])
def test_directions_are_those_of_the_definition(count: int) -> None:
    sky = np.random.default_rng(1).random((12, 20, 3)) ** 8 * 100.0
    for image, equal in ((None, False), (sky, False), (sky, True)):
        made, expected = (one(count, image, equal=equal) for one in (direction_sets, directions))
        for name in ("direction", "length", "solid_angle", "light"):
            a, b = getattr(made, name), getattr(expected, name)
            if b is None:
                assert a is None
            else:
                np.testing.assert_allclose(a, b, atol=1e-9)


def test_solid_angles_and_light_add_up_to_the_sphere_and_the_sky() -> None:
    rng = np.random.default_rng(1)
    sky = rng.random((12, 20, 3)) ** 8 * 100.0
    sets = direction_sets(8, sky)
    assert sets.light is not None
    np.testing.assert_allclose(2.0 * sets.solid_angle.sum(axis=-1), 4.0 * math.pi, rtol=1e-3)
    edges = np.cos(np.linspace(0.0, math.pi, 13))
    whole = ((edges[:-1] - edges[1:])[:, None, None] * sky).sum(axis=(0, 1)) * 2.0 * math.pi / 20
    np.testing.assert_allclose(sets.light.sum(axis=(2, 3)), np.tile(whole, (16, 4, 1)))
    np.testing.assert_allclose(cell_flux(sky).sum(axis=(0, 1)), whole)


# ---- bad input


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0.*scene units"),
        ({"samples": 257}, ValueError, r"samples is 257: expected an integer >= 1 and <= 256"),
        ({"thickness": -1.0}, ValueError, r"thickness is -1.0: expected a number >= 0.*radii"),
        ({"method": "disc"}, ValueError, r"method is 'disc': expected one of 'points', 'publ"),
        ({"nearest_distance": 0.0}, ValueError, r"nearest_distance is 0.0: expected a number > 0"),
        ({"strength": math.nan}, ValueError, r"strength is nan: expected a number"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        PointsParams(**params)


def test_gbuffer_of_another_size_or_without_a_camera_is_refused(runtime: Runtime) -> None:
    technique = SsdoPoints(runtime, (8, 8))
    with pytest.raises(ValueError, match=r"size is \(16, 16\): expected \(8, 8\)"):
        technique.run(DeviceGBuffer(runtime, (16, 16)))
    with pytest.raises(ValueError, match=r"G-buffer is empty: draw or upload something first"):
        technique.run(DeviceGBuffer(runtime, (8, 8)))
