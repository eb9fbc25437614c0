"""HBAO: its own parameters. Tests of all that scan slices: test_slices.py."""

from __future__ import annotations

import math

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.hbao import hbao

from ..analytic import view_of


def test_attenuation_opens_what_is_far(runtime: Runtime) -> None:
    gbuffer = view_of("bumpy")
    images = [hbao(gbuffer, 0.6, 16, 48, attenuation=w, blur_radius=0, runtime=runtime) for w in (1e-7, 0.5, 1.0)]
    # W is linear in the attenuation, and so is A; roundings of float32. Of 0 it is another program.
    np.testing.assert_allclose(images[1], 0.5 * (images[0] + images[2]), rtol=0, atol=2e-6)
    assert float(np.mean(images[2] - images[0])) > 5e-3


def test_angle_bias_ignores_what_is_low_and_keeps_what_is_high(runtime: Runtime) -> None:
    gbuffer = view_of("bumpy")
    plain, raised = (
        hbao(gbuffer, 0.6, 1, 2, angle_bias=b, attenuation=0.0, blur_radius=0, runtime=runtime)
        for b in (1e-3, math.radians(30.0))  # of 0 it is another program
    )
    assert np.mean(raised == 1.0) > np.mean(plain == 1.0)
    assert raised.min() < 0.7
