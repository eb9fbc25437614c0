"""World truth of light straight from lights, and by way of one surface: closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.reference.direct.shade import direct_reference
from ssgi_cl.truth.light import direct_light, one_bounce

from .surfaces import FAR, FLOOR, ROUNDING, WALL, Quad, above, closely, grey, quads, spot_of, tinted

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

OPEN = quads(FLOOR, materials=[grey(0.8)])
SUN = DirectionalLight((0.3, -1.0, 0.4), (2.0, 3.0, 4.0))
POINT = PointLight((0.3, 1.2, -0.2), (7.0, 5.0, 3.0))


def seen_as(kind: str) -> Camera:
    """Return a camera of some kind that sees a part of the floor."""
    if kind == "orthographic":
        return Camera.orthographic((0.5, 3.0, 1.5), (0.2, 0.0, -0.3), view_height=2.0, width=32, height=24)
    camera = above(reversed_z=kind == "reversed-z")
    if kind == "off-centre":
        projection = camera.projection.copy()
        projection[0, 2], projection[1, 2] = 0.4, -0.3
        return replace(camera, projection=projection)
    return camera


def on_floor(camera: Camera) -> NDArray[np.float64]:
    """Return where view rays meet y = 0, [rows, columns, 3] world space."""
    start = camera.unproject(np.zeros(camera.size, np.float32))
    along = camera.unproject(np.ones(camera.size, np.float32)) - start
    return start - along * (start[..., 1] / along[..., 1])[..., None]


# ---- direct light


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "off-centre", "reversed-z"])
def test_point_light_over_a_plane_obeys_cosine_and_distance(kind: str) -> None:
    camera = seen_as(kind)
    truth = direct_light(OPEN, camera, [POINT])
    to_light = np.array(POINT.position) - on_floor(camera)
    distance = np.linalg.norm(to_light, axis=-1)
    expected = (to_light[..., 1] / distance**3)[..., None] * np.array([7.0, 5.0, 3.0])
    np.testing.assert_allclose(truth.mean, expected, rtol=ROUNDING)
    assert (truth.error == 0.0).all()
    assert truth.passes == 1


def test_cone_of_a_spot_light_has_a_hard_edge_at_its_angle() -> None:
    camera = above(128, 96)
    light = SpotLight((0.1, 1.5, -0.2), (0.1, -1.0, 0.05), 0.6, (4.0, 4.0, 4.0))
    truth = direct_light(OPEN, camera, [light])
    place = on_floor(camera)
    up = np.broadcast_to((0.0, 1.0, 0.0), place.shape)
    expected = direct_reference(light, place, up)
    from_light = place - np.array(light.position)
    angle = np.arccos(from_light @ np.array(light.direction) / np.linalg.norm(from_light, axis=-1))
    sure = np.abs(angle - light.cone_angle) > 1e-5  # roundings of a direction of length 1
    assert sure.mean() > 0.99
    assert 0.1 < (expected[..., 0] > 0.0).mean() < 0.9, "both sides of the edge are seen"
    np.testing.assert_allclose(truth.mean[sure], expected[sure], rtol=ROUNDING)


def test_lights_add_up_and_dark_ones_add_nothing() -> None:
    dark = [PointLight((0.0, 1.0, 0.0), 0.0), Environment(0.0), DirectionalLight((0, -1, 0), 0.0)]
    both = direct_light(OPEN, above(), [SUN, *dark[:1], POINT])
    apart = [direct_light(OPEN, above(), [light]).mean for light in (SUN, POINT)]
    # A directional light falls by the cosine alone.
    np.testing.assert_allclose(apart[0], np.full((24, 32, 3), [2.0, 3.0, 4.0]) / math.sqrt(1.25), rtol=1e-6)
    np.testing.assert_allclose(both.mean, apart[0] + apart[1], rtol=1e-6)
    nothing = direct_light(OPEN, above(), dark, 2)
    assert (nothing.mean == 0.0).all()
    assert (nothing.error == 0.0).all()
    assert (one_bounce(OPEN, above(), dark, 1).mean == 0.0).all()


def test_light_below_the_surface_does_not_reach_its_upper_side() -> None:
    lights = [PointLight((0.0, -1.0, 0.0), 5.0), DirectionalLight((0.0, 1.0, 0.1), 5.0)]
    assert (direct_light(OPEN, above(), lights).mean == 0.0).all()


def test_a_light_on_the_surface_itself_leaves_no_infinity() -> None:
    for light in (PointLight((0, 0, 0), 5.0), SpotLight((0, 0, 0), (0, -1, 0), 1.0, 5.0)):
        assert np.isfinite(direct_light(OPEN, spot_of(0.0, size=3), [light]).mean).all()


def test_a_roof_casts_its_shadow() -> None:
    roof: Quad = ((-0.5, 1.0, -0.5), (0, 0, 1), (1, 0, 0))
    camera = above()
    place = on_floor(camera)
    truth = direct_light(quads(FLOOR, roof, materials=[grey(0.8)]), camera, [DirectionalLight((0, -1, 0), 3.0)])
    at_roof = place + (camera.position - place) / camera.position[1]  # where view rays to the floor pass it
    off, past = (np.abs(point[..., [0, 2]]).max(axis=-1) for point in (place, at_roof))
    shaded, lit = (off < 0.49) & (past > 0.51), (off > 0.51) & (past > 0.51)
    assert shaded.sum() > 5
    assert (truth.mean[shaded] == 0.0).all()
    np.testing.assert_allclose(truth.mean[lit], 3.0, rtol=1e-6)


def test_constant_environment_lights_an_open_plane_with_pi_l() -> None:
    truth = direct_light(OPEN, above(), [Environment((1.0, 2.0, 0.5))], 4)
    # Every sample counts the same: no noise but roundings.
    expected = np.broadcast_to(math.pi * np.array([1.0, 2.0, 0.5]), truth.mean.shape)
    np.testing.assert_allclose(truth.mean, expected, rtol=1e-5)
    assert (truth.error < 1e-5 * truth.mean).all()


def test_wall_hides_half_of_a_constant_environment() -> None:
    truth = direct_light(quads(FLOOR, WALL, materials=[grey(0.8)]), spot_of(0.5), [Environment(2.0)], 4)
    closely(truth, math.pi, other=2e-3)  # 2 pi / FAR, cut off at the wall's ends


def test_environment_images_light_a_plane_as_their_texels_say(rng: np.random.Generator) -> None:
    image = rng.random((6, 9, 3)) ** 4  # some texels are far brighter than others
    lights = [Environment(image), Environment((0.1, 0.2, 0.3))]
    tilt = np.array([0.4, 0.8, 0.45])
    tilt /= np.linalg.norm(tilt)
    first = np.cross(tilt, [0.0, 0.0, 1.0])
    second = np.cross(tilt, first)
    plane = (-5 * first - 5 * second, 10 * first, 10 * second)
    camera = Camera.look_at(3.0 * tilt, (0, 0, 0), (0, 0.3, 1), width=96, height=96, yfov=0.5)
    # Midpoint rule over the sphere, 1/30 of a texel apart.
    polar = (np.arange(180) + 0.5) * math.pi / 180
    azimuth = ((np.arange(270) + 0.5) / 270 - 0.5) * 2.0 * math.pi
    way = np.stack(
        np.broadcast_arrays(
            np.sin(polar)[:, None] * np.sin(azimuth), np.cos(polar)[:, None],
            -np.sin(polar)[:, None] * np.cos(azimuth),
        ), axis=-1,
    )  # fmt: skip
    radiance = image[np.arange(180) // 30][:, np.arange(270) // 30] + [0.1, 0.2, 0.3]
    share = np.maximum(way @ tilt, 0.0) * np.sin(polar)[:, None]
    expected = (radiance * share[..., None]).sum(axis=(0, 1)) * (math.pi / 180) * (math.tau / 270)
    truth = direct_light(quads(plane, materials=[grey(0.8)]), camera, lights, 4)
    closely(truth, expected, other=1e-3 * expected.max())  # a step between texels is 1/1024 wide


# ---- one bounce


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
