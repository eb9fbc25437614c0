"""Radiosity: surfels, furnaces, bounces, against float64 and closed forms, bad input."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer, rsm
from ssgi_cl.rasterize.raster.device_scene import cutouts_of
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.reference.radiosity.radiosity import form_factors, radiosity_reference
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.radiosity import radiosity as radiosity_module
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams, radiosity
from ssgi_cl.techniques.radiosity.sky_directions import sky_directions
from ssgi_cl.techniques.radiosity.start_triangles import SPREAD, StartTriangles
from ssgi_cl.techniques.radiosity.surfel_history import SurfelHistory
from ssgi_cl.techniques.radiosity.surfels import WIDEST, TriangleShares, scene_surfels
from ssgi_cl.techniques.radiosity.surfels_on_device import DeviceSurfels
from ssgi_cl.techniques.vpl.vpl_choice import on_device_rsms

QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def meshed(corners: Any, triangles: Any, materials: Any, ids: Any = None) -> Scene:
    corners, triangles = np.asarray(corners, np.float32), np.asarray(triangles, np.int32)
    count = len(corners)
    return Scene(
        positions=corners, normals=np.zeros((count, 3), np.float32),
        uvs=np.zeros((count, 2), np.float32), colors=np.ones((count, 3), np.float32),
        triangles=triangles,
        material_ids=np.zeros(len(triangles), np.int32) if ids is None else np.asarray(ids),
        materials=tuple(materials),
    )  # fmt: skip


def box(albedo: float, emission: float = 0.0, *, turned: bool = False) -> Scene:
    """A closed cube from -1 to 1."""
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    triangles = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])
    made = Material(albedo=(albedo,) * 3, emission=(emission,) * 3)
    return meshed(corners, triangles[:, ::-1] if turned else triangles, (made,))


def l_room(albedo: float, emission: float) -> Scene:
    """A closed room whose floor is an L, so that not all of it sees all of it."""
    plan = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    corners = [[x, y, z] for y in (0.0, 1.2) for x, z in plan]
    pieces = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    triangles = [list(p) for p in pieces] + [[k + 6 for k in p] for p in pieces]
    for k in range(6):
        n = (k + 1) % 6
        triangles += [[k, n, n + 6], [k, n + 6, k + 6]]
    made = Material(albedo=(albedo,) * 3, emission=(emission,) * 3)
    return meshed(corners, triangles, (made,))


def tiled(side: int, y: float, size: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A square of 2 side^2 triangles."""
    line = np.linspace(-size / 2, size / 2, side + 1)
    x, z = np.meshgrid(line, line)
    corners = np.stack([x.ravel(), np.full(x.size, y), z.ravel()], axis=1)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    a, b, c, d = first, first + 1, first + side + 1, first + side + 2
    return corners, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])


def two_squares(albedo: float, emission: float, side: int = 1, distance: float = 1.0) -> Scene:
    """A square of side 1 that emits below a dark one that reflects."""
    low, below = tiled(side, 0.0, 1.0)
    high, above = tiled(side, distance, 1.0)
    materials = (Material(albedo=(0.0,) * 3, emission=(emission,) * 3), Material(albedo=(albedo,) * 3))
    return meshed(
        np.concatenate([low, high]), np.concatenate([below, above + len(low)]), materials, np.repeat([0, 1], len(below))
    )


def solved(runtime: Runtime, scene: Scene, lights: Any = (), **params: Any) -> Radiosity:
    made = Radiosity(runtime, RadiosityParams(**{"surfels": 512, "vpls": 256, **params}))
    made.run(scene, lights, rsms=maps(runtime, scene, lights))
    return made


def maps(runtime: Runtime, scene: Scene, lights: Any) -> list[DeviceRsm]:
    punctual_lights = [light for light in lights if not isinstance(light, Environment)]
    seen = [rsm(scene, light, size=128, runtime=runtime) for light in punctual_lights]
    return on_device_rsms(seen, runtime) if seen else []


def mean(made: Radiosity, values: NDArray[np.float64]) -> float:
    area = made.surfels.area
    return float(area @ values.mean(axis=1) / area.sum())


def test_surfels_have_the_area_of_both_sides() -> None:
    made = scene_surfels(l_room(0.5, 1.0), 1000)
    floor = 5.0
    assert made.area.sum() == pytest.approx(2 * (2 * floor + 12.0 * 1.2), rel=1e-6)
    assert made.part_area.reshape(-1, PARTS).sum(axis=1) == pytest.approx(made.area)
    assert 1000 <= len(made) <= 1100  # those that are wide are cut
    np.testing.assert_allclose(np.linalg.norm(made.normal, axis=1), 1.0, atol=1e-12)


def test_a_quarter_of_the_surfels_are_where_surfaces_emit() -> None:
    # Two squares of area 1 and 0.01 in one plane, as a light in a ceiling.
    squares = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float64)
    corners = np.concatenate([squares, 0.1 * squares + (2.0, 0.0, 0.0)])
    triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    for emission in (1e-3, 1e9):
        made = scene_surfels(meshed(
            corners, triangles, (Material(), Material(emission=(emission,) * 3)), [0, 0, 1, 1]
        ), 1024)  # fmt: skip
        shines = made.emission[:, 0] > 0.0
        # A quarter by flux, and 1 % of the others by area; parts, since those that are wide are cut.
        parts = (made.part_area.reshape(-1, PARTS)[shines] > 0.0).sum() / PARTS
        assert parts == pytest.approx((0.25 + 0.75 * 0.01 / 1.01) * 1024, abs=5)
        # No surfel is of both, and none of the areas is lost.
        assert made.emission[shines] == pytest.approx(emission)
        assert (made.position[shines, 0] >= 2.0).all()
        assert made.area[shines].sum() == pytest.approx(2 * 0.01, rel=1e-6)
        assert made.area.sum() == pytest.approx(2 * 1.01, rel=1e-6)


def test_surfels_are_compact() -> None:
    made = scene_surfels(box(0.5), 2048)
    away = made.part_position.reshape(-1, PARTS, 3) - made.position[:, None]
    wide = np.sqrt(np.sum(away**2, axis=-1).max(axis=1) / made.area)
    # A square measures .71 from its middle to a corner; pieces of a curve are longer.
    assert np.median(wide) < 1.1


def test_no_surfel_is_wide() -> None:
    # In a room with a bend the curve leaves a wall and comes back to another one that faces alike.
    made = scene_surfels(l_room(0.5, 1.0), 200)
    there = (made.part_area > 0.0).reshape(-1, PARTS, 1)
    place = made.part_position.reshape(-1, PARTS, 3)
    low, high = (f(np.where(there, place, s * np.inf), axis=1) for f, s in ((np.min, 1.0), (np.max, -1.0)))
    wide = np.linalg.norm(high - low, axis=1)
    assert (wide <= WIDEST * np.sqrt(made.area) * (1.0 + 1e-9)).all()
    # Those that are cut are few, and no part of their area is lost.
    assert 200 < len(made) < 250
    assert made.area.sum() == pytest.approx(2 * (2 * 5.0 + 12.0 * 1.2), rel=1e-6)
    assert made.part_area.reshape(-1, PARTS).sum(axis=1) == pytest.approx(made.area)


def test_surfels_take_texture_and_holes() -> None:
    texels = np.full((2, 2, 4), 255, np.uint8)
    texels[:, 0] = (255, 0, 0, 0)  # the left half is a hole
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    plain = meshed(corners, [[0, 1, 2], [0, 2, 3]], (Material(albedo=(0.5,) * 3, texture=-1),))
    cut = replace(
        plain,
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
        textures=(texels,),
        materials=(Material(albedo=(0.5,) * 3, texture=0, alpha_cutoff=0.5),),
    )
    made = scene_surfels(cut, 512)
    assert made.area.sum() == pytest.approx(1.0, rel=0.02)  # of 2 on both sides
    assert (made.part_position[:, 0] >= 0.5).all()
    assert made.albedo == pytest.approx(0.5)


def test_surfels_take_textures_of_colour_and_emission_for_srgb() -> None:
    grey, glow = np.full((2, 2, 4), 255, np.uint8), np.full((2, 2, 4), 255, np.uint8)
    grey[..., :3], glow[..., :3] = 128, 64
    made = Material(albedo=(0.5,) * 3, texture=0, emission=(2.0,) * 3, emission_texture=1)
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    plain = meshed(corners, [[0, 1, 2], [0, 2, 3]], (Material(),))
    scene = replace(plain, textures=(grey, glow), materials=(made,))
    surfels = scene_surfels(scene, 64)
    # IEC 61966-2-1: ((b / 255 + .055) / 1.055)^2.4.
    assert surfels.part_albedo == pytest.approx(0.5 * 0.21586, rel=1e-4)
    assert surfels.albedo == pytest.approx(0.5 * 0.21586, rel=1e-4)
    assert surfels.emission == pytest.approx(2.0 * 0.05127, rel=1e-3)


def in_l_room(point: NDArray[np.float64]) -> NDArray[np.bool_]:
    x, y, z = point.T
    return (np.minimum(x, z) < 1.0) & (point > 0.0).all(axis=1) & (y < 1.2)


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_a_furnace_gives_the_geometric_series(runtime: Runtime, albedo: float) -> None:
    made = solved(runtime, box(albedo, 1.0))
    sent = math.pi + albedo * made.irradiance
    assert mean(made, sent) == pytest.approx(math.pi / (1.0 - albedo), rel=0.01)


@pytest.mark.parametrize("gloss", [1.0, 6.0, 30.0])
def test_a_furnace_of_metal_loses_what_lobes_have_below_surfaces(runtime: Runtime, gloss: float) -> None:
    """In red, where nothing is absorbed, that alone ends the series."""
    room = box(0.0, 1.0)
    metal = Material(albedo=(0.0,) * 3, emission=(1.0,) * 3, specular=(1.0, 0.77, 0.34), gloss=gloss)
    made = solved(runtime, replace(room, materials=(metal,)))
    # (n + 1) cos^n a sin a (1 + cos a) / 2, integrated over a from 0 to 90 degrees.
    share = 0.5 * (1.0 + (gloss + 1.0) / (gloss + 2.0))
    albedo = share * np.array([1.0, 0.77, 0.34])
    sent = made.surfels.area @ (math.pi + albedo * made.irradiance) / made.surfels.area.sum()
    # Series end where .2 % of the flux is left.
    np.testing.assert_allclose(sent, math.pi / (1.0 - albedo), rtol=0.02)


@pytest.mark.parametrize("albedo", [0.9, 1.0])
def test_light_leaves_a_long_corridor_of_white_walls(runtime: Runtime, albedo: float) -> None:
    """After five bounces none has come to its open end, and nothing seems to be absorbed."""
    corners = [[x, y, z] for z in (0.0, 9.0) for y in (0, 1) for x in (0, 1)]
    walls = [(0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = np.array([t for a, b, c, d in [(0, 2, 3, 1), *walls] for t in ((a, b, c), (a, c, d))])
    materials = (Material(albedo=(albedo,) * 3, emission=(1.0,) * 3), Material(albedo=(albedo,) * 3))
    corridor = meshed(corners, triangles, materials, [0, 0, *[1] * 8])
    made, one_by_one = solved(runtime, corridor), solved(runtime, corridor, bounces=1500)
    assert 20 < made.bounces <= one_by_one.bounces < 1500
    flux = [each.surfels.area @ each.irradiance[:, 0] for each in (made, one_by_one)]
    assert flux[0] == pytest.approx(flux[1], rel=0.004)  # in each .002 may be left


def test_few_bounces_tell_all_of_those_to_come(runtime: Runtime) -> None:
    """Channels would end after 2 to 120 bounces; those that end first must not keep the others from ending."""
    albedo = np.array([0.95, 0.7, 0.01])
    room = Material(albedo=tuple(albedo.tolist()), emission=(1.0,) * 3)
    made = solved(runtime, replace(l_room(0.0, 1.0), materials=(room,)))
    inside = in_l_room(made.surfels.position + 0.02 * made.surfels.normal)  # the notch is lit outside, too
    area = made.surfels.area[inside]
    sent = area @ (math.pi + albedo * made.irradiance[inside]) / area.sum()
    np.testing.assert_allclose(sent, math.pi / (1.0 - albedo), rtol=0.003)  # .002 of the flux may be left
    assert made.bounces < 40  # .95^n is below .002 from 121 on


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_a_furnace_with_a_bend(runtime: Runtime, albedo: float) -> None:
    made = solved(runtime, l_room(albedo, 1.0))
    surfels = made.surfels
    inside = in_l_room(surfels.position + 0.02 * surfels.normal)  # the notch is lit outside, too
    sent = math.pi + albedo * made.irradiance[inside, 0]
    area = surfels.area[inside]
    assert area.sum() == pytest.approx(24.4, rel=0.03)
    assert area @ sent / area.sum() == pytest.approx(math.pi / (1.0 - albedo), rel=0.02)


def test_a_furnace_at_pixels(runtime: Runtime) -> None:
    scene, albedo = box(0.8, 1.0), 0.8
    camera = Camera.look_at((0.9, -0.2, 0.8), (-1, -0.4, -1), width=96, height=72)
    made = Radiosity(runtime, RadiosityParams(surfels=2048))
    lights = made.run(scene, ()).lights
    splat = MultiresSplat(runtime, camera.size, MultiresSplatParams(vpls=16, visibility=True, grid=128), surfels=4096)
    seen = on_device(gbuffer(scene, camera, runtime=runtime), runtime)
    plane = splat.run(seen, scene=device_scene(scene, runtime), surfels=lights)
    image = plane.download()
    assert image.mean() == pytest.approx(math.pi / (1.0 - albedo), rel=0.02)


def test_inside_out_is_the_same(runtime: Runtime) -> None:
    one, other = solved(runtime, box(0.5, 1.0)), solved(runtime, box(0.5, 1.0, turned=True))
    assert mean(one, one.irradiance) == pytest.approx(mean(other, other.irradiance), rel=5e-3)


def test_two_squares_have_their_form_factor(runtime: Runtime) -> None:
    # Two unit squares at distance 1: F = 0.19982 (Howell, A Catalog of Radiation Heat Transfer
    # Configuration Factors, C-11).
    made = solved(runtime, two_squares(0.5, 2.0), surfels=2048)
    surfels = made.surfels
    upper = (surfels.position[:, 1] > 0.5) & (surfels.normal[:, 1] < 0.0)
    area = surfels.area[upper]
    received = area @ made.irradiance[upper, 0] / area.sum()
    # They are raised to the part of the hemisphere that is not open, by 128 directions.
    assert received == pytest.approx(0.19982 * 2.0 * math.pi, rel=0.04)


def test_bounces_add_up(runtime: Runtime) -> None:
    scene, albedo = box(0.5, 1.0), 0.5
    for bounces in (1, 2, 3):
        made = solved(runtime, scene, bounces=bounces)
        expected = math.pi * sum(albedo**n for n in range(bounces))
        assert mean(made, made.irradiance) == pytest.approx(expected, rel=0.01)
        assert made.bounces == bounces


@pytest.fixture
def by_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Form factors of pairs, as in scenes with holes."""
    monkeypatch.setattr(radiosity_module, "rays_meet_triangles", lambda scene: False)


@pytest.mark.usefixtures("by_pairs")
def test_kernel_against_float64(variant_runtime: Runtime) -> None:
    made = solved(
        variant_runtime, two_squares(0.7, 2.0, side=3), (Environment((1.0, 0.5, 0.2)),), surfels=128, bounces=3
    )
    device, surfels = made._device, made.surfels
    words = device._visible.download().view(np.uint32).reshape(-1, device._stride)
    number = np.arange(len(surfels))
    bits = (words[number // 32].T >> (number % 32).astype(np.uint32)) & 1
    visible = bits[: len(surfels)].astype(bool)
    assert visible.any()
    sky = device._seen.download().reshape(4, -1)[:, : len(surfels)].astype(np.float64)
    factors = form_factors(surfels.position, surfels.normal, surfels.area, visible)
    scale = float(made.irradiance.max())
    exitance = math.pi * surfels.emission
    unit = max(math.pi * 2.0, 1.0)  # the brightest source, in which the kernel counts
    expected = radiosity_reference(
        factors, sky[3], surfels.albedo, exitance, sky[:3].T * unit, np.zeros_like(surfels.albedo), 3
    )
    # Sums of a few hundred float32 terms.
    np.testing.assert_allclose(made.irradiance, expected, atol=2e-5 * scale)


def test_variants_are_bit_identical(runtime: Runtime, other_variant: Runtime) -> None:
    scene = two_squares(0.7, 2.0, side=3)
    lights = (Environment((1.0, 0.5, 0.2)), SpotLight((0, 0.9, 0.1), (0, -1, 0), 1.0, 3.0))
    one, other = (solved(variant, scene, lights, surfels=128) for variant in (runtime, other_variant))
    np.testing.assert_array_equal(one.irradiance, other.irradiance)


def test_bit_identical_results_twice_and_kept(runtime: Runtime) -> None:
    scene = box(0.6)
    lights = (SpotLight((0, 0.9, 0.1), (0, -1, 0), 1.0, 3.0),)
    one, other = solved(runtime, scene, lights), solved(runtime, scene, lights)
    np.testing.assert_array_equal(one.irradiance, other.irradiance)
    seen = maps(runtime, scene, lights)
    first = one.run(scene, lights, rsms=seen)
    assert one.run(scene, lights, rsms=seen) is first
    sky = (*lights, Environment(1.0))
    assert one.run(scene, sky, rsms=seen) is not first  # a light has come
    assert one.run(box(0.6), sky, rsms=seen) is not first  # another scene


def test_a_spot_in_a_closed_box_lights_by_its_flux(runtime: Runtime) -> None:
    """Each reflection leaves the albedo's share of the flux."""
    albedo, light = 0.5, SpotLight((0, 0.0, 0.0), (0, -1, 0), 0.6, 3.0)
    made = solved(runtime, box(albedo), (light,), surfels=1024, vpls=1024)
    flux = 3.0 * 2.0 * math.pi * (1.0 - math.cos(0.6))
    received = float(made.surfels.area @ made.irradiance.mean(axis=1))
    # Irradiance of surfels is by light that was reflected once and more.
    assert received == pytest.approx(flux * albedo / (1.0 - albedo), rel=0.04)


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_light_of_maps_has_been_reflected_once_when_it_arrives(runtime: Runtime, bounces: int) -> None:
    """The first of N bounces is what pixels take of the maps: surfels get the second one's light and on."""
    albedo, light = 0.5, SpotLight((0, 0.0, 0.0), (0, -1, 0), 0.6, 3.0)
    made = solved(runtime, box(albedo), (light,), surfels=1024, vpls=1024, bounces=bounces)
    flux = 3.0 * 2.0 * math.pi * (1.0 - math.cos(0.6))
    received = float(made.surfels.area @ made.irradiance.mean(axis=1))
    expected = flux * sum(albedo**n for n in range(1, bounces))
    assert received == pytest.approx(expected, rel=0.04)
    assert made.vpls is not None
    assert made.vpls.flux.any() == (bounces > 1)


@pytest.mark.usefixtures("by_pairs")
def test_surfaces_in_a_narrow_gap_see_out_of_its_slit_alone(runtime: Runtime) -> None:
    """Behind a plate that lies .016 above the floor, one cell of the grid."""
    closed = box(0.5, 1.0)
    plate, triangles = tiled(4, -0.984, 1.0)
    scene = meshed(
        np.concatenate([closed.positions, plate]), np.concatenate([closed.triangles, triangles + 8]), closed.materials
    )
    made = solved(runtime, scene, surfels=2048)
    surfels = made.surfels
    beneath = (np.abs(surfels.position[:, [0, 2]]) < 0.45).all(axis=1) & (surfels.position[:, 1] < -0.98)
    on_top = beneath & (surfels.position[:, 1] > -0.99) & (surfels.normal[:, 1] > 0.0)
    assert on_top.any()
    within = beneath & ~on_top
    assert within.any()
    words = made._device._visible.download().reshape(-1, made._device._stride).view(np.uint32)
    sees = (words[np.arange(len(surfels)) // 32] >> (np.arange(len(surfels), dtype=np.uint32) % 32)[:, None] & 1) > 0
    sees = sees[:, : len(surfels)]
    assert (sees == sees.T).all()
    # From .05 or more behind the plate's edge, the slit shows the walls up to .016 / .05 of 1.45 above the floor.
    above = surfels.position[:, 1] > -0.5
    assert not sees[np.ix_(within, above)].any()
    assert sees[np.ix_(on_top, above)].mean() > 0.5


def two_rooms(emission: float = 0.0, door: float = 0.0, right: float = 2.0) -> Scene:
    """Two closed rooms side by side, x below and above 0 up to `right`, and a door of some width in the wall.

    In the left one a plate may emit.
    """
    corners, triangles, ids = [], [], []

    def quad(*points: Any, material: int = 0) -> None:
        first = len(corners)
        corners.extend(points)
        triangles.extend([(first, first + 1, first + 2), (first, first + 2, first + 3)])
        ids.extend([material] * 2)

    for low, high in ((-2.0, 0.0), (0.0, right)):
        for y in (-1.0, 1.0):
            quad((low, y, -1), (high, y, -1), (high, y, 1), (low, y, 1))
            quad((low, -1, y), (high, -1, y), (high, 1, y), (low, 1, y))
    for x in (-2.0, right):
        quad((x, -1, -1), (x, 1, -1), (x, 1, 1), (x, -1, 1))
    half = door / 2
    quad((0, -1, -1), (0, 1, -1), (0, 1, -half), (0, -1, -half))
    quad((0, -1, half), (0, 1, half), (0, 1, 1), (0, -1, 1))
    quad((-1.2, 0.5, -0.2), (-0.8, 0.5, -0.2), (-0.8, 0.5, 0.2), (-1.2, 0.5, 0.2), material=1)
    shine = Material(albedo=(0.5,) * 3, emission=(emission,) * 3)
    return meshed(corners, triangles, (Material(albedo=(0.5,) * 3), shine), ids)


LEFT = SpotLight((-1.0, -0.2, 0.0), (0, -1, 0), 1.0, 3.0)


@pytest.mark.parametrize(("scene", "lights"), [(two_rooms(), (LEFT,)), (two_rooms(4.0), ())], ids=["spot", "emission"])
def test_only_rooms_that_light_enters_have_surfels(runtime: Runtime, scene: Scene, lights: tuple[Any, ...]) -> None:
    made = solved(runtime, scene, lights, surfels=1024)
    assert (made.surfels.position[:, 0] + scene.origin[0] < 0.02).all()
    # Twice as many as were asked for, not the half that lies on this side.
    assert len(made.surfels) == pytest.approx(2048, rel=0.1)
    inside = 4 * 4.0 + 2 * 4.0 + 2 * 0.16
    assert made.surfels.area.sum() == pytest.approx(inside, rel=0.05)


def test_light_through_a_door_gives_both_rooms_surfels(runtime: Runtime) -> None:
    scene = two_rooms(door=0.5)
    right = solved(runtime, scene, (LEFT,)).surfels.position[:, 0] + scene.origin[0] > 0.02
    assert 0.4 < right.mean() < 0.6


@pytest.mark.parametrize("right", [2.0, 2.03, 2.0625, 2.09])
def test_no_light_passes_a_wall_within_a_cell(runtime: Runtime, right: float) -> None:
    """A dim room beside one that is 280 times as bright and shut off: what it receives does not depend on that.

    Cells of the light volume that the wall cuts have floor of both rooms in them; undivided, they let through .6 to .8
    of the dim room's light.
    """
    spot = SpotLight((1.0, -0.2, 0.0), (0, -1, 0), 1.0, 0.01)
    found = []
    for emission in (4.0, 4e-6):  # so that both rooms have surfels
        scene = two_rooms(emission, right=right)
        # Series that end where .2 % of all light is left end earlier beside a bright room.
        made = solved(runtime, scene, (spot,), surfels=2048, bounces=40)
        surfels = made.surfels
        across = (surfels.part_position + scene.origin + 0.01 * surfels.part_normal)[:, 0].reshape(-1, PARTS)
        light = surfels.area * made.irradiance[:, 0]
        # Some have parts in both rooms, and so have the mean of their light.
        found.append((light[(across > 0.0).all(axis=1)].sum(), light[(across < 0.0).all(axis=1)].sum()))
    assert found[0][1] > 200.0 * found[0][0]
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-6)


def test_a_light_that_moves_to_another_room_takes_the_surfels_along(runtime: Runtime) -> None:
    scene = two_rooms()
    made = solved(runtime, scene, (LEFT,))
    moved = replace(LEFT, position=(1.0, -0.2, 0.0))
    made.run(scene, (moved,), rsms=maps(runtime, scene, (moved,)))
    anew = solved(runtime, scene, (moved,))
    np.testing.assert_array_equal(made.surfels.position, anew.surfels.position)
    np.testing.assert_array_equal(made.irradiance, anew.irradiance)
    assert (made.surfels.position[:, 0] + scene.origin[0] > -0.02).all()


def test_the_sky_enters_no_closed_room(runtime: Runtime) -> None:
    made = solved(runtime, two_rooms(), (LEFT, Environment(1.0)), surfels=1024)
    assert (made.surfels.position[:, 0] + two_rooms().origin[0] < 0.02).all()


def test_what_stands_outside_has_surfels_under_a_sky_alone(runtime: Runtime) -> None:
    closed, squares = box(0.5), two_squares(0.5, 0.0)
    corners = np.concatenate([closed.positions, squares.positions + np.float32([4, 0, 0])])
    scene = meshed(corners, np.concatenate([closed.triangles, squares.triangles + 8]), closed.materials)
    spot = SpotLight((0, 0.9, 0.1), (0, -1, 0), 1.0, 3.0)
    outside = [
        (solved(runtime, scene, lights).surfels.position[:, 0] + scene.origin[0] > 1.1).mean()
        for lights in ((spot,), (spot, Environment(1.0)))
    ]
    assert outside[0] == 0.0
    assert outside[1] > 0.05


def test_the_sky_reaches_what_nothing_covers(runtime: Runtime) -> None:
    made = solved(runtime, two_squares(0.5, 0.0), (Environment(2.0),), surfels=1024, bounces=1)
    surfels = made.surfels
    lower = (surfels.position[:, 1] < 0.5) & (surfels.normal[:, 1] > 0.0)
    area = surfels.area[lower]
    received = area @ made.irradiance[lower, 0] / area.sum()
    assert received == pytest.approx((1.0 - 0.19982) * 2.0 * math.pi, rel=0.02)


def test_sky_directions_hold_all_of_the_sky() -> None:
    rows, columns = 16, 32
    image = np.full((rows, columns, 3), 0.1)
    image[3, 5] = 1000.0
    edges = np.cos(np.arange(rows + 1) * math.pi / rows)
    solid = (edges[:-1] - edges[1:])[:, None] * (2.0 * math.pi / columns)
    ways, parts, radiance = sky_directions((Environment(image), Environment(0.3)), 64)
    assert parts.sum() == pytest.approx(4.0 * math.pi)
    total = ((image[..., 0] + 0.3) * solid).sum()
    assert (parts * radiance[:, 0]).sum() == pytest.approx(total)
    polar, around = (3.5) * math.pi / rows, ((5.5) / columns - 0.5) * 2.0 * math.pi
    sun = np.array([math.sin(polar) * math.sin(around), math.cos(polar), -math.sin(polar) * math.cos(around)])
    assert ways[radiance[:, 0].argmax()] @ sun > 0.99


def test_without_light_nothing_is_sent(runtime: Runtime) -> None:
    assert Radiosity(runtime, RadiosityParams(surfels=64)).run(box(0.5), ()).lights is None


def test_a_scene_without_area_sends_nothing(runtime: Runtime) -> None:
    flat = meshed([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], (Material(emission=(1.0,) * 3),))
    assert Radiosity(runtime, RadiosityParams(surfels=64)).run(flat, ()).lights is None


def test_many_bright_emissive_triangles(runtime: Runtime) -> None:
    made = solved(runtime, two_squares(0.5, 1e9, side=40))
    assert np.isfinite(made.irradiance).all()
    dim = solved(runtime, two_squares(0.5, 1.0, side=40))
    np.testing.assert_allclose(made.irradiance, dim.irradiance * 1e9, rtol=1e-4, atol=1.0)


def test_a_light_inside_a_wall_sends_nothing_wrong(runtime: Runtime) -> None:
    made = solved(runtime, box(0.5), (SpotLight((0, -1.0, 0), (0, 1, 0), 1.0, 3.0),))
    assert np.isfinite(made.irradiance).all()


def test_white_and_closed_is_refused(runtime: Runtime) -> None:
    with pytest.raises(ValueError, match="closed in absorb"):
        solved(runtime, box(1.0, 1.0))
    made = solved(runtime, box(1.0, 1.0), bounces=4)
    assert mean(made, made.irradiance) == pytest.approx(4 * math.pi, rel=0.01)


def test_emission_can_be_left_to_others(runtime: Runtime) -> None:
    scene = box(0.5, 1.0)
    with_it, without = (solved(runtime, scene, emission=flag) for flag in (True, False))
    assert with_it.vpls is not None
    assert without.vpls is not None
    own = math.pi * with_it.surfels.area.sum()
    assert with_it.vpls.flux[:, 0].sum() - without.vpls.flux[:, 0].sum() == pytest.approx(own)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"bounces": 0}, "bounces"),
        ({"bounces": "many"}, "bounces"),
        ({"grid": 48}, "grid"),
        ({"surfels": 3}, "surfels"),
    ],
)
def test_bad_parameters_are_named(params: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RadiosityParams(**params)


def test_triangles_in_another_order_keep_their_corners_and_holes(runtime: Runtime) -> None:
    made = make_scene("terrace").scene
    order = np.random.default_rng(2).permutation(len(made.triangles))
    holes = np.array([m.has_holes for m in made.materials])
    materials = tuple(replace(m, texture=0, alpha_cutoff=0.5) if i % 2 else m for i, m in enumerate(made.materials))
    texture = np.full((1, 1, 4), 255, np.uint8)
    scene = replace(
        made,
        triangles=made.triangles[order],
        material_ids=made.material_ids[order],
        materials=materials,
        textures=made.textures or (texture,),
    )
    assert not holes.all()
    near = StartTriangles.of(runtime, scene, device_scene(scene, runtime))
    count = len(scene.triangles)
    corners = near.corners.download().reshape(3, -1)[:, :count].T
    cutouts = near.cutouts.download()
    assert (corners != scene.triangles).any(), "they were put in order"
    found, expected = (
        {(*map(int, corner), int(hole)) for corner, hole in zip(*pair, strict=True)}
        for pair in ((corners, cutouts), (scene.triangles, cutouts_of(scene)))
    )
    assert found == expected
    assert len({hole for *_, hole in found}) > 1


def test_starts_do_not_depend_on_the_order_of_triangles(runtime: Runtime) -> None:
    """In their own order most lie in boxes that a surfel is not near; shuffled, they are put in
    order first."""
    made = make_scene("workshop").scene
    order = np.random.default_rng(2).permutation(len(made.triangles))
    shuffled = replace(made, triangles=made.triangles[order], material_ids=made.material_ids[order])
    assert device_scene(made, runtime).spread < SPREAD < device_scene(shuffled, runtime).spread
    device = DeviceSurfels(runtime, 128)
    surfels = scene_surfels(made, 2048, TriangleShares.of(made))
    found = []
    for scene in (made, shuffled):
        device.enter(scene, SurfelHistory())
        device._upload(surfels)
        found.append(device._find_starts(surfels, device_scene(scene, runtime)))
    np.testing.assert_array_equal(*found)
    assert (found[0] < 0).any()
    assert (found[0] > 0).any()
    assert (found[0] == 0).any()


def test_the_function_returns_what_surfels_send(runtime: Runtime) -> None:
    scene, params = box(0.5, 1.0), {"surfels": 64, "vpls": 16, "directions": 16, "grid": 32}
    found = radiosity(scene, [], runtime=runtime, **params)
    expected = solved(runtime, scene, **params).vpls
    assert expected is not None
    np.testing.assert_array_equal(found.flux, expected.flux)
    assert len(found.parts) == PARTS * len(found)
    dark = radiosity(scene, [], runtime=runtime, **params, emission=False, bounces=1)
    assert 0.0 < dark.flux.sum() < found.flux.sum()
    with pytest.raises(TypeError, match="scene is NoneType: expected a Scene"):
        radiosity(None, [], runtime=runtime)
    with pytest.raises(ValueError, match="surfels is 4: expected an integer >= 16 and <= 16384"):
        radiosity(scene, [], runtime=runtime, surfels=4)
