"""SSDO from taps: against its numpy reference, sums over all senders, and under what must not
matter."""

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
from ssgi_cl.reference.ssdo.ssdo_points import Gathered, ssdo_points_reference
from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams, SsdoPoints, cell_centres, cell_flux

from ..analytic import CAMERAS, camera, scene, tilted, trace

Doubles = NDArray[np.float64]

RADIUS = 0.6
ROUNDING = 1e-4
"""Of A, and of irradiance from radiance and sky up to 1: sums of 16 terms in float32, and, as
published, a fade-out that multiplies a rounding of some 1e-6 radii by 7."""
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
    radiance: Doubles | None = None,
    sky: Doubles | None = None,
) -> Gathered:
    """Return what the kernel gathers, in the reference's form."""
    device = DeviceGBuffer(
        runtime,
        gbuffer.size,
        layers=gbuffer.layers,
        margin=gbuffer.margin,
        attributes=1 if np.ndim(gbuffer.normal) < 4 else gbuffer.layers,
    )
    device.upload(gbuffer)
    sent = None
    if radiance is not None:
        sent = runtime.plane(3 * len(radiance), device.whole)
        sent.upload(np.moveaxis(radiance, -1, 1).reshape(-1, *device.whole).astype(np.float32))
    technique = SsdoPoints(runtime, gbuffer.size, step, params)
    plane = technique.run(device, radiance=sent, sky=SimpleNamespace(image=sky))
    before = runtime.allocated_bytes, runtime.builds
    images = plane.download()
    again = technique.run(device, radiance=sent, sky=SimpleNamespace(image=sky)).download()
    assert (runtime.allocated_bytes, runtime.builds) == before
    np.testing.assert_array_equal(images, again)
    nothing = np.zeros((*images.shape[1:], 3))
    last = np.moveaxis(images[-3:], 0, -1) if radiance is not None else nothing
    light = np.moveaxis(images[1:4], 0, -1) if sky is not None else nothing
    return Gathered(images[0], light, last, np.zeros((0, *images.shape[1:]), bool))


def assert_alike(one: Gathered, other: Gathered) -> None:
    """Check that but for a few flips both are the same up to roundings."""
    for name in ("visibility", "sky", "bounce"):
        a, b = getattr(one, name), getattr(other, name)
        assert np.isfinite(a).all()
        off = np.abs(a - b) > ROUNDING * np.maximum(1.0, np.abs(b))
        assert np.mean(off) <= FLIPS, name


def senders(gbuffer: GBuffer, rng: np.random.Generator) -> Doubles:
    """Return random radiance of every layer and pixel."""
    depth = np.asarray(gbuffer.depth)
    return rng.random((gbuffer.layers, *depth.shape[-2:], 3))


def two_layers(rng: np.random.Generator, *, normals: bool) -> GBuffer:
    """Return balls with the floor and what else lies behind them."""
    made = camera(size=(33, 43))
    front = scene("bumpy", made, rng, margin=(2, 4))
    floor = scene("corner", made, rng, margin=(2, 4))
    depth, behind = np.asarray(front.depth), np.asarray(floor.depth)
    deep = np.where(behind > depth + 1e-3, behind, np.inf)
    normal = np.stack([np.asarray(front.normal), np.asarray(floor.normal)])
    return GBuffer(camera=made, depth=np.stack([depth, deep]), normal=normal if normals else normal[0])


# ---- against the numpy reference


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize(
    "name", ["corner", *(pytest.param(name, marks=pytest.mark.slow) for name in ("bumpy", "noisy"))]
)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = scene(name, camera(kind, size=(33, 43)), rng, margin=(3, 5))
    params = PointsParams(radius=RADIUS)
    sent, sky = senders(gbuffer, rng), rng.random((8, 16, 3))
    found = gathered(runtime, gbuffer, params, radiance=sent, sky=sky)
    assert_alike(found, ssdo_points_reference(gbuffer, params, radiance=sent, sky=sky))


VARIANTS: dict[str, dict[str, Any]] = {
    "published": {"method": "published", "strength": 2.0, "nearest_distance": 0.3},
    "few": {"samples": 3, "max_radius_px": 9.0},
    "many": {"samples": 33, "thickness": 0.2, "bias": 0.1},
    "published and many": {"method": "published", "samples": 33, "max_radius_px": 30.0},
}
STEPS = (1, 2, 4, 1)


@pytest.mark.parametrize(("variant", "step"), list(zip(VARIANTS, STEPS, strict=True)))
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, rng: np.random.Generator, variant: str, step: int
) -> None:
    gbuffer = two_layers(rng, normals=variant != "few")
    if variant == "many":  # each pixel its own
        thickness = rng.uniform(0.0, RADIUS, np.shape(gbuffer.depth)[1:])
        gbuffer = replace(gbuffer, thickness=thickness.astype(np.float32))
    params = PointsParams(radius=RADIUS, **VARIANTS[variant])
    sent = senders(gbuffer, rng)[: 1 if variant == "few" else 2]
    sky = rng.random((8, 16, 3)) if step != 2 else None
    found = gathered(variant_runtime, gbuffer, params, step=step, radiance=sent, sky=sky)
    expected = ssdo_points_reference(gbuffer, params, step=step, radiance=sent, sky=sky)
    assert_alike(found, expected)


def test_every_kernel_variant_gives_the_same_result(
    runtime: Runtime, other_variant: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = two_layers(rng, normals=True)
    sent = senders(gbuffer, rng)
    a = gathered(runtime, gbuffer, PointsParams(radius=RADIUS), radiance=sent)
    b = gathered(other_variant, gbuffer, PointsParams(radius=RADIUS), radiance=sent)
    # Contraction is off and light is added in the order of the taps: bit-identical results.
    np.testing.assert_array_equal(a.visibility, b.visibility)
    np.testing.assert_array_equal(a.bounce, b.bounce)


# ---- under what must not matter


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
    assert_alike(*results)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_bounce_is_proportional_to_radiance(runtime: Runtime, factor: float) -> None:
    rng = np.random.default_rng(1)
    gbuffer = scene("corner", camera(), rng)
    sent = senders(gbuffer, rng)
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
    found = gathered(runtime, gbuffer, PointsParams(radius=RADIUS, samples=16), sky=sky)
    normal = np.asarray(gbuffer.normal)[0, 0].astype(np.float64)
    normal *= -np.sign(normal @ (made.view[2, :3] * -1.0)) or 1.0
    cosine = np.maximum(cell_centres() @ normal, 0.0)
    expected = (cell_flux(sky) * cosine[..., None]).sum(axis=(0, 1))
    # A pixel has 32 directions for the whole sphere, half of them where the sun is.
    np.testing.assert_allclose(found.sky[:44, :60].mean(axis=(0, 1)), expected, rtol=0.06)


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
