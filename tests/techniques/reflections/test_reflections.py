"""Reflections of glossy surfaces: the float64 reference, closed forms, what blocks rays, truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.frame.renderer import Renderer
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.reference.direct.shade import world_surface
from ssgi_cl.reference.phong import Lobes
from ssgi_cl.reference.reflections.reflections import Screen, added_reference, arriving_reference
from ssgi_cl.techniques.occupancy.occupancy_grid import OccupancyGrid
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, LightVolume
from ssgi_cl.techniques.radiosity.radiosity import RadiosityParams
from ssgi_cl.techniques.reflections.reflections import Reflections, ReflectionsParams, reflections

from ...closed_forms import Quad, quads
from ..analytic import Ball, Plane, camera, trace

Doubles = NDArray[np.float64]
HALF = 8.0
"""Half the side of the space that holds all, round the camera, scene units."""
CUBE = 128
"""Cells along a side of the occupancy grid, as radiosity has it by default."""
DEFAULTS = ReflectionsParams()


FAR_AWAY = quads(((500, 500, 500), (1, 0, 0), (0, 1, 0)))
"""Nothing that any ray meets."""


def even(value: float) -> LightVolume:
    """Return a volume of surfaces that all send the same."""
    record = np.concatenate([np.full((1, FACES, 3), value), np.ones((1, FACES, 1))], axis=-1, dtype=np.float32)
    return LightVolume(np.zeros((CELLS,) * 3, np.int32), record, np.full(3, -HALF), 2.0 * HALF)


def added(
    runtime: Runtime,
    gbuffer: GBuffer,
    radiance: ArrayLike,
    light: ArrayLike,
    environment: Environment,
    *,
    blocks: Scene = FAR_AWAY,
    volume: LightVolume | None = None,
    by_triangles: bool = False,
) -> NDArray[np.float32]:
    """Return what `Reflections` adds to radiance, [rows, columns, 3]."""
    device = on_device(gbuffer, runtime)
    planes = [runtime.plane(3, device.size) for _ in range(2)]
    for plane, values in zip(planes, (radiance, light), strict=True):
        plane.upload(np.moveaxis(np.broadcast_to(values, (*device.size, 3)), -1, 0).astype(np.float32))
    with runtime.frame():
        occupancy = OccupancyGrid(runtime, CUBE, device.size).fill_scene(
            DeviceScene(runtime, blocks), gbuffer.camera.view, HALF, -HALF, HALF
        )
        Reflections(runtime, device.size).run(
            device,
            planes[0],
            light=planes[1],
            lights=[environment],
            shadows=[None],
            volume=volume or even(0.0),
            occupancy=None if by_triangles else occupancy,
            scene=blocks if by_triangles else None,
        )
        after = planes[0].download()
    return np.moveaxis(after, 0, -1) - np.asarray(radiance, np.float32)


def glossy(gbuffer: GBuffer, gloss: float, rng: np.random.Generator | None = None) -> GBuffer:
    """Return the G-buffer with lobes everywhere, of one exponent, or random patches of it."""
    size = np.asarray(gbuffer.depth).shape
    specular = np.full((*size, 3), (0.5, 0.4, 0.3))
    exponent = np.full(size, gloss)
    if rng is not None:
        patches = np.kron(rng.random((size[0] // 8 + 1, size[1] // 8 + 1)), np.ones((8, 8)))
        patches = patches[: size[0], : size[1]]
        specular[patches < 0.3] = 0.0
        exponent[patches > 0.6] = 7.0
    return replace(
        gbuffer,
        albedo=np.full((*size, 3), 0.2, np.float32),
        specular=specular.astype(np.float32),
        gloss=exponent.astype(np.float32),
    )


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_kernels_agree_with_the_reference(variant_runtime: Runtime, rng: np.random.Generator, kind: str) -> None:
    """Of balls on a floor before an even sky, which nothing blocks but what is shown."""
    made = camera(kind, (45, 61))
    balls = [Ball((x, 0.1, z), 0.4) for x, z in ((-0.9, 0.2), (0.1, -0.5), (0.8, 0.6))]
    gbuffer = glossy(trace(made, [Plane((0, -0.3, 0), (0, 1, 0)), *balls]), 90.0, rng)
    size = (*made.size, 3)
    radiance, light = rng.random(size), rng.random(size)
    thick = DEFAULTS.thickness * 2.0 * HALF / CUBE
    screen = Screen.of(gbuffer, thick, 2.0 * HALF, DEFAULTS.steps)
    sky = np.array((2.0, 1.0, 0.5))
    arriving, meets = arriving_reference(screen, radiance, light, sky, DEFAULTS.rays)
    assert 0.03 < meets.mean() < 0.6
    expected = added_reference(gbuffer, arriving)
    found = added(variant_runtime, gbuffer, radiance, light, Environment(sky))
    # A ray that ends on a pixel's edge takes the next one's radiance, here any from 0 to 1, in
    # float32: of 16 rays of a mean that is .06.
    off = np.abs(found - expected).max(axis=-1)
    assert (off < 2e-3).mean() > 0.85
    assert np.quantile(off, 0.995) < 0.1
    assert abs(float((found - expected).mean())) < 2e-3 * float(expected.mean())
    # What lobes spread is all light here. Of lobes with an exponent of 7 a share of .056 lies below surfaces.
    arriving, _ = arriving_reference(screen, 0.0 * radiance, light, 0.0 * sky, DEFAULTS.rays)
    expected = added_reference(gbuffer, arriving)
    found = added(variant_runtime, gbuffer, 0.0, light, Environment(0.0))
    assert float(found.mean()) == pytest.approx(float(expected.mean()), rel=0.01)


def test_sky_is_averaged_over_the_lobe(runtime: Runtime) -> None:
    """A sky that grows linearly with height: its mean over a lobe is that of the lobe's axis times
    (n + 1) / (n + 2)."""
    rows = np.cos((np.arange(128) + 0.5) / 128 * np.pi)
    sky = np.broadcast_to((1.0 + 0.9 * rows)[:, None, None], (128, 256, 3)).copy()
    made = camera("perspective", (32, 48), eye=(0.0, 3.0, 1.5), target=(0.0, 0.0, 0.0))
    for gloss in (300.0, 20.0):
        gbuffer = glossy(trace(made, [Plane((0, -0.3, 0), (0, 1, 0))]), gloss)
        found = added(runtime, gbuffer, 0.0, 0.0, Environment(sky))
        lobes = Lobes.of(gbuffer, *world_surface(gbuffer)[:2])
        mean = 1.0 + 0.9 * lobes.axis[..., 1:2] * (gloss + 1.0) / (gloss + 2.0)
        inner = np.s_[4:-4, 4:-4]
        # 16 rays of a lobe 13 degrees wide, whose sky differs by .2 within; texels of 1.4 degrees.
        np.testing.assert_allclose(found[inner], (lobes.specular * mean)[inner], rtol=0.02 if gloss > 100 else 0.05)


def test_the_sky_is_round_at_its_seam(runtime: Runtime) -> None:
    """A sky of 16 columns that grows from west to east, and a floor that mirrors its first and last ones."""
    turn = 2.0 * np.pi * ((np.arange(16) + 0.5) / 16.0 - 0.5)
    sky = np.broadcast_to((1.0 + 0.9 * np.sin(turn))[None, :, None], (8, 16, 3)).copy()
    made = camera("perspective", (32, 48), eye=(0.0, 1.5, -3.0), target=(0.0, 0.0, 0.0))
    gbuffer = glossy(trace(made, [Plane((0, -0.3, 0), (0, 1, 0))]), 1e5)
    found = added(runtime, gbuffer, 0.0, 0.0, Environment(sky))
    lobes = Lobes.of(gbuffer, *world_surface(gbuffer)[:2])
    x, z = lobes.axis[..., 0], lobes.axis[..., 2]
    there = np.isfinite(np.asarray(gbuffer.depth))
    assert (np.abs(np.arctan2(x, z))[there] < np.pi / 16.0).mean() > 0.2  # of half a column from the seam
    expected = lobes.specular * (1.0 + 0.9 * x / np.hypot(x, z))[..., None]
    # A straight line through 16 columns is .9 (1 - cos(pi / 16)) = .017 off, of which a half is reflected, and means
    # of 5 x 5 pixels end with the image. From a column's middle to the seam the sky changes by .18.
    np.testing.assert_allclose(found[there], expected[there], rtol=0, atol=0.02)


def panel_in_a_floor() -> tuple[GBuffer, Doubles, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return what is seen of a wall and a floor, positions, what is wall, and what of it shines: .8 x .6 units."""
    made = camera("perspective", (360, 480), eye=(0.0, 1.2, 4.5), target=(0.0, 0.5, -1.0))
    seen = trace(made, [Plane((0, 0, -1.5), (0, 0, 1)), Plane((0, -0.3, 0), (0, 1, 0))])
    position = made.unproject(np.asarray(seen.depth))
    wall = position[..., 2] < -1.45
    shines = wall & (np.abs(position[..., 0]) < 0.4) & (np.abs(position[..., 1] - 0.9) < 0.3)
    return seen, position, wall, shines


def lobe_over_panel(position: Doubles, axis: Doubles, gloss: float) -> Doubles:
    """Return the share of lobes [n] within which the panel lies: an integral over its area."""
    side = (np.arange(24) + 0.5) / 24.0
    x, y = np.meshgrid(0.8 * side - 0.4, 0.6 * side + 0.6)
    way = np.stack([x, y, np.full_like(x, -1.5)], axis=-1).reshape(1, -1, 3) - position[:, None]
    squared = np.sum(way**2, axis=-1)
    way /= np.sqrt(squared)[..., None]
    cosine = np.maximum(np.einsum("nkc,nc->nk", way, axis), 0.0)
    value = (gloss + 1.0) / (2.0 * np.pi) * cosine**gloss * np.abs(way[..., 2]) / squared
    share: Doubles = value.mean(axis=1) * 0.8 * 0.6
    return share


@pytest.mark.parametrize("by_triangles", [False, True])
@pytest.mark.parametrize(("gloss", "most"), [(10.0, 0.15), (100.0, 0.07)])
def test_a_light_in_a_broad_lobe_is_one_light(runtime: Runtime, gloss: float, most: float, by_triangles: bool) -> None:
    """Of 256 rays of a mean, at most 28 and 141 find the panel; with the same 16 in all tiles of 4 x 4 pixels, RMS
    is .59 and .16."""
    seen, position, wall, shines = panel_in_a_floor()
    gbuffer = glossy(seen, gloss)
    assert gbuffer.specular is not None
    gbuffer = replace(gbuffer, specular=np.where(wall[..., None], 0.0, gbuffer.specular))
    solid = quads(((-8, -0.3, -1.5), (16, 0, 0), (0, 6, 0)), ((-8, -0.3, -1.5), (0, 0, 16), (16, 0, 0)))
    radiance = np.where(shines[..., None], 10.0, 0.0) * np.ones(3)
    found = added(runtime, gbuffer, radiance, 0.0, Environment(0.0), blocks=solid, by_triangles=by_triangles)
    floor = ~wall & np.isfinite(np.asarray(seen.depth)) & (position[..., 2] > -1.0)
    floor[np.arange(360) % 3 > 0] = False
    axis = Lobes.of(gbuffer, *world_surface(gbuffer)[:2]).axis[floor]
    expected = 10.0 * 0.5 * lobe_over_panel(position[floor], axis, gloss)
    off = found[floor][:, 0] - expected
    assert np.sqrt(np.mean(off**2) / np.mean(expected**2)) < most
    assert abs(off.mean()) < 0.02 * expected.mean()


@pytest.mark.parametrize("by_triangles", [False, True])
def test_no_sky_enters_a_closed_room(runtime: Runtime, by_triangles: bool) -> None:
    """Rays that leave the image in a closed room take what its surfaces send.

    In a grid pixels within six cells of two walls begin in the cells of both and may be taken for outside.
    """
    low, high = np.array((-2.0, -0.3, -2.0)), np.array((2.0, 2.5, 2.9))
    x, y, z = ((high - low) * np.eye(3)).tolist()
    a, b = low.tolist(), high.tolist()
    down = [[-v for v in axis] for axis in (x, y, z)]
    room = quads((a, x, y), (a, y, z), (a, x, z), (b, down[0], down[1]), (b, down[1], down[2]),
                 (b, down[0], down[2]))  # fmt: skip
    made = camera("perspective", (48, 64), eye=(0.3, 1.2, 2.0), target=(0.0, 0.0, -0.5))
    planes = [Plane(a, n) for n in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    planes += [Plane(b, n) for n in ((-1, 0, 0), (0, -1, 0), (0, 0, -1))]
    gbuffer = glossy(trace(made, planes), 2000.0)
    sky, volume = Environment(1000.0), even(3.0)
    found = added(runtime, gbuffer, 3.0, 0.0, sky, blocks=room, volume=volume, by_triangles=by_triangles)
    assert gbuffer.specular is not None
    position = made.unproject(np.asarray(gbuffer.depth))
    apart = np.sort(np.minimum(position - low, high - position), axis=-1)
    found = found[apart[..., 1] > (0.0 if by_triangles else 6.0 * 2.0 * HALF / CUBE)]
    assert len(found) > 1000
    expected = 3.0 * np.array((0.5, 0.4, 0.3))
    # What of lobes lies below the surface is lost at grazing angles alone.
    assert (found < expected * 1.001).all()
    assert np.quantile(found / expected, 0.1) > 0.99
    assert (found / expected).min() > 0.8


def test_surfaces_count_by_how_large_they_appear(runtime: Runtime) -> None:
    """In a volume whose surfaces that face along x are bright slivers, along z half as large."""
    made = camera("perspective", (24, 32), eye=(0.0, 2.0, 2.0), target=(0.0, 0.0, 0.0))
    gbuffer = glossy(trace(made, [Plane((0, -0.3, 0), (0, 1, 0))]), 1e5)
    wall = quads(((-7, -1, -4.0), (14, 0, 0), (0, 6, 0)))
    volume = even(0.0)
    for face, radiance, area in ((0, 1e3, 1e-7), (1, 1e3, 1e-7), (2, 2.0, 1.0), (3, 2.0, 1.0),
                                 (4, 6.0, 0.5), (5, 6.0, 0.5)):  # fmt: skip
        volume.records[:, face] = [*[radiance] * 3, area]
    found = added(runtime, gbuffer, 0.0, 0.0, Environment(0.0), blocks=wall, volume=volume)
    lobes = Lobes.of(gbuffer, *world_surface(gbuffer)[:2])
    y, z = np.abs(lobes.axis[..., 1]), np.abs(lobes.axis[..., 2])
    expected = lobes.specular * ((2.0 * y + 6.0 * 0.5 * z) / (y + 0.5 * z))[..., None]
    blocked = found[..., 0] > 0.0
    assert blocked.mean() > 0.3
    # All rays of a pixel and its neighbours that reach the wall; others find no sky.
    inner = np.all([np.roll(blocked, k, 0) for k in range(-5, 6)], axis=0)
    inner[:5], inner[-5:] = False, False
    assert inner.sum() > 100
    np.testing.assert_allclose(found[inner], expected[inner], rtol=0.03)


ACROSS = {"-z": (0.0, -1.0), "+z": (0.0, 1.0), "-x": (-1.0, 0.0), "+x": (1.0, 0.0)}
"""Direction -> x and z of what a floor or ceiling mirrors."""


@pytest.mark.parametrize("up", [1.0, -1.0], ids=["floor", "ceiling"])
@pytest.mark.parametrize("to", ACROSS.values(), ids=ACROSS)
def test_rays_see_the_sides_that_face_against_them(runtime: Runtime, to: tuple[float, float], up: float) -> None:
    """In a volume of whose six sides each sends another radiance; a wall blocks the rays."""
    x, z = to
    made = camera("perspective", (24, 32), eye=(-2.0 * x, 2.0 * up, -2.0 * z), target=(0.0, 0.0, 0.0))
    gbuffer = glossy(trace(made, [Plane((0, -0.3 * up, 0), (0, up, 0))]), 1e5)
    middle, along = np.array((4.0 * x, 2.5 * up, 4.0 * z)), np.array((z, 0.0, x))
    wall = quads(((middle - 7.0 * along - (0, 3.5, 0)).tolist(), (14.0 * along).tolist(), (0, 7, 0)))
    volume = even(0.0)
    sides = np.array((2.0, 3.0, 5.0, 7.0, 11.0, 13.0))  # of surfaces that face +x, -x, +y, -y, +z and -z
    volume.records[..., :3] = sides[:, None]
    found = added(runtime, gbuffer, 0.0, 0.0, Environment(0.0), blocks=wall, volume=volume)
    lobes = Lobes.of(gbuffer, *world_surface(gbuffer)[:2])
    against = sides[[0, 2, 4] + (lobes.axis > 0.0)]
    weight = np.abs(lobes.axis)
    expected = lobes.specular * ((weight * against).sum(axis=-1) / weight.sum(axis=-1))[..., None]
    blocked = (found[..., 0] > 0.0) & (weight.min(axis=-1) > 0.05)  # a lobe is not wholly on one side of an axis
    inner = np.all([np.roll(blocked, k, 0) for k in range(-5, 6)], axis=0)
    inner[:5], inner[-5:] = False, False
    assert inner.sum() > 50
    np.testing.assert_allclose(found[inner], expected[inner], rtol=0.03)


def test_the_back_of_what_the_image_shows_is_not_its_front(runtime: Runtime) -> None:
    """A mirror before the eye, and a plate between them whose lit side the eye sees and the mirror does not."""
    made = camera("perspective", (60, 80), eye=(0.0, 0.0, 6.0), target=(0.0, 0.0, 0.0))
    wall, plane = (trace(made, [Plane((0, 0, z), (0, 0, 1))]) for z in (0.0, 3.0))
    points = made.unproject(np.asarray(plane.depth))
    plate = (points[..., 0] > 0.3) & (points[..., 0] < 1.2) & (np.abs(points[..., 1]) < 0.8)
    depth = np.where(plate, plane.depth, wall.depth).astype(np.float32)
    gbuffer = glossy(GBuffer(camera=made, depth=depth, normal=np.asarray(wall.normal)), 1e5)
    assert gbuffer.specular is not None
    gbuffer = replace(gbuffer, specular=np.where(plate[..., None], 0.0, gbuffer.specular))
    radiance = np.where(plate[..., None], 50.0, 0.0) * np.ones(3)
    found = added(runtime, gbuffer, radiance, 0.0, Environment(1.0))
    # A ray from (x, y, 0) is at 1.5 (x, y) where it passes the plate.
    seen = 1.5 * made.unproject(depth)
    meets = ~plate & (np.abs(seen[..., 0] - 0.6) < 0.25) & (np.abs(seen[..., 1]) < 0.7)
    assert meets.sum() > 30
    np.testing.assert_allclose(found[~plate] / (0.5, 0.4, 0.3), 1.0, rtol=1e-3)


def test_rays_pass_behind_what_is_no_thicker_than_surfaces_are_taken_to_be(runtime: Runtime) -> None:
    """A ball close to the eye, in front of which no mirrored ray comes."""
    made = camera("perspective", (45, 61), eye=(0.0, 1.0, 4.0), target=(0.0, 0.6, 0.0))
    floor, ball = Plane((0, -0.3, 0), (0, 1, 0)), Ball((0.0, 1.0, 2.8), 0.25)
    gbuffer = trace(made, [floor, ball])
    depth = np.asarray(gbuffer.depth)
    seen = made.unproject(np.where(np.isfinite(depth), depth, 1.0).astype(np.float32))
    on_ball = (seen[..., 1] > 0.2) & np.isfinite(depth)
    matt = glossy(gbuffer, 3000.0)
    assert matt.specular is not None
    matt = replace(matt, specular=np.where(on_ball[..., None], 0.0, matt.specular))
    radiance = np.where(on_ball[..., None], 50.0, 0.0) * np.ones(3)
    found = added(runtime, matt, radiance, 0.0, Environment(1.0))
    on_floor = np.isfinite(depth) & ~on_ball
    behind = on_floor.copy()
    behind[:, (~on_ball).all(axis=0)] = False
    assert behind.sum() > 50
    share = found[on_floor] / (0.5, 0.4, 0.3)
    # Of the sky alone, a part of the lobe lies below the floor at its horizon.
    assert share.min() > 0.8
    assert share.max() < 1.001
    assert (found[behind][:, 0] > 0.49).mean() > 0.9


def test_a_ray_that_passes_behind_what_is_shown_does_not_reach_what_lies_beyond(runtime: Runtime) -> None:
    """A table before a bright wall: its underside, which is not seen, is dark in the floor."""
    made = camera("perspective", (60, 80), eye=(0.0, 1.1, 3.5), target=(0.0, 0.4, 0.0))
    wall, floor = Plane((0, 0, -1.5), (0, 0, 1)), Plane((0, -0.3, 0), (0, 1, 0))
    seen = [trace(made, [wall, floor]), trace(made, [Plane((0, 0.6, 0), (0, 1, 0))])]
    depth = np.asarray(seen[1].depth, np.float64)
    points = made.unproject(seen[1].depth)
    table = (np.abs(points[..., 0]) < 1.0) & (np.abs(points[..., 2]) < 0.9) & np.isfinite(depth)
    table &= depth < np.asarray(seen[0].depth)
    gbuffer = glossy(
        GBuffer(
            camera=made,
            depth=np.where(table, depth, seen[0].depth).astype(np.float32),
            normal=np.where(table[..., None], (0.0, 1.0, 0.0), seen[0].normal).astype(np.float32),
        ),
        2000.0,
    )
    position = made.unproject(np.asarray(gbuffer.depth))
    on_wall = position[..., 2] < -1.4
    radiance = np.where(on_wall[..., None], 10.0, 0.0) * np.ones(3)
    solid = quads(((-1.0, 0.6, -0.9), (2, 0, 0), (0, 0, 1.8)),
                  ((-4, -0.3, -1.5), (8, 0, 0), (0, 5, 0)),
                  ((-4, -0.3, -1.5), (8, 0, 0), (0, 0, 6)))  # fmt: skip
    found = added(runtime, gbuffer, radiance, 0.0, Environment(0.0), blocks=solid)
    # Floor points whose mirrored view ray crosses the table's plane within the table.
    eye = made.position
    to = position - eye
    crossing = position + to * np.array((1, -1, 1)) * ((0.6 - position[..., 1:2]) / -to[..., 1:2])
    is_floor = (position[..., 1] < -0.25) & ~on_wall
    under = is_floor & (np.abs(crossing[..., 0]) < 0.8) & (np.abs(crossing[..., 2]) < 0.7)
    beside = is_floor & (np.abs(crossing[..., 0]) > 1.4) & (position[..., 2] < -0.5)
    assert under.sum() > 100
    assert beside.sum() > 20
    assert found[under].mean() < 0.1
    assert found[beside].mean() > 2.0


PANELS = ((-0.5, 0.5, -1.5), (1.0, 0.0, 0.0), (0.0, 0.8, 0.0)), ((-0.5, 2.0, 1.2), (1.0, 0.0, 0.0), (0.0, 0.6, -0.3))
"""Before the camera of the next test, and above what it sees: corner and two sides."""


def within_panel(start: Doubles, way: Doubles, panel: Quad) -> Doubles:
    """Return how far within a panel rays meet its plane, in its sides; below 0 outside, -inf where they do not."""
    corner, first, second = np.array(panel)
    normal = np.cross(first, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = ((corner - start) @ normal) / (way @ normal)
        at = start + far[..., None] * way - corner
        inside = np.stack([at @ first / (first @ first), at @ second / (second @ second)])
        least: Doubles = np.minimum(inside, 1.0 - inside).min(axis=0)
    return np.where((far > 0.0) & np.isfinite(least), least, -np.inf)


@pytest.mark.parametrize(
    ("eye", "target", "panel"),
    [((0.0, 1.6, 4.0), (0.0, 0.3, -0.5), 0), ((0.0, 1.6, 2.0), (0.0, -0.6, 0.3), 1)],
    ids=["shown", "not shown"],
)
def test_a_mirror_shows_a_panel_as_it_is(
    runtime: Runtime, eye: tuple[float, ...], target: tuple[float, ...], panel: int
) -> None:
    """In a floor that mirrors, whether the image shows it or not: its radiance, and where each pixel's mirrored ray
    meets its rectangle."""
    made = Camera.look_at(eye, target, width=160, height=120)
    floor = ((-8.0, 0.0, -8.0), (0.0, 0.0, 16.0), (16.0, 0.0, 0.0))
    scene = quads(floor, *PANELS)
    emission = (5.0, 4.0, 3.0), (1.0, 6.0, 1.0)
    metal = Material(albedo=(0.0, 0.0, 0.0), specular=(0.9, 0.8, 0.7), gloss=1e6)
    glowing = [Material(albedo=(0.0, 0.0, 0.0), emission=each) for each in emission]
    scene = replace(scene, materials=(metal, *glowing), material_ids=np.array([0, 0, 1, 1, 2, 2], np.int32))
    frame = render(scene, made, [], runtime=runtime)
    position = made.unproject(np.asarray(trace(made, [Plane((0, 0, 0), (0, 1, 0))]).depth))
    view = position - made.position
    hidden = (within_panel(made.position, view, PANELS[0]) > -0.03) & (position[..., 2] < PANELS[0][0][2])
    on_floor = np.isfinite(position[..., 0]) & ~hidden
    inside = within_panel(position, view * (1.0, -1.0, 1.0), PANELS[panel])
    expected = np.array(emission[panel]) * (0.9, 0.8, 0.7)
    within, outside = on_floor & (inside > 0.03), on_floor & (inside < -0.03)
    assert within.sum() > 150
    radiance = np.asarray(frame.radiance)
    np.testing.assert_allclose(radiance[within], np.broadcast_to(expected, (within.sum(), 3)), rtol=0.01)
    found = on_floor & (np.abs(radiance - expected) < 0.01 * expected).all(axis=-1)
    assert not (found & outside).any()
    # The whole, edges too: as much light as the panel's rectangle has.
    whole = np.count_nonzero(on_floor & (inside > 0.0))
    assert abs(np.count_nonzero(found) - whole) < 0.02 * whole


def test_a_mirror_shows_the_back_of_a_card_and_not_its_front(runtime: Runtime) -> None:
    """A mirror behind a card whose front alone is lit: rays come back where the image shows the front."""
    card = (-0.5, -0.5, -1.0), (1.0, 0.0, 0.0), (0.0, 1.3, 0.0)
    scene = quads(card, ((-4.0, -4.0, -3.0), (8.0, 0.0, 0.0), (0.0, 8.0, 0.0)))
    metal, paper = Material(albedo=(0.0,) * 3, specular=(0.9,) * 3, gloss=1e6), Material(albedo=(0.8,) * 3)
    scene = replace(scene, materials=(paper, metal), material_ids=np.array([0, 0, 1, 1], np.int32))
    made = Camera.look_at((0.0, 1.6, 4.0), (0.0, 0.2, -1.0), width=160, height=120)
    spot = SpotLight((0.0, 0.15, 3.0), (0.0, 0.0, -1.0), 0.08, 10.0)
    frame = render(scene, made, [spot], edges=0, gbuffer=True, runtime=runtime)
    assert frame.gbuffer is not None
    radiance, position = np.asarray(frame.radiance), made.unproject(np.asarray(frame.gbuffer.first("depth")))
    view = position - made.position
    behind = np.isfinite(view[..., 0]) & (position[..., 2] < -2.9)
    back = behind & (within_panel(position, view * (1.0, 1.0, -1.0), card) > 0.05)
    assert back.sum() > 50
    lit = radiance[np.abs(position[..., 2] + 1.0) < 0.01]
    assert lit.max() > 0.15
    assert radiance[back].max() < 0.01 * lit.max()


def test_mirrors_show_mirrors(runtime: Runtime) -> None:
    """A panel in a ceiling that mirrors, in a floor that mirrors: where the panel's image above the ceiling is, with
    the reflectances' product."""
    made = Camera.look_at((0.0, 1.6, 4.0), (0.0, 0.0, 2.6), width=160, height=120)
    planes = [((-8.0, y, -8.0), (0.0, 0.0, 16.0), (16.0, 0.0, 0.0)) for y in (0.0, 3.0)]
    scene = quads(*planes, PANELS[0])
    metals = [Material(albedo=(0.0,) * 3, specular=each, gloss=1e6) for each in ((0.9, 0.8, 0.7), (0.5, 0.7, 0.9))]
    panel = Material(albedo=(0.0,) * 3, emission=(5.0, 4.0, 3.0))
    scene = replace(scene, materials=(*metals, panel), material_ids=np.array([0, 0, 1, 1, 2, 2], np.int32))
    radiance = np.asarray(render(scene, made, [], runtime=runtime).radiance)
    position = made.unproject(np.asarray(trace(made, [Plane((0, 0, 0), (0, 1, 0))]).depth))
    (x, y, z), first, second = PANELS[0]
    image = (x, 6.0 - y, z), first, tuple(-each for each in second)
    inside = within_panel(position, (position - made.position) * (1.0, -1.0, 1.0), image)
    expected = np.array((5.0, 4.0, 3.0)) * (0.9, 0.8, 0.7) * (0.5, 0.7, 0.9)
    assert (inside > 0.03).sum() > 80
    shown = radiance[inside > 0.03]
    np.testing.assert_allclose(shown, np.broadcast_to(expected, shown.shape), rtol=0.01)
    found = (np.abs(radiance - expected) < 0.01 * expected).all(axis=-1)
    assert not (found & (inside < -0.03)).any()


def test_a_frame_without_holes_fills_no_grid_for_its_reflections(runtime: Runtime) -> None:
    metal = Material(albedo=(0.0, 0.0, 0.0), specular=(0.9, 0.8, 0.7), gloss=20.0)
    scene = replace(quads(((-8.0, 0.0, -8.0), (0.0, 0.0, 16.0), (16.0, 0.0, 0.0)), *PANELS), materials=(metal,))
    made = Camera.look_at((0.0, 1.6, 4.0), (0.0, 0.3, -0.5), width=48, height=32)
    renderer = Renderer(runtime, (32, 48))
    renderer(scene, made, [Environment(1.0)])  # places surfels in a grid
    moved = Camera.look_at((0.1, 1.6, 4.0), (0.0, 0.3, -0.5), width=48, height=32)
    frame = renderer(scene, moved, [Environment(1.0)])
    ran = {each.name for each in frame.passes if not each.skipped}
    assert "reflect_mirror" in ran
    assert not ran & {"reflect_trace", "occupancy_voxelize", "occupancy_reach"}


def test_what_is_matt_is_left_alone(runtime: Runtime, rng: np.random.Generator) -> None:
    made = camera("perspective", (21, 37))
    gbuffer = glossy(trace(made, [Plane((0, -0.3, 0), (0, 1, 0))]), 50.0, rng)
    assert gbuffer.specular is not None
    size = (*made.size, 3)
    found = added(runtime, gbuffer, rng.random(size), rng.random(size), Environment(2.0))
    matt = (np.asarray(gbuffer.specular) == 0.0).all(axis=-1)
    assert 0 < matt.sum() < matt.size
    assert (found[matt] == 0.0).all()
    there = np.isfinite(np.asarray(gbuffer.depth))
    assert (found[~matt & there].max(axis=-1) > 0.0).all()


def test_an_empty_image_gets_nothing(runtime: Runtime) -> None:
    made = Camera.look_at((0, 0, 3), (0, 0, 0), width=16, height=8)
    empty = glossy(GBuffer(camera=made, depth=np.full((8, 16), np.inf, np.float32)), 50.0)
    assert (added(runtime, empty, 0.0, 0.0, Environment(2.0)) == 0.0).all()


def test_the_function_adds_the_sky_that_a_floor_mirrors(runtime: Runtime) -> None:
    """A floor alone: its lobes see nothing but an even sky, above it."""
    made = camera("perspective", (24, 32), eye=(0.0, 3.0, 1.5), target=(0.0, 0.0, 0.0))
    matt = trace(made, [Plane((0, -0.3, 0), (0, 1, 0))])
    floor = quads(((-8, -0.3, -8), (0, 0, 16), (16, 0, 0)))
    few = RadiosityParams(surfels=16, vpls=16, directions=16)
    dark = np.zeros((24, 32, 3), np.float32)
    given: dict[str, Any] = {"scene": floor, "radiosity": few, "runtime": runtime}
    found = reflections(glossy(matt, 300.0), dark, [Environment((2.0, 1.0, 0.5))], **given)
    expected = np.array((0.5, 0.4, 0.3)) * (2.0, 1.0, 0.5)
    np.testing.assert_allclose(found[4:-4, 4:-4], np.broadcast_to(expected, (16, 24, 3)), rtol=0.02)
    np.testing.assert_array_equal(reflections(matt, dark + 3.0, [], **given), 3.0)
    with pytest.raises(ValueError, match=r"radiance has shape \(2, 2\): expected \(24, 32\) as the G-buffer"):
        reflections(matt, dark[:2, :2], [], **given)
    with pytest.raises(ValueError, match="rays is 0: expected an integer >= 1 and <= 64"):
        reflections(matt, dark, [], **given, rays=0)
