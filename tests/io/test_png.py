"""PNG files, and pictures of a G-buffer's arrays."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssgi_cl.core import atomic
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.io import exr, png
from ssgi_cl.io.previews import depth_view, gbuffer_views, levels_view, normal_view, share_view

STRIDES = (slice(None, None, -2), slice(None, None, 3))


@pytest.mark.parametrize("part", [(), STRIDES])
@pytest.mark.parametrize("shape", [(1, 1), (1, 1, 3), (17, 31), (17, 31, 3)])
def test_what_is_written_is_read_back(tmp_path: Path, shape: tuple[int, ...], part: tuple[slice, ...]) -> None:
    image = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)[part]
    png.write(str(tmp_path / "a picture"), image)  # the name needs no suffix
    with Image.open(tmp_path / "a picture") as picture:
        assert picture.format == "PNG"
        np.testing.assert_array_equal(np.asarray(picture), image)
    assert [path.name for path in tmp_path.iterdir()] == ["a picture"]


@pytest.mark.parametrize("shape", [(1, 1, 3), (17, 31, 3)])
def test_pictures_of_16_bits_keep_them(tmp_path: Path, shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(1).integers(0, 65536, shape, dtype=np.uint16)
    png.write(tmp_path / "a.png", image)
    with Image.open(tmp_path / "a.png") as picture:  # of 16 bits Pillow reads the upper 8, and checks all sums
        np.testing.assert_array_equal(np.asarray(picture), image >> 8)
    data = (tmp_path / "a.png").read_bytes()
    place = data.index(b"IDAT")
    size = int.from_bytes(data[place - 4 : place], "big")
    lines = np.frombuffer(zlib.decompress(data[place + 4 : place + 4 + size]), np.uint8).reshape(shape[0], -1)
    assert (lines[:, 0] == 2).all()
    bytes_ = np.cumsum(lines[:, 1:], axis=0, dtype=np.uint8)
    np.testing.assert_array_equal(np.ascontiguousarray(bytes_).view(">u2").reshape(shape), image)


def test_floats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="float64: expected uint8"):
        png.write(tmp_path / "a.png", np.zeros((2, 2)))  # type: ignore[arg-type]


@pytest.mark.parametrize("shape", [(2,), (2, 2, 4), (0, 3), (2, 2, 3, 1)])
def test_a_wrong_shape_is_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="expected \\(rows, columns\\)"):
        png.write(tmp_path / "a.png", np.zeros(shape, np.uint8))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("write", [png.write, lambda path, image: exr.write(path, {"depth": image})])
def test_missing_folders_and_folders_are_refused(tmp_path: Path, write: Callable[..., None]) -> None:
    image = np.zeros((2, 2), np.uint8)
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write(tmp_path / "nowhere" / "a", image)
    with pytest.raises(IsADirectoryError, match="folder"):
        write(tmp_path / "folder", image)
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_a_device_is_not_replaced() -> None:
    with pytest.raises(OSError, match="not a regular file"):
        png.write("/dev/null", np.zeros((2, 2), np.uint8))
    assert Path("/dev/null").is_char_device()


def test_a_writer_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    target.write_bytes(b"old")

    def fail() -> None:
        with atomic.replacement(target) as temporary:
            temporary.write_bytes(b"half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail()
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_a_link_is_followed_and_a_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    (tmp_path / "link.png").symlink_to("real.png")
    png.write(tmp_path / "link.png", np.zeros((2, 2), np.uint8))
    assert (tmp_path / "link.png").is_symlink()
    assert (tmp_path / "real.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "real.png").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_nearest_is_white_furthest_dark_grey_and_nothing_black() -> None:
    depth = np.array([[1.0, 2.0, 4.0, np.inf]], np.float32)
    view = depth_view(depth)
    assert view.dtype == np.uint8
    assert view[0].tolist()[0] == 255
    assert view[0].tolist()[2:] == [40, 0]
    assert 40 < view[0, 1] < 255


@pytest.mark.parametrize("depth", [np.inf, 1e-30, 7.0, 1e30])
def test_any_depth_seen_straight_on_is_one_grey_without_a_warning(depth: float) -> None:
    view = depth_view(np.full((3, 4), depth, np.float32))
    assert view.shape == (3, 4)
    assert np.unique(view).size == 1
    assert (view[0, 0] >= 40) == np.isfinite(depth)
    assert depth_view(np.zeros((0, 4), np.float32)).shape == (0, 4)


def test_depth_of_an_orthographic_camera_may_be_zero_or_less() -> None:
    view = depth_view(np.array([[-1.0, 0.0, 1.0, 2.0]], np.float32))
    assert (np.diff(view[0].astype(int)) < 0).all(), "nearer is not brighter"


def test_normals_go_from_0_to_255_and_nothing_is_mid_grey() -> None:
    normal = np.array([[[-1.0, 0.0, 1.0], [2.0, -2.0, 0.0]]], np.float32)
    assert normal_view(normal).tolist() == [[[0, 128, 255], [255, 0, 128]]]


def test_shares_are_linear_and_clipped() -> None:
    share = np.array([[0.0, 0.2, 1.0, 1.5, -1.0]], np.float32)
    assert share_view(share).tolist() == [[0, 51, 255, 255, 0]]


def full_gbuffer(**arrays: np.ndarray) -> GBuffer:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=4, height=2)
    return GBuffer(camera=camera, depth=np.full((4, 6), 2.0, np.float32), **arrays)


def test_levels_have_a_colour_each_and_what_is_interpolated_none() -> None:
    steps = np.array([[16, 8, 4], [2, 1, 0]], np.int32)
    view = levels_view(steps)
    assert len({tuple(colour) for colour in view.reshape(-1, 3).tolist()}) == 6
    np.testing.assert_array_equal(view[1, 2], 0)


def test_gbuffer_views_show_what_is_there_without_its_margin() -> None:
    views = gbuffer_views(full_gbuffer())
    assert {name: view.shape for name, view in views.items()} == {"depth": (2, 4)}
    normal = np.broadcast_to(np.float32([0, 0, 1]), (4, 6, 3))
    views = gbuffer_views(full_gbuffer(normal=normal, albedo=np.full((4, 6, 3), 0.5, np.float32)))
    assert views["normal"][0, 0].tolist() == [128, 128, 255]
    assert views["albedo"][0, 0].tolist() == [186, 186, 186]  # 255 * 0.5^(1 / 2.2) = 186.08
