"""World truth of light: the library's shading, what must not matter, and its keeping."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.shadow_map import rsm
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.truth import mitsuba_scene, path_tracer
from ssgi_cl.truth.light import direct_light, one_bounce
from ssgi_cl.truth.path_tracer import PathTracer
from ssgi_cl.truth.radiance import radiance

from .surfaces import FLOOR, above, grey, quads, spot_of

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

VIEW = BUILTIN_SCENES["cornell_box"]()
OPEN = quads(FLOOR, materials=[grey(0.8)])
SKY = [Environment(1.0)]


# ---- the whole chain: units, cameras, materials


def edges_of(image: NDArray[np.float32], reach: int = 2) -> NDArray[np.bool_]:
    """Return the pixels near a step of more than 20 % from a pixel to the next."""
    level = image.max(axis=-1).astype(np.float64)
    edge = np.zeros(level.shape, np.bool_)
    for axis in (0, 1):
        one, two = (np.take(level, np.arange(level.shape[axis] - 1) + i, axis) for i in (0, 1))
        step = np.abs(one - two) > 0.2 * np.maximum(one, two)
        before, after = ([0, 0], [0, 0]), ([0, 0], [0, 0])
        before[axis][1], after[axis][0] = 1, 1
        edge |= np.pad(step, before) | np.pad(step, after)
    for axis in (0, 1):
        edge = np.any([np.roll(edge, k, axis) for k in range(-reach, reach + 1)], axis=0)
    return edge


@pytest.mark.slow
def test_shading_of_the_cornell_box_is_within_a_percent_of_truth(
    runtime: Runtime, capsys: pytest.CaptureFixture[str]
) -> None:
    camera = VIEW.camera(400, 300)
    seen = gbuffer(VIEW.scene, camera, runtime=runtime)
    # Emission is light of its own, in `shade` only.
    dull = GBuffer(camera=camera, depth=seen.depth, normal=seen.normal, albedo=seen.albedo)
    maps = [rsm(VIEW.scene, light, size=1024, runtime=runtime) for light in VIEW.lights]  # type: ignore[arg-type]
    ours = shade(dull, VIEW.lights, shadow_maps=maps, runtime=runtime)
    truth = direct_light(VIEW.scene, camera, VIEW.lights).mean
    albedo = seen.first("albedo")
    assert albedo is not None
    expected = albedo / math.pi * truth
    counted = np.isfinite(np.asarray(seen.depth)) & ~edges_of(truth)
    assert counted.mean() > 0.5
    lit = counted & (truth.max(axis=-1) > 0.0)
    assert lit.mean() > 0.2
    off = np.abs(ours - expected)
    share = off[counted].mean() / expected[counted].mean()
    lit_share = (off[lit] / np.maximum(expected[lit], 1e-9)).mean()
    bias = (ours - expected)[counted].mean() / expected[counted].mean()
    with capsys.disabled():
        print(
            f"\n[direct light, Cornell box 400x300: mean |difference| {100 * share:.4f} % of the "
            f"mean, relative {100 * lit_share:.4f} % where lit, bias {100 * bias:+.4f} %, "
            f"{100 * counted.mean():.1f} % of pixels]"
        )
    assert share < 0.01
    assert lit_share < 0.01


# ---- what must not matter


def test_far_from_the_origin_light_is_the_same() -> None:
    far = np.array([1e6, -2e6, 3e5])
    spot = VIEW.lights[0]
    assert isinstance(spot, SpotLight)
    moved = replace(VIEW.scene, origin=VIEW.scene.origin + far)
    spot_there = replace(spot, position=np.asarray(spot.position) + far)
    camera = VIEW.camera(64, 48)
    camera_there = Camera.look_at(far + VIEW.eye, far + VIEW.target, yfov=VIEW.yfov, width=64, height=48)
    here = direct_light(VIEW.scene, camera, [spot]).mean
    there = direct_light(moved, camera_there, [spot_there]).mean
    # 1e6 m in float64 is known to 1e-10 m, the camera to as much: a few edges flip.
    same = np.isclose(here, there, rtol=1e-4, atol=1e-5).all(axis=-1)
    assert same.mean() > 0.995
    bounces = [
        one_bounce(s, c, [light], 4).mean.mean(axis=(0, 1))
        for s, c, light in ((VIEW.scene, camera, spot), (moved, camera_there, spot_there))
    ]
    np.testing.assert_allclose(bounces[0], bounces[1], rtol=1e-3)  # the same random numbers


def test_scale_of_the_scene_does_not_matter() -> None:
    spot = VIEW.lights[0]
    assert isinstance(spot, SpotLight)
    own = [estimate(VIEW.scene, VIEW.camera(64, 48), VIEW.lights, 2).mean for estimate in (direct_light, one_bounce)]
    for scale in (1e-6, 1e6):
        positions = np.float32(scale) * VIEW.scene.positions
        scaled = replace(VIEW.scene, origin=scale * VIEW.scene.origin, positions=positions)
        eye, target = scale * np.array(VIEW.eye), scale * np.array(VIEW.target)
        camera = Camera.look_at(eye, target, yfov=VIEW.yfov, width=64, height=48)
        # Intensity grows with the squared distance, so that irradiance stays.
        light = SpotLight(
            scale * np.asarray(spot.position), spot.direction, spot.cone_angle, scale**2 * np.asarray(spot.intensity)
        )
        for estimate, expected in zip((direct_light, one_bounce), own, strict=True):
            other = estimate(scaled, camera, [light], 2).mean
            # The same random numbers; what they hit at edges differs by roundings.
            assert np.isclose(expected, other, rtol=1e-3, atol=1e-5).mean() > 0.98


def test_an_image_in_blocks_of_rows_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = VIEW.camera(40, 30)
    whole = direct_light(VIEW.scene, camera, VIEW.lights)
    monkeypatch.setattr(path_tracer, "PIXELS", 300)
    blocks = direct_light(VIEW.scene, camera, VIEW.lights, rebuild=True)
    np.testing.assert_array_equal(blocks.mean, whole.mean)
    assert whole.mean.any()


@pytest.mark.parametrize("shape", [(7,), (3, 33), (2, 16), (0,), (0, 5)])
def test_memory_for_mitsuba_is_aligned_row_by_row(shape: tuple[int, ...], rng: np.random.Generator) -> None:
    for given in (rng.random(shape, np.float32), rng.integers(0, 99, shape, np.uint32)):
        found = path_tracer.aligned(given)
        np.testing.assert_array_equal(found, given)
        assert {row.ctypes.data % 64 for row in np.atleast_2d(found) if row.size} <= {0}


@pytest.mark.slow
def test_paths_in_parts_give_the_bits_of_all_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    lights = [*VIEW.lights, Environment((0.2, 0.4, 0.3))]
    given: Any = (VIEW.scene, VIEW.camera(12, 9), lights, 24)
    makers = (one_bounce, partial(radiance, box_filter=True))
    together = [make(*given, rebuild=True) for make in makers]
    monkeypatch.setattr(path_tracer, "PATHS", 2 * 12 * 9)  # of 3 paths a pass: 2 and 1
    for make, expected in zip(makers, together, strict=True):
        found = make(*given, rebuild=True)
        np.testing.assert_array_equal(found.mean, expected.mean)
        np.testing.assert_array_equal(found.error, expected.error)


def test_a_camera_that_looks_past_the_scene_sees_no_light() -> None:
    camera = Camera.look_at((0, 50, 0), (0, 60, 0), (1, 0, 0), width=8, height=6)
    truth = direct_light(OPEN, camera, SKY, 4)
    assert (truth.mean == 0.0).all()
    assert (truth.error == 0.0).all()


# ---- kept


@pytest.fixture
def traced(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The paths of each image that is asked for, of which all are black."""
    paths: list[int] = []

    def black(self: PathTracer, camera: Camera, count: int, seed: int) -> NDArray[np.float32]:
        paths.append(count)
        return np.zeros((*camera.size, 3), np.float32)

    monkeypatch.setattr(PathTracer, "image", black)
    return paths


def test_a_second_call_finds_what_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    first = direct_light(OPEN, above(), SKY, 4)
    monkeypatch.setattr(mitsuba_scene.MitsubaScene, "of", None)
    second = direct_light(OPEN, above(), SKY, 4)
    assert np.array_equal(first.mean, second.mean)
    assert first.key == second.key


def test_key_differs_with_everything_that_matters(traced: list[int]) -> None:
    keys = [
        direct_light(OPEN, above(), SKY, 4).key,
        direct_light(OPEN, above(), SKY, 64).key,
        direct_light(OPEN, above(), [Environment(2.0)], 4).key,
        direct_light(OPEN, above(yfov=0.5), SKY, 4).key,
        direct_light(quads(FLOOR, materials=[grey(0.3)]), above(), SKY, 4).key,
        one_bounce(OPEN, above(), SKY, 4).key,
        one_bounce(OPEN, above(), SKY, 4, visibility=False).key,
    ]
    assert len(set(keys)) == len(keys)
    assert traced


@pytest.mark.parametrize(("paths", "passes"), [(1, 1), (2, 2), (5, 2), (16, 4), (64, 8), (256, 8), (1000, 16)])
def test_paths_are_split_into_passes_that_tell_the_error(traced: list[int], paths: int, passes: int) -> None:
    assert direct_light(OPEN, spot_of(0.5, size=2), SKY, paths).passes == passes
    assert len(traced) == passes
    assert paths <= sum(traced) < paths + passes


# ---- bad input


def test_scene_without_lights_is_refused() -> None:
    for call in (direct_light, one_bounce):
        with pytest.raises(ValueError, match="lights is empty: expected at least one light"):
            call(OPEN, above(), [])


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"paths": 0}, ValueError, "paths is 0"),
        ({"paths": 2.5}, TypeError, "paths"),
        ({"lights": ["sun"]}, TypeError, r"lights\[0\] is str: expected a light"),
        ({"scene": "hall"}, TypeError, "scene is str: expected a Scene"),
        ({"camera": None}, TypeError, "camera is None: expected"),
        ({"visibility": 1}, TypeError, "visibility is 1: expected True or False"),
    ],
)
def test_bad_arguments_are_named(change: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        one_bounce(**{"scene": OPEN, "camera": above(), "lights": SKY, **change})


def test_missing_mitsuba_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba_scene.best_variant.cache_clear()
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    for call in (direct_light, radiance):
        with pytest.raises(MissingExtraError, match=r"pip install 'ssgi-cl\[truth\]'"):
            call(OPEN, above(), SKY)
