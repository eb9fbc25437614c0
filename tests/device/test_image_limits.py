"""Images are no larger than the device has them, and hold the same however small they are."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.image_limits import VARIABLE, ImageLimits
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.ao.ssao import ssao


def opened(monkeypatch: pytest.MonkeyPatch, limit: str) -> Runtime:
    """Return a runtime whose kernels read images of at most this size."""
    monkeypatch.setenv(VARIABLE, limit)
    try:
        return Runtime.open(lanes=1, storage="image")
    except DeviceError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("rows", [1, 2, 61, 62, 63, 126, 127, 200])
@pytest.mark.parametrize("count", [1, 3])
def test_every_pixel_is_read_wherever_rows_end(monkeypatch: pytest.MonkeyPatch, rows: int, count: int) -> None:
    # With the rows before and after, images of 62 and 126 rows fill their columns of 64 exactly.
    runtime = opened(monkeypatch, "64x8192")
    values = np.arange(count * rows * 3, dtype=np.float32).reshape(count, rows, 3)
    plane, result = runtime.plane(count, (rows, 3), -7.0), runtime.plane(2 * count, (rows, 3))
    plane.upload(values)
    text = """
    #include "common/gbuffer.clh"
    __kernel void copy(ssgi_plane source, __global float *restrict to, const int2 size,
                       const int count)
    {
        const int x = ssgi_first_column(), y = (int)get_global_id(1);
        if (x >= size.x || y >= size.y) {
            return;
        }
        for (int i = 0; i < count; ++i) {
            ssgi_store(ssgi_load(source, size, i, x, y), to, size, 2 * i, x, y, 0.0f);
            // Left of a row lies the guard of the one above, maybe in another column of rows.
            ssgi_store(ssgi_load(source, size, i, x - 2, y), to, size, 2 * i + 1, x, y, 0.0f);
        }
    }
    """
    runtime.kernel_from_text("copy", text).run((rows, 3), source=plane, to=result, count=count)
    found = result.download()
    np.testing.assert_array_equal(found[::2], values)
    np.testing.assert_array_equal(found[1::2, :, :2], -7.0)
    np.testing.assert_array_equal(found[1::2, :, 2], values[..., 0])


@pytest.mark.parametrize(
    ("rows", "columns", "message"),
    [
        (16, 100, "at most 64 rows and 64 columns: .* needs 128 columns"),
        (200, 20, "at most 64 rows and 64 columns: a plane of 202 rows of 48 elements"),
    ],
)
def test_a_plane_that_no_image_holds_is_refused_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch, rows: int, columns: int, message: str
) -> None:
    runtime = opened(monkeypatch, "64")
    gbuffer = GBuffer(camera=cornell_box().camera(columns, rows), depth=np.ones((rows, columns)))
    builds, taken = runtime.builds, runtime.allocated_bytes
    with runtime.frame():
        pass
    with pytest.raises(DeviceError, match=message):
        ssao(gbuffer, radius=0.3, runtime=runtime)
    assert runtime.builds == builds
    assert runtime.allocated_bytes == taken
    assert runtime.times() == []


def device(rows: int = 8192, columns: int = 16384, size: int = 1 << 30) -> Any:
    return SimpleNamespace(image2d_max_height=rows, image2d_max_width=columns, max_mem_alloc_size=size)


def test_rows_in_a_column_are_a_power_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert ImageLimits.of(device(rows=16383)).rows == 8192
    assert ImageLimits.of(device(rows=65536)).rows == 65536


@pytest.mark.parametrize(
    ("asked", "rows", "columns"),
    [("2048", 2048, 2048), ("64x8192", 64, 8192), ("100x30", 64, 30), ("99999", 8192, 16384), ("", 8192, 16384)],
)
def test_the_variable_lowers_them(monkeypatch: pytest.MonkeyPatch, asked: str, rows: int, columns: int) -> None:
    monkeypatch.setenv(VARIABLE, asked)
    assert ImageLimits.of(device()) == ImageLimits(rows, columns, 1 << 30)


@pytest.mark.parametrize("asked", ["0", "x", "64x", "-1", "64x0", "2048 "])
def test_another_value_of_the_variable_is_refused(monkeypatch: pytest.MonkeyPatch, asked: str) -> None:
    monkeypatch.setenv(VARIABLE, asked)
    with pytest.raises(ValueError, match=f"{VARIABLE} is '{asked}': expected elements, such as"):
        ImageLimits.of(device())


def test_rows_beyond_the_limit_lie_in_further_columns() -> None:
    limits = ImageLimits(rows=64, columns=96, size=96 * 64 * 4)
    assert limits.shape("X", 64, 32) == (64, 32)
    assert limits.shape("X", 5, 96) == (5, 96)
    assert limits.shape("X", 65, 32) == (64, 64)
    assert limits.shape("X", 192, 32) == (64, 96)
    too_wide = "X has images of at most 64 rows and 96 columns: a plane of 193 rows of 32 elements needs 128 columns"
    with pytest.raises(DeviceError, match=too_wide):
        limits.shape("X", 193, 32)
    limits = ImageLimits(rows=64, columns=4096, size=64 * 64 * 4)
    assert limits.shape("X", 128, 32) == (64, 64)
    with pytest.raises(DeviceError, match=r"X has images of at most 16384 bytes: .* needs 24576;"):
        limits.shape("X", 129, 32)
