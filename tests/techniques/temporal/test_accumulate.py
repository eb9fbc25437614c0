"""Accumulation over frames: against its numpy reference, in closed form, and where it must begin anew."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.history import History, Reset
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.temporal.accumulate import Accumulation, accumulate_reference
from ssgi_cl.techniques.temporal.accumulate import Accumulate, AccumulateParams, accumulate

from ..analytic import check_second_run, share_off, uploaded, view_of

Doubles = NDArray[np.float64]
SIZE = (33, 47)
ROUNDING = 2e-5
"""Of values in [0, 1]: a place is off by some 2^-24 of its distance in pixels, 1e-5 pixels here, between taps whose
values differ by up to 1."""
FLIPS = 4e-3
"""Share of pixels in which that is exceeded: those with a tap at a threshold, or a mean at the end of its range."""


def camera_at(
    x: float, y: float = 0.0, z: float = 5.0, *, orthographic: bool = False, size: tuple[int, int] = SIZE
) -> Camera:
    """Return a camera that looks along -z."""
    given: dict[str, Any] = {"width": size[1], "height": size[0]}
    if orthographic:
        return Camera.orthographic((x, y, z), (x, y, z - 5.0), view_height=3.0, **given)
    return Camera.look_at((x, y, z), (x, y, z - 5.0), yfov=0.8, **given)


def wall(camera: Camera, *, margin: int = 0, layers: int = 1, front: Any = None, motion: Any = None) -> GBuffer:
    """Return what a camera sees of the plane z = 0, behind a square of half a unit at (front, 0, 1) if it is given.

    The wall is the second layer behind the square.
    """
    rows, columns = np.indices((camera.height + 2 * margin, camera.width + 2 * margin)) + 0.5 - margin
    sx, sy, ox, oy = camera.pixel_to_view
    eye = camera.position
    depth = np.full(rows.shape, eye[2])
    deeper = np.full(rows.shape, np.inf)
    if front is not None:
        k = 1.0 if camera.is_orthographic else eye[2] - 1.0
        x, y = (sx * columns + ox) * k + eye[0], (sy * rows + oy) * k + eye[1]
        covered = np.maximum(np.abs(x - front), np.abs(y)) < 0.5
        deeper = np.where(covered, depth, np.inf)
        depth = np.where(covered, eye[2] - 1.0, depth)
    normal = np.zeros((*rows.shape, 3))
    normal[..., 2] = 1.0
    return GBuffer(
        camera=camera, depth=np.stack([depth, deeper]) if layers == 2 else depth, normal=normal, motion=motion
    )


def close(found: History, wanted: History, tolerance: float = ROUNDING) -> None:
    """Hold a history to that of the reference."""
    for name in ("mean", "fast", "square"):
        assert share_off(getattr(found, name), getattr(wanted, name), tolerance) <= FLIPS, name
    assert share_off(found.count, wanted.count, 1e-4) <= FLIPS, "count"
    assert (found.reasons != wanted.reasons).mean() <= FLIPS, "reasons"


PATH = [(0.0, 0.0, 5.0), (0.13, 0.05, 5.0), (0.21, 0.02, 4.9), (0.3, -0.1, 4.9), (0.3, -0.1, 4.9), (0.37, -0.07, 5.0)]


def follow(
    runtime: Runtime, rng: np.random.Generator, gbuffers: list[GBuffer], channels: int = 1, **params: Any
) -> tuple[History, History]:
    """Return the last history of noise over some frames, and that of the reference, each of its own past."""
    history = wanted = previous = None
    for gbuffer in gbuffers:
        noise = rng.random((*gbuffer.size, 3) if channels == 3 else gbuffer.size).astype(np.float32)
        wanted = accumulate_reference(noise, gbuffer, previous, wanted, Accumulation(**params))
        mean, history = accumulate(noise, gbuffer, previous, history, runtime=runtime, **params)
        np.testing.assert_array_equal(mean, history.mean)
        previous = gbuffer
    assert history is not None
    assert wanted is not None
    return history, wanted


SETTINGS: list[dict[str, Any]] = [
    {},
    {"clamp": "fast", "fast": 2, "clamp_sigma": 1.5},
    {"clamp": "none", "limit": 3},
    {"young": 4},
    {"clamp": "none", "young": 2, "clamp_radius": 2},
    {"fast": 1, "clamp_radius": 1, "clamp_sigma": 1.0, "plane_distance": 0.5, "normal_angle": 0.2},
]


@pytest.mark.parametrize("params", SETTINGS, ids=str)
@pytest.mark.parametrize("channels", [1, 3])
def test_every_kernel_variant_agrees_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, params: dict[str, Any], channels: int
) -> None:
    gbuffers = [wall(camera_at(*place), front=0.1) for place in PATH]
    close(*follow(variant_runtime, rng, gbuffers, channels, **params))


@pytest.mark.parametrize("name", ["corner", "ball", "step", "bumpy", "noisy"])
@pytest.mark.parametrize("kind", ["perspective", "orthographic", "off-centre"])
def test_kernel_agrees_with_numpy_reference_in_every_scene(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = view_of(name, kind)
    motion = rng.uniform(-2.0, 2.0, (*np.shape(gbuffer.depth), 2)).astype(np.float32)
    moving = replace(gbuffer, motion=motion)
    history, wanted = follow(runtime, rng, [gbuffer, gbuffer, moving, gbuffer, moving], fast=1)
    assert 0.02 < history.begun.mean() < 1.0
    close(history, wanted, 1e-4 if name == "noisy" else ROUNDING)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("margins", [(0, 0), (2, 3)], ids=str)
@pytest.mark.parametrize("components", [0, 2, 3])
def test_margins_layers_motion_and_other_sizes_agree_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, orthographic: bool, margins: tuple[int, int], components: int
) -> None:
    sizes = [SIZE, (20, 61), (20, 61)]
    gbuffers = []
    for i, (place, size) in enumerate(zip(PATH, sizes, strict=False)):
        camera = camera_at(*place, orthographic=orthographic, size=size)
        own = wall(camera, margin=margins[i % 2], layers=1 + i % 2, front=0.1 * i)
        if i and components:
            own = own.with_motion(gbuffers[-1].camera)
            own = replace(own, motion=np.asarray(own.motion)[..., :components])
        gbuffers.append(own)
    history, wanted = follow(variant_runtime, rng, gbuffers, fast=1)
    assert history.begun.mean() < 0.6
    close(history, wanted)


# ---- closed forms


@pytest.mark.parametrize("limit", [1, 4, 100])
def test_still_camera_gives_the_mean_of_the_frames_up_to_the_limit(
    variant_runtime: Runtime, rng: np.random.Generator, limit: int
) -> None:
    gbuffer = wall(camera_at(0.0))
    values = rng.random((7, *SIZE)).astype(np.float32)
    history, previous, wanted = None, None, np.zeros(SIZE)
    for n, value in enumerate(values):
        mean, history = accumulate(
            value, gbuffer, previous, history, clamp="none", limit=limit, runtime=variant_runtime
        )
        previous = gbuffer
        wanted += (value - wanted) / min(n + 1, limit)
        # Of a camera that stands still no tap but the pixel's own counts: some roundings of float32.
        np.testing.assert_allclose(mean, wanted, rtol=0, atol=1e-6)
        assert (history.count == min(n + 1, limit)).all()
        assert (history.reasons == (Reset.FIRST if n == 0 else 0)).all()
    assert history is not None
    if limit == 100:
        np.testing.assert_allclose(history.variance, values.var(axis=0, dtype=np.float64), rtol=0, atol=1e-6)
        error = values.std(axis=0, dtype=np.float64, ddof=1) / math.sqrt(7)
        np.testing.assert_allclose(history.standard_error, error, rtol=0, atol=1e-5)


def test_mean_follows_a_surface_by_whole_pixels_of_motion_without_blur(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    camera = camera_at(0.0)
    first = rng.random(SIZE).astype(np.float32)
    _, history = accumulate(first, wall(camera), runtime=variant_runtime)
    motion = np.zeros((*SIZE, 2), np.float32)
    motion[...] = (-3.0, 2.0)  # it was 3 columns further left and 2 rows further down
    second = np.zeros(SIZE, np.float32)
    mean, after = accumulate(second, wall(camera, motion=motion), wall(camera), history, runtime=variant_runtime)
    np.testing.assert_allclose(mean[:-2, 3:], 0.5 * first[2:, :-3], rtol=0, atol=1e-6)
    came = np.ones(SIZE, bool)
    came[:-2, 3:] = False
    np.testing.assert_array_equal(after.because(Reset.BORDER), came)
    np.testing.assert_array_equal(after.begun, came)
    assert (mean[came] == second[came]).all()


def test_partly_hidden_taps_are_renormalised(runtime: Runtime) -> None:
    """Beside an edge, one column of the taps shows another surface: the other column has all the weight."""
    camera = camera_at(0.0)
    before = wall(camera, front=0.0)
    hidden = np.asarray(before.depth) < 4.5
    value = np.where(hidden, 1e6, 1.0).astype(np.float32)
    _, history = accumulate(value, before, runtime=runtime)
    motion = np.full((*SIZE, 2), 0.5, np.float32)
    after = wall(camera, front=None, motion=motion)
    mean, found = accumulate(np.ones(SIZE, np.float32), after, before, history, runtime=runtime)
    # Nothing of the square's 1e6 is in any mean, and pixels all of whose taps show it begin anew.
    np.testing.assert_array_equal(mean, 1.0)
    inner = hidden[:-1, :-1] & hidden[1:, :-1] & hidden[:-1, 1:] & hidden[1:, 1:]
    np.testing.assert_array_equal(found.because(Reset.PLANE)[:-1, :-1], inner)
    assert inner.sum() < hidden.sum()
    assert (found.count[:-1, :-1][~inner] == 2.0).all()


# ---- where it begins anew


@pytest.mark.parametrize("orthographic", [False, True])
def test_what_was_hidden_begins_anew_and_the_rest_goes_on(variant_runtime: Runtime, orthographic: bool) -> None:
    camera = camera_at(0.0, orthographic=orthographic)
    before, after = wall(camera, front=-0.4), wall(camera, front=0.4)
    _, history = accumulate(np.zeros(SIZE, np.float32), before, runtime=variant_runtime)
    value = np.full(SIZE, 0.7, np.float32)
    mean, found = accumulate(value, after, before, history, runtime=variant_runtime)
    was, now = (np.asarray(each.depth) < 4.5 for each in (before, after))
    # The square did not say that it moves: what it covers anew is not the wall that was there.
    np.testing.assert_array_equal(found.because(Reset.PLANE), was != now)
    np.testing.assert_array_equal(mean, np.where(was != now, value, np.float32(0.35)))


def test_moved_object_keeps_its_history_with_motion(variant_runtime: Runtime) -> None:
    camera = camera_at(0.0, orthographic=True)
    step = 4 * 3.0 / SIZE[0]  # four pixels
    before, after = wall(camera, front=-step / 2), wall(camera, front=step / 2)
    was, now = (np.asarray(each.depth) < 4.5 for each in (before, after))
    motion = np.where(now[..., None], (-4.0, 0.0, 0.0), 0.0)
    _, history = accumulate(was.astype(np.float32), before, runtime=variant_runtime)
    after = replace(after, motion=motion)
    mean, found = accumulate(now.astype(np.float32), after, before, history, runtime=variant_runtime)
    np.testing.assert_array_equal(mean, now)
    np.testing.assert_array_equal(found.begun, was & ~now)


def test_object_that_moves_in_depth_needs_the_third_component(variant_runtime: Runtime) -> None:
    camera = camera_at(0.0, orthographic=True)
    near, far = (GBuffer(camera=camera, depth=np.full(SIZE, depth, np.float32)) for depth in (4.0, 5.0))
    _, history = accumulate(np.zeros(SIZE), far, runtime=variant_runtime)
    for components, begins in ((2, True), (3, False)):
        motion = np.zeros((*SIZE, components), np.float32)
        motion[..., 2:] = 1.0  # it was deeper
        _, found = accumulate(np.ones(SIZE), replace(near, motion=motion), far, history, runtime=variant_runtime)
        assert (found.begun == begins).all(), components
        assert (found.because(Reset.PLANE) == begins).all()


def test_deeper_layer_that_fits_better_is_no_history(variant_runtime: Runtime) -> None:
    """Two sheets closer than the tolerance: the front one's values are not those of the other."""
    camera = camera_at(0.0)
    footprint = 5.0 * camera.pixel_to_view[0]
    both = np.stack([np.full(SIZE, 5.0 - footprint), np.full(SIZE, 5.0)])
    sheets, front = GBuffer(camera=camera, depth=both), GBuffer(camera=camera, depth=both[0])
    back = GBuffer(camera=camera, depth=both[1])
    for previous, begins in ((sheets, True), (front, False)):
        _, history = accumulate(np.zeros(SIZE), previous, runtime=variant_runtime)
        _, found = accumulate(np.ones(SIZE), back, previous, history, runtime=variant_runtime)
        assert (found.begun == begins).all()
        assert (found.because(Reset.LAYER) == begins).all()


def test_other_normal_and_nothing_begin_anew(variant_runtime: Runtime) -> None:
    camera = camera_at(0.0)
    before = wall(camera)
    normal = np.asarray(before.normal).copy()
    normal[:, :20] = (math.sin(0.6), 0.0, math.cos(0.6))
    depth = np.asarray(before.depth).copy()
    depth[:5] = np.inf
    depth_before = np.asarray(before.depth).copy()
    depth_before[-5:] = np.inf
    earlier = replace(before, depth=depth_before)
    _, history = accumulate(np.zeros(SIZE), earlier, runtime=variant_runtime)
    now = replace(before, normal=normal, depth=depth)
    mean, found = accumulate(np.ones(SIZE), now, earlier, history, runtime=variant_runtime)
    wanted = np.zeros(SIZE, np.uint8)
    wanted[:, :20] = Reset.NORMAL
    wanted[-5:] = Reset.EMPTY
    wanted[:5] = Reset.NOTHING
    np.testing.assert_array_equal(found.reasons, wanted)
    np.testing.assert_array_equal(mean, np.where(wanted, 1.0, 0.5))
    _, wide = accumulate(np.ones(SIZE), now, earlier, history, normal_angle=0.7, runtime=variant_runtime)
    assert not wide.because(Reset.NORMAL).any()


def test_camera_that_turned_away_begins_anew_everywhere(variant_runtime: Runtime) -> None:
    ahead = camera_at(0.0)
    behind = Camera.look_at((0, 0, -5), (0, 0, -10), yfov=0.8, width=SIZE[1], height=SIZE[0])
    nothing = GBuffer(camera=behind, depth=np.full(SIZE, 3.0, np.float32))
    _, history = accumulate(np.zeros(SIZE), nothing, runtime=variant_runtime)
    mean, found = accumulate(np.ones(SIZE), wall(ahead), nothing, history, runtime=variant_runtime)
    assert (mean == 1.0).all()
    assert (found.reasons == Reset.BORDER).all()


def test_cut_and_first_frame_have_the_bits_of_the_value(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = wall(camera_at(0.0), front=0.0)
    value = rng.normal(size=(*SIZE, 3)).astype(np.float32)
    for previous in (None, gbuffer):  # a cut: no history, whatever was there before
        mean, history = accumulate(value, gbuffer, previous, None, runtime=variant_runtime)
        np.testing.assert_array_equal(mean, value)
        assert (history.count == 1.0).all()
        assert (history.reasons == Reset.FIRST).all()
        assert np.isinf(history.standard_error).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 5)], ids=str)
def test_odd_sizes_agree_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    gbuffers = [wall(camera_at(0.02 * i, size=size)) for i in range(6)]
    history, wanted = follow(variant_runtime, rng, gbuffers)
    for name in ("mean", "count", "reasons"):
        # Pixels of so few are wide: 2^-24 of the depth is less of one.
        np.testing.assert_allclose(getattr(history, name), getattr(wanted, name), rtol=0, atol=1e-5, err_msg=name)


# ---- the clamp


@pytest.mark.parametrize(("clamp", "frames"), [("neighbourhood", 1), ("fast", 4)])
def test_light_that_goes_out_is_followed(variant_runtime: Runtime, clamp: str, frames: int) -> None:
    gbuffer = wall(camera_at(0.0))
    lit, dark = np.ones(SIZE, np.float32), np.zeros(SIZE, np.float32)
    history = previous = None
    for _ in range(20):
        _, history = accumulate(lit, gbuffer, previous, history, clamp=clamp, fast=2, runtime=variant_runtime)  # type: ignore[arg-type]
        previous = gbuffer
        assert history is not None
        assert not history.because(Reset.CHANGED).any()
    mean = lit
    for _ in range(frames):
        mean, history = accumulate(dark, gbuffer, gbuffer, history, clamp=clamp, fast=2, runtime=variant_runtime)  # type: ignore[arg-type]
        assert history.because(Reset.CHANGED).all()
        assert not history.begun.any()
        assert (history.count == 2.0).all()
    assert mean.max() < 0.1  # 90 % of the step
    slow, _ = accumulate(dark, gbuffer, gbuffer, None, runtime=variant_runtime)
    assert slow.max() == 0.0


def test_long_mean_of_steady_noise_is_hardly_clamped(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = wall(camera_at(0.0))
    history = previous = None
    mean = np.zeros(SIZE)
    for _ in range(48):
        mean, history = accumulate(rng.random(SIZE), gbuffer, previous, history, runtime=runtime)
        previous = gbuffer
    assert history is not None
    # .27 % of a normal distribution lie beyond 3 standard errors; the mean of 49 differences is nearly one.
    assert history.because(Reset.CHANGED).mean() < 0.006
    # Its deviation is that of one frame times the root of 1 / (2 x 32 - 1), more where it has been moved.
    assert mean.std() < 1.4 * math.sqrt(1.0 / 12.0 / 63.0)


def test_clamp_looks_at_the_same_surface_alone(runtime: Runtime) -> None:
    camera = camera_at(0.0)
    gbuffer = wall(camera, front=0.0)
    front = np.asarray(gbuffer.depth) < 4.5
    value = np.where(front, 1.0, 0.0)
    history = previous = None
    mean = value
    for _ in range(8):
        mean, history = accumulate(value, gbuffer, previous, history, clamp_radius=4, runtime=runtime)
        previous = gbuffer
    np.testing.assert_array_equal(mean, value)
    assert history is not None
    assert not history.reasons.any()


def test_moved_mean_stays_within_the_values_of_the_neighbourhood(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer = wall(camera_at(0.0))
    before = np.where(rng.random(SIZE) < 0.5, 0.0, 1.0)  # of which half would go below 0
    history = previous = None
    for _ in range(8):
        _, history = accumulate(before, gbuffer, previous, history, runtime=variant_runtime)
        previous = gbuffer
    mean, found = accumulate(np.zeros(SIZE), gbuffer, gbuffer, history, runtime=variant_runtime)
    # Half of n pixels by 1 each: n / 2 against the root of n / 2, which is more than 3 of it from n = 18 on.
    assert found.because(Reset.CHANGED).mean() > 0.9
    assert (mean[found.because(Reset.CHANGED)] == 0.0).all()


# ---- young pixels


def test_young_pixels_take_the_mean_of_their_own_surface(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    """What a square uncovers becomes the mean of the wall around, and no part of the square's."""
    errors = {}
    for young in (0, 2):
        history = previous = None
        for number in range(8):
            gbuffer = wall(camera_at(0.0), front=-0.5 + 0.1 * number)
            front = np.asarray(gbuffer.depth) < 4.5
            motion = np.zeros((*SIZE, 3), np.float32)
            motion[front, 0] = -0.1 / (gbuffer.camera.pixel_to_view[0] * 4.0)
            value = np.where(front, 100.0, 1.0 + 0.1 * rng.standard_normal(SIZE)).astype(np.float32)
            mean, history = accumulate(
                value, replace(gbuffer, motion=motion), previous, history, young=young, runtime=variant_runtime
            )
            previous = gbuffer
        assert history is not None
        fresh = history.begun & ~front
        assert fresh.sum() > 5
        errors[young] = np.abs(mean[fresh] - 1.0)
        assert (mean[front] == 100.0).all()
    assert errors[2].max() < 0.2  # a hundredth of the square would be more
    # Means of about 8 frames of some 30 pixels, the pixel's own aside, against one value.
    assert np.sqrt((errors[2] ** 2).mean()) < 0.4 * np.sqrt((errors[0] ** 2).mean())


def test_a_first_frame_keeps_its_bits_whatever_is_young(runtime: Runtime, rng: np.random.Generator) -> None:
    value = rng.random(SIZE).astype(np.float32)
    mean, _ = accumulate(value, wall(camera_at(0.0)), young=8, runtime=runtime)
    np.testing.assert_array_equal(mean, value)


# ---- device, determinism, bad input


def test_second_run_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffers = [wall(camera_at(0.1 * i, size=(131, 217)), front=0.0) for i in range(2)]
    now, before = (uploaded(variant_runtime, each) for each in gbuffers)
    technique = Accumulate(variant_runtime, (131, 217), AccumulateParams(fast=1))
    plane = variant_runtime.plane(1, (131, 217))
    plane.upload(rng.random((1, 131, 217)).astype(np.float32))

    def run() -> NDArray[Any]:
        with variant_runtime.frame():
            first = technique.run(before, plane)
            return technique.run(now, plane, previous=before, history=first).download().mean

    check_second_run(variant_runtime, run)


def test_device_gbuffers_give_the_bits_of_host_ones(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffers = [wall(camera_at(0.1 * i), front=0.0) for i in range(2)]
    value = rng.random(SIZE)
    _, history = accumulate(value, gbuffers[0], runtime=runtime)
    host = accumulate(value, gbuffers[1], gbuffers[0], history, runtime=runtime)[0]
    before, now = (uploaded(runtime, each) for each in gbuffers)
    np.testing.assert_array_equal(accumulate(value, now, before, history, runtime=runtime)[0], host)
    with pytest.raises(ValueError, match="previous is the G-buffer itself in device memory"):
        accumulate(value, now, now, history, runtime=runtime)


def test_frames_in_device_memory_give_the_bits_of_the_function(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    # To all sides: taps lie on either side of the pixel.
    gbuffers = [wall(camera_at(x, 0.5 * x), front=0.0) for x in (0.0, 0.2, 0.1, -0.3, -0.1)]
    technique = Accumulate(variant_runtime, SIZE, AccumulateParams(fast=1))
    plane = variant_runtime.plane(1, SIZE)
    past = before = history = previous = None
    for gbuffer in gbuffers:
        value = rng.random(SIZE).astype(np.float32)
        mean, history = accumulate(value, gbuffer, previous, history, fast=1, runtime=variant_runtime)
        previous = gbuffer
        plane.upload(value[None])
        now = uploaded(variant_runtime, gbuffer)
        with variant_runtime.frame():
            past = technique.run(now, plane, previous=before, history=past)  # two histories take turns
        before = now
        found = past.download()
        np.testing.assert_array_equal(found.mean, mean)
        for name in ("fast", "square", "count", "reasons"):
            np.testing.assert_array_equal(getattr(found, name), getattr(history, name))


def test_depths_a_rounding_apart_are_one_surface_at_any_field_of_view(variant_runtime: Runtime) -> None:
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), yfov=1e-4, width=SIZE[1], height=SIZE[0])
    before = wall(camera)
    now = replace(before, depth=np.nextafter(np.asarray(before.depth, np.float32), np.float32(9.0)))
    _, history = accumulate(np.zeros(SIZE), before, runtime=variant_runtime)
    # A rounding is 5e-7 here, a hundredth of a footprint 1.5e-7.
    _, found = accumulate(np.ones(SIZE), now, before, history, plane_distance=0.01, runtime=variant_runtime)
    assert not found.begun.any()


def test_any_values_and_depths_give_finite_means(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    for orthographic in (False, True):
        history = previous = None
        for _ in range(4):
            camera = camera_at(float(rng.uniform(-1e3, 1e3)), orthographic=orthographic)
            depth = (10.0 ** rng.uniform(-37.0, 37.0, SIZE)).astype(np.float32)
            motion = rng.uniform(-1e6, 1e6, (*SIZE, 3)).astype(np.float32)
            motion[:20] *= 1e-6
            gbuffer = GBuffer(camera=camera, depth=depth, motion=motion)
            value = rng.choice([-1e18, 0.0, 1e-30, 1e18], SIZE)
            mean, history = accumulate(
                value,
                gbuffer,
                previous,
                history,
                fast=1,
                plane_distance=1e4,
                normal_angle=math.pi,
                runtime=variant_runtime,
            )
            previous = gbuffer
            for array in (mean, history.fast, history.square, history.count):
                assert np.isfinite(array).all()
            assert np.abs(mean).max() <= 1.0001e18


GBUFFER = wall(camera_at(0.0))
VALUE = np.zeros(SIZE, np.float32)
PAST = accumulate_reference(VALUE, GBUFFER)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((VALUE[1:], GBUFFER), ValueError, r"plane has shape \(32, 47\): expected \(33, 47\) as the G-buffer"),
        ((VALUE + math.nan, GBUFFER), ValueError, r"plane\[0, 0\] is nan"),
        ((VALUE + 2e18, GBUFFER), ValueError, r"plane\[0, 0\] is .*: expected numbers >= -1e\+18"),
        ((VALUE[..., None], GBUFFER), ValueError, r"plane has shape \(33, 47, 1\)"),
        ((VALUE, GBUFFER, None, PAST), ValueError, "history is given without previous"),
        ((VALUE, GBUFFER, GBUFFER, "past"), TypeError, "history is str: expected the History"),
        ((VALUE, VALUE), TypeError, "gbuffer is ndarray: expected GBuffer or DeviceGBuffer"),
        ((VALUE, GBUFFER, VALUE, PAST), TypeError, "previous is ndarray: expected GBuffer or DeviceGBuffer"),
        ((VALUE, GBUFFER, "cut"), TypeError, "previous is str: expected GBuffer or DeviceGBuffer"),
        ((VALUE, GBUFFER, wall(camera_at(0.0, size=(8, 9))), PAST), ValueError, r"history has size \(33, 47\): exp"),
        ((np.zeros((*SIZE, 3)), GBUFFER, GBUFFER, PAST), ValueError, r"history has 1 channel\(s\): expected 3"),
        ((VALUE, GBUFFER, GBUFFER, replace(PAST, count=0 * PAST.count)), ValueError, r"history.count\[0, 0\] is 0.0"),
        ((VALUE, GBUFFER, GBUFFER, replace(PAST, fast=PAST.fast + math.nan)), ValueError, r"history.fast\[0, 0\]"),
    ],
    ids=[
        "size",
        "nan",
        "beyond",
        "channels",
        "alone",
        "type",
        "gbuffer",
        "previous",
        "cut",
        "other",
        "colours",
        "count",
        "fast",
    ],
)
def test_bad_arguments_are_refused(
    runtime: Runtime, arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        accumulate(*arguments, runtime=runtime)


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"limit": 0}, ValueError, r"limit is 0: expected an integer >= 1 and <= 4096 \(frames\)"),
        ({"fast": 2.0}, TypeError, r"fast is 2.0: expected an integer"),
        ({"clamp": "box"}, ValueError, r"clamp is 'box': expected one of 'neighbourhood', 'fast', 'none'"),
        ({"clamp_sigma": -1.0}, ValueError, r"clamp_sigma is -1.0"),
        ({"young": -1}, ValueError, r"young is -1"),
        ({"young": 1.5}, TypeError, r"young is 1.5"),
        ({"plane_distance": 0.0}, ValueError, r"plane_distance is 0.0: expected a number > 0"),
        ({"normal_angle": 4.0}, ValueError, r"normal_angle is 4.0: expected .*radians"),
    ],
    ids=str,
)
def test_bad_parameters_are_refused(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        accumulate(VALUE, GBUFFER, runtime=runtime, **params)


def test_arrays_of_a_history_have_one_shape() -> None:
    with pytest.raises(ValueError, match=r"count has shape \(32, 47\): expected \(33, 47\)"):
        replace(PAST, count=PAST.count[1:])
    with pytest.raises(ValueError, match=r"mean has shape \(33, 47, 2\)"):
        replace(PAST, mean=np.zeros((*SIZE, 2)))
