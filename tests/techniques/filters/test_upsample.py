"""Joint-bilateral upsampling: against its numpy reference, on planes, and at silhouettes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.filters.upsample import upsample_blur_reference, upsample_reference
from ssgi_cl.techniques.filters.bilateral import BilateralParams, bilateral_blur
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleBlur, coarse_size, upsample

from ..analytic import VIEWS, camera, check_second_run, share_off, tilted, trace, uploaded, view_of

ROUNDING = 1e-4
"""Of an image in [0, 1]. A distance from a tangent plane is off by some 2^-24 of the depth, that is
2e-5 of the distance at which a weight ends, and by more where normals rebuilt from noise graze the
view. Measured over all scenes but the noisy one: 2e-5."""
FLIPS = 0.01
"""Share of pixels that may exceed it: another sample is the best of bad ones, or, in the noisy
scene, normals graze the view. Measured, steps 1 to 4: 0.005 without that scene, 0.01 in it."""
SIZES = ((1, 1), (1, 40), (3, 5), (17, 31), (47, 61), (16, 600))


def upsample_blurred(
    image: NDArray[np.floating],
    gbuffer: GBuffer,
    runtime: Runtime,
    step: int,
    params: BilateralParams,
    background: float = 0.0,
) -> NDArray[np.float32]:
    """Return what `UpsampleBlur` makes of an image."""
    device = uploaded(runtime, gbuffer)
    reduced = ReducedGBuffer(device, step)
    reduced.update(device)
    plane = runtime.plane(1, reduced.size)
    plane.upload(image.astype(np.float32)[None])
    blur = UpsampleBlur(runtime, gbuffer.size, step, params, background=background)
    return blur.run(device, plane, reduced=reduced).download()[0]


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = view_of(name, kind)
    image = rng.random(coarse_size(gbuffer.size, 2)).astype(np.float32)
    fine = upsample(image, gbuffer, runtime=runtime)
    wanted = upsample_reference(image, gbuffer)
    assert share_off(fine, wanted, ROUNDING) <= FLIPS


@pytest.mark.parametrize(
    ("step", "channels"),
    [(1, 1), (2, 1), (2, 3), (4, 1), *(pytest.param(step, 3, marks=pytest.mark.slow) for step in (1, 4))],
)
@pytest.mark.parametrize("margin", [pytest.param((0, 0), marks=pytest.mark.slow), (3, 5)], ids=str)
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_step_and_margin(
    variant_runtime: Runtime, rng: np.random.Generator, step: int, channels: int, margin: tuple[int, int]
) -> None:
    gbuffer = view_of("bumpy", size=(22, 37), margin=margin)
    small = coarse_size(gbuffer.size, step)
    image = rng.random(small if channels == 1 else (*small, 3)).astype(np.float32)
    options = {"step": step, "background": -1.0, "depth_sigma": 0.02, "normal_sigma": 0.5}
    fine = upsample(image, gbuffer, runtime=variant_runtime, **options)
    wanted = upsample_reference(image, gbuffer, **options)
    assert share_off(fine, wanted, ROUNDING) <= FLIPS


@pytest.mark.parametrize("degrees", [0.0, 45.0])
@pytest.mark.parametrize("step", [2, 4])
def test_ramp_on_a_plane_comes_back_as_a_ramp(runtime: Runtime, degrees: float, step: int) -> None:
    gbuffer = trace(made := camera(size=(49, 61)), [tilted(made, degrees)])
    row, column = np.indices(made.size)
    ramp = (0.3 * row - 0.2 * column).astype(np.float32)
    fine = upsample(ramp[::step, ::step], gbuffer, step=step, runtime=runtime)
    # Beyond the last coarse pixel the image goes on as a constant.
    inner = np.s_[: 48 // step * step + 1, : 60 // step * step + 1]
    # Weights are those of linear interpolation; the ramp's values up to 15 are rounded by 2^-24.
    np.testing.assert_allclose(fine[inner], ramp[inner], rtol=0, atol=1e-5)


@pytest.mark.parametrize("step", [2, 4])
@pytest.mark.parametrize("blurred", [False, True])
def test_silhouette_does_not_leak(variant_runtime: Runtime, step: int, blurred: bool) -> None:
    gbuffer = view_of("step", size=(49, 61))
    near = (np.asarray(gbuffer.normal)[..., 0] > 0).astype(np.float32)
    assert 0.1 < near.mean() < 0.9
    if blurred:
        params = BilateralParams(radius=7)
        fine = upsample_blurred(near[::step, ::step], gbuffer, variant_runtime, step, params)
    else:
        fine = upsample(near[::step, ::step], gbuffer, step=step, runtime=variant_runtime)
    # Both sizes end on a coarse pixel, so that a pixel has one of its own side in reach unless the
    # slanted edge cuts it off. What is on the other side weighs exactly 0.
    own = _own_side_in_reach(near, step)
    assert own.mean() > 0.98
    np.testing.assert_allclose(fine[own], near[own], rtol=0, atol=1e-6)


def _own_side_in_reach(near: NDArray[np.float32], step: int) -> NDArray[np.bool_]:
    y, x = np.indices(near.shape)
    last_y, last_x = (near.shape[0] - 1) // step, (near.shape[1] - 1) // step
    corners = [
        near[np.minimum(y // step + dy, last_y) * step, np.minimum(x // step + dx, last_x) * step]
        for dy in (0, 1)
        for dx in (0, 1)
    ]
    return np.any([corner == near for corner in corners], axis=0)


def test_step_of_one_returns_the_image(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = trace(made := camera(), [tilted(made, 30.0)])
    image = rng.random(made.size).astype(np.float32)
    # The pixel itself is the only one near: a product of its value and a weight over that weight.
    np.testing.assert_allclose(upsample(image, gbuffer, step=1, runtime=runtime), image, rtol=3e-7)


def test_coarse_pixels_keep_their_values(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = view_of("bumpy", size=(33, 71))
    image = rng.random(coarse_size(gbuffer.size, 2)).astype(np.float32)
    fine = upsample(image, gbuffer, background=0.0, runtime=variant_runtime)
    there = np.isfinite(np.asarray(gbuffer.depth))[::2, ::2]
    np.testing.assert_allclose(fine[::2, ::2][there], image[there], rtol=3e-7)  # as above


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_blurred_upsampling_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = view_of(name, kind)
    image = rng.random(coarse_size(gbuffer.size, 2))
    params = BilateralParams(radius=7)
    fine = upsample_blurred(image, gbuffer, runtime, 2, params)
    wanted = upsample_blur_reference(image, gbuffer, params)
    assert share_off(fine, wanted, ROUNDING) <= FLIPS


@pytest.mark.parametrize(
    ("step", "radius"),
    [
        (2, 7),
        (4, 7),
        (4, 1),  # of less than step - 1 it is that
        *(pytest.param(*choice, marks=pytest.mark.slow) for choice in ((1, 1), (1, 7), (2, 1), (4, 6))),
    ],
)
@pytest.mark.parametrize("margin", [pytest.param((0, 0), marks=pytest.mark.slow), (3, 5)], ids=str)
def test_every_kernel_variant_of_blurred_upsampling_agrees_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, step: int, radius: int, margin: tuple[int, int]
) -> None:
    gbuffer = view_of("bumpy", size=(22, 37), margin=margin)
    image = rng.random(coarse_size(gbuffer.size, step))
    params = BilateralParams(radius=radius, depth_sigma=0.02, normal_sigma=0.5)
    fine = upsample_blurred(image, gbuffer, variant_runtime, step, params, background=-1.0)
    wanted = upsample_blur_reference(image, gbuffer, params, step=step, background=-1.0)
    assert share_off(fine, wanted, ROUNDING) <= FLIPS


def test_blurred_upsampling_by_one_is_the_blur(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = trace(made := camera(), [tilted(made, 30.0)])
    image = rng.random(made.size).astype(np.float32)
    fine = upsample_blurred(image, gbuffer, runtime, 1, BilateralParams(radius=7))
    wanted = bilateral_blur(image, gbuffer, radius=7, runtime=runtime)
    # The last bit of the first pass's values is a flag.
    np.testing.assert_allclose(fine, wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("step", [2, 4])
@pytest.mark.parametrize("blurred", [False, True])
def test_constant_stays_constant_at_odd_sizes(
    variant_runtime: Runtime, size: tuple[int, int], step: int, blurred: bool
) -> None:
    gbuffer = view_of("noisy", size=size)
    there = np.isfinite(gbuffer.depth)
    # A quotient of 4 products and sums, blurred two of 8, each rounded by 2^-24; 1, where nothing
    # hides, is exact when blurred, as it is one of equal sums.
    for value, tolerance in ((0.7, 2e-6), (1.0, 0.0)) if blurred else ((0.7, 1e-6),):
        image = np.full(coarse_size(size, step), value, np.float32)
        if blurred:
            params = BilateralParams(radius=7)
            fine = upsample_blurred(image, gbuffer, variant_runtime, step, params, background=-1.0)
        else:
            fine = upsample(image, gbuffer, step=step, background=-1.0, runtime=variant_runtime)
        assert fine.shape == size
        np.testing.assert_allclose(fine[there], value, rtol=tolerance)
        np.testing.assert_array_equal(fine[~there], -1.0)


@pytest.mark.parametrize("degrees", [45.0, 80.0])
def test_blurred_upsampling_of_a_tilted_plane_is_that_of_one_that_faces_the_viewer(
    runtime: Runtime, rng: np.random.Generator, degrees: float
) -> None:
    made = Camera.look_at((0, 0, 5), (0, 0, 0), yfov=0.15, width=47, height=33)
    image = rng.random(coarse_size(made.size, 2))
    facing, leaning = (
        upsample_blurred(image, trace(made, [tilted(made, d)]), runtime, 2, BilateralParams(radius=7))
        for d in (0.0, degrees)
    )
    np.testing.assert_allclose(leaning, facing, rtol=0, atol=ROUNDING)


def test_reduced_gbuffer_sees_what_its_camera_says(variant_runtime: Runtime) -> None:
    for margin in ((0, 0), (3, 5), (2, 3)):
        gbuffer = view_of("bumpy", size=(22, 34), margin=margin)
        device = uploaded(variant_runtime, gbuffer)
        reduced = ReducedGBuffer(device, 2)
        reduced.update(device)
        rows, columns = reduced.margin
        depth = reduced.depth.download()[0]
        assert depth.shape == (11 + 2 * rows, 17 + 2 * columns)
        np.testing.assert_array_equal(
            depth[rows : rows + 11, columns : columns + 17], gbuffer.inner(gbuffer.first("depth"))[::2, ::2]
        )


def test_two_runs_give_bit_identical_results_and_allocate_nothing(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = view_of("bumpy")
    device = uploaded(variant_runtime, gbuffer)
    reduced = ReducedGBuffer(device, 2)
    technique = Upsample(variant_runtime, gbuffer.size)
    plane = variant_runtime.plane(1, reduced.size)
    plane.upload(rng.random((1, *reduced.size)).astype(np.float32))

    def run() -> NDArray[np.float32]:
        reduced.update(device)
        return technique.run(device, plane, reduced=reduced).download()

    check_second_run(variant_runtime, run)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"step": 0}, ValueError, r"step is 0: expected an integer >= 1 and <= 4"),
        ({"step": 3}, ValueError, r"step is 3: expected 1, 2 or 4"),
        ({"step": 2.0}, TypeError, r"step is 2.0: expected an integer"),
        ({"background": math.nan}, ValueError, r"background is nan: expected a number"),
        ({"depth_sigma": 0.0}, ValueError, r"depth_sigma is 0.0: expected a number >= 1e-06"),
        ({"normal_sigma": -1.0}, ValueError, r"normal_sigma is -1.0: .*radians"),
        ({"image": np.ones((4, 4))}, ValueError, r"image has shape \(4, 4\): expected \(2, 3\)"),
        ({"image": np.full((2, 3), math.nan)}, ValueError, r"image\[0, 0\] is nan"),
        ({"image": np.ones((2, 3), complex)}, TypeError, r"image has dtype complex128"),
        ({"image": np.ones((2, 3, 4))}, ValueError, r"image has shape \(2, 3, 4\): expected"),
    ],
    ids=str,
)
def test_bad_argument_is_refused_with_its_name_value_and_range(
    runtime: Runtime, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    gbuffer = trace(made := camera(size=(3, 5)), [tilted(made, 0.0)])
    image = options.pop("image", np.ones((2, 3)))
    with pytest.raises(error, match=message):
        upsample(image, gbuffer, runtime=runtime, **options)
