"""The occupancy grid: triangles in it against the reference, shadows of what no camera sees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.reference.occupancy.occupancy_grid import OccupancyGridReference, voxelized
from ssgi_cl.reference.vpl.vpl_splat import receivers
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.occupancy.occupancy_grid import Occupancy, OccupancyGrid
from ssgi_cl.techniques.radiosity.air import Air
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams, vpl_splat

from ...closed_forms import Quad, quads
from ...closed_forms import made as scene_of
from ...truth.surfaces import quads as textured_quads
from ..vpl.given import uploaded

Doubles = NDArray[np.float64]
FLOOR: Quad = ((-2, 0, -1), (4, 0, 0), (0, 0, 2))
CELLS = 64
CELL = 4.0 / (CELLS - 6)
"""Length of a cell in metres where the floor is the widest."""
NOTHING = quads(((-2, -3, -1), (4, 0, 0), (0, 0, 2)))
"""A scene too low to block any light."""


def from_above(scene: Scene, runtime: Runtime, height: float = 3.0, layers: int = 1) -> GBuffer:
    """The floor from straight above, where upright walls are seen edge-on: not at all."""
    camera = Camera.orthographic((0, height, 0), (0, 0, 0), (0, 0, -1), view_height=2.0, width=128, height=64)
    return drawn(scene, camera, layers=layers, runtime=runtime)


def punctual_lights(at: tuple[float, float, float], normal: tuple[float, float, float]) -> Vpls:
    """16 lights at one place, so that each pixel of an interleaved pattern has one."""
    return Vpls(
        np.tile(np.array(at, np.float64), (16, 1)),
        np.tile(np.array(normal, np.float64), (16, 1)),
        np.ones((16, 3)),
        np.full(16, 1e-4),
    )


def held_by(walls: Occupancy) -> NDArray[np.bool_]:
    """Return [z, y, x] which cells of a grid are occupied."""
    n = walls.cells // 4
    words = walls.grid.download()[: walls.cells**3 // 32].view(np.uint32)
    bits = (words[:, None] >> np.arange(32, dtype=np.uint32)) & 1
    blocks = bits.astype(np.bool_).reshape(n, n, n, 2, 2, 4, 4)
    return blocks.transpose(0, 3, 4, 1, 5, 2, 6).reshape((walls.cells,) * 3)


def lit(runtime: Runtime, kind: str, gbuffer: GBuffer, vpls: Vpls, scene: Scene | None) -> tuple[Doubles, Any]:
    """Return irradiance [rows, columns], and what made it."""
    device, given = uploaded(runtime, gbuffer), {"vpls": len(vpls), "visibility": True, "grid": CELLS}
    technique: Any
    solid = None if scene is None else device_scene(scene, runtime)
    if kind == "multires":
        technique = MultiresSplat(runtime, gbuffer.size, MultiresSplatParams(**given, coarsest=1, light_error=0.0))
        found = technique.gather(device, vpls, scene=solid)
        technique.filled = found.occupancy
        return found.irradiance.download()[0].astype(np.float64), technique
    params = VplSplatParams(**given, cutoff=0.0, interleave=True, blur_radius=0)
    technique = VplSplat(runtime, gbuffer.size, params)
    return technique.run(device, vpls, scene=solid).download()[0].astype(np.float64), technique


def floor_at(gbuffer: GBuffer) -> tuple[Doubles, Doubles]:
    """Return x and z [rows, columns] of the floor's pixels, nan elsewhere."""
    there, point, _ = receivers(gbuffer)
    x, z = np.full((2, *there.shape), np.nan)
    floor = np.abs(point[:, 1]) < 1e-3
    x[there], z[there] = (np.where(floor, point[:, i], np.nan) for i in (0, 2))
    return x, z


# ---- triangles


@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_kernel_occupies_the_cells_of_the_reference(
    variant_runtime: Runtime, rng: np.random.Generator, shift: float
) -> None:
    parts: list[Quad] = [FLOOR]
    for size in (0.01, 0.05, 0.3, 2.0):
        for _ in range(12):
            corner = rng.uniform((-2, 0, -1), (2, 1, 1))
            parts.append((corner, size * rng.standard_normal(3), size * rng.standard_normal(3)))
    # A sliver, a triangle seen edge-on along two axes, and one without area.
    parts += [
        ((-1, 0.3, 0), (2, 0.001, 0.7), (0, 0.001, 0)),
        ((-1, 0.5, 0.5), (1, 0, 0), (0, 0.3, 0)),
        ((0, 0.5, 0), (1, 0, 0), (2, 0, 0)),
    ]
    scene = quads(*parts, shift=shift)
    camera = Camera.look_at(np.array([1.0, 2.0, 4.0]) + shift, np.array([0.1, 0.3, 0.0]) + shift, width=40, height=30)
    gbuffer = drawn(scene, camera, runtime=variant_runtime)
    vpls = punctual_lights((shift, 1.0 + shift, shift), (0, -1, 0))
    _, technique = lit(variant_runtime, "multires", gbuffer, vpls, scene)
    held = held_by(technique.filled)
    box = technique.filled.box.download().astype(np.float64)
    unit = technique._lights.unit
    view = camera.view
    corners = (scene.positions.astype(np.float64) + scene.origin) @ view[:3, :3].T + view[:3, 3]
    reference = OccupancyGridReference(
        np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), [], CELLS, corners[scene.triangles]
    )
    # In the kernel's own box, whose place is rounded; see the tests of rays for the reference's.
    reference.cell, reference.corner = unit / box[3], unit * box[:3]
    reference.held[:] = False
    reference.occupy(corners[scene.triangles])
    assert held.sum() > 2000
    # Triangles are a thousandth of a cell wider, and corners round by 1e-4 of one at 1e5 m.
    assert np.mean(held != reference.held) * held.size < 0.01 * held.sum()


def test_holes_of_a_cut_out_texture_let_light_pass(runtime: Runtime) -> None:
    texture = np.full((2, 2, 4), 255, np.uint8)
    texture[:, 1, 3] = 0  # the half with u > 0.5: z > 0
    lid: Quad = ((-0.8, 0.5, -0.8), (1.6, 0, 0), (0, 0, 1.6))
    scene = textured_quads(
        FLOOR, lid, textures=(texture,), materials=[Material(), Material(texture=0, alpha_cutoff=0.5)]
    )
    floor = quads(FLOOR)
    gbuffer, vpls = from_above(floor, runtime), punctual_lights((0, 1.5, 0), (0, -1, 0))
    shadowed, _ = lit(runtime, "multires", gbuffer, vpls, scene)
    free, _ = lit(runtime, "multires", gbuffer, vpls, NOTHING)
    x, z = floor_at(gbuffer)
    # The lid is at a third of the way down: its shadow is half as wide again.
    under, margin = np.abs(x) < 1.0, 6 * CELL
    holes = {side: (shadowed / free)[under & (np.abs(z) < 0.9) & (side * z > margin)].mean() for side in (-1, 1)}
    assert sorted(round(share, 6) for share in holes.values()) == [0.0, 1.0]


# ---- shadows in closed form, of what the camera doesn't see


@pytest.mark.parametrize("kind", ["multires", "vpl"])
def test_a_thin_wall_that_nobody_sees_shadows_the_floor_behind_it(variant_runtime: Runtime, kind: str) -> None:
    scene = quads(FLOOR, ((0, 0, -1), (0, 0.2, 0), (0, 0, 2)))
    gbuffer = from_above(scene, variant_runtime)
    vpls = punctual_lights((-0.6, 0.4, 0), (0.8, -0.6, 0))
    free, _ = lit(variant_runtime, kind, gbuffer, vpls, NOTHING)
    solid, _ = lit(variant_runtime, kind, gbuffer, vpls, scene)
    seen, _ = lit(variant_runtime, kind, gbuffer, vpls, None)
    x, _ = floor_at(gbuffer)
    # By similar triangles the shadow ends at 0.6 m x 0.2 / (0.4 - 0.2).
    end, margin = 0.6, 3.0 * CELL
    dark, bright = (x > 2.0 * CELL) & (x < end - margin), (x > end + margin) & (x < 1.9)
    before = (x < -margin) & (x > -0.5)
    np.testing.assert_array_equal(solid[dark], 0.0)
    for open_ in (bright, before):
        np.testing.assert_allclose(solid[open_], free[open_], rtol=1e-5)
    # The camera sees the wall edge-on, so a grid of what it sees has no wall.
    np.testing.assert_allclose(seen[dark], free[dark], rtol=1e-5)


@pytest.mark.parametrize("kind", ["multires", "vpl"])
@pytest.mark.parametrize("tilt", [0.0, 0.31])
def test_light_passes_a_gap_of_two_cells(variant_runtime: Runtime, kind: str, tilt: float) -> None:
    half = CELL  # of the gap
    parts: list[Quad] = [((0, 0, side * half), (0, 0.9, 0), (tilt, 0, side * 0.9)) for side in (-1, 1)]
    scene = quads(FLOOR, *parts)
    gbuffer = from_above(scene, variant_runtime)
    vpls = punctual_lights((-1.0, 0.5, 0), (1, 0, 0))
    free, _ = lit(variant_runtime, kind, gbuffer, vpls, NOTHING)
    solid, _ = lit(variant_runtime, kind, gbuffer, vpls, scene)
    x, z = floor_at(gbuffer)
    beyond = (x > 0.5) & (x < 1.5)
    # From the lights at x = -1 the gap is seen twice as wide at x = 1.
    inside = beyond & (np.abs(z) < 0.2 * half * (x + 1.0))
    outside = beyond & (np.abs(z) > (half + 1.5 * CELL) * (x + 1.0)) & (np.abs(z) < 0.9)
    assert inside.sum() > 20
    np.testing.assert_allclose(solid[inside], free[inside], rtol=1e-5)
    np.testing.assert_array_equal(solid[outside], 0.0)


def test_a_box_under_a_plate_and_a_ceiling_above_the_camera_block_light(runtime: Runtime) -> None:
    plate: Quad = ((-0.3, 0.9, -1), (0.6, 0, 0), (0, 0, 2))
    box = [((x, 0, -1), (0, 0.5, 0), (0, 0, 2)) for x in (-0.1, 0.1)]
    scene = quads(FLOOR, plate, *box, ((-0.1, 0.5, -1), (0.2, 0, 0), (0, 0, 2)))
    gbuffer, vpls = from_above(scene, runtime), punctual_lights((-1.0, 0.3, 0), (1, 0, 0))
    x, _ = floor_at(gbuffer)
    behind = (x > 0.4) & (x < 1.5)
    assert behind.any()
    shadowed = vpl_sum(runtime, gbuffer, vpls, scene, behind)
    leaking = vpl_sum(runtime, gbuffer, vpls, None, behind)
    assert shadowed == 0.0
    assert leaking > 0.0

    ceiling: Quad = ((-2, 1, -1), (4, 0, 0), (0, 0, 2))
    scene = quads(FLOOR, ceiling)
    gbuffer, vpls = from_above(scene, runtime, height=0.8), punctual_lights((0, 2.0, 0), (0, -1, 0))
    every = np.ones(gbuffer.size, np.bool_)
    assert vpl_sum(runtime, gbuffer, vpls, scene, every) == 0.0
    assert vpl_sum(runtime, gbuffer, vpls, None, every) > 0.0


def vpl_sum(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls, scene: Scene | None, where: NDArray[np.bool_]) -> float:
    """Return the light that both techniques find in a part of the image."""
    return sum(float(lit(runtime, kind, gbuffer, vpls, scene)[0][where].sum()) for kind in ("multires", "vpl"))


@pytest.mark.parametrize("height", [0.0, 0.7])
def test_flat_and_tilted_planes_don_t_shadow_themselves(runtime: Runtime, height: float) -> None:
    floor: Quad = ((-2, 0, -1), (4, height, 0), (0, 0.4 * height, 2))
    scene = quads(floor)
    gbuffer = from_above(scene, runtime)
    vpls = punctual_lights((0, 1.5, 0), (0, -1, 0))
    for kind in ("multires", "vpl"):
        free, _ = lit(runtime, kind, gbuffer, vpls, NOTHING)
        solid, _ = lit(runtime, kind, gbuffer, vpls, scene)
        np.testing.assert_allclose(solid, free, rtol=1e-5)


def test_scene_of_another_type_is_refused(runtime: Runtime) -> None:
    gbuffer = from_above(quads(FLOOR), runtime)
    with pytest.raises(TypeError, match=r"scene is int: expected a Scene"):
        vpl_splat(gbuffer, [], scene=3, interleave=True, visibility=True, runtime=runtime)  # type: ignore[arg-type]


def test_small_triangles_occupy_the_cells_of_the_reference(runtime: Runtime) -> None:
    """Most lie between all columns of cells along an axis, and are left out early."""
    rng = np.random.default_rng(4)
    middle = rng.uniform(-0.9, 0.9, (2000, 1, 3))
    corners = (middle + rng.normal(0.0, 0.015, (2000, 3, 3))).astype(np.float32)
    scene = scene_of(corners.reshape(-1, 3), np.arange(6000).reshape(-1, 3))
    filled = OccupancyGrid(runtime, CELLS, (1, 1)).fill_scene(device_scene(scene, runtime), np.eye(4), 1.0, -1.0, 1.0)
    box = filled.box.download().astype(np.float64)
    held = Air.of(filled.grid.download(), CELLS).numbers == 0
    expected = np.zeros_like(held)
    for triangle in (corners - box[:3]) * box[3]:
        x, y, z = voxelized(triangle, CELLS).T
        expected[z, y, x] = True
    assert 500 < expected.sum() < 0.6 * expected.size
    assert not (expected & ~held).any()
    # Triangles of some .3 cells are .001 cells wider on all sides: 2 % larger.
    assert (held & ~expected).sum() < 0.04 * expected.sum()
