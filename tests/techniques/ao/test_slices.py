"""What holds for every technique that scans slices: HBAO, GTAO and the visibility bitmask."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.constants import SLICES_STRIP
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ao.bitmask_ao import bitmask_reference
from ssgi_cl.reference.ao.gtao import gtao_reference
from ssgi_cl.reference.ao.hbao import hbao_reference
from ssgi_cl.techniques.ao.bitmask_ao import BitmaskAo, BitmaskParams, bitmask_ao
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams, hbao
from ssgi_cl.techniques.ao.slices import SliceParams, SliceTechnique, pattern

from ..analytic import CAMERAS, VIEWS, Ball, Plane, camera, scene, tilted, trace

RADIUS = 0.6
ROUNDING = 1e-5
"""Of A without blur: measured at most 6e-6 over all scenes and cameras; a horizon's cotangent is
rounded to some 1e-6."""
WEIGHTS = 1e-4
"""Of a blurred A: the error that kernels/common/lanes.clh states for a weight's power of two."""
FLIPS = 1e-3
"""Share of pixels in which a tap may fall to the next pixel, to the other side of the radius or
into the next sector; measured: none of 57,000. An image of 39 x 31 may have 1."""


@dataclass(frozen=True)
class Subject:
    """A technique under test."""

    function: Callable[..., NDArray[np.float32]]
    kind: type[SliceTechnique[Any]]
    params: type[SliceParams]
    reference: Callable[..., NDArray[np.float64]]


SUBJECTS = {
    "hbao": Subject(hbao, Hbao, HbaoParams, hbao_reference),
    "gtao": Subject(gtao, Gtao, GtaoParams, gtao_reference),
    "bitmask": Subject(bitmask_ao, BitmaskAo, BitmaskParams, bitmask_reference),
}


@pytest.fixture(params=SUBJECTS)
def subject(request: pytest.FixtureRequest) -> Subject:
    """Each technique."""
    return SUBJECTS[request.param]


def share_off(a: NDArray[Any], b: NDArray[Any], tolerance: float) -> float:
    """Return the share of pixels that differ by more than `tolerance` (or are not numbers)."""
    return float(np.mean(~(np.abs(a - b) <= tolerance)))


def layered(made: Camera, margin: tuple[int, int] = (0, 0)) -> tuple[GBuffer, GBuffer, GBuffer]:
    """Return a corner behind a ball near the eye: one layer, two layers, and without the ball."""
    floor = Plane((0.0, -0.3, 0.0), (0.0, 1.0, 0.0))
    corner = [floor, Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))]
    behind = trace(made, corner, margin=margin)
    ball = Ball(made.position - 1.7 * made.view[2, :3], 0.4 if made.is_orthographic else 0.2)
    front = trace(made, [*corner, ball], margin=margin)
    covered = np.asarray(front.depth) < np.asarray(behind.depth)
    assert 0.01 < covered.mean() < 0.5
    deeper = np.where(covered, behind.depth, np.inf).astype(np.float32)
    both = GBuffer(camera=made, depth=np.stack([np.asarray(front.depth), deeper]), normal=front.normal)
    return front, both, behind


# ---- against the numpy reference


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, subject: Subject, name: str, kind: str
) -> None:
    gbuffer = scene(name, camera(kind, size=(31, 39)), rng)
    a = subject.function(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    wanted = subject.reference(gbuffer, subject.params(radius=RADIUS, blur_radius=0))
    assert share_off(a, wanted, ROUNDING) <= FLIPS


def test_normals_that_turn_away_agree_with_numpy_reference(
    runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    made = camera("orthographic")
    gbuffer = scene("ball", made, rng)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    ahead = -made.view[2, :3]
    leaning = np.asarray(gbuffer.normal) + np.where(seen[..., None], 0.3 * ahead, 0.0)
    leaning /= np.maximum(np.linalg.norm(leaning, axis=-1, keepdims=True), 1e-9)
    averted = leaning @ ahead > 0.0
    assert 20 < np.count_nonzero(averted) < 0.1 * averted.size
    smooth = replace(gbuffer, normal=leaning.astype(np.float32))
    a = subject.function(smooth, RADIUS, blur_radius=0, runtime=runtime)
    wanted = subject.reference(smooth, subject.params(radius=RADIUS, blur_radius=0))
    # Angles are measured in parts of a cosine of .05 there.
    np.testing.assert_allclose(a[averted], wanted[averted], atol=2.0 * ROUNDING)


SHARED: dict[str, dict[str, Any]] = {
    "few taps": {"slices": 1, "taps": 2, "tap_power": 1.0, "contrast": 2.2},
    "bias": {"bias": 0.05},
    "limited": {"max_radius_px": 6.0},
}
MANY: dict[str, dict[str, Any]] = {
    "many taps": {"slices": 5, "taps": 9, "bias": 0.05},
    "limited": {"slices": 5, "taps": 9, "max_radius_px": 6.0},
}
"""Each count of slices and taps is a program of its own: these are left to the slow tests."""
VARIANTS: list[tuple[str, dict[str, Any]]] = [
    *((name, choice) for name in SUBJECTS for choice in SHARED.values()),
    ("hbao", {"attenuation": 0.0, "angle_bias": 0.4}),
    (
        "gtao",
        {  # XeGTAO's High
            "falloff": 0.615,
            "radius": 0.73,
            "slices": 3,
            "taps": 3,
            "contrast": 2.2,
        },
    ),
    ("gtao", {"falloff": 1.0, "thin_occluder": 0.7}),
    ("bitmask", {"sectors": "angle", "thickness": 0.1}),
    ("bitmask", {"thickness": 0.0}),
    ("bitmask", {"thickness": 1e3}),
]
SLOW = [pytest.param(name, choice, marks=pytest.mark.slow) for name in SUBJECTS for choice in MANY.values()]


@pytest.mark.parametrize(("name", "choice"), [*VARIANTS, *SLOW], ids=str)
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, rng: np.random.Generator, name: str, choice: dict[str, Any], kind: str
) -> None:
    subject = SUBJECTS[name]
    gbuffer = scene("bumpy", camera(kind, size=(31, 39)), rng)
    params = {"radius": RADIUS, "blur_radius": 0, **choice}
    a = subject.function(gbuffer, **params, runtime=variant_runtime)
    assert share_off(a, subject.reference(gbuffer, subject.params(**params)), ROUNDING) <= FLIPS


def test_an_image_of_more_than_a_strip_agrees_with_numpy_reference(
    runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    gbuffer = scene("noisy", camera("intrinsics", size=(9, 2 * SLICES_STRIP)), rng)
    a = subject.function(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    wanted = subject.reference(gbuffer, subject.params(radius=RADIUS, blur_radius=0))
    assert (wanted[:, SLICES_STRIP:] < 0.8).mean() > 0.1
    # Slices are some 100 px long, and roundings of a place grow with that.
    assert share_off(a, wanted, 10.0 * ROUNDING) <= 20 * FLIPS


SLOW_MARGINS = [("full", (0, 0)), ("full", (2, 7)), ("half", (0, 0)), ("quarter", (1, 2))]


@pytest.mark.parametrize(
    ("resolution", "margin"),
    [
        ("full", (1, 2)),
        ("half", (1, 2)),
        ("half", (2, 7)),
        ("quarter", (0, 0)),
        ("quarter", (2, 7)),
        *(pytest.param(*choice, marks=pytest.mark.slow) for choice in SLOW_MARGINS),
    ],
    ids=str,
)
def test_blurred_layers_with_any_margin_agree_with_numpy_reference_at_every_resolution(
    variant_runtime: Runtime, subject: Subject, resolution: str, margin: tuple[int, int]
) -> None:
    _, both, _ = layered(camera(size=(21, 27)), margin)
    a = subject.function(both, RADIUS, resolution=resolution, runtime=variant_runtime)
    wanted = subject.reference(both, subject.params(radius=RADIUS, resolution=resolution))
    # A flip spreads over the 5 x 5 pixels of the blur and over the pixels of a coarse one.
    assert share_off(a, wanted, WEIGHTS) <= 25 * FLIPS


@pytest.mark.slow
@pytest.mark.parametrize("name", ["corner", "noisy"])
def test_every_kernel_variant_gives_the_same_result(
    runtime: Runtime, every_variant: Runtime, rng: np.random.Generator, subject: Subject, name: str
) -> None:
    gbuffer = scene(name, camera(size=(131, 217)), rng)
    a = subject.function(gbuffer, RADIUS, runtime=runtime)
    b = subject.function(gbuffer, RADIUS, runtime=every_variant)
    # Contraction is off, so variants differ only where a device's division or root is not exact.
    assert share_off(a, b, 1e-5) < 1e-4


# ---- what a plane must give


SIZES = ((1, 1), (17, 31), (3, 5), (16, 300), (300, 16))
TILTS = (0.0, 20.0, 45.0, 70.0, 85.0, 89.0, 89.9)
SHAPES = [
    pytest.param(kind, size, marks=() if fast else pytest.mark.slow)
    for kind in CAMERAS
    for size in SIZES
    for fast in [kind in ("perspective", "orthographic") or size == (17, 31)]
]


@pytest.mark.parametrize(("kind", "size"), SHAPES, ids=str)
def test_plane_is_exactly_open_at_any_tilt(
    runtime: Runtime, subject: Subject, kind: str, size: tuple[int, int]
) -> None:
    made = camera(kind, size)
    # At least 4 pixels, so that small images have taps at all.
    unit_px = 0.5 * made.height * made.projection[1, 1] / (1 if made.is_orthographic else 5.0)
    radius = max(0.5, 4.0 / unit_px)
    for degrees in TILTS:
        gbuffer = trace(made, [tilted(made, degrees)])
        a = subject.function(gbuffer, radius, blur_radius=0, runtime=runtime)
        np.testing.assert_array_equal(a, 1.0, err_msg=f"tilt {degrees}")


@pytest.mark.parametrize("kind", CAMERAS)
def test_plane_with_rebuilt_normals_is_open_at_any_tilt(runtime: Runtime, subject: Subject, kind: str) -> None:
    made = camera(kind)
    for degrees in TILTS:
        gbuffer = trace(made, [tilted(made, degrees)], normals=False)
        a = subject.function(gbuffer, 0.5, blur_radius=0, bias=0.02, runtime=runtime)
        # A normal from depths that are rounded to 2^-24 is off by some 1e-4: within the bias.
        np.testing.assert_array_equal(a, 1.0, err_msg=f"tilt {degrees}")


@pytest.mark.parametrize("resolution", ["half", "quarter"])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_plane_is_open_at_reduced_resolution_of_odd_sizes(
    variant_runtime: Runtime, subject: Subject, resolution: str, size: tuple[int, int]
) -> None:
    gbuffer = trace(made := camera(size=size), [tilted(made, 40.0)])
    a = subject.function(gbuffer, 1.0, resolution=resolution, runtime=variant_runtime)
    assert a.shape == size
    # A constant is blurred and upsampled: two divisions round by 2^-24 each.
    np.testing.assert_allclose(a, 1.0, rtol=0, atol=5e-7)


def test_inner_corner_is_darker_than_the_planes_away_from_it(
    runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    gbuffer = scene("corner", camera(), rng)
    a = subject.function(gbuffer, RADIUS, runtime=runtime)
    assert a.min() < 0.75
    assert a.max() > 0.999


# ---- beyond the front layer and the image


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_second_layer_shows_what_a_thing_near_the_eye_hides(
    variant_runtime: Runtime, subject: Subject, kind: str
) -> None:
    front, both, behind = layered(camera(kind))
    seen = np.asarray(front.depth) == np.asarray(behind.depth)
    # Joined, the surfaces of the bitmask break where they go from one layer to the next.
    single: dict[str, Any] = {"joined": False} if subject.kind is BitmaskAo else {}
    one, two, whole = (
        subject.function(g, 1.0, blur_radius=0, runtime=variant_runtime, **single) for g in (front, both, behind)
    )
    # The ball is farther away than the radius, so that only what it hides makes a difference.
    assert np.abs(one - whole)[seen].max() > 0.02
    np.testing.assert_array_equal(two[seen], whole[seen])


@pytest.mark.parametrize(
    ("name", "choice"),
    [
        ("hbao", {}),  # GTAO scans by the same code
        ("bitmask", {"joined": False}),
        pytest.param("gtao", {}, marks=pytest.mark.slow),
        pytest.param("bitmask", {}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_empty_layers_change_nothing(runtime: Runtime, name: str, choice: dict[str, Any]) -> None:
    subject = SUBJECTS[name]
    front, _, _ = layered(camera())
    depth = np.full((4, *front.size), np.inf, np.float32)
    depth[0] = front.depth
    more = GBuffer(camera=front.camera, depth=depth, normal=front.normal)
    # As many taps as the front one of four layers is read at.
    taps = subject.params(**choice).in_front_of(4).taps
    a = subject.function(front, RADIUS, **{**choice, "taps": taps}, runtime=runtime)
    np.testing.assert_array_equal(a, subject.function(more, RADIUS, **choice, runtime=runtime))


@pytest.mark.parametrize("margin", [(4, 64), (12, 128)])
def test_margin_gives_what_a_larger_image_gives_inside(
    runtime: Runtime, rng: np.random.Generator, subject: Subject, margin: tuple[int, int]
) -> None:
    # From the corner of the result the pattern repeats every 4 rows, and groups of pixels that
    # scan alike every 64 columns: other margins change both. The blur stops at the edge of the
    # result.
    made = camera(size=(30, 41))
    whole = scene("bumpy", made.with_margin(margin), rng)
    inner = GBuffer(camera=made, depth=whole.depth, normal=whole.normal)
    a = subject.function(inner, RADIUS, blur_radius=0, runtime=runtime)
    b = inner.inner(subject.function(whole, RADIUS, blur_radius=0, runtime=runtime))
    assert a.shape == made.size
    # The same pixels, but a camera whose numbers round differently.
    assert share_off(a, b, ROUNDING) <= FLIPS
    bare = GBuffer(
        camera=made, depth=inner.inner(np.asarray(whole.depth)), normal=inner.inner(np.asarray(whole.normal))
    )
    assert np.abs(a - subject.function(bare, RADIUS, blur_radius=0, runtime=runtime)).max() > 0.02


# ---- limits


def test_limit_of_the_projected_radius_is_a_smaller_radius(
    runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    gbuffer = scene("bumpy", made := camera("orthographic"), rng)
    unit_px = made.height / 4.0
    limited = subject.function(gbuffer, 1.0, max_radius_px=0.5 * unit_px, blur_radius=0, runtime=runtime)
    small = subject.function(gbuffer, 0.5, blur_radius=0, runtime=runtime)
    assert share_off(limited, small, ROUNDING) <= FLIPS


def test_radius_below_a_pixel_leaves_everything_open(
    runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    gbuffer = scene("noisy", made := camera("orthographic"), rng)
    a = subject.function(gbuffer, 0.99 * 4.0 / made.height, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(a, 1.0)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_radius_beyond_the_scene_sees_the_scene_and_no_more(
    runtime: Runtime, rng: np.random.Generator, subject: Subject, kind: str
) -> None:
    gbuffer = scene("bumpy", camera(kind), rng)
    far, farther = (subject.function(gbuffer, radius, blur_radius=0, runtime=runtime) for radius in (1e4, 1e8))
    assert far.min() < 0.5
    # Nor does what is infinitely far away occlude, however large the radius.
    assert share_off(far, farther, ROUNDING) <= FLIPS


@pytest.mark.parametrize("radius", [1e-30, 1e-6, 1e3, 1e6, 1e30])
@pytest.mark.parametrize("kind", ["perspective", pytest.param("orthographic", marks=pytest.mark.slow)])
def test_any_radius_gives_visibility_between_0_and_1(
    runtime: Runtime, rng: np.random.Generator, subject: Subject, radius: float, kind: str
) -> None:
    gbuffer = scene("noisy", camera(kind), rng)
    for limits in ({}, {"max_radius_px": 8.0}):
        a = subject.function(gbuffer, radius, runtime=runtime, **limits)
        assert a.min() >= 0.0
        assert a.max() <= 1.0


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("resolution", ["full", "half"])
@pytest.mark.parametrize("name", [*SUBJECTS, "falloff", "angle"])
def test_any_depths_give_visibility_between_0_and_1(
    variant_runtime: Runtime, rng: np.random.Generator, name: str, kind: str, resolution: str
) -> None:
    more: dict[str, Any] = {"falloff": {"falloff": 0.5}, "angle": {"sectors": "angle"}}
    choice = more.get(name, {})
    subject = SUBJECTS[{"falloff": "gtao", "angle": "bitmask"}.get(name, name)]
    made = camera(kind, (33, 70))
    for reach in (3.0, 37.0):
        depth = 10.0 ** rng.uniform(-reach, reach, made.size)
        depth[rng.random(made.size) < 0.1] = np.inf
        gbuffer = GBuffer(camera=made, depth=depth.astype(np.float32))
        for radius in (1e-20, 1.0, 1e20):
            a = subject.function(gbuffer, radius, resolution=resolution, runtime=variant_runtime, **choice)
            assert a.min() >= 0.0
            assert a.max() <= 1.0


# ---- what must not matter


@pytest.mark.parametrize("scale", [1e-4, 1e4])
@pytest.mark.parametrize("kind", CAMERAS)
def test_result_does_not_depend_on_the_unit_of_length(
    runtime: Runtime, subject: Subject, kind: str, scale: float
) -> None:
    one, other = (
        subject.function(
            scene("bumpy", camera(kind, (31, 39), scale=s), np.random.default_rng(3), scale=s),
            RADIUS * s,
            blur_radius=0,
            runtime=runtime,
        )
        for s in (1.0, scale)
    )
    # Scaled depths round differently, by 2^-24.
    assert share_off(one, other, 1e-3) <= FLIPS


@pytest.mark.parametrize("kind", CAMERAS)
def test_scene_far_from_the_origin_looks_as_at_the_origin(runtime: Runtime, subject: Subject, kind: str) -> None:
    one, other = (
        subject.function(
            scene("bumpy", camera(kind, (31, 39), shift=s), np.random.default_rng(3), shift=s),
            RADIUS,
            blur_radius=0,
            runtime=runtime,
        )
        for s in (np.zeros(3), np.array([1e6, -1e6, 1e6]))
    )
    # A double resolves 1e-10 at 1e6, so only the rounding of float32 depths may differ.
    assert share_off(one, other, 1e-3) <= FLIPS


def test_two_runs_give_bit_identical_results(
    variant_runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    gbuffer = scene("noisy", camera(size=(131, 217)), rng)
    device = _uploaded(variant_runtime, gbuffer)
    technique = subject.kind(variant_runtime, gbuffer.size, subject.params(radius=RADIUS))
    np.testing.assert_array_equal(technique(device), technique(device))


def test_empty_image_is_open(variant_runtime: Runtime, subject: Subject) -> None:
    for kind in ("perspective", "orthographic"):
        made = camera(kind, size=(9, 20))
        gbuffer = GBuffer(camera=made, depth=np.full(made.size, np.inf, np.float32))
        for resolution in ("full", "half"):
            a = subject.function(gbuffer, resolution=resolution, runtime=variant_runtime)
            np.testing.assert_array_equal(a, 1.0)


def test_pixels_with_nothing_are_open(runtime: Runtime, rng: np.random.Generator, subject: Subject) -> None:
    gbuffer = scene("noisy", camera(), rng)
    for resolution in ("full", "half"):
        a = subject.function(gbuffer, RADIUS, resolution=resolution, runtime=runtime)
        np.testing.assert_array_equal(a[np.isinf(gbuffer.depth)], 1.0)


def test_pattern_of_a_tile_spreads_angles_and_distances_evenly() -> None:
    made = pattern(SliceParams(slices=2, taps=3, tap_power=1.0))
    even = (np.arange(16) + 0.5) / 16
    for number in (0, 1):
        angle, share = made.angle[..., number], made.share[..., number, :]
        np.testing.assert_allclose(np.sort(2.0 * angle.ravel() / np.pi), number + even)
        for tap in range(3):
            np.testing.assert_allclose(np.sort(3.0 * share[..., tap].ravel()), tap + even)


# ---- prepared once, called many times


@pytest.mark.parametrize("resolution", ["full", "half"])
def test_second_call_allocates_and_builds_nothing(variant_runtime: Runtime, subject: Subject, resolution: str) -> None:
    _, both, _ = layered(camera())
    device = _uploaded(variant_runtime, both)
    technique = subject.kind(variant_runtime, both.size, subject.params(radius=RADIUS, resolution=resolution), layers=2)
    first = technique.run(device).download()
    before = variant_runtime.allocated_bytes, variant_runtime.builds
    second = technique.run(device).download()
    assert (variant_runtime.allocated_bytes, variant_runtime.builds) == before
    np.testing.assert_array_equal(first, second)


def test_camera_may_change_its_kind_from_frame_to_frame(
    runtime: Runtime, rng: np.random.Generator, subject: Subject
) -> None:
    gbuffers = [scene("bumpy", camera(kind), rng) for kind in ("perspective", "orthographic")]
    technique = subject.kind(runtime, gbuffers[0].size, subject.params(radius=RADIUS))
    for gbuffer in (*gbuffers, *gbuffers):
        a = technique(_uploaded(runtime, gbuffer))
        np.testing.assert_array_equal(a, subject.function(gbuffer, RADIUS, runtime=runtime))


def test_result_is_written_to_the_given_array(runtime: Runtime, rng: np.random.Generator, subject: Subject) -> None:
    gbuffer = scene("corner", camera(), rng)
    technique = subject.kind(runtime, gbuffer.size, subject.params(radius=RADIUS))
    out = np.zeros(gbuffer.size, np.float32)
    technique(_uploaded(runtime, gbuffer), out)
    np.testing.assert_array_equal(out, subject.function(gbuffer, RADIUS, runtime=runtime))


def _uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    device = DeviceGBuffer(runtime, gbuffer.size, margin=gbuffer.margin, layers=gbuffer.layers)
    device.upload(gbuffer)
    return device


# ---- bad input


@pytest.mark.parametrize("layers", [1, 2])
def test_gbuffer_of_another_shape_is_refused(runtime: Runtime, subject: Subject, layers: int) -> None:
    technique = subject.kind(runtime, (8, 8))
    gbuffer = DeviceGBuffer(runtime, (8, 8) if layers == 2 else (9, 8), layers=layers)
    with pytest.raises(ValueError, match=r"size, margin and layers are .*expected \(8, 8\)"):
        technique.run(gbuffer)


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"radius": -1.0}, ValueError, r"radius is -1.0: expected a number > 0.*scene units"),
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0"),
        ({"radius": math.nan}, ValueError, r"radius is nan: expected a number > 0"),
        ({"radius": math.inf}, ValueError, r"radius is inf: expected a number > 0"),
        ({"radius": "wide"}, TypeError, r"radius is 'wide': expected"),
        ({"radius": (0.5, 1.0)}, TypeError, r"radius is \(0.5, 1.0\): expected"),
        ({"slices": 0}, ValueError, r"slices is 0: expected an integer >= 1 and <= 32"),
        ({"slices": 2.5}, TypeError, r"slices is 2.5: expected an integer"),
        ({"taps": 65}, ValueError, r"taps is 65: expected an integer >= 1 and <= 64"),
        ({"tap_power": 0.0}, ValueError, r"tap_power is 0.0: expected a number >= 0.1"),
        ({"bias": -0.1}, ValueError, r"bias is -0.1: expected a number >= 0.*radii"),
        ({"contrast": math.nan}, ValueError, r"contrast is nan: expected a number"),
        ({"max_radius_px": 0.5}, ValueError, r"max_radius_px is 0.5: expected a number >= 1.*px"),
        ({"resolution": "third"}, ValueError, r"resolution is 'third': expected one of 'full'"),
        ({"blur_radius": 17}, ValueError, r"blur_radius is 17: expected an integer >= 0 and <= 16"),
        ({"colour": 1}, TypeError, r"colour"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, subject: Subject, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        subject.function(layered(camera())[0], runtime=runtime, **params)


def test_something_else_than_a_gbuffer_is_refused(runtime: Runtime, subject: Subject) -> None:
    with pytest.raises(TypeError, match=r"gbuffer is ndarray: expected GBuffer or DeviceGBuffer"):
        subject.function(np.ones((4, 4)), runtime=runtime)
