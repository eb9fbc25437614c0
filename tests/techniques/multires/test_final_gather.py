"""Rays over the hemisphere: their directions, what they find, and light in two parts."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import LUMINANCE, PARTS, Vpls
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.gbuffer import SurfaceView, view_normals
from ssgi_cl.reference.multires.final_gather import final_gather_reference
from ssgi_cl.techniques.multires.final_gather import tile_turn
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.occupancy.scene_rays import LIFT
from ssgi_cl.techniques.radiosity.even_light import EVEN, EvenLight, even_and_bright
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, LightVolume

from ...frame.scenes import cube, halves, inside, matt, scene_of

Doubles = NDArray[np.float64]


def volume_of(radiance: Doubles, area: Doubles, middle: Doubles | float = 0.0) -> LightVolume:
    """Return a volume of given sides, 2 units wide."""
    cells = np.arange(CELLS**3, dtype=np.int32).reshape((CELLS,) * 3)
    records = np.concatenate([radiance, area[..., None]], axis=-1, dtype=np.float32).reshape(-1, FACES, 4)
    return LightVolume(cells, records, np.full(3, -1.0) + middle, 2.0)


def even(value: float = 1.0) -> LightVolume:
    return volume_of(np.full((CELLS, CELLS, CELLS, FACES, 3), value), np.ones((CELLS, CELLS, CELLS, FACES)))


def found(
    runtime: Runtime, scene: Scene, camera: gi.Camera, light: EvenLight, rays: int, **params: Any
) -> tuple[gi.GBuffer, Doubles]:
    seen = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    chosen = MultiresSplatParams(vpls=1, visibility=True, grid=32, **params)
    technique = MultiresSplat(runtime, seen.size, chosen, surfels=64, rays=rays)
    with runtime.frame():
        plane = technique.run(on_device(seen, runtime), blockers=scene, even=light)
        image = np.moveaxis(plane.download(), 0, -1).astype(np.float64)
    return seen, image


@pytest.mark.parametrize("rays", [29, 20])  # 5 x 5 and 4 x 5 of them
def test_directions_lie_one_in_a_stratum(rays: int) -> None:
    ways = hemisphere_ways(rays)
    assert ways.shape == (rays // 5 * 5, 3, TILE * TILE)
    x, y, z = np.moveaxis(ways.astype(np.float64), 1, 0)
    np.testing.assert_allclose(x * x + y * y + z * z, 1.0, atol=1e-6)
    assert z.min() >= 0.0
    # Squares of the sine are spread evenly. Of all points' rays together one lies in each of 40 x 40 or 32 x 40 strata,
    # within which they differ by 1/32 or less: the means err by some 1/32 / 32.
    square = (x * x + y * y).ravel()
    assert abs(square.mean() - 0.5) < 2e-3
    assert abs((square**2).mean() - 1.0 / 3.0) < 2e-3
    # For one point alone: within its strata, 4 or 5 along each side, squares differ by up to 1/4.
    assert np.abs((x * x + y * y).mean(axis=0) - 0.5).max() < 2.5 / rays
    assert np.abs(np.stack([x, y]).mean(axis=(1, 2))).max() < 1e-3


@pytest.mark.parametrize("size", [(33, 21), (1, 1), (17, 40)])
def test_a_closed_room_of_one_radiance_gives_pi_of_it(variant_runtime: Runtime, size: tuple[int, int]) -> None:
    # Creases and corners included: there is no distance at which light is lost.
    camera = inside(*size)
    _, image = found(variant_runtime, cube(0.5), camera, EvenLight(even(3.0), None), 16)
    np.testing.assert_allclose(image, 3.0 * math.pi, rtol=2e-6)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_size_of_the_scene_does_not_matter(runtime: Runtime, scale: float) -> None:
    room = cube(0.5)
    scene = scene_of(np.asarray(room.positions, np.float64) * scale, room.triangles, matt(0.5))
    camera = gi.Camera.look_at(
        np.array((0.6, -0.2, 0.5)) * scale, np.array((-1.0, -0.3, -0.8)) * scale, yfov=1.2, width=16, height=12,
        near=0.01 * scale, far=10.0 * scale,
    )  # fmt: skip
    volume = replace(even(), low=np.full(3, -scale), extent=2.0 * scale)
    _, image = found(runtime, scene, camera, EvenLight(volume, None), 16)
    np.testing.assert_allclose(image, math.pi, rtol=2e-6)


@pytest.mark.parametrize(("coarsest", "rays"), [(1, 9), (2, 20)])
def test_what_rays_find_is_what_float64_finds(
    variant_runtime: Runtime, rng: np.random.Generator, coarsest: int, rays: int
) -> None:
    """Points of the second level have .45 times the rays of the coarsest one, whose points are smoothed."""
    runtime, shift = variant_runtime, np.array((30.0, 0.0, -20.0))
    triangles = rng.uniform(-0.7, 0.7, (12, 1, 3)) + rng.uniform(-0.3, 0.3, (12, 3, 3))
    walls = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    faces = halves([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4)])
    points = np.concatenate([walls, triangles.reshape(-1, 3)]) + shift
    own = (8 + np.arange(36)).reshape(-1, 3)
    scene = scene_of(points, [*faces, *own.tolist()], matt(0.5))
    camera = gi.Camera.look_at(shift + np.array((0.3, 0.2, 3.0)), shift, yfov=0.6, width=19, height=13)
    cells = (CELLS, CELLS, CELLS, FACES)
    volume = volume_of(rng.uniform(0.0, 1.0, (*cells, 3)), rng.uniform(0.1, 1.0, cells), shift)
    seen, image = found(
        runtime, scene, camera, EvenLight(volume, None), rays, coarsest=coarsest, interpolation_error=0.0
    )
    there = np.isfinite(np.asarray(seen.depth))
    if coarsest > 1:
        there[::coarsest, ::coarsest] = False
    normal = (view_normals(SurfaceView.of(seen), seen.first("normal")) @ camera.view[:3, :3])[there]
    start = camera.unproject(np.asarray(seen.depth, np.float64))[there]
    lift = LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    row, column = np.nonzero(there)
    columns_on, rows_on = tile_turn(camera)
    tile = (row + rows_on) % TILE * TILE + (column + columns_on) % TILE
    ways = np.moveaxis(hemisphere_ways(9).astype(np.float64), 2, 0)[tile]
    corners = np.asarray(scene.positions, np.float64)[scene.triangles] + scene.origin
    sides = volume.records.reshape(CELLS, CELLS, CELLS, FACES, 4).astype(np.float64)
    expected, near = final_gather_reference(
        start + lift * normal, normal, ways, corners, sides, volume.low, volume.side
    )
    assert near.mean() < 0.5
    assert expected[~near].std() > 0.05
    # Ends of rays are rounded to float32 positions 30 units from the origin: other cells near their walls, seldom.
    off = np.abs(image[there] - expected).max(axis=1)[~near]
    assert np.quantile(off, 0.95) < 1e-4


def test_what_meets_nothing_adds_nothing(runtime: Runtime) -> None:
    # A floor alone: no ray meets anything.
    floor = scene_of([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], halves([(0, 1, 2, 3)]), matt(0.5))
    camera = gi.Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), yfov=0.9, width=20, height=16)
    _, image = found(runtime, floor, camera, EvenLight(even(), None), 16)
    assert (image == 0.0).all()


def test_pictures_of_a_part_have_other_rays(runtime: Runtime) -> None:
    camera = inside(24, 16)
    turns = {tile_turn(camera.cropped(right, 0.25, 24, 16)) for right in (0.0, 0.1, 0.4, 1.3)}
    assert len(turns) == 4


def test_light_is_parted_into_two_that_sum_to_it(rng: np.random.Generator) -> None:
    count = 40
    area = rng.uniform(0.1, 1.0, PARTS * count)
    flux = rng.uniform(0.0, 1.0, (PARTS * count, 3)) * area[:, None]
    flux[:32] *= 50.0
    flux[64:96] = 0.0
    place, normal = rng.uniform(-1.0, 1.0, (2, PARTS * count, 3))
    parts = Vpls(place, normal, flux, area)
    whole = Vpls(
        place[::PARTS],
        normal[::PARTS],
        flux.reshape(-1, PARTS, 3).sum(axis=1),
        area.reshape(-1, PARTS).sum(axis=1),
        parts,
    )
    low, bright = even_and_bright(whole)
    most = EVEN * (flux @ LUMINANCE).sum() / area.sum()
    assert (low @ LUMINANCE <= most * area * (1.0 + 1e-12)).all()
    assert len(bright) == 2
    assert bright.parts is not None
    rest = flux - low
    np.testing.assert_allclose(bright.parts.flux, rest[:32])
    np.testing.assert_allclose(bright.flux, rest[:32].reshape(2, PARTS, 3).sum(axis=1))
    assert (rest[32:] == 0.0).all()
    # Colours stay.
    np.testing.assert_allclose(low[:32] * flux[:32, :1], flux[:32] * low[:32, :1], rtol=1e-12)


def test_black_light_has_no_bright_part() -> None:
    none = np.zeros((PARTS, 3))
    parts = Vpls(none, none, none, np.ones(PARTS))
    low, bright = even_and_bright(Vpls(none[:1], none[:1], none[:1], np.full(1, float(PARTS)), parts))
    assert (low == 0.0).all()
    assert len(bright) == 0


def test_even_light_needs_rays_and_blockers(runtime: Runtime) -> None:
    scene, camera = cube(0.5), inside(8, 6)
    seen = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    light: Any = SimpleNamespace(bright=None, volume=even())
    for rays, blockers in ((0, scene), (16, None)):
        technique = MultiresSplat(runtime, seen.size, MultiresSplatParams(vpls=1, visibility=True, grid=32), rays=rays)
        with runtime.frame(), pytest.raises(ValueError, match="even is EvenLight: expected None without"):
            technique.run(on_device(seen, runtime), blockers=blockers, even=light)


@pytest.mark.parametrize("rays", [16, 144])
def test_noise_is_that_of_strata(runtime: Runtime, rays: int) -> None:
    # One of six sides is lit: irradiance of a point is that side's form factor.
    radiance = np.zeros((CELLS, CELLS, CELLS, FACES, 3))
    radiance[..., 2, :] = 1.0  # the floor, facing +y
    light = EvenLight(volume_of(radiance, np.ones((CELLS, CELLS, CELLS, FACES))), None)
    camera = gi.Camera.look_at((0.0, 0.0, 0.9), (0.0, 0.0, -1.0), yfov=1.2, width=32, height=32)
    seen, image = found(runtime, cube(0.5), camera, light, rays, coarsest=1)
    place = camera.unproject(np.asarray(seen.depth, np.float64))
    wall = (np.abs(place[..., 2] + 1.0) < 1e-3) & (np.abs(place[..., :2]) < 0.9).all(axis=-1)
    place = place[wall]
    # Form factor from an element to a rectangle at right angles, in the corners (x0, y0) and (x1, y1) of it.
    h = place[:, 1] + 1.0

    def corner(x: Doubles) -> Doubles:
        return (np.arctan(x / h) - h / np.hypot(2.0, h) * np.arctan(x / np.hypot(2.0, h))) / (2.0 * math.pi)

    factor = corner(1.0 - place[:, 0]) + corner(1.0 + place[:, 0])
    off = image[wall][:, 0] / math.pi - factor
    # An edge through the disk crosses about 2 sqrt(rays) strata, of which each errs by at most half a ray.
    assert off.std() < 0.5 * math.sqrt(2.0 * math.sqrt(rays)) / rays
    assert abs(off.mean()) < 0.1 / math.sqrt(rays * 8.0)
