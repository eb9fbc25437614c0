"""Furnace of SSDO: inside a sphere, irradiance is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ssdo.ssdo import ssdo

RADIUS = 2.0
PIXELS = 64
EMISSION = 3.0
"""Radiance of the sphere, W m^-2 sr^-1."""


def ball_from_inside(height: float) -> tuple[GBuffer, float]:
    """Return a sphere's inside from `height` radii above its centre, and the fraction of it in view."""
    camera = Camera.look_at(
        (0.0, height * RADIUS, 0.0),
        (0.0, -RADIUS, 0.0),
        (0.0, 0.0, 1.0),
        yfov=math.radians(110.0),
        width=PIXELS,
        height=PIXELS,
    )
    start = camera.position
    along = camera.unproject(np.ones(camera.size)) - start
    # |start + depth along| = RADIUS
    a, b = np.sum(along**2, axis=-1), along @ start
    depth = (np.sqrt(b * b - a * (start @ start - RADIUS**2)) - b) / a
    normal = -(start + depth[..., None] * along) / RADIUS
    # A pixel shows its area across the view ray over the cosine.
    facing = -np.sum(normal * along, axis=-1) / np.sqrt(a)
    to_x, to_y, _, _ = camera.pixel_to_view
    area = np.sum(abs(to_x * to_y) * depth**2 / np.sqrt(a) / facing)
    gbuffer = GBuffer(
        camera=camera,
        depth=depth.astype(np.float32),
        normal=normal.astype(np.float32),
        emission=np.full((*camera.size, 3), EMISSION, np.float32),
    )
    return gbuffer, float(area / (4.0 * math.pi * RADIUS**2))


@pytest.mark.parametrize("height", [0.5, 0.95])
def test_bounce_in_a_sphere_is_pi_l_times_the_share_of_it_that_is_seen(runtime: Runtime, height: float) -> None:
    gbuffer, share = ball_from_inside(height)
    expected = math.pi * EMISSION * share
    _, bounce = ssdo(gbuffer, [], radius=2.5 * RADIUS, slices=8, taps=48, runtime=runtime)
    # Pieces of tangent planes stand for a sphere of 64 pixels: .4 % on average.
    assert float(bounce.mean()) == pytest.approx(expected, rel=0.02)
    # Where the border is near, the last taps' pieces end beyond it or before.
    assert float(np.std(bounce)) < 0.02 * expected
    _, quick = ssdo(gbuffer, [], radius=2.5 * RADIUS, runtime=runtime)
    assert float(quick.mean()) == pytest.approx(expected, rel=0.05)
