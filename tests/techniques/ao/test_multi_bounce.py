"""Multiple bounces from A and albedo: the function, and as an option of shading."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.ao.multi_bounce import multi_bounce_reference
from ssgi_cl.reference.direct.shade import shade_reference
from ssgi_cl.techniques.ao.multi_bounce import multi_bounce
from ssgi_cl.techniques.direct.shade import shade

from ..analytic import camera, view_of

STEPS = np.linspace(0.0, 1.0, 201, dtype=np.float32)
A = np.broadcast_to(STEPS[:, None], (201, 201))
GREY = np.repeat(np.broadcast_to(STEPS, (201, 201))[..., None], 3, axis=-1)
"""Albedo rises along rows, A along columns."""


def test_function_agrees_with_float64_reference(rng: np.random.Generator) -> None:
    a, albedo = rng.random((31, 17)), rng.random((31, 17, 3))
    # Four roundings of float32 of sums of up to 5.
    np.testing.assert_allclose(multi_bounce(a, albedo), multi_bounce_reference(a, albedo), rtol=0, atol=2e-6)


def test_open_stays_open_and_closed_stays_closed() -> None:
    found = multi_bounce(A, GREY)
    np.testing.assert_array_equal(found[-1], 1.0)
    np.testing.assert_array_equal(found[0], 0.0)


def test_brightness_rises_with_visibility_and_with_albedo_and_is_never_below_a() -> None:
    found = multi_bounce(A, GREY)[..., 0]
    # Steps of 1 / 200 change it by far more than it is rounded by, unless it stays as it is.
    assert np.diff(found, axis=0).min() > 0.0
    assert np.diff(found, axis=1).min() >= -1e-7
    assert (found >= A).all()


def test_black_surfaces_leave_a_and_white_ones_brighten_it_much() -> None:
    found = multi_bounce(A, GREY)[..., 0]
    # The fit is not exact for black: measured at most 1e-5 above A.
    np.testing.assert_allclose(found[:, 0], STEPS, rtol=0, atol=2e-5)
    # Infinitely many bounces between white walls of visibility 1/2 would make it 1.
    assert 0.75 < float(found[100, -1]) < 1.0


@pytest.mark.parametrize("albedo", [0.5, (0.5, 0.5, 0.5)], ids=str)
def test_one_albedo_may_stand_for_all_pixels(albedo: Any) -> None:
    np.testing.assert_array_equal(multi_bounce(A, albedo), multi_bounce(A, np.full((*A.shape, 3), 0.5)))


@pytest.mark.parametrize(
    ("ao", "albedo", "error", "message"),
    [
        (np.full((2, 2), 1.5), 0.5, ValueError, r"ao\[0, 0\] is 1.5: expected numbers >= 0 and <="),
        (np.full((2, 2), np.nan), 0.5, ValueError, r"ao\[0, 0\] is nan"),
        (np.ones((2, 2, 3)), 0.5, ValueError, r"ao has shape \(2, 2, 3\): expected \(rows, col"),
        (np.ones((2, 2)), 1.5, ValueError, r"albedo is \[1.5, 1.5, 1.5\]: expected numbers"),
        (np.ones((2, 2)), (-0.1, 0, 0), ValueError, r"albedo is \[-0.1, 0.0, 0.0\]: expected"),
        (np.ones((2, 2)), np.full((2, 2, 3), 2), ValueError, r"albedo\[0, 0, 0\] is 2.0: .*<= 1"),
        (np.ones((2, 2)), np.ones((3, 2, 3)), ValueError, r"albedo has shape \(3, 2, 3\): exp"),
        (np.ones((2, 2)), "red", TypeError, r"albedo is 'red': expected 3 numbers"),
    ],
)
def test_bad_input_is_refused(ao: Any, albedo: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        multi_bounce(ao, albedo)


def test_shading_with_bounces_agrees_with_float64_reference(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = replace(view_of("bumpy"), albedo=rng.random((47, 61, 3)))
    lights = (Environment((0.2, 0.4, 0.6)), DirectionalLight((-0.3, -1.0, -0.5), (3, 2, 1)))
    ao = rng.random(gbuffer.size, np.float32)
    found = shade(gbuffer, lights, ao=ao, multi_bounce=True, runtime=variant_runtime)
    wanted = shade_reference(gbuffer, lights, ao=ao, multi_bounce=True)
    # As without: some roundings of positions and normals, relative to the brightest pixel.
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-5 * float(wanted.max()))
    plain = shade(gbuffer, lights, ao=ao, runtime=variant_runtime)
    assert (found >= plain).all()
    assert float(np.mean(found - plain)) > 0.02 * float(np.mean(plain))


def test_bounces_need_ambient_occlusion(runtime: Runtime) -> None:
    gbuffer = view_of("bumpy")
    sky = (Environment(1.0),)
    found = shade(gbuffer, sky, multi_bounce=True, runtime=runtime)
    np.testing.assert_array_equal(found, shade(gbuffer, sky, runtime=runtime))


def test_rendering_with_bounces_is_brighter(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    view = Camera.look_at(made.eye, made.target, made.up, yfov=made.yfov, width=48, height=36)
    plain, bounced = (
        render(
            made.scene,
            view,
            [Environment(1.0)],
            bounces=0,
            ao_radius=made.ao_radius,
            multi_bounce=choice,
            exposure=1.0,
            runtime=runtime,
        )
        for choice in (False, True)
    )
    assert (bounced.radiance >= plain.radiance).all()
    assert float(bounced.radiance.mean()) > 1.01 * float(plain.radiance.mean())


def test_something_else_than_a_switch_is_refused(runtime: Runtime) -> None:
    wrong: Any = 2
    message = r"multi_bounce is 2: expected True or False"
    with pytest.raises(TypeError, match=message):
        shade(view_of("corner"), [], multi_bounce=wrong, runtime=runtime)
    built = BUILTIN_SCENES["cornell_box"]()
    with pytest.raises(TypeError, match=message):
        render(built.scene, camera(), [], bounces=0, multi_bounce=wrong, runtime=runtime)
