"""kernels/common/gbuffer.clh: planes, their guard, and images that hold the same."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.device.arrays import GUARD, Plane, Size
from ssgi_cl.device.runtime import Runtime

from .expression import run_expressions

PLANES = "common/gbuffer.clh"
SIZES = [(1, 1), (3, 15), (2, 16), (2, 17), (17, 31), (5, 64)]
TALL = (9000, 5)
"""More rows than an image has, if there is more than one."""
OUTSIDE = -7.5

LOAD = """
#include "common/gbuffer.clh"
// Every position that a load may have, on both sides of the row.
__kernel void load(ssgi_plane plane, __global float *restrict result, const int2 size,
                   const int starts)
{
    const int start = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    const vfloat value = ssgi_load(plane, size, row / size.y, start - SSGI_GUARD, row % size.y);
    v_store(value, result + (row * starts + start) * SSGI_LANES);
}
"""

LOAD_AT = """
#include "common/gbuffer.clh"
// The same, but by the number of the row's first pixel, reached from that of pixel (1, 0).
__kernel void load_at(ssgi_plane plane, __global float *restrict result, __global int *restrict indices,
                      const int2 size, const int starts)
{
    const int start = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    const int pixel =
        ssgi_pixel(size, 1, 0) + row % size.y * ssgi_below(size) + start - SSGI_GUARD - 1;
    const int to = row * starts + start;
    v_store(ssgi_load_at(plane, size, row / size.y, pixel), result + to * SSGI_LANES);
    indices[to] = ssgi_pixel_index(size, pixel);
}
"""

STORE = """
#include "common/gbuffer.clh"
__kernel void store(ssgi_plane plane, __global float *restrict result, const int2 size,
                    const int images, const float outside)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    for (int i = 0; i < images; ++i) {
        ssgi_store(ssgi_load(plane, size, i, x, y) + 1.0f, result, size, i, x, y, outside);
    }
}
"""


def filled(runtime: Runtime, count: int, size: Size) -> tuple[Plane, NDArray[np.float32]]:
    """A plane of numbers that are all different, and those numbers."""
    values = np.arange(1, count * size[0] * size[1] + 1, dtype=np.float32)
    plane = runtime.plane(count, size, OUTSIDE)
    plane.upload(values.reshape(count, *size))
    return plane, values.reshape(count, *size)


def memory_of(plane: Plane) -> NDArray[np.float32]:
    """A copy of all of a plane's memory, guard included."""
    with plane._mapped() as memory:
        return np.array(memory)


def positions(values: NDArray[np.float32], lanes: int) -> NDArray[np.float32]:
    """What loads of so many lanes give at every column from a guard's width left of the image on, row by row."""
    wide = np.pad(values, ((0, 0), (0, 0), (GUARD, GUARD)), constant_values=OUTSIDE)
    return np.lib.stride_tricks.sliding_window_view(wide, lanes, axis=2).reshape(-1, lanes)


@pytest.mark.parametrize("size", SIZES)
def test_loads_give_the_outside_value_up_to_the_guard_on_both_sides(every_variant: Runtime, size: Size) -> None:
    plane, values = filled(every_variant, 3, size)
    lanes = every_variant.variant.lanes
    expected = positions(values, lanes)
    starts = len(expected) // (3 * size[0])
    result = every_variant.empty(expected.size, np.float32)
    kernel = every_variant.kernel_from_text("load", LOAD)
    kernel.run(size, grid=(3 * size[0], starts), local=(1, 1), plane=plane, result=result, starts=starts)
    np.testing.assert_array_equal(result.download().reshape(expected.shape), expected)


@pytest.mark.parametrize("size", [*SIZES, TALL])
def test_loads_by_number_give_the_same(every_variant: Runtime, size: Size) -> None:
    plane, values = filled(every_variant, 2, size)
    lanes = every_variant.variant.lanes
    expected = positions(values, lanes)
    starts = len(expected) // (2 * size[0])
    given = {"result": every_variant.empty(expected.size, np.float32)}
    given["indices"] = every_variant.empty(len(expected), np.int32)
    kernel = every_variant.kernel_from_text("load_at", LOAD_AT)
    kernel.run(size, grid=(2 * size[0], starts), local=(1, 1), plane=plane, starts=starts, **given)
    np.testing.assert_array_equal(given["result"].download().reshape(expected.shape), expected)
    rows = np.arange(1, size[0] + 1)[:, None] * plane.pitch + np.arange(starts) - GUARD
    np.testing.assert_array_equal(given["indices"].download(), np.tile(rows.ravel(), 2))


@pytest.mark.parametrize("size", [*SIZES, TALL])
def test_gathers_read_any_pixel_of_any_image(every_variant: Runtime, size: Size, rng: np.random.Generator) -> None:
    plane, values = filled(every_variant, 3, size)
    x = rng.integers(0, size[1], 100).astype(np.int32)
    y = rng.integers(0, size[0], 100).astype(np.int32)
    expressions = {str(image): f"ssgi_gather(plane, size, {image}, x, y)" for image in range(3)}
    expressions["index"] = "v_splat((float)(ssgi_index(size, 1, 2, 3) + SSGI_GUARD))"
    read = run_expressions(every_variant, PLANES, expressions, planes={"plane": plane}, x=x, y=y)
    for image in range(3):
        np.testing.assert_array_equal(read[str(image)], values[image, y, x])
    # The pitch is that of the host.
    assert (read["index"] == (size[0] + 3 + 1) * plane.pitch + 2 + GUARD).all()


@pytest.mark.parametrize("size", [*SIZES, TALL])
def test_stores_leave_the_guard_as_it_is(every_variant: Runtime, size: Size) -> None:
    plane, values = filled(every_variant, 2, size)
    values[0, 0, 0] = values[1, -1, -1] = np.inf  # infinities pass through, inside and outside
    plane.upload(values)
    result = every_variant.plane(2, size, np.inf)
    kernel = every_variant.kernel_from_text("store", STORE)
    kernel.run(size, plane=plane, result=result, images=2, outside=np.inf)
    expected = np.full((2 * size[0] + 2, result.pitch), np.inf, np.float32)
    expected[1:-1, : size[1]] = (values + 1.0).reshape(-1, size[1])
    np.testing.assert_array_equal(memory_of(result), expected)
    np.testing.assert_array_equal(result.download(), values + 1.0)


def test_what_a_kernel_wrote_is_what_the_next_one_reads(every_variant: Runtime) -> None:
    # With images the second kernel reads a copy, which must be made anew.
    plane, values = filled(every_variant, 1, (3, 20))
    other = every_variant.plane(1, (3, 20), OUTSIDE)
    kernel = every_variant.kernel_from_text("store", STORE)
    last = {"images": 1, "outside": OUTSIDE}
    for _ in range(2):
        kernel.run((3, 20), plane=plane, result=other, **last)
        kernel.run((3, 20), plane=other, result=plane, **last)
    np.testing.assert_array_equal(plane.download(), values + 4.0)
    plane.upload(values)
    kernel.run((3, 20), plane=plane, result=other, **last)
    np.testing.assert_array_equal(other.download(), values + 1.0)
