"""Pictures in a row as a video: what comes back of them, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.io import png, video

needs_ffmpeg = pytest.mark.skipif(
    find_spec("imageio_ffmpeg") is None, reason="imageio-ffmpeg is not installed (extra 'video')"
)


def pictures(folder: Path, count: int, size: tuple[int, int] = (32, 48)) -> list[Path]:
    paths = []
    for number in range(count):
        image = np.full((*size, 3), 40 * number + 20, np.uint8)
        image[: size[0] // 2] = (200, 60, 40)
        paths.append(folder / f"a.{number:04d}.png")
        png.write(paths[-1], image)
    return paths


def frames_of(path: Path) -> np.ndarray:
    """Return the bytes of all frames, red, green, blue."""
    line = [video.encoder(), "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    return np.frombuffer(subprocess.run(line, check=True, capture_output=True).stdout, np.uint8)


@needs_ffmpeg
@pytest.mark.parametrize("size", [(32, 48), (31, 45), (1, 1)])
def test_a_video_has_the_pictures_in_their_order(tmp_path: Path, size: tuple[int, int]) -> None:
    paths = pictures(tmp_path, 5, size)
    assert video.write(tmp_path / "a.mp4", iter(paths), 12.0) == 5
    rows, columns = size[0] + size[0] % 2, size[1] + size[1] % 2
    found = frames_of(tmp_path / "a.mp4").reshape(-1, rows, columns, 3)
    assert len(found) == 5
    for number, image in enumerate(found):
        # Of 8 bits, in other primaries and at half the size for colours, a few steps.
        assert abs(float(image[-1].mean()) - (40 * number + 20)) < 6


@needs_ffmpeg
def test_what_fails_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    mixed = pictures(tmp_path, 2) + pictures(tmp_path / "b", 1, (16, 16))
    with pytest.raises(ValueError, match="picture 3 has another size than the first: expected 48 x 32 pixels"):
        video.write(tmp_path / "a.mp4", mixed, 24.0)
    assert not (tmp_path / "a.mp4").exists()
    with pytest.raises(FileNotFoundError):
        video.write(tmp_path / "a.mp4", [tmp_path / "none.png"], 24.0)
    with pytest.raises(FileNotFoundError, match=r"a\.mp4"):
        video.write(tmp_path / "none" / "a.mp4", mixed[:1], 24.0)


def test_bad_arguments_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a name that ends in \.mp4"):
        video.write(tmp_path / "a.avi", [], 24.0)
    with pytest.raises(ValueError, match="pictures is empty"):
        video.write(tmp_path / "a.mp4", [], 24.0)
    with pytest.raises(ValueError, match="fps is 0"):
        video.write(tmp_path / "a.mp4", [], 0.0)


def test_the_extra_is_named_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'ssgi-cl\[video\]'"):
        video.write(tmp_path / "a.mp4", pictures(tmp_path, 1), 24.0)
    assert not (tmp_path / "a.mp4").exists()
