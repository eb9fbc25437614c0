"""Tiles: what is found of them, what is proven, and that ambient occlusion is 1 in open ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.tiles import by_tile, nearness, rises_reference, too_far
from ssgi_cl.techniques.ao.slices import SliceTechnique
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.shading.light_data import PunctualLight, PunctualLights
from ssgi_cl.techniques.shading.light_reach import reaching
from ssgi_cl.techniques.tiles import TILE, Reach, Tiles

from . import analytic

SIZE = (70, 150)
CAMERAS = ("perspective", "orthographic")
OPEN, INTERIOR, FAR, FLAT = 1, 2, 4, 8


def uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    device = DeviceGBuffer(runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin)
    device.upload(gbuffer)
    return device


def corner(camera: Camera, margin: tuple[int, int] = (0, 0)) -> GBuffer:
    """Return a floor, a wall that ends in the middle, and nothing beside it."""
    floor = analytic.Plane((0.0, -0.3, 0.0), (0.0, 1.0, 0.0), ((0.0, 0.0, 1.0), -4.0))
    wall = analytic.Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), ((1.0, 0.0, 0.0), 0.0))
    return analytic.trace(camera, [floor, wall], margin=margin)


def proven(runtime: Runtime, gbuffer: GBuffer, reach: Reach) -> tuple[NDArray[np.int32], DeviceGBuffer]:
    """Return the bits [rows of tiles, columns of tiles], and the G-buffer on the device."""
    device = uploaded(runtime, gbuffer)
    tiles = Tiles(runtime, gbuffer.size, gbuffer.margin, gbuffer.layers)
    tiles.look(device)
    return tiles.open(device, reach).bits.download().reshape(tiles.size), device


# ---- what is found


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("margin", [(0, 0), (5, 20)])
def test_boxes_and_normals_hold_every_pixel_of_their_tiles(
    variant_runtime: Runtime, name: str, margin: tuple[int, int]
) -> None:
    camera = analytic.camera(name, SIZE)
    gbuffer = corner(camera, margin)
    device = uploaded(variant_runtime, gbuffer)
    summary = Tiles(variant_runtime, SIZE, margin).look(device)
    depth = gbuffer.inner(gbuffer.first("depth"))
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    safe = np.where(np.isfinite(depth), depth, 1.0)
    points = np.moveaxis(camera.unproject(safe) @ turn.T + shift, -1, 0)
    inner = np.s_[:, margin[0] : margin[0] + SIZE[0], margin[1] : margin[1] + SIZE[1]]
    normals = device.normal.download()[inner]
    there = np.isfinite(depth)
    shown = by_tile(there, np.logical_or).astype(bool)
    assert len(summary.boxes.least) == np.count_nonzero(shown)
    for values, least, greatest in (
        (points, summary.boxes.least, summary.boxes.greatest),
        (normals, summary.boxes.normal_least, summary.boxes.normal_greatest),
    ):
        for axis in range(3):
            low = by_tile(np.where(there, values[axis], np.inf), np.minimum)[shown]
            high = by_tile(np.where(there, values[axis], -np.inf), np.maximum)[shown]
            assert (least[:, axis] <= low).all()
            assert (greatest[:, axis] >= high).all()


def test_layers_without_a_pixel_are_not_counted(variant_runtime: Runtime) -> None:
    gbuffer = corner(analytic.camera("perspective", SIZE))
    front = np.asarray(gbuffer.depth)
    nothing = np.full_like(front, np.inf)
    one = nothing.copy()
    one[61, 140] = front[61, 140] + 1.0
    for deeper, expected in (([nothing, nothing], 1), ([one, nothing], 2), ([one, one], 3)):
        layered = GBuffer(camera=gbuffer.camera, depth=np.stack([front, *deeper]), normal=gbuffer.normal)
        device = uploaded(variant_runtime, layered)
        assert Tiles(variant_runtime, SIZE, (0, 0), 3).look(device).layers == expected


# ---- what is proven


@pytest.mark.parametrize("name", CAMERAS)
def test_in_flat_tiles_nothing_rises_above_any_tangent_plane(variant_runtime: Runtime, name: str) -> None:
    camera = analytic.camera(name, SIZE)
    gbuffer = corner(camera)
    to_x, to_y, _, _ = camera.pixel_to_view
    px = 6
    depth = np.asarray(gbuffer.depth, np.float64)
    near = 1.0 if camera.is_orthographic else depth.min()
    reach = Reach(radius=px * min(abs(to_x), abs(to_y)) * near, more_px=0.0)
    bits, device = proven(variant_runtime, gbuffer, reach)
    rises = rises_reference(depth, np.moveaxis(device.normal.download(), 0, -1), camera, px)
    highest = by_tile(rises, np.maximum)
    flat = (bits & FLAT) > 0
    # float32 depths round by 2^-24 of themselves, twice; the kernel's own bias is 4e-6.
    assert highest[flat].max() < 2e-6
    # Not in vain: most tiles that are flat for every pixel within tiles' distance are found.
    wide = by_tile(rises_reference(depth, np.moveaxis(device.normal.download(), 0, -1), camera, 2 * TILE), np.maximum)
    sure = (wide < 5e-7) & (wide > -np.inf)
    assert sure.sum() >= 5
    assert flat[sure].mean() >= 0.5  # nothing is proven beside a tile that is bent or half empty
    np.testing.assert_array_equal(
        bits == (OPEN | (bits & INTERIOR)), by_tile(nearness(depth, camera), np.maximum) == -np.inf
    )


@pytest.mark.parametrize("name", [*CAMERAS, "intrinsics"])
@pytest.mark.parametrize("step", [1, 2])
def test_far_tiles_are_those_where_the_radius_covers_less_than_a_pixel(
    variant_runtime: Runtime, name: str, step: int
) -> None:
    camera = analytic.camera(name, SIZE)
    gbuffer = corner(camera)
    depth = np.asarray(gbuffer.depth, np.float64)
    to_x, to_y, _, _ = camera.pixel_to_view
    middle = 1.0 if camera.is_orthographic else np.median(depth[np.isfinite(depth)])
    found = set()
    for share in (0.9, 1.1):
        reach = Reach(radius=share * step * min(abs(to_x), abs(to_y)) * middle, step=step)
        bits, _ = proven(variant_runtime, gbuffer, reach)
        small = by_tile(too_far(depth, camera, reach), np.logical_and).astype(bool)
        empty = by_tile(np.isfinite(depth), np.logical_or) == 0
        np.testing.assert_array_equal((bits & FAR) > 0, small & ~empty)
        found.add(bool(small[~empty].any()))
    assert True in found


@pytest.mark.parametrize("margin", [(0, 0), (0, 48)])
@pytest.mark.parametrize("most_px", [math.inf, 25.0])
@pytest.mark.parametrize("stretch", [1.0, 1.7])
def test_tiles_look_as_far_as_the_radius_and_its_limits_say(
    runtime: Runtime, margin: tuple[int, int], most_px: float, stretch: float
) -> None:
    rows, columns = 32, 480
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.3, width=columns, height=rows)
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    wide = columns + 2 * margin[1]
    found = set()
    for edge in (10, 20, 28):  # tile of the image at which a part begins that stands out of a wall
        depth = np.full((rows, wide), 5.0, np.float32)
        depth[:, margin[1] + edge * TILE :] = 3.0
        normal = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), (rows, wide, 3))
        gbuffer = GBuffer(camera=camera, depth=depth, normal=normal)
        reach = Reach(radius=1.3, stretch=stretch, most_px=most_px)
        bits, _ = proven(runtime, gbuffer, reach)
        for row in range(rows // TILE):
            for column in range(edge):
                # Lengths across a view ray grow in the image with its slope.
                x = np.abs(at_x + to_x * TILE * np.array([column, column + 1])).max()
                y = np.abs(at_y + to_y * TILE * np.array([row, row + 1])).max()
                px = min(1.3 / min(abs(to_x), abs(to_y)) / 5.0, most_px) * stretch
                tiles = (px * math.hypot(1.0, x, y) + reach.more_px) / TILE
                if abs(tiles - round(tiles)) < 1e-3:
                    continue
                flat = column + math.ceil(tiles) < edge
                assert bool(bits[row, column] & FLAT) == flat, (edge, row, column)
                found.add(flat)
    assert found == {False, True}


def test_calm_tiles_have_open_ones_all_round(runtime: Runtime) -> None:
    gbuffer = corner(analytic.camera("perspective", SIZE))
    bits, _ = proven(runtime, gbuffer, Reach(radius=0.05))
    opened = np.pad((bits & OPEN) > 0, 1, constant_values=True)
    rows, columns = bits.shape
    around = np.stack([opened[i : i + rows, j : j + columns] for i in range(3) for j in range(3)])
    np.testing.assert_array_equal((bits & INTERIOR) > 0, around.all(axis=0))
    assert 0 < np.count_nonzero(bits & INTERIOR) < np.count_nonzero(bits & OPEN) < bits.size


# ---- what it is for


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize(
    ("name", "choice"),
    [
        ("gtao", {}),
        ("ssao", {"contrast": 2.0}),
        pytest.param("gtao", {"bent_normals": True, "resolution": "half"}, marks=pytest.mark.slow),
        pytest.param("hbao", {"resolution": "half"}, marks=pytest.mark.slow),
        pytest.param("bitmask_ao", {"contrast": 1.5}, marks=pytest.mark.slow),
        pytest.param("bitmask_ao", {"resolution": "quarter"}, marks=pytest.mark.slow),
        pytest.param("ssao", {"resolution": "quarter", "blur_passes": 3}, marks=pytest.mark.slow),
        pytest.param("gtao", {"max_radius_px": 4.0}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_open_tiles_change_no_bit_of_the_result(
    variant_runtime: Runtime, name: str, choice: dict[str, Any], camera: str
) -> None:
    entry = TECHNIQUES[name]
    margin = (3, 9)
    gbuffer = corner(analytic.camera(camera, (150, 200)), margin)
    device = uploaded(variant_runtime, gbuffer)
    tiles = Tiles(variant_runtime, gbuffer.size, margin)
    tiles.look(device)
    opened = []
    make: Any = entry.technique
    more = (1,) if issubclass(entry.technique, SliceTechnique) else ()
    for radius in (0.02, 0.1):
        params = entry.params(radius=radius, **choice)  # type: ignore[call-arg]
        technique = make(variant_runtime, gbuffer.size, params, margin, *more)
        expected = technique.run(device).download()
        reach = technique.reach(device)
        known = tiles.open(device, reach)
        np.testing.assert_array_equal(technique.run(device, tiles=known).download(), expected)
        opened.append(known.open - known.empty)
    assert max(opened) > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gtao", "hbao", "bitmask_ao"])
def test_lines_of_sight_at_a_slant_look_farther_across_the_image(runtime: Runtime, name: str) -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=2.0, width=1200, height=640)
    across = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    wall = analytic.Plane((0.0, 0.0, -5.0), (0.0, 0.0, 1.0))
    entry = TECHNIQUES[name]
    make: Any = entry.technique
    params = entry.params(radius=0.95, blur_passes=0)  # type: ignore[call-arg]
    technique = make(runtime, (640, 1200), params, (0, 0), 1)
    for begins in (11.9, 12.2, 12.4):
        step = analytic.Plane((0, 0, -4.58), (0, 0, 1), (across, begins))
        device = uploaded(runtime, analytic.trace(camera, [wall, step]))
        tiles = Tiles(runtime, (640, 1200))
        expected = technique.run(device).download()
        tiles.look(device)
        known = tiles.open(device, technique.reach(device))
        assert 0 < known.flat < known.total
        np.testing.assert_array_equal(technique.run(device, tiles=known).download(), expected)


@pytest.mark.parametrize(
    ("radius", "most_px"), [(2.0, math.inf), (4.0, 60.0), pytest.param(3.0, math.inf, marks=pytest.mark.slow)], ids=str
)
def test_points_before_a_wall_are_seen_farther_across_the_image(
    runtime: Runtime, radius: float, most_px: float
) -> None:
    # A point of the ball that lies nearer to the eye, and aslant, projects up to
    # sqrt(1 + slope^2) / (1 - radius / depth) times as far from the receiver as the radius; here
    # 2.4 / .4. Points lie near the ball's surface, and the step is as high as they are.
    size = (200, 400)
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=1.8, width=size[1], height=size[0])
    across = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    wall = analytic.Plane((0.0, 0.0, -5.0), (0.0, 0.0, 1.0))
    params = SsaoParams(radius=radius, max_radius_px=most_px, samples=64, length_power=0.2, blur_passes=0)
    technique = Ssao(runtime, size, params)
    flat = 0
    for begins in np.arange(-2.0, 9.0, 0.62):
        step = analytic.Plane((0.0, 0.0, 0.95 * radius - 5.0), (0, 0, 1), (across, begins))
        device = uploaded(runtime, analytic.trace(camera, [wall, step]))
        tiles = Tiles(runtime, size)
        expected = technique.run(device).download()
        tiles.look(device)
        known = tiles.open(device, technique.reach(device))
        np.testing.assert_array_equal(technique.run(device, tiles=known).download(), expected)
        flat += known.flat
    assert flat > 0


@pytest.mark.parametrize("name", ["gtao", "bitmask_ao"])
def test_tiles_look_as_far_as_the_nearest_that_scan_with_them(runtime: Runtime, name: str) -> None:
    # Pixels of a row that scan together show a near wall on the left and, behind its end, a far one
    # or nothing. Over the near one's radius, .3 or 57 px, lies a step.
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.7, width=192, height=140)
    end = ((-1.0, 0.0, 0.0), 0.25)
    near = analytic.Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), end)
    step = analytic.Plane((0.0, 0.0, -0.9), (0.0, 0.0, 1.0), ((0.0, -1.0, 0.0), 0.12))
    far = analytic.Plane((0.0, 0.0, -6.0), (0.0, 0.0, 1.0))
    entry = TECHNIQUES[name]
    make: Any = entry.technique
    params = entry.params(radius=0.3, blur_passes=0)  # type: ignore[call-arg]
    technique = make(runtime, (140, 192), params, (0, 0), 1)
    for behind in ([far], []):
        device = uploaded(runtime, analytic.trace(camera, [near, step, *behind]))
        tiles = Tiles(runtime, (140, 192))
        expected = technique.run(device).download()
        tiles.look(device)
        known = tiles.open(device, technique.reach(device))
        assert 0 < known.open < known.total
        np.testing.assert_array_equal(technique.run(device, tiles=known).download(), expected)


def test_techniques_that_plain_surfaces_occlude_have_no_reach(runtime: Runtime) -> None:
    gbuffer = uploaded(runtime, corner(analytic.camera("perspective", SIZE)))
    for choice in ({"hemisphere": False}, {"outside": "open"}, {"outside": 3.0}):
        entry = TECHNIQUES["ssao"]
        make: Any = entry.technique
        technique = make(runtime, SIZE, entry.params(**choice))  # type: ignore[arg-type]
        assert technique.reach(gbuffer) is None


def test_lights_that_are_left_out_light_nothing(runtime: Runtime, rng: np.random.Generator) -> None:
    camera = analytic.camera("perspective", SIZE)
    device = uploaded(runtime, corner(camera))
    summary = Tiles(runtime, SIZE).look(device)
    shading = PunctualLights(runtime, SIZE)
    left_out = 0
    for _ in range(25):
        place, aim = rng.uniform(-3.0, 3.0, 3), rng.standard_normal(3)
        punctual_lights: list[PunctualLight] = [
            PointLight(place, 1.0),
            SpotLight(place, aim, rng.uniform(0.1, 1.2), 1.0),
            DirectionalLight(aim, 1.0),
        ]
        reach = reaching(punctual_lights, summary.boxes, camera)
        for punctual_light, reaches in zip(punctual_lights, reach, strict=True):
            with runtime.frame():
                plane = shading.run(device, [punctual_light])
                assert plane is not None
                dark = not plane.download().any()
            if not reaches:
                assert dark, punctual_light
                left_out += 1
    assert left_out >= 5


def test_a_light_below_the_floor_or_aimed_away_is_left_out(runtime: Runtime) -> None:
    camera = analytic.camera("perspective", SIZE)
    floor = analytic.Plane((0.0, -0.3, 0.0), (0.0, 1.0, 0.0), ((0.0, 0.0, 1.0), -4.0))
    device = uploaded(runtime, analytic.trace(camera, [floor]))
    summary = Tiles(runtime, SIZE).look(device)
    punctual_lights: list[PunctualLight] = [
        PointLight((0.0, -3.0, 0.0), 1.0),
        DirectionalLight((0.0, 1.0, 0.0), 1.0),
        PointLight((0.0, 1.0, 0.0), 1.0),
        SpotLight((0.0, 5.0, 0.0), (0.0, -1.0, 0.0), 0.1, 1.0),
    ]
    assert reaching(punctual_lights, summary.boxes, camera).tolist() == [False, False, True, True]
    assert math.isfinite(summary.boxes.greatest.max())
    near = Tiles(runtime, SIZE).look(uploaded(runtime, corner(camera)))
    away = SpotLight((0.0, 5.0, 0.0), (0.0, 1.0, 0.0), 1.0, 1.0)
    assert not reaching([away], near.boxes, camera)[0]
