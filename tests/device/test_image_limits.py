"""Images are no larger than the device has them, and hold the same however small they are."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import PointLight
from ssgi_cl.device.image_limits import VARIABLE, ImageLimits
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.ao.ssao import ssao
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.filters.bilateral import bilateral_blur
from ssgi_cl.techniques.filters.upsample import coarse_size, upsample

SIZE = (51, 70)


def opened(monkeypatch: pytest.MonkeyPatch, limit: str | None) -> Runtime:
    """Return a runtime whose kernels read images of at most this size."""
    monkeypatch.delenv(VARIABLE, raising=False)
    if limit is not None:
        monkeypatch.setenv(VARIABLE, limit)
    try:
        return Runtime.open(lanes=1, storage="image")
    except DeviceError as error:
        pytest.skip(str(error))


@pytest.fixture
def box(runtime: Runtime) -> GBuffer:
    """Two layers of the Cornell box with a margin."""
    made = cornell_box()
    camera = made.camera(SIZE[1], SIZE[0])
    return drawn(made.scene, camera, layers=2, overscan=0.1, runtime=runtime)


def results(gbuffer: GBuffer, texels: int, runtime: Runtime) -> dict[str, NDArray[np.float32]]:
    """Return what techniques make of planes that have up to 6 `texels` rows."""
    punctual_light = PointLight((0.278, 0.45, 0.28), 0.3)
    shadow = rsm(cornell_box().scene, punctual_light, size=texels, runtime=runtime)
    ao = ssao(gbuffer, radius=0.3, samples=4, runtime=runtime)
    coarse = ao[: coarse_size(SIZE, 2)[0], : coarse_size(SIZE, 2)[1]]
    return {
        "map": np.asarray(shadow.depth),
        "flux": np.asarray(shadow.flux),
        "ssao": ao,
        "blur": bilateral_blur(ao, gbuffer, runtime=runtime),
        "upsample": upsample(coarse, gbuffer, runtime=runtime),
        "shade": shade(gbuffer, [punctual_light], shadow_maps=[shadow], ao=ao, runtime=runtime),
    }


@pytest.mark.parametrize(
    ("limit", "texels"),
    # Images of 64 rows: every plane but the smallest lies in several columns of them. Of 2048: the
    # six faces of the map do.
    [("64x8192", 40), ("2048", 400)],
)
@pytest.mark.slow  # stress/test_same_bits.py does it for all techniques
def test_wrapped_planes_give_bit_identical_results(
    monkeypatch: pytest.MonkeyPatch, box: GBuffer, limit: str, texels: int
) -> None:
    expected = results(box, texels, opened(monkeypatch, None))
    limited = opened(monkeypatch, limit)
    assert limited is not opened(monkeypatch, None)
    found = results(box, texels, limited)
    for name, image in expected.items():
        np.testing.assert_array_equal(found[name], image, err_msg=name)
        assert len(np.unique(image)) > 9, name  # they show something


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


def test_limits_are_the_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert ImageLimits.of(device()) == ImageLimits(8192, 16384, 1 << 30)
    # Rows in a column are a power of two.
    assert ImageLimits.of(device(rows=16383)).rows == 8192
    assert ImageLimits.of(device(rows=65536)).rows == 65536


@pytest.mark.parametrize(
    ("asked", "rows", "columns"),
    [("2048", 2048, 2048), ("64x8192", 64, 8192), ("100x30", 64, 30), ("99999", 8192, 16384)],
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
    with pytest.raises(
        DeviceError,
        match="X has images of at most 64 rows and 96 columns: a plane of 193 rows of 32 elements needs 128 columns",
    ):
        limits.shape("X", 193, 32)


def test_an_image_that_no_allocation_holds_is_refused() -> None:
    limits = ImageLimits(rows=64, columns=4096, size=64 * 64 * 4)
    assert limits.shape("X", 128, 32) == (64, 64)
    with pytest.raises(DeviceError, match=r"X has images of at most 16384 bytes: .* needs 24576;"):
        limits.shape("X", 129, 32)
