"""World truth of light: closed forms, Mitsuba's own integrator, and the library's shading."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.shadow_map import rsm
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.direct.shade import direct_reference, world_surface
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.truth import metrics, mitsuba_scene, path_tracer, store
from ssgi_cl.truth.light import direct_light, one_bounce
from ssgi_cl.truth.mitsuba_scene import MitsubaScene
from ssgi_cl.truth.path_tracer import DirectLight
from ssgi_cl.truth.radiance import radiance
from ssgi_cl.truth.store import Truth

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

Doubles = NDArray[np.float64]

ROUNDING = 2e-5
"""Relative: positions in float32 a few hundred roundings from the eye, and 1 / d^2 of them."""
STANDARD_ERRORS = 3.0
"""The mean over an image is that many of its standard errors from the closed form, at most."""
FAR = 1e3
"""Extent of planes that stand for infinite ones; the rest is seen under about 1 / FAR."""


# ---- scenes

Quad = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""A corner and the two edges that leave it."""


def made(
    positions: ArrayLike,
    triangles: ArrayLike,
    *,
    materials: Sequence[Material] = (Material(),),
    ids: ArrayLike | None = None,
    uvs: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    **rest: Any,
) -> Scene:
    points, faces = np.asarray(positions, np.float32), np.asarray(triangles, np.int32)
    zeros = np.zeros(points.shape, np.float32)
    return Scene(
        positions=points,
        normals=zeros if normals is None else np.asarray(normals, np.float32),
        uvs=np.asarray(zeros[:, :2] if uvs is None else uvs, np.float32),
        triangles=faces,
        material_ids=np.zeros(len(faces), np.int32) if ids is None else np.asarray(ids),
        materials=tuple(materials),
        **{"colors": np.ones(points.shape, np.float32), **rest},
    )


def quads(*parts: Quad, albedos: Sequence[float] | None = None, **rest: Any) -> Scene:
    """Return a scene of parallelograms, each of its own material; v grows along the first edge."""
    corners = []
    for part in parts:
        corner, first, second = (np.asarray(p, np.float64) for p in part)
        corners += [corner, corner + first, corner + first + second, corner + second]
    faces = [[4 * i + k for k in t] for i in range(len(parts)) for t in ((0, 1, 2), (0, 2, 3))]
    colors = albedos or [0.8] * len(parts)
    return made(
        corners,
        faces,
        ids=np.repeat(np.arange(len(parts)), 2),
        **{
            "uvs": [[0, 0], [0, 1], [1, 1], [1, 0]] * len(parts),
            "materials": [Material(albedo=(a, 0.5 * a, 0.25 * a)) for a in colors],
            **rest,
        },
    )


FLOOR: Quad = ((-5, 0, -5), (0, 0, 10), (10, 0, 0))


def looking_down(kind: str = "perspective", size: tuple[int, int] = (24, 32)) -> Camera:
    """Return a camera that sees a part of FLOOR."""
    rows, columns = size
    eye, target = (0.5, 3.0, 1.5), (0.2, 0.0, -0.3)
    if kind == "orthographic":
        return Camera.orthographic(eye, target, view_height=2.0, width=columns, height=rows)
    camera = Camera.look_at(eye, target, width=columns, height=rows, reversed_z=kind == "reversed-z")
    if kind == "off-centre":
        projection = camera.projection.copy()
        projection[0, 2], projection[1, 2] = 0.4, -0.3
        return replace(camera, projection=projection)
    return camera


def on_floor(camera: Camera) -> Doubles:
    """Return where view rays meet y = 0, [rows, columns, 3] world space."""
    start = camera.unproject(np.zeros(camera.size, np.float32))
    along = camera.unproject(np.ones(camera.size, np.float32)) - start
    return start - along * (start[..., 1] / along[..., 1])[..., None]


def spot_of(x: float, z: float = 0.0, size: int = 16) -> Camera:
    """Return a camera that sees a spot of the floor, as small as a point, from 1 cm above."""
    return Camera.orthographic((x, 0.01, z), (x, 0.0, z), (0, 0, 1), view_height=1e-6, width=size, height=size, far=1.0)


def closely(truth: Truth, expected: ArrayLike, other: float = 0.0) -> None:
    """Assert that the mean of each channel is as expected, by its standard error and `other`."""
    wanted = np.broadcast_to(expected, truth.mean.shape)
    off = np.mean(truth.mean - wanted, axis=(0, 1))
    pixels = truth.mean.shape[0] * truth.mean.shape[1]
    own = np.sqrt(np.sum(truth.error.astype(np.float64) ** 2, axis=(0, 1))) / pixels
    assert (np.abs(off) <= STANDARD_ERRORS * own + other).all(), (off, own)
    assert (own < 0.02 * np.abs(wanted).mean()).all(), "the test would notice nothing"


# ---- direct light


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "off-centre", "reversed-z"])
def test_point_light_over_a_plane_obeys_cosine_and_distance(kind: str) -> None:
    camera = looking_down(kind)
    light = PointLight((0.3, 1.2, -0.2), (7.0, 5.0, 3.0))
    truth = direct_light(quads(FLOOR), camera, [light])
    to_light = np.array(light.position) - on_floor(camera)
    distance = np.linalg.norm(to_light, axis=-1)
    expected = (to_light[..., 1] / distance**3)[..., None] * np.array([7.0, 5.0, 3.0])
    np.testing.assert_allclose(truth.mean, expected, rtol=ROUNDING)
    assert (truth.error == 0.0).all()
    assert truth.passes == 1


def test_directional_light_falls_by_the_cosine_alone() -> None:
    light = DirectionalLight((0.3, -1.0, 0.4), (2.0, 3.0, 4.0))
    truth = direct_light(quads(FLOOR), looking_down(), [light])
    expected = np.array([2.0, 3.0, 4.0]) / math.sqrt(1.25)
    np.testing.assert_allclose(truth.mean, np.broadcast_to(expected, truth.mean.shape), rtol=1e-6)


def test_cone_of_a_spot_light_has_a_hard_edge_at_its_angle() -> None:
    camera = looking_down(size=(96, 128))
    light = SpotLight((0.1, 1.5, -0.2), (0.1, -1.0, 0.05), 0.6, (4.0, 4.0, 4.0))
    truth = direct_light(quads(FLOOR), camera, [light])
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
    camera, scene = looking_down(), quads(FLOOR)
    sun = DirectionalLight((0.3, -1.0, 0.4), (2.0, 3.0, 4.0))
    punctual_light = PointLight((0.3, 1.2, -0.2), (7.0, 5.0, 3.0))
    dark = [PointLight((0.0, 1.0, 0.0), 0.0), Environment(0.0), DirectionalLight((0, -1, 0), 0.0)]
    both = direct_light(scene, camera, [sun, *dark[:1], punctual_light])
    apart = [direct_light(scene, camera, [light]).mean for light in (sun, punctual_light)]
    np.testing.assert_allclose(both.mean, apart[0] + apart[1], rtol=1e-6)
    nothing = direct_light(scene, camera, dark, 4)
    assert (nothing.mean == 0.0).all()
    assert (nothing.error == 0.0).all()
    assert (one_bounce(scene, camera, dark, 4).mean == 0.0).all()


def test_light_below_the_surface_does_not_reach_its_upper_side() -> None:
    lights = [PointLight((0.0, -1.0, 0.0), 5.0), DirectionalLight((0.0, 1.0, 0.1), 5.0)]
    assert (direct_light(quads(FLOOR), looking_down(), lights).mean == 0.0).all()


def test_a_light_on_the_surface_itself_leaves_no_infinity() -> None:
    camera = spot_of(0.0, size=3)
    for light in (PointLight((0, 0, 0), 5.0), SpotLight((0, 0, 0), (0, -1, 0), 1.0, 5.0)):
        assert np.isfinite(direct_light(quads(FLOOR), camera, [light]).mean).all()


def test_a_roof_casts_its_shadow() -> None:
    roof: Quad = ((-0.5, 1.0, -0.5), (0, 0, 1), (1, 0, 0))
    camera = looking_down()
    place = on_floor(camera)
    truth = direct_light(quads(FLOOR, roof), camera, [DirectionalLight((0, -1, 0), 3.0)])
    shaded = np.abs(place[..., [0, 2]]).max(axis=-1) < 0.49
    seen_past_roof = gap_under_roof(camera, place)
    assert (shaded & seen_past_roof).sum() > 5
    assert (truth.mean[shaded & seen_past_roof] == 0.0).all()
    lit = np.abs(place[..., [0, 2]]).max(axis=-1) > 0.51
    np.testing.assert_allclose(truth.mean[lit & seen_past_roof], 3.0, rtol=1e-6)


def gap_under_roof(camera: Camera, place: Doubles) -> NDArray[np.bool_]:
    """Return where the view ray to the floor misses the roof at height 1."""
    at_roof = place + (camera.position - place) / camera.position[1]
    return np.asarray(np.abs(at_roof[..., [0, 2]]).max(axis=-1) > 0.51)


def test_constant_environment_lights_an_open_plane_with_pi_l() -> None:
    truth = direct_light(quads(FLOOR), looking_down(), [Environment((1.0, 2.0, 0.5))], 32)
    # Every sample counts the same: no noise but roundings.
    expected = np.broadcast_to(math.pi * np.array([1.0, 2.0, 0.5]), truth.mean.shape)
    np.testing.assert_allclose(truth.mean, expected, rtol=1e-5)
    assert (truth.error < 1e-5 * truth.mean).all()


def test_wall_hides_half_of_a_constant_environment() -> None:
    wall: Quad = ((0, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR))
    truth = direct_light(quads(FLOOR, wall), spot_of(0.5), [Environment(2.0)], 256)
    closely(truth, math.pi, other=2e-3)  # 2 pi / FAR, cut off at the wall's ends


def test_environment_images_light_a_plane_as_their_texels_say(rng: np.random.Generator) -> None:
    image = rng.random((6, 9, 3)) ** 4  # some texels are far brighter than others
    lights = [Environment(image), Environment((0.1, 0.2, 0.3))]
    tilt = np.array([0.4, 0.8, 0.45])
    tilt /= np.linalg.norm(tilt)
    first = np.cross(tilt, [0.0, 0.0, 1.0])
    plane: Quad = tuple(  # type: ignore[assignment]
        v.tolist() for v in (-5 * first - 5 * np.cross(tilt, first), 10 * first,
                             10 * np.cross(tilt, first))
    )  # fmt: skip
    camera = Camera.look_at(3.0 * tilt, (0, 0, 0), (0, 0.3, 1), width=24, height=24, yfov=0.5)
    # Midpoint rule over the sphere, 1/60 of a texel apart.
    polar = (np.arange(360) + 0.5) * math.pi / 360
    azimuth = ((np.arange(540) + 0.5) / 540 - 0.5) * 2.0 * math.pi
    way = np.stack(
        np.broadcast_arrays(
            np.sin(polar)[:, None] * np.sin(azimuth), np.cos(polar)[:, None],
            -np.sin(polar)[:, None] * np.cos(azimuth),
        ), axis=-1,
    )  # fmt: skip
    radiance = image[np.arange(360) // 60][:, np.arange(540) // 60] + [0.1, 0.2, 0.3]
    share = np.maximum(way @ tilt, 0.0) * np.sin(polar)[:, None]
    expected = (radiance * share[..., None]).sum(axis=(0, 1)) * (math.pi / 360) * (math.tau / 540)
    truth = direct_light(quads(plane), camera, lights, 256)
    closely(truth, expected, other=1e-3 * expected.max())  # a step between texels is 1/1024 wide


# ---- one bounce


def ball(radius: float, albedo: tuple[float, float, float]) -> Scene:
    """Return a sphere round the origin with its smooth normals (inwards)."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    return made(mesh.vertices, mesh.faces, normals=-mesh.vertices / radius, materials=[Material(albedo=albedo)])


@pytest.mark.parametrize("visibility", [True, False])
def test_bounce_inside_a_sphere_lit_from_its_centre_is_albedo_times_direct(visibility: bool) -> None:
    albedo = (0.8, 0.5, 0.2)
    scene, lights = ball(2.0, albedo), [PointLight((0.0, 0.0, 0.0), (12.0, 10.0, 8.0))]
    camera = Camera.look_at((0.3, -0.2, 0.4), (1.5, 0.5, -0.4), width=24, height=16)
    # The icosphere's faces lie up to 0.03 % inside the sphere, and E grows by twice that; light
    # is lost at edges, where a ray that leaves one face below its smooth horizon is dropped.
    tessellation = 4e-3
    direct = direct_light(scene, camera, lights).mean
    expected = np.array([12.0, 10.0, 8.0]) / 4.0
    np.testing.assert_allclose(direct, np.broadcast_to(expected, direct.shape), rtol=tessellation)
    truth = one_bounce(scene, camera, lights, 128, visibility=visibility)
    reflected = expected * albedo
    closely(truth, reflected, other=tessellation * reflected.min())


def test_floor_beside_an_infinite_lit_wall_gets_half_of_what_it_reflects() -> None:
    wall: Quad = ((0, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR))
    sun = DirectionalLight((-1.0, 0.0, 0.0), 5.0)  # along the floor
    truth = one_bounce(quads(FLOOR, wall, albedos=[0.3, 0.6]), spot_of(0.5), [sun], 256)
    closely(truth, 0.5 * 5.0 * np.array([0.6, 0.3, 0.15]), other=2e-3)  # about 1 / FAR


def test_environment_counts_by_way_of_a_surface_only() -> None:
    camera, sky = looking_down(), [Environment(1.0)]
    assert (one_bounce(quads(FLOOR), camera, sky, 8).mean == 0.0).all()
    # From below, an infinite ceiling is as bright as the sky that a floor under it would see.
    wall: Quad = ((0, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR))
    endless: Quad = ((-1, 0, -FAR), (0, 0, 2 * FAR), (FAR, 0, 0))
    truth = one_bounce(quads(endless, wall, albedos=[0.0, 1.0]), spot_of(0.5), sky, 512)
    # The wall sees half of the sky, the floor half of the wall.
    closely(truth, math.pi * 0.25 * np.array([1.0, 0.5, 0.25]), other=5e-3)


def test_screen_between_hides_the_bounce_unless_visibility_is_off() -> None:
    wall: Quad = ((0, 0, -3), (0, 2, 0), (0, 0, 6))
    screen: Quad = ((0.3, 0, -3), (0, 1.9, 0), (0, 0, 6))
    # The sun comes over the screen: it lights all of the wall from 0.1 up, and not the screen's
    # side that faces away from it.
    sun = DirectionalLight((-1.0, -0.2, 0.0), 5.0)
    camera = spot_of(0.6, size=24)
    open_scene = quads(wall, FLOOR, albedos=[0.8, 0.0])
    hidden_scene = quads(wall, FLOOR, screen, albedos=[0.8, 0.0, 0.0])
    lights: list[Light] = [PointLight((0.15, 1.0, 0.0), 2.0)]
    # A light between wall and screen lights the same of the wall with the screen as without.
    free = one_bounce(open_scene, camera, lights, 256)
    hidden = one_bounce(hidden_scene, camera, lights, 256)
    through = one_bounce(hidden_scene, camera, lights, 256, visibility=False)
    closely(through, free.mean.mean(axis=(0, 1)), other=0.02 * float(free.mean.mean()))
    assert hidden.mean.mean() < 0.2 * through.mean.mean()
    # Shadows from light to wall stay: the sun reaches less of the wall past the screen.
    with_screen = one_bounce(hidden_scene, camera, [sun], 64, visibility=False).mean.mean()
    assert with_screen < 0.5 * one_bounce(open_scene, camera, [sun], 64).mean.mean()


def test_every_lit_surface_along_a_ray_counts_without_visibility() -> None:
    # Behind the first wall a second one, lit from between them: E = half of each one's light.
    walls: list[Quad] = [((x, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR)) for x in (0.0, -1.0)]
    sun = DirectionalLight((-1.0, 0.0, 0.0), 4.0)
    scene = quads(FLOOR, *walls, albedos=[0.0, 0.5, 0.5])
    lit_first = one_bounce(scene, spot_of(0.5), [sun], 256, visibility=False)
    closely(lit_first, 0.5 * 4.0 * np.array([0.5, 0.25, 0.125]), other=2e-3)
    # From the other side only the second wall's back is lit, which no floor point in front sees.
    other = DirectionalLight((1.0, 0.0, 0.0), 4.0)
    assert (one_bounce(scene, spot_of(0.5), [other], 16, visibility=False).mean == 0.0).all()


# ---- the whole chain: units, cameras, materials


def test_mitsubas_own_integrator_and_sensor_give_the_same_radiance() -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    camera = view.camera(160, 120)
    truth = direct_light(view.scene, camera, view.lights).mean
    variant = mitsuba_scene.best_variant()
    world = MitsubaScene.of(view.scene, view.lights, variant)
    with mitsuba_scene.within(variant) as mi:
        origin = view.scene.origin
        eye, target = (np.subtract(end, origin).tolist() for end in (view.eye, view.target))
        sensor = mi.load_dict({
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at(eye, target, list(view.up)),
            "fov": math.degrees(view.yfov), "fov_axis": "y",
            "film": {"type": "hdrfilm", "width": 160, "height": 120, "rfilter": {"type": "box"}},
        })  # fmt: skip
        image = mi.render(world.scene, sensor=sensor, integrator=mi.load_dict({"type": "direct"}), spp=64)
        rendered = np.array(image)[..., :3]
    seen = gbuffer(view.scene, camera)
    radiance = albedo_of(seen) / math.pi * truth
    # Mitsuba averages over pixels, and ours looks at their centres: edges differ.
    inner = metrics.regions(seen)["elsewhere"] & ~edges_of(radiance)
    assert inner.mean() > 0.3  # nearly half of the picture is border, nothing or edges
    assert (inner & (radiance.max(axis=-1) > 0.0)).mean() > 0.1
    difference = (rendered - radiance)[inner] / radiance[inner].mean()
    # Its samples lie at random within pixels, across which radiance changes by a few percent.
    assert np.abs(difference).mean() < 4e-3
    assert abs(difference.mean()) < 4e-4, "such differences cancel"


def albedo_of(seen: GBuffer) -> NDArray[np.float32]:
    albedo = seen.first("albedo")
    assert albedo is not None
    return albedo


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


def test_shading_of_the_cornell_box_is_within_a_percent_of_truth(
    runtime: Runtime, capsys: pytest.CaptureFixture[str]
) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    camera = view.camera(400, 300)
    seen = gbuffer(view.scene, camera, runtime=runtime)
    # Emission is light of its own, in `shade` only.
    dull = GBuffer(camera=camera, depth=seen.depth, normal=seen.normal, albedo=seen.albedo)
    maps = [rsm(view.scene, light, size=1024, runtime=runtime) for light in view.lights]  # type: ignore[arg-type]
    ours = shade(dull, view.lights, shadow_maps=maps, runtime=runtime)
    truth = direct_light(view.scene, camera, view.lights).mean
    expected = albedo_of(seen) / math.pi * truth
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


@pytest.mark.slow
def test_smooth_normals_light_the_hall_as_the_definition_says(runtime: Runtime) -> None:
    view = BUILTIN_SCENES["hall"]()
    camera = view.camera(160, 120)
    seen = gbuffer(view.scene, camera, runtime=runtime)
    sun = view.lights[0]
    truth = direct_light(view.scene, camera, [sun]).mean
    position, normal, _ = world_surface(seen)
    assert isinstance(sun, DirectionalLight)
    unshadowed = direct_reference(sun, position, normal)
    lit = (truth[..., 0] > 0.0) & metrics.regions(seen)["elsewhere"]
    assert lit.sum() > 500
    off = np.abs(truth - unshadowed)[lit] / unshadowed[lit].mean()
    # Edges of triangles that the rasteriser snaps to 1/256 of a pixel.
    assert np.percentile(off, 95) < 1e-3
    assert off.mean() < 2e-3


# ---- what must not matter


def test_far_from_the_origin_light_is_the_same() -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    far = np.array([1e6, -2e6, 3e5])
    spot = view.lights[0]
    assert isinstance(spot, SpotLight)
    moved = replace(view.scene, origin=view.scene.origin + far)
    spot_there = replace(spot, position=np.asarray(spot.position) + far)
    camera = view.camera(64, 48)
    camera_there = Camera.look_at(far + view.eye, far + view.target, yfov=view.yfov, width=64, height=48)
    here = direct_light(view.scene, camera, [spot]).mean
    there = direct_light(moved, camera_there, [spot_there]).mean
    # 1e6 m in float64 is known to 1e-10 m, the camera to as much: a few edges flip.
    same = np.isclose(here, there, rtol=1e-4, atol=1e-5).all(axis=-1)
    assert same.mean() > 0.995
    bounces = [
        one_bounce(s, c, [light], 32).mean.mean(axis=(0, 1))
        for s, c, light in ((view.scene, camera, spot), (moved, camera_there, spot_there))
    ]
    np.testing.assert_allclose(bounces[0], bounces[1], rtol=1e-3)  # the same random numbers


@pytest.mark.slow
def test_without_llvm_the_same_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    camera = view.camera(12, 9)
    lights = [*view.lights, Environment(np.linspace(0.1, 0.5, 24).reshape(2, 4, 3))]
    calls = [
        lambda: direct_light(view.scene, camera, lights, 8),
        lambda: one_bounce(view.scene, camera, lights, 8),
        lambda: one_bounce(view.scene, camera, lights, 8, visibility=False),
    ]
    monkeypatch.setattr(mitsuba_scene, "best_variant", lambda: "scalar_rgb")
    slow = [call() for call in calls]
    monkeypatch.undo()
    if mitsuba_scene.best_variant() == "scalar_rgb":
        pytest.skip("no libLLVM of version 17 or later: there is nothing to compare with")
    monkeypatch.setattr(store, "truth_folder", lambda: tmp_path)
    fast = [call() for call in calls]
    for one, two in zip(slow, fast, strict=True):
        # The same random numbers: they differ by roundings, and where these decide what is hit.
        assert one.key != two.key
        np.testing.assert_allclose(one.mean.mean(), two.mean.mean(), rtol=0.01)
        assert np.isclose(one.mean, two.mean, rtol=1e-3, atol=1e-4).mean() > 0.95


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_scale_of_the_scene_does_not_matter(scale: float) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    spot = view.lights[0]
    assert isinstance(spot, SpotLight)
    scaled = replace(view.scene, origin=scale * view.scene.origin, positions=np.float32(scale) * view.scene.positions)
    eye, target = scale * np.array(view.eye), scale * np.array(view.target)
    camera = Camera.look_at(eye, target, yfov=view.yfov, width=64, height=48)
    # Intensity grows with the squared distance, so that irradiance stays.
    light = SpotLight(
        scale * np.asarray(spot.position), spot.direction, spot.cone_angle, scale**2 * np.asarray(spot.intensity)
    )
    for estimate in (direct_light, one_bounce):
        own = estimate(view.scene, view.camera(64, 48), view.lights, 16).mean
        other = estimate(scaled, camera, [light], 16).mean
        # The same random numbers; what they hit at edges differs by roundings.
        assert np.isclose(own, other, rtol=1e-3, atol=1e-5).mean() > 0.98


def test_an_image_in_blocks_of_rows_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    camera = view.camera(40, 30)
    whole = direct_light(view.scene, camera, view.lights)
    monkeypatch.setattr(path_tracer, "PIXELS", 300)
    blocks = direct_light(view.scene, camera, view.lights, rebuild=True)
    np.testing.assert_array_equal(blocks.mean, whole.mean)
    assert whole.mean.any()


@pytest.mark.slow
def test_paths_in_parts_give_the_bits_of_all_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    lights = [*view.lights, Environment((0.2, 0.4, 0.3))]
    given: Any = (view.scene, view.camera(12, 9), lights, 24)
    makers = (one_bounce, partial(radiance, box_filter=True))
    together = [make(*given, rebuild=True) for make in makers]
    monkeypatch.setattr(path_tracer, "PATHS", 2 * 12 * 9)  # of 3 paths a pass: 2 and 1
    for make, expected in zip(makers, together, strict=True):
        found = make(*given, rebuild=True)
        np.testing.assert_array_equal(found.mean, expected.mean)
        np.testing.assert_array_equal(found.error, expected.error)


def test_a_camera_that_looks_past_the_scene_sees_no_light() -> None:
    camera = Camera.look_at((0, 50, 0), (0, 60, 0), (1, 0, 0), width=8, height=6)
    truth = direct_light(quads(FLOOR), camera, [Environment(1.0)], 4)
    assert (truth.mean == 0.0).all()
    assert (truth.error == 0.0).all()


def test_a_second_call_finds_what_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    camera, lights = looking_down(), [Environment(1.0)]
    first = direct_light(quads(FLOOR), camera, lights, 4)
    monkeypatch.setattr(mitsuba_scene.MitsubaScene, "of", None)
    second = direct_light(quads(FLOOR), camera, lights, 4)
    assert np.array_equal(first.mean, second.mean)
    assert first.key == second.key


def test_key_differs_with_everything_that_matters() -> None:
    scene, camera, lights = quads(FLOOR), looking_down(), [Environment(1.0)]
    keys = [
        direct_light(scene, camera, lights, 4).key,
        direct_light(scene, camera, lights, 64).key,
        direct_light(scene, camera, [Environment(2.0)], 4).key,
        direct_light(scene, looking_down("off-centre"), lights, 4).key,
        direct_light(quads(FLOOR, albedos=[0.3]), camera, lights, 4).key,
        one_bounce(scene, camera, lights, 4).key,
        one_bounce(scene, camera, lights, 4, visibility=False).key,
    ]
    assert len(set(keys)) == len(keys)


def test_error_is_unknown_after_a_single_path_and_known_after_two() -> None:
    wall: Quad = ((0, 0, -3), (0, 2, 0), (0, 0, 6))
    scene, camera = quads(FLOOR, wall), spot_of(0.5)
    single = direct_light(scene, camera, [Environment(1.0)], 1)
    assert np.isinf(single.error).all()
    pair = direct_light(scene, camera, [Environment(1.0)], 2)
    assert pair.passes == 2
    assert np.isfinite(pair.error).all()


@pytest.mark.parametrize(("paths", "passes"), [(5, 2), (16, 4), (64, 8), (256, 8), (1000, 16)])
def test_paths_are_split_into_passes_that_tell_the_error(
    monkeypatch: pytest.MonkeyPatch, paths: int, passes: int
) -> None:
    traced: list[int] = []
    image = DirectLight.image

    def counted(self: DirectLight, camera: Camera, paths: int, number: int) -> Any:
        traced.append(paths)
        return image(self, camera, paths, number)

    monkeypatch.setattr(DirectLight, "image", counted)
    scene, camera = quads(FLOOR), spot_of(0.5, size=2)
    assert direct_light(scene, camera, [Environment(1.0)], paths).passes == passes
    assert len(traced) == passes
    assert paths <= sum(traced) < paths + passes


# ---- bad input


def test_scene_without_lights_is_refused() -> None:
    for call in (direct_light, one_bounce):
        with pytest.raises(ValueError, match="lights is empty: expected at least one light"):
            call(quads(FLOOR), looking_down(), [])


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
    arguments = {
        "scene": quads(FLOOR), "camera": looking_down(), "lights": [Environment(1.0)], **change,
    }  # fmt: skip
    with pytest.raises(error, match=message):
        one_bounce(**arguments)


def test_missing_mitsuba_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba_scene.best_variant.cache_clear()
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'ssgi-cl\[truth\]'"):
        direct_light(quads(FLOOR), looking_down(), [Environment(1.0)])
