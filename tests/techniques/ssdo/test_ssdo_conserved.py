"""Conservation of light in directional occlusion, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ssdo.ssdo import ssdo
from ssgi_cl.techniques.ssdo.ssdo_views import auxiliary_cameras

from ..analytic import Plane, trace
from .wall import WALL, floor_of, quads_of, seen

SKY = Environment(1.0)
RADIUS = 4.0
FLOOR = ((0, 0, -1.5), (0, 0, 3), (2, 0, 0))


def inside_of(camera: Camera, low: ArrayLike, high: ArrayLike) -> GBuffer:
    """Return the G-buffer of a camera in an empty box."""
    return trace(camera, [Plane(end, sign * way) for end, sign in ((low, 1.0), (high, -1.0)) for way in np.eye(3)])


def wall_beside_floor(camera: Camera, runtime: Runtime) -> GBuffer:
    return seen(quads_of(WALL, FLOOR), camera, runtime)


# ---- a furnace: the sky and all surfaces have radiance 1, so all irradiance is pi

ROOM = (np.array([-2.0, -1.5, -2.0]), np.array([2.0, 1.5, 2.0]))
FURNACES = {
    "from inside": (Camera.look_at((0.3, 0.2, 1.8), (0, 0, -1), yfov=1.2, width=80, height=60), 0.0),
    "orthographic, odd size": (
        Camera.orthographic((0.1, 0.1, 1.5), (0.3, -0.2, -1.0), view_height=2.5, width=61, height=47),
        0.0,
    ),
    "elsewhere, another size": (
        Camera.look_at((11.3, 5.2, -8.2), (10, 4.5, -11), yfov=1.0, width=35, height=53),
        (10.0, 5.0, -10.0),
    ),
}


@pytest.mark.parametrize(
    ("name", "samples"),
    [*((name, 16) for name in FURNACES), *(pytest.param(name, 256, marks=pytest.mark.slow) for name in FURNACES)],
)
def test_furnace_of_points_is_exact(runtime: Runtime, name: str, samples: int) -> None:
    camera, shift = FURNACES[name]
    gbuffer = inside_of(camera, ROOM[0] + shift, ROOM[1] + shift)
    direct, bounce = ssdo(
        gbuffer, [SKY], 3.0, radiance=np.ones((*camera.size, 3)), method="points", samples=samples, runtime=runtime
    )
    # Each direction brings one of both; 256 weights and the blur's are added in float32.
    np.testing.assert_allclose(direct + bounce, math.pi, rtol=1e-4)
    assert direct.mean() > 0.05 * math.pi
    assert bounce.mean() > 0.02 * math.pi


def test_furnace_as_published_is_not_conserved(runtime: Runtime) -> None:
    # Which is what its documentation says, and why "points" exists.
    camera, _ = FURNACES["from inside"]
    direct, bounce = ssdo(
        inside_of(camera, *ROOM), [SKY], 3.0, radiance=np.ones((*camera.size, 3)), method="published", runtime=runtime
    )
    total = (direct + bounce) / math.pi
    assert total.max() > 1.1
    assert bounce.mean() > 0.02 * math.pi


# ---- a sphere, of which irradiance is known in closed form

SPHERE = 2.0
"""Its radius."""
PIXELS = 64
EMISSION = 3.0
"""Its radiance, W m^-2 sr^-1."""


def ball_from_inside(height: float) -> tuple[GBuffer, float]:
    """Return a sphere's inside from `height` radii above its centre, and the fraction of it in view."""
    camera = Camera.look_at(
        (0.0, height * SPHERE, 0.0),
        (0.0, -SPHERE, 0.0),
        (0.0, 0.0, 1.0),
        yfov=math.radians(110.0),
        width=PIXELS,
        height=PIXELS,
    )
    start = camera.position
    along = camera.unproject(np.ones(camera.size)) - start
    # |start + depth along| = SPHERE
    a, b = np.sum(along**2, axis=-1), along @ start
    depth = (np.sqrt(b * b - a * (start @ start - SPHERE**2)) - b) / a
    normal = -(start + depth[..., None] * along) / SPHERE
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
    return gbuffer, float(area / (4.0 * math.pi * SPHERE**2))


@pytest.mark.parametrize("height", [0.5, 0.95])
@pytest.mark.parametrize(
    ("params", "most"),
    [
        ({}, 0.05),
        # Pieces of tangent planes stand for a sphere of 64 pixels: .4 % on average.
        pytest.param({"slices": 8, "taps": 48}, 0.02, marks=pytest.mark.slow),
    ],
    ids=["default", "many"],
)
def test_bounce_in_a_sphere_is_pi_l_times_the_share_of_it_that_is_seen(
    runtime: Runtime, height: float, params: dict[str, int], most: float
) -> None:
    gbuffer, share = ball_from_inside(height)
    expected = math.pi * EMISSION * share
    _, bounce = ssdo(gbuffer, [], radius=2.5 * SPHERE, runtime=runtime, **params)
    assert float(bounce.mean()) == pytest.approx(expected, rel=most)
    # Where the border is near, the last taps' pieces end beyond it or before.
    assert float(np.std(bounce)) < most * expected


# ---- a lit wall beside a floor

BESIDE = {
    "perspective": Camera.look_at((2.2, 1.6, 1.2), (0.4, 0.3, 0), yfov=0.9, width=120, height=90),
    "low, odd size": Camera.look_at((2.6, 0.5, 0.6), (0.3, 0.3, 0), yfov=0.9, width=121, height=91),
    "orthographic": Camera.orthographic((3.0, 2.4, 1.4), (0.5, 0.2, 0), view_height=2.6, width=131, height=99),
}


@pytest.mark.parametrize(
    ("count", "name"),
    [
        *((0, name) for name in BESIDE),
        (4, "low, odd size"),
        (4, "orthographic"),
        pytest.param(4, "perspective", marks=pytest.mark.slow),
        *(pytest.param(count, name, marks=pytest.mark.slow) for count in (1, 2) for name in BESIDE),
    ],
)
def test_wall_beside_a_floor_lights_and_hides_as_its_form_factor_says_with_any_cameras(
    runtime: Runtime, count: int, name: str
) -> None:
    gbuffer = wall_beside_floor(BESIDE[name], runtime)
    floor, irradiance = floor_of(gbuffer)
    views = [wall_beside_floor(each, runtime) for each in auxiliary_cameras(gbuffer.camera, gbuffer, count, size=1.0)]
    options = {"radiance": gbuffer.emission, "method": "points", "samples": 64, "runtime": runtime}
    direct, bounce = ssdo(gbuffer, [SKY], RADIUS, auxiliary_views=views, **options)
    expected = irradiance.mean()
    # Rays that leave the wall's image between two taps miss it, and nothing below .5 % of the
    # radius counts.
    assert bounce[floor].mean() == pytest.approx(expected, rel=0.05)
    assert math.pi - direct[floor].mean() == pytest.approx(expected, rel=0.05)
    # All that hides sends 1, but for the floor, which views at its edges may take for a wall.
    np.testing.assert_allclose((direct + bounce)[floor].mean(), math.pi, rtol=1e-3)


# ---- as published


def test_knobs_of_the_published_bounce(runtime: Runtime) -> None:
    gbuffer = wall_beside_floor(BESIDE["perspective"], runtime)

    def bounce(**options: float) -> NDArray[np.float32]:
        _, found = ssdo(gbuffer, [SKY], RADIUS, method="published", runtime=runtime, **options)
        return found

    plain, strong = bounce(), bounce(strength=2.5)
    assert plain.max() > 0.0
    np.testing.assert_allclose(strong, 2.5 * plain, rtol=1e-5)
    # Beyond the radius, all senders are as far away as the limit.
    far, farther = bounce(nearest_distance=2.0 * RADIUS), bounce(nearest_distance=6.0 * RADIUS)
    np.testing.assert_allclose(far, 9.0 * farther, rtol=1e-5)
    assert (bounce(nearest_distance=1e-3) >= plain - 1e-6 * plain.max()).all()
