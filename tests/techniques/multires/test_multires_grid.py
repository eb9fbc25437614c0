"""Levels of points: against the numpy reference, formulas, and what interpolation may never do."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.multires.multires_grid import multires_grid_reference
from ssgi_cl.techniques.multires import multires_grid
from ssgi_cl.techniques.multires.multires_grid import MultiresGrid, MultiresGridParams, tile_order

from ..analytic import CAMERAS, SCENES, camera, scene, tilted, trace

SIZE = (75, 101)
EXACT = 2e-5
"""Of a value of about 1: float32 against float64, through five levels of weighted means."""
FLIPS = 4e-3
"""Share of pixels that differ more: grazing surfaces, and points that pass a limit in one of both.
Found: 1.7e-3."""

Doubles = NDArray[np.float64]


def light(size: tuple[int, int], sharp: float = 0.0) -> Doubles:
    """Return three smooth images >= 0.5, and an edge of width 1 px and height `sharp` in them."""
    y, x = np.indices(size)
    waves = [np.sin(x / 17.0) * np.cos(y / 13.0), np.sin((x + 2 * y) / 31.0), np.cos(y / 9.0)]
    edge = sharp / (1.0 + np.exp(-np.clip(4.0 * (x - 0.6 * y - 20.3), -50.0, 50.0)))
    return 1.5 + np.stack(waves, axis=-1) + edge[..., None]


def fill(
    grid: MultiresGrid, gbuffer: DeviceGBuffer, truth: Doubles, bound: float
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the result where listed pixels get their share of `truth`, and which those are."""
    images = np.moveaxis(truth, -1, 0)
    limit = grid.runtime.array(np.array([bound], np.float32))
    for level in grid.levels(gbuffer, limit):
        values = level.values.download()
        points = tuple(level.listed().T)
        fractions = level.fractions.download()[0][points]
        assert ((fractions > 0.0) & (fractions <= 1.0)).all()
        values[:, *points] += fractions * images[:, :: level.step, :: level.step][:, *points]
        level.values.upload(values)
    return np.moveaxis(grid.result.download(), 0, -1), grid.computed()


def run(
    runtime: Runtime, gbuffer: GBuffer, truth: Doubles, bound: float = 0.02, **params: float
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    grid = MultiresGrid(runtime, gbuffer.size, MultiresGridParams(**params), channels=truth.shape[-1])
    return fill(grid, on_device(gbuffer, runtime), truth, bound)


def inner(gbuffer: GBuffer, name: str) -> NDArray[np.float32]:
    array = gbuffer.first(name)
    assert array is not None
    return gbuffer.inner(array)


def there(gbuffer: GBuffer) -> NDArray[np.bool_]:
    return np.isfinite(inner(gbuffer, "depth"))


# ---- against the numpy reference


@pytest.mark.parametrize("bound", [0.0, 0.02, math.inf])
@pytest.mark.parametrize("name", SCENES)
def test_every_kernel_variant_agrees_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, name: str, bound: float
) -> None:
    gbuffer = scene(name, camera(size=SIZE), rng)
    truth = light(SIZE, 0.5)
    values, computed = run(variant_runtime, gbuffer, truth, bound)
    expected, steps = multires_grid_reference(gbuffer, truth, bound, MultiresGridParams())
    off = (np.abs(values - expected) > EXACT).any(axis=-1)
    # With no error allowed, whether something is a straight line is decided by rounding.
    assert off.mean() <= FLIPS
    if bound > 0.0:
        assert (computed != steps).mean() <= FLIPS


@pytest.mark.parametrize("kind", CAMERAS)
def test_kernel_agrees_with_numpy_reference_in_every_camera_and_with_a_margin(
    runtime: Runtime, rng: np.random.Generator, kind: str
) -> None:
    gbuffer = scene("ball", camera(kind, SIZE), rng, margin=(3, 6))
    values, computed = run(runtime, gbuffer, light(SIZE))
    expected, steps = multires_grid_reference(gbuffer, light(SIZE), 0.02, MultiresGridParams())
    assert (np.abs(values - expected) > EXACT).any(axis=-1).mean() <= FLIPS
    assert (computed != steps).mean() <= FLIPS


@pytest.mark.parametrize("name", ["bumpy", "noisy"])
def test_every_kernel_variant_gives_bit_identical_results_and_order(
    runtime: Runtime, other_variant: Runtime, rng: np.random.Generator, name: str
) -> None:
    gbuffer = scene(name, camera(size=SIZE), rng)
    truth = light(SIZE, 0.5)[..., :1]
    results, orders = [], []
    for used in (runtime, other_variant):
        grid = MultiresGrid(used, SIZE, channels=1)
        results.append(fill(grid, on_device(gbuffer, used), truth, 0.02)[0])
        orders.append(np.concatenate([level.listed() for level in grid._levels]))
    np.testing.assert_array_equal(*results)
    np.testing.assert_array_equal(*orders)


@pytest.mark.parametrize(("counted", "groups"), [(0, 256), (0, 3), (1 << 30, 3)])
def test_lists_are_the_same_however_many_work_groups_make_them(
    runtime: Runtime,
    plain_images: Runtime,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
    counted: int,
    groups: int,
) -> None:
    """Tiles counted by a pass before or not, and one, or several one after the other, for a work-group."""
    gbuffer = scene("noisy", camera(size=(180, 230)), rng)
    truth = light((180, 230), 0.5)[..., :1]
    orders = []
    for used in (runtime, plain_images):
        monkeypatch.setattr(multires_grid, "COUNTED", counted)
        monkeypatch.setattr(multires_grid, "MOST_LISTING", groups)
        grid = MultiresGrid(used, (180, 230), channels=1)
        fill(grid, on_device(gbuffer, used), truth, 0.02)
        orders.append(np.concatenate([level.listed() for level in grid._levels]))
    assert len(orders[0]) > 10_000
    np.testing.assert_array_equal(*orders)


# ---- what the result is


@pytest.mark.parametrize("degrees", [0.0, 20.0, 40.0])
def test_linear_light_on_a_tilted_plane_needs_the_coarsest_level_alone(runtime: Runtime, degrees: float) -> None:
    seen = camera(size=(65, 97))
    gbuffer = trace(seen, [tilted(seen, degrees)])
    y, x = np.indices(gbuffer.size)
    truth = (1.0 + 0.02 * x + 0.03 * y)[..., None]
    values, computed = run(runtime, gbuffer, truth, 0.05)
    # 65 and 97 are 1 more than multiples of 16, so that no point lies beyond the last one.
    np.testing.assert_array_equal(computed != 0, (x % 16 == 0) & (y % 16 == 0))
    np.testing.assert_allclose(values, truth, rtol=1e-5)


def test_constant_light_is_constant_whatever_the_geometry(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("noisy", camera(size=SIZE), rng)
    values, _ = run(runtime, gbuffer, np.full((*SIZE, 3), 0.7))
    expected = np.where(there(gbuffer), np.float32(0.7), 0.0)[..., None]
    # A weighted mean of equal numbers rounds five times at most on its way to a pixel.
    np.testing.assert_allclose(values, np.broadcast_to(expected, values.shape), rtol=1e-6)


def test_surfaces_never_mix(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("step", camera(size=SIZE), rng)
    depth = inner(gbuffer, "depth")
    near = depth < 0.5 * (depth.min() + depth.max())
    truth = np.where(near, 1.0, 5.0)[..., None]
    assert near.any()
    assert not near.all()
    values, _ = run(runtime, gbuffer, truth, math.inf)
    np.testing.assert_allclose(values, truth, rtol=1e-5)


def test_a_sharp_edge_of_light_on_a_flat_wall_is_kept(runtime: Runtime) -> None:
    seen = camera(size=(96, 128))
    gbuffer = trace(seen, [tilted(seen, 30.0)])
    truth = light(gbuffer.size, 2.0)
    values, computed = run(runtime, gbuffer, truth, 0.02)
    # The bound at the finest level is four times that at a step of 8.
    assert np.sqrt(np.mean((values - truth) ** 2)) < 0.03
    assert 0.02 < np.mean(computed != 0) < 0.2


def test_a_smaller_bound_gives_a_smaller_error_for_more_points(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("ball", camera(size=SIZE), rng)
    truth = light(SIZE, 0.5)
    made = [run(runtime, gbuffer, truth, bound) for bound in (0.2, 0.05, 0.01, 0.002)]
    errors = [np.sqrt(np.mean((values - truth)[there(gbuffer)] ** 2)) for values, _ in made]
    counts = [np.count_nonzero(computed) for _, computed in made]
    assert errors == sorted(errors, reverse=True)
    assert counts == sorted(counts)


def test_points_that_pass_the_bound_do_not_jump(runtime: Runtime) -> None:
    seen = camera(size=(96, 128))
    gbuffer = trace(seen, [tilted(seen, 30.0)])
    truth = light(gbuffer.size, 2.0)
    bounds = 0.02 * 1.003 ** np.arange(4)
    made = [run(runtime, gbuffer, truth, bound)[0] for bound in bounds]
    jumps = np.array([np.abs(b - a).max() for a, b in pairwise(made)])
    errors = np.abs(made[0] - truth)
    # An error near the bound of 0.07 at the finest level; a hundredth of the fade is passed.
    assert errors.max() > 0.07
    assert (jumps < 0.02 * errors.max()).all()


def test_with_a_step_of_1_every_pixel_is_computed(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(size=SIZE), rng)
    values, computed = run(runtime, gbuffer, light(SIZE), coarsest=1)
    np.testing.assert_array_equal(computed, there(gbuffer))
    np.testing.assert_array_equal(values, np.where(there(gbuffer)[..., None], light(SIZE), 0.0).astype(np.float32))


def test_the_bound_is_read_on_the_device_when_a_level_is_planned(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = on_device(scene("corner", camera(size=SIZE), rng), runtime)
    grid = MultiresGrid(runtime, SIZE)
    bound = runtime.array(np.array([0.0], np.float32))
    for level in grid.levels(gbuffer, bound):
        level.values.upload(np.moveaxis(light(SIZE, 1.0)[:: level.step, :: level.step], -1, 0))
        bound.upload(np.array([1e6], np.float32))
    assert sum(grid.counts().values()) < 0.1 * SIZE[0] * SIZE[1]


# ---- lists


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (16, 16), (17, 33), (100, 7), (150, 260)])
def test_tiles_are_all_there_once_and_in_the_order_of_a_z_curve(size: tuple[int, int]) -> None:
    order = tile_order(size)
    rows, columns = order >> 16, order & 0xFFFF
    expected = {(y, x) for y in range(-(-size[0] // 16)) for x in range(-(-size[1] // 16))}
    assert len(order) == len(expected)
    assert set(zip(rows.tolist(), columns.tolist(), strict=True)) == expected
    if size == (150, 260):
        first = [(int(y), int(x)) for y, x in zip(rows[:6], columns[:6], strict=True)]
        assert first == [(0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (0, 3)]


def test_sixteen_points_in_a_row_of_the_list_are_a_block(runtime: Runtime) -> None:
    seen = camera(size=(80, 96))
    grid = MultiresGrid(runtime, (80, 96), MultiresGridParams(coarsest=1))
    gbuffer = on_device(trace(seen, [tilted(seen, 10.0)]), runtime)
    (level,) = grid.levels(gbuffer, runtime.array(np.zeros(1, np.float32)))
    points = level.listed()
    assert len(np.unique(points, axis=0)) == 80 * 96
    for length, side in ((16, 4), (64, 8), (256, 16)):
        blocks = points.reshape(-1, length, 2)
        assert (np.ptp(blocks, axis=1) == side - 1).all()


# ---- sizes, contents, memory


@pytest.mark.parametrize("size", [(1, 1), (1, 33), (40, 1), (5, 7), (16, 16), (33, 18)])
def test_every_size_works(variant_runtime: Runtime, size: tuple[int, int]) -> None:
    seen = camera(size=size)
    gbuffer = trace(seen, [tilted(seen, 20.0)])
    truth = light(size)
    values, computed = run(variant_runtime, gbuffer, truth)
    expected, steps = multires_grid_reference(gbuffer, truth, 0.02, MultiresGridParams())
    np.testing.assert_allclose(values, expected, atol=EXACT)
    np.testing.assert_array_equal(computed, steps)


def test_an_empty_image_has_no_points(runtime: Runtime) -> None:
    gbuffer = trace(camera(size=SIZE), [])
    values, computed = run(runtime, gbuffer, light(SIZE))
    assert not values.any()
    assert not computed.any()


def test_the_margin_does_not_count(runtime: Runtime, rng: np.random.Generator) -> None:
    results = [
        run(runtime, scene("corner", camera(size=SIZE), rng, margin=margin), light(SIZE))
        for margin in ((0, 0), (5, 16), (7, 3))
    ]
    for values, computed in results[1:]:
        # Slopes of view rays are counted from another corner: the last bit differs.
        np.testing.assert_array_equal(computed, results[0][1])
        np.testing.assert_allclose(values, results[0][0], atol=EXACT)


def test_a_second_frame_allocates_and_compiles_nothing(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = on_device(scene("bumpy", camera(size=SIZE), rng), runtime)
    grid = MultiresGrid(runtime, SIZE)
    first, _ = fill(grid, gbuffer, light(SIZE), 0.02)
    before = (runtime.allocated_bytes, runtime.builds)
    second, _ = fill(grid, gbuffer, light(SIZE), 0.02)
    np.testing.assert_array_equal(first, second)
    bound = runtime.array(np.zeros(1, np.float32))
    assert (runtime.allocated_bytes - bound.count * 4 * 2, runtime.builds) == before


def test_a_camera_moved_a_hundredth_of_a_pixel_changes_little(runtime: Runtime, rng: np.random.Generator) -> None:
    made = []
    for shift in (0.0, 0.01):
        seen = camera(size=(96, 128))
        width = 2.0 * shift / 128.0  # of the image plane, which is 2 wide
        matrix = seen.projection.copy()
        matrix[0, 2] += width
        moved = type(seen)(view=seen.view, projection=matrix, width=128, height=96)
        gbuffer = scene("corner", moved, np.random.default_rng(1))
        values, _ = run(runtime, gbuffer, light((96, 128), 0.5), 0.01)
        made.append((values, inner(gbuffer, "normal")))
    (a, normal), (b, moved_normal) = made
    same = (normal == moved_normal).all(axis=-1)  # the others see another wall
    changed = (np.abs(a - b).max(axis=-1) > 0.01 * a.mean())[same]
    assert changed.mean() < 2e-3


# ---- bad input


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"coarsest": 12}, r"coarsest is 12: expected one of \(1, 2, 4, 8, 16, 32\) \(px\)"),
        ({"coarsest": 64}, "coarsest is 64"),
        ({"plane_tolerance": 0.0}, "plane_tolerance is 0"),
        ({"normal_tolerance": 4.0}, "normal_tolerance is 4"),
    ],
)
def test_parameters_out_of_range_are_refused(params: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MultiresGridParams(**params)


def test_a_wrong_gbuffer_or_number_of_channels_is_refused(runtime: Runtime) -> None:
    bound = runtime.array(np.zeros(1, np.float32))
    with pytest.raises(ValueError, match=r"the G-buffer's size is \(4, 5\): expected \(3, 3\)"):
        next(MultiresGrid(runtime, (3, 3)).levels(DeviceGBuffer(runtime, (4, 5)), bound))
    with pytest.raises(ValueError, match="the device G-buffer is empty"):
        next(MultiresGrid(runtime, (4, 5)).levels(DeviceGBuffer(runtime, (4, 5)), bound))
    with pytest.raises(ValueError, match="channels is 17: expected 1 to 16"):
        MultiresGrid(runtime, (3, 3), channels=17)
