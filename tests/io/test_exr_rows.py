"""OpenEXR files by bands of rows: the bytes and values of whole files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

import ssgi_cl as gi
from ssgi_cl.io import exr

ROWS, COLUMNS = 133, 71


@pytest.fixture
def arrays() -> dict[str, Any]:
    random = np.random.default_rng(7)
    return {
        "depth": random.random((ROWS, COLUMNS), np.float32) + 1.0,
        "normal": random.random((ROWS, COLUMNS, 3), np.float32),
    }


@pytest.fixture
def source(tmp_path: Path, arrays: dict[str, Any]) -> Path:
    path = tmp_path / "in.exr"
    camera = gi.Camera.look_at((1, 2, 3), (0, 0, 0), width=COLUMNS, height=ROWS)
    exr.write(path, arrays, camera=camera, attributes={"owner": "somebody"})
    return path


def bands(arrays: dict[str, Any], height: int) -> Iterator[tuple[int, dict[str, Any]]]:
    for first in range(0, ROWS, height):
        yield first, {name: array[first : first + height] for name, array in arrays.items()}


@pytest.mark.parametrize("height", [16, 64, 192])
def test_a_file_written_by_bands_has_the_bytes_of_the_whole(
    height: int, source: Path, arrays: dict[str, Any], tmp_path: Path
) -> None:
    whole, banded = tmp_path / "whole.exr", tmp_path / "banded.exr"
    exr.write(whole, arrays, like=source, attributes={"key": "a"})
    exr.write_in_rows(banded, bands(arrays, height), like=source, attributes={"key": "a"})
    assert banded.read_bytes() == whole.read_bytes()


def test_windows_that_begin_elsewhere_are_kept(arrays: dict[str, Any], tmp_path: Path) -> None:
    source, banded = tmp_path / "in.exr", tmp_path / "banded.exr"
    window = (-5, 12, COLUMNS - 6, ROWS + 11)
    exr.write(source, arrays, data=window, display=(0, 0, 99, 199))
    exr.write_in_rows(banded, bands(arrays, 32), like=source)
    read = exr.read(banded)
    assert np.array_equal(read["Z"], arrays["depth"])
    assert exr.read_headers(banded)[0].data == window


def test_rows_are_those_of_the_whole(source: Path, arrays: dict[str, Any]) -> None:
    for rows in ((0, 1), (5, 40), (60, ROWS)):
        found, kind = exr.read_with_kind(source, rows=rows)
        assert kind == "planar"
        for name, array in arrays.items():
            assert np.array_equal(found[name], array[slice(*rows)])


@pytest.mark.parametrize("how", ["tiled", "half", "piz"])
def test_rows_of_other_files(how: str, tmp_path: Path, arrays: dict[str, Any]) -> None:
    path = tmp_path / "other.exr"
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    depth = arrays["depth"]
    if how == "tiled":
        header |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    elif how == "piz":
        header["compression"] = OpenEXR.PIZ_COMPRESSION
    else:
        depth = depth.astype(np.float16)
    OpenEXR.File(header, {"Z": depth}).write(str(path))
    found, _ = exr.read_with_kind(path, rows=(30, 90))
    assert np.array_equal(found["depth"], depth[30:90].astype(np.float32))


def test_wrong_bands_leave_no_file(source: Path, arrays: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "out.exr"
    depth = {"depth": arrays["depth"]}
    wrong = {
        "a band has row 32": [(0, {"depth": arrays["depth"][:16]}), (32, {"depth": arrays["depth"][32:48]})],
        "the last band ends at row 64": [(0, {"depth": arrays["depth"][:64]})],
        "a band has row 24": [(0, {"depth": arrays["depth"][:24]}), (24, {"depth": arrays["depth"][24:]})],
    }
    assert depth
    for message, given in wrong.items():
        with pytest.raises(ValueError, match=message):
            exr.write_in_rows(path, iter(given), like=source)
        assert not path.exists()
    assert [each.name for each in tmp_path.iterdir()] == ["in.exr"]


def test_a_file_of_several_parts_is_refused(tmp_path: Path, arrays: dict[str, Any]) -> None:
    path = tmp_path / "parts.exr"
    exr.write(path, arrays, parts=True)
    with pytest.raises(ValueError, match=r"has 2 parts: expected a file with one to read it by rows"):
        exr.read_with_kind(path, rows=(0, 8))


def test_a_file_that_is_cut_short_is_named(source: Path) -> None:
    data = source.read_bytes()
    source.write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(ValueError, match=r"in\.exr.* is damaged or cut short"):
        exr.read_with_kind(source, rows=(100, ROWS))
