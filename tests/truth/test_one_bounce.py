"""World truth of light that one surface has reflected on its way: closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.truth.light import direct_light, one_bounce

from .surfaces import FAR, FLOOR, WALL, Quad, above, closely, grey, quads, spot_of, tinted

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")


def ball(radius: float, albedo: tuple[float, float, float]) -> Scene:
    """Return a sphere round the origin with its smooth normals (inwards)."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    points = mesh.vertices.astype(np.float32)
    return Scene(
        positions=points,
        normals=-points / radius,
        uvs=np.zeros_like(points[:, :2]),
        colors=np.ones_like(points),
        triangles=mesh.faces.astype(np.int32),
        material_ids=np.zeros(len(mesh.faces), np.int32),
        materials=(Material(albedo=albedo),),
    )


def test_bounce_inside_a_sphere_lit_from_its_centre_is_albedo_times_direct() -> None:
    albedo = (0.8, 0.5, 0.2)
    scene, lights = ball(2.0, albedo), [PointLight((0.0, 0.0, 0.0), (12.0, 10.0, 8.0))]
    camera = Camera.look_at((0.3, -0.2, 0.4), (1.5, 0.5, -0.4), width=96, height=64)
    # The icosphere's faces lie up to 0.03 % inside the sphere, and E grows by twice that; light
    # is lost at edges, where a ray that leaves one face below its smooth horizon is dropped.
    tessellation = 4e-3
    direct = direct_light(scene, camera, lights).mean
    expected = np.array([12.0, 10.0, 8.0]) / 4.0
    np.testing.assert_allclose(direct, np.broadcast_to(expected, direct.shape), rtol=tessellation)
    reflected = expected * albedo
    for visibility in (True, False):
        truth = one_bounce(scene, camera, lights, 4, visibility=visibility)
        closely(truth, reflected, other=tessellation * reflected.min())


def test_floor_beside_an_infinite_lit_wall_gets_half_of_what_it_reflects() -> None:
    sun = DirectionalLight((-1.0, 0.0, 0.0), 5.0)  # along the floor
    truth = one_bounce(quads(FLOOR, WALL, materials=tinted(0.3, 0.6)), spot_of(0.5), [sun], 4)
    closely(truth, 0.5 * 5.0 * np.array([0.6, 0.3, 0.15]), other=2e-3)  # about 1 / FAR


def test_environment_counts_by_way_of_a_surface_only() -> None:
    sky = [Environment(1.0)]
    assert (one_bounce(quads(FLOOR, materials=[grey(0.8)]), above(), sky, 1).mean == 0.0).all()
    # From below, an infinite ceiling is as bright as the sky that a floor under it would see.
    endless: Quad = ((-1, 0, -FAR), (0, 0, 2 * FAR), (FAR, 0, 0))
    truth = one_bounce(quads(endless, WALL, materials=tinted(0.0, 1.0)), spot_of(0.5, size=96), sky, 4)
    # The wall sees half of the sky, the floor half of the wall.
    closely(truth, math.pi * 0.25 * np.array([1.0, 0.5, 0.25]), other=5e-3)


def test_screen_between_hides_the_bounce_unless_visibility_is_off() -> None:
    wall: Quad = ((0, 0, -3), (0, 2, 0), (0, 0, 6))
    screen: Quad = ((0.3, 0, -3), (0, 1.9, 0), (0, 0, 6))
    # The sun comes over the screen: it lights all of the wall from 0.1 up, and not the screen's
    # side that faces away from it.
    sun = DirectionalLight((-1.0, -0.2, 0.0), 5.0)
    camera = spot_of(0.6, size=96)
    open_scene = quads(wall, FLOOR, materials=tinted(0.8, 0.0))
    hidden_scene = quads(wall, FLOOR, screen, materials=tinted(0.8, 0.0, 0.0))
    lights = [PointLight((0.15, 1.0, 0.0), 2.0)]
    # A light between wall and screen lights the same of the wall with the screen as without.
    free = one_bounce(open_scene, camera, lights, 16)
    hidden = one_bounce(hidden_scene, camera, lights, 4)
    through = one_bounce(hidden_scene, camera, lights, 16, visibility=False)
    closely(through, free.mean.mean(axis=(0, 1)), other=0.02 * float(free.mean.mean()))
    assert hidden.mean.mean() < 0.2 * through.mean.mean()
    # Shadows from light to wall stay: the sun reaches less of the wall past the screen.
    with_screen = one_bounce(hidden_scene, camera, [sun], 1, visibility=False).mean.mean()
    assert with_screen < 0.5 * one_bounce(open_scene, camera, [sun], 1).mean.mean()


def test_every_lit_surface_along_a_ray_counts_without_visibility() -> None:
    # Behind the first wall a second one, lit from between them: E = half of each one's light.
    behind: Quad = ((-1, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR))
    scene = quads(FLOOR, WALL, behind, materials=tinted(0.0, 0.5, 0.5))
    sun = DirectionalLight((-1.0, 0.0, 0.0), 4.0)
    lit_first = one_bounce(scene, spot_of(0.5), [sun], 4, visibility=False)
    closely(lit_first, 0.5 * 4.0 * np.array([0.5, 0.25, 0.125]), other=2e-3)
    # From the other side only the second wall's back is lit, which no floor point in front sees.
    other = DirectionalLight((1.0, 0.0, 0.0), 4.0)
    assert (one_bounce(scene, spot_of(0.5), [other], 2, visibility=False).mean == 0.0).all()
