"""Frames of extreme input: finite pictures near the reference, or an error with the reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime

from .scenes import CORNERS, QUADS, cube, halves, inside, matt, scene_of

Floats = NDArray[np.float32]

WHITE = gi.Environment(1.0)


def floor(albedo: float = 0.5) -> Scene:
    points = [[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]]
    return scene_of(points, [(0, 2, 1), (0, 3, 2)], matt(albedo))


DOWN = gi.Camera.look_at((0, 3, 0.1), (0, 0, 0), yfov=0.6, width=24, height=16)
INSIDE = inside(24, 16)


def radiance(runtime: Runtime, scene: Scene, lights: Any, camera: gi.Camera = INSIDE, **given: Any) -> Floats:
    given = {"preset": "low", "shadow_size": 256, "rsm_size": 64, "exposure": 1.0, "ao": False, **given}
    frame = gi.render(scene, camera, lights, runtime=runtime, **given)
    assert np.isfinite(frame.radiance).all()
    return frame.radiance


@pytest.mark.parametrize(
    "shapes",
    [[(1, 1)], [(1, 100_000), (100_000, 1)], *(pytest.param([s], marks=pytest.mark.slow) for s in ((1, 2), (3, 1)))],
    ids=str,
)
def test_environments_of_any_shape_light_an_open_floor(runtime: Runtime, shapes: list[tuple[int, int]]) -> None:
    found = radiance(runtime, floor(), [gi.Environment(np.ones((*shape, 3))) for shape in shapes], DOWN)
    # E = pi L on an open floor; the 64 directions of this preset sum to .94 of it at this normal.
    np.testing.assert_allclose(found.mean(), 0.5 * len(shapes), rtol=0.08)


def test_emission_of_1e9_scales_the_picture(runtime: Runtime) -> None:
    weak, strong = (radiance(runtime, cube(0.5, e), []) for e in (1.0, 1e9))
    np.testing.assert_allclose(strong, weak * 1e9, rtol=1e-3)
    np.testing.assert_allclose(strong.mean(), 2e9, rtol=0.03)  # L / (1 - rho)


def test_inside_out_is_lit_the_same(runtime: Runtime) -> None:
    light = gi.PointLight((0.2, 0.6, 0.1), 1.0)
    room = cube(0.5)
    a, b = (radiance(runtime, scene, [light]) for scene in (room, replace(room, triangles=room.triangles[:, ::-1])))
    assert a.mean() > 0.01
    np.testing.assert_allclose(a.mean(), b.mean(), rtol=0.02)


def test_a_light_inside_a_wall_lights_nothing_inside(runtime: Runtime) -> None:
    # A slab from -0.4 to 0.4 in a room; the light is in the middle of it. Each side has corners and
    # normals of its own: those estimated from depths look into the slab at its edges.
    corners = np.array(CORNERS, float)
    sides = np.concatenate([corners[list(quad)] * size for size in (1.0, 0.4) for quad in QUADS])
    triangles = [(i, i + j, i + j + 1) for i in range(0, len(sides), 4) for j in (1, 2)]
    first, second, third = (sides[[t[i] for t in triangles[::2]]] for i in range(3))
    normals = np.repeat(np.cross(second - first, third - first), 4, axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    scene = replace(scene_of(sides, triangles, matt(0.5)), normals=normals.astype(np.float32))
    camera = gi.Camera.look_at((0.8, 0.8, 0.8), (0, 0, 0), yfov=1.2, width=24, height=16)
    found = radiance(runtime, scene, [gi.PointLight((0, 0, 0), 1.0)], camera)
    outside = radiance(runtime, scene, [gi.PointLight((0.7, 0.7, -0.7), 1.0)], camera)
    assert found.mean() < 0.01 * outside.mean()  # .005 with 512 surfels, .007 with 2048


def test_thousands_of_emissive_triangles(runtime: Runtime) -> None:
    # The furnace again, each side of 24 x 24 squares.
    u, v = (w.ravel() for w in np.meshgrid(*[np.linspace(-1.0, 1.0, 25)] * 2))
    sides = [np.insert(np.stack([u, v], 1), axis, side, axis=1) for axis in range(3) for side in (-1.0, 1.0)]
    corner = (np.arange(6)[:, None, None] * 625 + np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
    triangles = halves([(a, a + 1, a + 26, a + 25) for a in corner])
    scene = scene_of(np.concatenate(sides), triangles, matt(0.5, 1.0))
    assert len(triangles) == 6912
    found = radiance(runtime, scene, [])
    np.testing.assert_allclose(found.mean(), 2.0, rtol=0.03)


def test_a_box_that_absorbs_nothing(runtime: Runtime) -> None:
    with pytest.raises(ValueError, match=r"bounces is 'all'.*expected 0\.002 or more.*albedo"):
        radiance(runtime, cube(1.0, 1.0), [])
    found = radiance(runtime, cube(1.0, 1.0), [], bounces=3)
    assert found.mean() == pytest.approx(5.0, rel=0.05)
    # No light, no series; and from outside an open floor of albedo 1 is all right.
    assert not radiance(runtime, cube(1.0), []).any()
    found = radiance(runtime, floor(1.0), [WHITE], DOWN)
    np.testing.assert_allclose(found.mean(), 1.0, rtol=0.08)
