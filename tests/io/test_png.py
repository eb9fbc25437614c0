"""PNG files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssgi_cl.core import atomic
from ssgi_cl.io import exr, png

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
