"""Pictures of several samples a pixel: closed forms, convergence, and what else they hold."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.samples import shifts
from ssgi_cl.rasterize.scenes import make_scene

from .scenes import MAPS, cube, inside, matt, scene_of

DIRECT: dict[str, Any] = {"bounces": 0, "ao": False, **MAPS}


@pytest.mark.parametrize(
    ("samples", "error"), [(0, ValueError), (1025, ValueError), (2.5, TypeError), ("2", TypeError), (None, TypeError)]
)
def test_bad_numbers_of_samples(runtime: Runtime, samples: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=f"samples is {samples!r}: expected an integer"):
        gi.render(cube(0.0, 1.0), inside(8, 6), [], samples=samples, runtime=runtime, **DIRECT)


def test_an_image_too_large_for_other_patterns_is_named() -> None:
    with pytest.raises(ValueError, match="samples is 2: expected 1 with an image of"):
        gi.render(cube(0.0, 1.0), inside(16384, 1), [], samples=2)


@pytest.mark.parametrize("samples", [2, 5, 8, 16, 64])
def test_samples_surround_the_centre_and_move_patterns(samples: int) -> None:
    found = np.array(shifts(samples))
    np.testing.assert_allclose(found[:, :2].mean(axis=0), 0.0, atol=1e-12)
    assert np.abs(found[:, :2]).max() < 0.5
    assert len(set(map(tuple, found[:16, 2:].tolist()))) == min(samples, 16)


def test_one_sample_is_the_frame(runtime: Runtime) -> None:
    built = make_scene("cornell_box")
    frames = [
        gi.render(built.scene, built.camera(40, 30), built.lights, runtime=runtime, **DIRECT, **more)
        for more in ({}, {"samples": 1})
    ]
    np.testing.assert_array_equal(frames[0].radiance, frames[1].radiance)
    np.testing.assert_array_equal(frames[0].image, frames[1].image)


def test_even_light_keeps_its_value(runtime: Runtime) -> None:
    frame = gi.render(cube(0.5, 1.0), inside(33, 21), [], samples=3, preset="low", runtime=runtime, **MAPS)
    assert frame.radiance.shape == (21, 33, 3)
    assert frame.image.shape == (21, 33, 3)
    assert frame.radiance.mean() == pytest.approx(2.0, rel=0.02)  # L / (1 - rho), as in a frame of one sample


@pytest.mark.parametrize("limited", [False, True])
def test_edges_have_their_share_where_they_are(runtime: Runtime, limited: bool) -> None:
    camera = gi.Camera.orthographic((20, 10, 9), (20, 10, 0), view_height=20.0, width=40, height=20)
    right, bottom = 20.3, 7.55
    points = [(0.0, bottom, 0.0), (right, bottom, 0.0), (right, 30.0, 0.0), (0.0, 30.0, 0.0)]
    wall = scene_of(points, [(0, 1, 2), (0, 2, 3)], matt(0.0, 2.0))
    more = {"max_memory": runtime.memory.limit} if limited else {}
    found = gi.render(wall, camera, [], samples=16, runtime=runtime, **DIRECT, **more).radiance[..., 0]
    across = 2.0 * np.clip(right - np.arange(40), 0.0, 1.0)
    down = 2.0 * np.clip(20.0 - bottom - np.arange(20), 0.0, 1.0)
    # One of 16 places of each row and column: an edge is right within one of them.
    np.testing.assert_allclose(found[3], across, atol=2.0 / 16 + 1e-5)
    np.testing.assert_allclose(found[:, 3], down, atol=2.0 / 16 + 1e-5)


def test_the_error_falls_with_the_root_of_the_samples(runtime: Runtime) -> None:
    built = make_scene("workshop")

    def picture(samples: int) -> np.ndarray:
        return gi.render(
            built.scene, built.camera(64, 48), built.lights, samples=samples, outputs=("radiance",), edges=0,
            runtime=runtime, **DIRECT,
        ).radiance  # fmt: skip

    exact = picture(289)
    errors = [float(np.sqrt(np.mean((np.sqrt(picture(n)) - np.sqrt(exact)) ** 2))) for n in (1, 4, 16, 64)]
    # Halved by four times as many or better: places are spread evenly. Measured: .35, .42 and .34.
    assert all(after < 0.56 * before for before, after in pairwise(errors)), errors


def test_other_outputs_are_means_and_surfaces_those_of_centres(runtime: Runtime) -> None:
    built = make_scene("cornell_box")
    given: dict[str, Any] = {"preset": "low", "gbuffer": True, "runtime": runtime, **MAPS}
    plain, several = (
        gi.render(built.scene, built.camera(48, 36), built.own_lights, samples=samples, **given) for samples in (1, 4)
    )
    assert plain.gbuffer is not None
    assert several.gbuffer is not None
    np.testing.assert_array_equal(several.gbuffer.depth, plain.gbuffer.depth)
    np.testing.assert_array_equal(several.gbuffer.normal, plain.gbuffer.normal)
    assert plain.indirect is not None
    assert several.indirect is not None
    assert several.indirect.shape == plain.indirect.shape
    assert several.indirect.mean() == pytest.approx(plain.indirect.mean(), rel=0.1)
    alone = gi.render(built.scene, built.camera(48, 36), built.own_lights, samples=4, outputs=("radiance",), **given)
    np.testing.assert_array_equal(alone.radiance, several.radiance)
    with pytest.raises(ValueError, match="no image"):
        _ = alone.image


def test_progress_grows_to_one(runtime: Runtime) -> None:
    built, shares = make_scene("cornell_box"), list[float]()
    gi.render(
        built.scene, built.camera(40, 30), built.lights, samples=3, progress=shares.append, runtime=runtime, **DIRECT
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert sum(share > 0.5 for share in shares) > 2
