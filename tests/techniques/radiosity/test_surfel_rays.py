"""Rays from surfels: what they meet, direct light, emission and gaps, against float64 and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, PunctualLight, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.area_lights.area_lights import polygon_irradiance
from ssgi_cl.reference.multires.final_gather import final_gather_reference
from ssgi_cl.techniques.occupancy.scene_rays import LIFT
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, LightVolume
from ssgi_cl.techniques.radiosity.surface_cells import Pieces, SurfaceCells
from ssgi_cl.techniques.radiosity.surfel_hits import RAYS, SurfelHits
from ssgi_cl.techniques.radiosity.surfel_points import SurfelPoints
from ssgi_cl.techniques.radiosity.surfel_rays import SurfelRays
from ssgi_cl.techniques.radiosity.surfels import Surfels, scene_surfels
from ssgi_cl.techniques.sky_levels import SkyLevels

from .test_radiosity import box, meshed

Doubles = NDArray[np.float64]
SHIFT = np.array((30.0, 0.0, -20.0))
DARK, GLOW = Material(albedo=(0.5,) * 3), Material(albedo=(0.0,) * 3, emission=(2.0, 1.0, 0.5))


def quads(*parts: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]) -> Scene:
    """Parallelograms of a corner and two edges; the first is dark, the others glow."""
    corners, triangles = [], []
    for corner, one, other in np.array(parts, np.float64) + np.array([SHIFT, np.zeros(3), np.zeros(3)]):
        first = len(corners)
        corners += [corner, corner + one, corner + one + other, corner + other]
        triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return meshed(corners, triangles, (DARK, GLOW), [0, 0] + [1] * (len(triangles) - 2))


FLOOR = ((-2.0, 0.0, -2.0), (0.0, 0.0, 4.0), (4.0, 0.0, 0.0))
PLATE = ((-0.5, 1.0, -0.5), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))


def cells_of(runtime: Runtime, surfels: Surfels, scene: Scene) -> SurfaceCells:
    low, high = scene.bounds
    pieces = Pieces(surfels.part_position + surfels.origin, surfels.part_normal, surfels.part_area)
    return SurfaceCells(runtime, pieces, 0.5 * (low + high) - 0.5 * (high - low).max(), float((high - low).max()))


def hits_of(runtime: Runtime, scene: Scene, surfels: Surfels, length: float = 1.0) -> SurfelHits:
    return SurfelHits(SurfelPoints(runtime, scene, surfels), length)


def rays_of(runtime: Runtime, scene: Scene, count: int) -> tuple[Surfels, SurfelRays]:
    surfels = scene_surfels(scene, count)
    return surfels, SurfelRays(hits_of(runtime, scene, surfels), cells_of(runtime, surfels, scene))


def floor_parts(surfels: Surfels) -> tuple[NDArray[np.bool_], Doubles]:
    """Return which parts are on the floor's upper side, and where all are, without `SHIFT`."""
    place = surfels.part_position + surfels.origin - SHIFT
    return (np.abs(place[:, 1]) < 1e-3) & (surfels.part_normal[:, 1] > 0.5), place


def of_plate(places: Doubles) -> Doubles:
    """Return irradiance of places that face up by `PLATE`, of radiance 1."""
    corner, one, other = np.array(PLATE)
    corners = np.array([corner, corner + one, corner + one + other, corner + other])
    return np.array([abs(polygon_irradiance(corners, at, np.array((0.0, 1.0, 0.0)))) for at in places])


LIGHTS: dict[str, PunctualLight] = {
    "point": PointLight(SHIFT + np.array((0.3, 2.0, 0.1)), (3.0, 2.0, 1.0)),
    "spot": SpotLight(SHIFT + np.array((0.3, 2.0, 0.1)), (0.2, -1.0, 0.1), 0.5, (3.0, 2.0, 1.0)),
    "sun": DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0)),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_direct_light_is_that_of_closed_forms(variant_runtime: Runtime, name: str) -> None:
    scene, light = quads(FLOOR, PLATE), LIGHTS[name]
    surfels, rays = rays_of(variant_runtime, scene, 256)
    found = rays.direct([light, light])
    floor, place = floor_parts(surfels)
    if isinstance(light, DirectionalLight):
        way = np.broadcast_to(-np.asarray(light.direction), place.shape) / np.linalg.norm(light.direction)
        power: Doubles = np.ones(len(place))
        sent, aimed = np.asarray(light.irradiance), np.ones(len(place), np.bool_)
    else:
        towards = np.asarray(light.position) - SHIFT - place
        distance = np.linalg.norm(towards, axis=1)
        way, power, sent = towards / distance[:, None], distance**-2.0, np.asarray(light.intensity)
        aimed = np.ones(len(place), np.bool_)
        if isinstance(light, SpotLight):
            axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
            aimed = -way @ axis >= math.cos(light.cone_angle)
    expected = np.maximum(way[:, 1], 0.0) * power
    through = place + way / np.maximum(way[:, 1:2], 1e-9)  # where the ray passes the plate's height
    apart = np.abs(through[:, [0, 2]]).max(axis=1) - 0.5
    expected = np.where(aimed & (apart > 0.0), expected, 0.0)
    sure = floor & (np.abs(apart) > 0.01)
    if isinstance(light, SpotLight):
        sure &= np.abs(-way @ axis - math.cos(light.cone_angle)) > 0.01
    assert (expected[sure] > 0.0).any()
    assert (expected[sure] == 0.0).any()
    # Points 1e-3 of the diagonal above the floor at 30 units from the origin, in float32.
    np.testing.assert_allclose(found[sure], 2.0 * expected[sure, None] * sent, rtol=2e-3)


def test_light_of_some_extent_has_a_penumbra(runtime: Runtime) -> None:
    """Under the edge of a half-plane half of a sphere's disc is seen, far from it all or nothing."""
    scene = quads(FLOOR, ((-3.0, 1.0, -3.0), (0.0, 0.0, 6.0), (3.0, 0.0, 0.0)))
    radius = 0.2
    light = PointLight(SHIFT + np.array((0.0, 2.0, 0.0)), 1.0, radius=radius)
    surfels, rays = rays_of(runtime, scene, 16384)
    floor, place = floor_parts(surfels)
    towards = np.array((0.0, 2.0, 0.0)) - place
    whole = towards[:, 1] / np.linalg.norm(towards, axis=1) ** 3
    near = floor & (np.abs(place[:, 2]) < 1.0) & (np.abs(place[:, 0]) < 1.0)
    share = rays.direct([light])[:, 0] / whole
    # The edge is at x = 0, half-way to the light: its shadow is as wide as the disc, 2 radii.
    for middle in (-0.15, -0.1, 0.0, 0.1, 0.15):
        own = near & (np.abs(place[:, 0] - middle) < 0.02)
        # Of the disc's points those lie on the lit side whose x exceeds -middle, of a disc of that radius.
        h = np.clip(middle / radius, -1.0, 1.0)
        expected = 0.5 + (h * math.sqrt(1.0 - h * h) + math.asin(h)) / math.pi
        assert own.sum() > 60
        # Binomial: 3 standard deviations, of evenly spread places.
        assert share[own].mean() == pytest.approx(expected, abs=3.0 * 0.5 / math.sqrt(own.sum()))


def test_emission_is_that_of_polygons(variant_runtime: Runtime) -> None:
    scene = quads(FLOOR, PLATE)
    surfels, rays = rays_of(variant_runtime, scene, 2048)
    floor, place = floor_parts(surfels)
    factor = of_plate(place[floor])
    expected = np.outer(factor, (2.0, 1.0, 0.5))
    found = rays.emitted[floor]
    # 4 places and 16 rays a part: within 1 % of the mean together, and less noise than rays alone would have.
    np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), rtol=0.01)
    below = (np.abs(place[floor][:, [0, 2]]) < 0.4).all(axis=1)
    assert np.std(found[below, 0] / expected[below, 0]) < 0.3


def linear_sky(rows: int = 128) -> Environment:
    """Radiance 1 + .5 x + .3 y of direction (x, y, z), red; a half and a quarter of it."""
    polar = (np.arange(rows) + 0.5)[:, None] * (math.pi / rows)
    around = ((np.arange(2 * rows) + 0.5) / (2 * rows) - 0.5) * (2.0 * math.pi)
    radiance = 1.0 + 0.5 * np.sin(polar) * np.sin(around) + 0.3 * np.cos(polar)
    return Environment((radiance[..., None] * (1.0, 0.5, 0.25)).astype(np.float32))


def levels_of(runtime: Runtime, *environments: Environment) -> SkyLevels:
    sky = SkyLevels(runtime)
    sky.set(environments)
    return sky


def test_sky_is_that_of_closed_forms(variant_runtime: Runtime) -> None:
    # One slanted quad: each side sees half of the sphere. The integral of (d v) (d n) over it is 2 pi / 3 v n.
    scene = quads(((-1.0, 0.0, -1.0), (1.2, 1.6, 0.0), (0.0, 0.0, 2.0)))
    surfels, rays = rays_of(variant_runtime, scene, 1024)
    found = rays.sky(levels_of(variant_runtime, linear_sky()))
    for side in (1.0, -1.0):
        own = surfels.part_normal[:, 1] * side > 0.0
        normal = surfels.part_normal[own][0]
        expected = math.pi + 2.0 * math.pi / 3.0 * (0.5 * normal[0] + 0.3 * normal[1])
        # What is read is a mean over .2 sr, half a texel on each side: flatter by 1 - sin(.22) / .22, .8 %, each way.
        np.testing.assert_allclose(found[own].mean(axis=0), expected * np.array((1.0, 0.5, 0.25)), rtol=8e-3)
        np.testing.assert_allclose(found[own, 0], expected, rtol=0.08)  # of 16 rays, jittered in their strata


def test_sky_is_what_nothing_hides(variant_runtime: Runtime) -> None:
    scene = quads(FLOOR, PLATE)
    surfels, rays = rays_of(variant_runtime, scene, 2048)
    floor, place = floor_parts(surfels)
    hidden = of_plate(place[floor])
    both = levels_of(variant_runtime, Environment((2.0, 2.0, 1.0)), Environment((0.0, 0.0, 1.0)))
    found = rays.sky(both)[floor]
    np.testing.assert_allclose(found, np.repeat(found[:, :1], 3, axis=1), rtol=1e-6)
    assert found[:, 0].mean() == pytest.approx(2.0 * (math.pi - hidden.mean()), rel=2e-3)
    # An edge through the disk crosses about 8 of 16 strata, of which each errs by at most half a ray.
    assert np.std(found[:, 0] / 2.0 + hidden) < math.pi * 0.5 * math.sqrt(8.0) / 16.0


def test_without_sky_none_arrives(runtime: Runtime) -> None:
    _, rays = rays_of(runtime, quads(FLOOR, PLATE), 64)
    assert not rays.sky(levels_of(runtime)).any()
    assert not rays.sky(levels_of(runtime, Environment((0.0, 0.0, 0.0)))).any()


def test_emission_of_surfaces_that_nearly_touch_is_whole(runtime: Runtime) -> None:
    """A plate .01 above the floor: places alone would err by the size of their part."""
    plate = ((-0.5, 0.01, -0.5), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    surfels, rays = rays_of(runtime, quads(FLOOR, plate), 2048)
    floor, place = floor_parts(surfels)
    below = floor & (np.abs(place[:, [0, 2]]) < 0.4).all(axis=1)
    np.testing.assert_allclose(rays.emitted[below].mean(axis=0), math.pi * np.array((2.0, 1.0, 0.5)), rtol=0.01)
    assert rays.emitted[below, 0].max() < 1.5 * math.pi * 2.0


def test_bounces_are_those_of_float64(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    pieces = rng.uniform(-0.7, 0.7, (12, 1, 3)) + rng.uniform(-0.3, 0.3, (12, 3, 3))
    scene = meshed((pieces + SHIFT).reshape(-1, 3), np.arange(36).reshape(-1, 3), (DARK,))
    surfels = scene_surfels(scene, 16)
    cells = cells_of(variant_runtime, surfels, scene)
    rays = SurfelRays(hits_of(variant_runtime, scene, surfels), cells)
    areas = cells.light(np.zeros((len(surfels.part_area), 3)))
    light = LightVolume(areas.cells, areas.records.copy(), areas.low, areas.extent)
    light.records[..., :3] = rng.uniform(0.0, 1.0, (*light.records.shape[:2], 3))
    found = rays.bounce(light)
    lift = LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    start = surfels.part_position + surfels.origin + lift * surfels.part_normal
    tile = np.arange(len(start)) % (TILE * TILE)
    ways = np.moveaxis(hemisphere_ways(RAYS).astype(np.float64), 2, 0)[tile]
    sides = light.records[light.cells].astype(np.float64)
    assert sides.shape == (CELLS, CELLS, CELLS, FACES, 4)
    expected, near = final_gather_reference(
        start,
        surfels.part_normal,
        ways,
        np.asarray(scene.positions, np.float64)[scene.triangles] + scene.origin,
        sides,
        light.low,
        light.side,
    )
    assert near.mean() < 0.5
    assert expected[~near].std() > 0.05
    off = np.abs(found - expected).max(axis=1)[~near]
    # Where rays end near a wall between cells, float32 may say another one.
    assert np.quantile(off, 0.9) < 1e-4


def test_parts_in_a_narrow_gap_are_hardly_open(runtime: Runtime) -> None:
    gap = 0.05
    scene = quads(FLOOR, ((-0.5, gap, -0.5), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    surfels = scene_surfels(scene, 2048)
    floor, place = floor_parts(surfels)
    for length in (1.5 * gap, 3.0 * gap):
        found = hits_of(runtime, scene, surfels, length).far
        inside = floor & (np.abs(place[:, [0, 2]]).max(axis=1) < 0.5 - length)
        # The cosine of rays between parallel surfaces that go farther is below gap / length.
        assert found[inside].mean() == pytest.approx((gap / length) ** 2, abs=0.02)
        outside = floor & (np.abs(place[:, [0, 2]]).max(axis=1) > 0.5 + length)
        assert (found[outside] == 1.0).all()


def test_at_the_foot_of_a_wall_half_of_the_hemisphere_is_open(runtime: Runtime) -> None:
    surfels = scene_surfels(box(0.5), 512)
    found = hits_of(runtime, box(0.5), surfels, 0.2).far
    place = np.sort(1.0 - np.abs(surfels.part_position + surfels.origin), axis=1)
    inside = np.sum(surfels.part_normal * (surfels.part_position + surfels.origin), axis=1) < 0.0
    assert (found[inside & (place[:, 1] > 0.21)] == 1.0).all()
    foot = inside & (place[:, 1] < 0.01) & (place[:, 2] > 0.21)
    assert foot.sum() > 20
    assert found[foot].mean() == pytest.approx(0.5, abs=0.04)


def test_the_inside_of_a_box_is_seen_and_its_outside_is_not(runtime: Runtime) -> None:
    surfels = scene_surfels(box(0.5), 512)
    found = hits_of(runtime, box(0.5), surfels).seen
    inside = np.sum(surfels.part_normal * (surfels.part_position + surfels.origin), axis=1) < 0.0
    assert 0.4 < inside.mean() < 0.6
    np.testing.assert_array_equal(found, inside)


def test_a_part_is_seen_if_any_of_its_rays_meets_a_surface(runtime: Runtime) -> None:
    """Floor below a plate above its middle: next to no part has only rays that meet it."""
    scene = quads(FLOOR, ((-0.5, 0.5, -0.5), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    surfels = scene_surfels(scene, 512)
    hits = hits_of(runtime, scene, surfels, 100.0)
    floor, place = floor_parts(surfels)
    below = floor & (np.abs(place[:, [0, 2]]).max(axis=1) < 0.6)
    assert (hits.far[below] > 0.0).all()
    assert hits.seen[below].all()
    # From the plate's upper side, and from below the floor, nothing is seen.
    assert not hits.seen[(surfels.part_normal[:, 1] > 0.5) & ~floor].any()
    assert not hits.seen[(surfels.part_normal[:, 1] < -0.5) & (np.abs(place[:, 1]) < 1e-3)].any()


def test_colours_of_vertices_dim_what_surfels_reflect() -> None:
    scene = box(0.5)
    colors = np.random.default_rng(1).uniform(0.2, 0.9, scene.colors.shape).astype(np.float32)
    surfels = scene_surfels(replace(scene, colors=colors), 64)
    wanted = np.einsum("nk,nkc->nc", surfels.part_weights, colors[scene.triangles[surfels.part_triangle]])
    np.testing.assert_allclose(surfels.part_albedo, 0.5 * wanted, rtol=1e-6)
    np.testing.assert_allclose(scene_surfels(scene, 64).part_albedo, 0.5)
