"""The edge-aware blur: against its numpy reference, on planes, and at edges that it must not
cross."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.filters.bilateral import bilateral_reference
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams, bilateral_blur

from ..analytic import SCENES, VIEWS, camera, check_second_run, share_off, tilted, trace, uploaded, view_of

ROUNDING = 3e-5
"""Of a blurred image in [0, 1]. A distance from a tangent plane is off by some 2^-24 of the depth,
that is 1e-5 of the distance at which a weight ends. Measured over all scenes but the noisy one, at
radii up to 7: 1.1e-5."""
NOISE = 2e-4
"""The same where normals rebuilt from noise graze the view: their planes are steep."""
FLIPS = 1e-3
"""Share of pixels in which that is exceeded, for the steepest of planes."""


def narrow(size: tuple[int, int] = (33, 47)) -> Camera:
    """Return a camera with a view so narrow that a plane tilted by 80 degrees fills it."""
    return Camera.look_at((0, 0, 5), (0, 0, 0), yfov=0.15, width=size[1], height=size[0])


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = view_of(name, kind)
    image = rng.random(gbuffer.size).astype(np.float32)
    blurred = bilateral_blur(image, gbuffer, runtime=runtime)
    wanted = bilateral_reference(image, gbuffer)
    assert share_off(blurred, wanted, NOISE if name == "noisy" else ROUNDING) <= FLIPS


SWITCHES: list[tuple[dict[str, Any], int]] = [
    ({"radius": 7, "separable": False}, 1),
    ({"radius": 16, "sigma": 6.0, "passes": 2}, 1),
    ({"radius": 3, "sigma": math.inf, "separable": False}, 1),
    ({"depth_sigma": 0.1, "normal_sigma": 1.0}, 3),
]
"""And how many channels are blurred; the slow tests take the other number too, and the least radius."""


@pytest.mark.parametrize(
    ("params", "channels"),
    [
        *SWITCHES,
        *(
            pytest.param(params, 4 - n, marks=pytest.mark.slow)
            for params, n in (*SWITCHES, ({"radius": 1}, 1), ({"radius": 1}, 3))
        ),
    ],
    ids=str,
)
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, rng: np.random.Generator, params: dict[str, Any], channels: int
) -> None:
    gbuffer = view_of("bumpy", size=(19, 37))
    shape = gbuffer.size if channels == 1 else (*gbuffer.size, 3)
    image = rng.random(shape).astype(np.float32)
    blurred = bilateral_blur(image, gbuffer, runtime=variant_runtime, **params)
    wanted = bilateral_reference(image, gbuffer, BilateralParams(**params))
    passes = 2 * params.get("passes", 1)
    assert share_off(blurred, wanted, passes * ROUNDING) <= FLIPS


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 5), (17, 31)], ids=str)
@pytest.mark.parametrize("margin", [(0, 0), (3, 5)], ids=str)
def test_every_kernel_variant_agrees_with_numpy_reference_at_odd_sizes_and_margins(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int], margin: tuple[int, int]
) -> None:
    gbuffer = view_of("bumpy", size=size, margin=margin)
    image = rng.random(size).astype(np.float32)
    blurred = bilateral_blur(image, gbuffer, runtime=variant_runtime)
    # Of few pixels each is so wide that planes change by their own depth from one to the next.
    # Measured: 7e-5.
    np.testing.assert_allclose(blurred, bilateral_reference(image, gbuffer), rtol=0, atol=NOISE)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("value", [0.0, -3.7, 1e20])
def test_constant_stays_constant(variant_runtime: Runtime, name: str, value: float) -> None:
    gbuffer = view_of(name)
    image = np.full(gbuffer.size, value, np.float32)
    blurred = bilateral_blur(image, gbuffer, runtime=variant_runtime)
    # 2 x 9 products and sums, each rounded by 2^-24.
    np.testing.assert_allclose(blurred, image, rtol=2e-6, atol=0)


@pytest.mark.parametrize("normals", [True, False], ids=["given", "rebuilt"])
@pytest.mark.parametrize("degrees", [45.0, 80.0])
@pytest.mark.parametrize("separable", [True, False])
def test_tilted_plane_is_blurred_like_one_that_faces_the_viewer(
    runtime: Runtime, rng: np.random.Generator, normals: bool, degrees: float, separable: bool
) -> None:
    made = narrow()
    image = rng.random(made.size).astype(np.float32)
    facing, leaning = (
        bilateral_blur(
            image, trace(made, [tilted(made, d)], normals=normals), separable=separable, radius=7, runtime=runtime
        )
        for d in (0.0, degrees)
    )
    # Off the plane by some 2^-24 of the depth, 1e-5 sigma. Normals rebuilt from depths that are
    # rounded to 2^-24 with pixels of 0.005 radians lean by 1e-5, times the tangent of 80 degrees.
    np.testing.assert_allclose(leaning, facing, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("normals", [True, False], ids=["given", "rebuilt"])
def test_blur_does_not_cross_a_step_in_depth(variant_runtime: Runtime, normals: bool) -> None:
    gbuffer = view_of("step")
    near = (np.asarray(gbuffer.normal)[..., 0] > 0).astype(np.float32)
    assert 0.1 < near.mean() < 0.9
    if not normals:
        gbuffer = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth)
    for separable in (True, False):
        blurred = bilateral_blur(near, gbuffer, radius=7, passes=3, separable=separable, runtime=variant_runtime)
        # Tossed neighbours weigh exactly 0; 1 is a quotient of equal sums.
        np.testing.assert_allclose(blurred, near, rtol=0, atol=1e-6)


def test_blur_does_not_cross_a_crease(variant_runtime: Runtime) -> None:
    gbuffer = view_of("corner")
    wall = np.argmax(np.abs(gbuffer.normal), axis=-1).astype(np.float32)
    assert len(np.unique(wall)) == 3
    blurred = bilateral_blur(wall, gbuffer, radius=7, runtime=variant_runtime)
    np.testing.assert_allclose(blurred, wall, rtol=0, atol=2e-6)  # as above, of values up to 2


def test_separable_blur_of_a_plane_is_the_full_one(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = trace(made := narrow(), [tilted(made, 60.0)])
    image = rng.random(made.size).astype(np.float32)
    a, b = (bilateral_blur(image, gbuffer, radius=7, separable=s, runtime=runtime) for s in (True, False))
    # On a plane all weights are those of the Gaussian, which is a product.
    np.testing.assert_allclose(a, b, rtol=0, atol=2e-6)


def test_passes_are_the_blur_again_and_again(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = view_of("bumpy")
    image = rng.random((*gbuffer.size, 3)).astype(np.float32)
    once = image
    for _ in range(3):
        once = bilateral_blur(once, gbuffer, runtime=runtime)
    np.testing.assert_array_equal(bilateral_blur(image, gbuffer, passes=3, runtime=runtime), once)


def test_channels_are_blurred_apart(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = view_of("bumpy")
    image = rng.random((*gbuffer.size, 3)).astype(np.float32)
    together = bilateral_blur(image, gbuffer, runtime=runtime)
    for c in range(3):
        alone = bilateral_blur(image[..., c], gbuffer, runtime=runtime)
        np.testing.assert_array_equal(together[..., c], alone)


@pytest.mark.parametrize("params", [{"radius": 0}, {"passes": 0}], ids=str)
def test_blur_of_no_reach_returns_the_image(runtime: Runtime, rng: np.random.Generator, params: dict[str, Any]) -> None:
    gbuffer = view_of("bumpy")
    image = rng.random(gbuffer.size).astype(np.float32)
    np.testing.assert_array_equal(bilateral_blur(image, gbuffer, runtime=runtime, **params), image)
    blur = Bilateral(runtime, gbuffer.size, BilateralParams(**params))
    value = runtime.plane(1, gbuffer.size)
    assert blur.run(on_device(gbuffer, runtime), value) is value
    assert [p.name for p in runtime.times() if p.skipped] == ["bilateral_blur"]


def test_pixels_with_nothing_keep_their_value_and_give_none(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = view_of("noisy")
    empty = np.isinf(gbuffer.depth)
    image = np.where(empty, rng.uniform(-1e6, 1e6, gbuffer.size), 0.25).astype(np.float32)
    blurred = bilateral_blur(image, gbuffer, runtime=variant_runtime)
    np.testing.assert_array_equal(blurred[empty], image[empty])
    np.testing.assert_allclose(blurred[~empty], 0.25, rtol=2e-6)  # as of any constant


def test_any_depths_give_values_within_those_of_the_image(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    for kind in ("perspective", "orthographic"):
        made = camera(kind, (33, 70))
        depth = (10.0 ** rng.uniform(-37.0, 37.0, made.size)).astype(np.float32)
        image = rng.random(made.size).astype(np.float32)
        blurred = bilateral_blur(image, GBuffer(camera=made, depth=depth), runtime=variant_runtime, normal_sigma=10.0)
        assert blurred.min() >= 0.0
        assert blurred.max() <= 1.0


def test_second_run_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = view_of("noisy", size=(131, 217))
    device = uploaded(variant_runtime, gbuffer)
    blur = Bilateral(variant_runtime, gbuffer.size, BilateralParams(passes=2))
    plane = variant_runtime.plane(1, gbuffer.size)
    plane.upload(rng.random((1, *gbuffer.size)).astype(np.float32))
    check_second_run(variant_runtime, lambda: blur.run(device, plane).download())


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"radius": -1}, ValueError, r"radius is -1: expected an integer >= 0 and <= 16 \(px\)"),
        ({"radius": 17}, ValueError, r"radius is 17: expected an integer"),
        ({"radius": 2.0}, TypeError, r"radius is 2.0: expected an integer"),
        ({"sigma": math.nan}, ValueError, r"sigma is nan: expected a number"),
        ({"depth_sigma": 0.0}, ValueError, r"depth_sigma is 0.0: expected a number >= 1e-06"),
        ({"normal_sigma": -1.0}, ValueError, r"normal_sigma is -1.0: expected .*radians"),
        ({"passes": 65}, ValueError, r"passes is 65: expected an integer >= 0 and <= 64"),
        ({"separable": 1}, TypeError, r"separable is 1: expected True or False"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    gbuffer = trace(made := camera(size=(4, 4)), [tilted(made, 0.0)])
    with pytest.raises(error, match=message):
        bilateral_blur(np.ones((4, 4)), gbuffer, runtime=runtime, **params)


@pytest.mark.parametrize(
    ("image", "error", "message"),
    [
        (np.ones((4, 5)), ValueError, r"image has shape \(4, 5\): expected \(4, 4\)"),
        (np.ones((4, 4, 2)), ValueError, r"image has shape \(4, 4, 2\): expected .*3\)"),
        (np.full((4, 4), math.nan), ValueError, r"image\[0, 0\] is nan: expected numbers"),
        (np.ones((4, 4), complex), TypeError, r"image has dtype complex128: expected a real"),
    ],
    ids=["size", "channels", "nan", "complex"],
)
def test_bad_image_is_refused_with_its_shape_dtype_or_pixel(
    runtime: Runtime, image: NDArray[Any], error: type[Exception], message: str
) -> None:
    gbuffer = trace(made := camera(size=(4, 4)), [tilted(made, 0.0)])
    with pytest.raises(error, match=message):
        bilateral_blur(image, gbuffer, runtime=runtime)
