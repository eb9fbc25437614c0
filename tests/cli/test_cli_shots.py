"""`ssgi render --cameras` for shots: animations, history, videos, and runs that go on."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import make_scene

from ..io.test_video import frames_of, needs_ffmpeg
from ..rasterize.test_gltf_animation import Shot
from .commands import fails, succeeds

SIZE = ("--width", "40", "--height", "30")
FAST = ("--shadow-size", "64", "--rsm-size", "64", "--preset", "low", "--exposure", "1", *SIZE)


def picture(path: Path) -> np.ndarray[Any, Any]:
    with Image.open(path) as image:
        return np.asarray(image)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Cameras that go to the right through the Cornell box."""
    file = tmp_path / "path.json"
    fields = {"forward": [0, 0, 1], "up": [0, 1, 0], "fov_deg": 50}
    file.write_text(json.dumps([{"origin": [0.278 + 0.01 * n, 0.273, -0.8], **fields} for n in range(4)]))
    return file


@pytest.fixture
def animation(tmp_path: Path) -> Path:
    shot = Shot()
    shot.moves(2, "translation", [0.0, 1.0], [[0.278, 0.273, -0.8], [0.308, 0.273, -0.8]])
    shot.json["nodes"][2]["rotation"] = [0, 1, 0, 0]  # it looks along +z
    file = tmp_path / "move.glb"
    file.write_bytes(shot.bytes())
    return file


def test_an_animation_gives_a_picture_a_frame(animation: Path, tmp_path: Path) -> None:
    lines = ("render", "cornell_box", *FAST, "--cameras", animation, "--fps", "3")
    assert "4 frames: 4 done" in succeeds(*lines, "-o", tmp_path / "a.####.png").output
    assert picture(tmp_path / "a.0004.png").shape == (30, 40, 3)
    first, last = (picture(tmp_path / f"a.{number:04d}.png") for number in (1, 4))
    assert first.mean() > 20
    assert np.mean(first != last) > 0.3
    assert "4 frames: 0 done, 4 skipped" in succeeds(*lines, "-o", tmp_path / "a.####.png").output
    said = fails(tmp_path, *lines, "--camera", "other", "-o", tmp_path / "b.####.png")
    assert "moves no camera 'other'" in said


def test_frames_with_a_history_are_those_of_render(path: Path, tmp_path: Path) -> None:
    succeeds("render", "cornell_box", *FAST, "--cameras", path, "--history", "-o", tmp_path / "a.####.png")
    built = make_scene("cornell_box")
    history = gi.FrameHistory()
    for number in range(4):
        eye = np.array([0.278 + 0.01 * number, 0.273, -0.8])
        yfov = 2 * np.arctan(np.tan(np.radians(25)) * 30 / 40)
        camera = gi.Camera.look_at(eye, np.add(eye, (0, 0, 1)), (0, 1, 0), yfov=yfov, width=40, height=30, near=1e-3)
        frame = gi.render(
            built.scene,
            camera,
            built.own_lights,
            history=history,
            preset="low",
            shadow_size=64,
            rsm_size=64,
            exposure=1.0,
            outputs=("image",),
        )
        np.testing.assert_array_equal(picture(tmp_path / f"a.{number + 1:04d}.png"), frame.image)
        assert frame.image.mean() > 20


def test_a_run_that_goes_on_renders_what_its_history_needs(path: Path, tmp_path: Path) -> None:
    lines = ("render", "cornell_box", *FAST, "--cameras", path, "--history")
    succeeds(*lines, "-o", tmp_path / "a.####.png")
    whole = [picture(tmp_path / f"a.{number:04d}.png") for number in (1, 2, 3, 4)]
    (tmp_path / "a.0003.png").unlink()
    assert "4 frames: 1 done, 3 skipped" in succeeds(*lines, "-o", tmp_path / "a.####.png").output
    assert np.mean(whole[2] != whole[3]) > 0.3
    # All frames before are fewer than a mean stands for: to the bit.
    np.testing.assert_array_equal(picture(tmp_path / "a.0003.png"), whole[2])
    succeeds(*lines, "--frames", "4", "-o", tmp_path / "b.####.png")
    np.testing.assert_array_equal(picture(tmp_path / "b.0004.png"), whole[3])


@needs_ffmpeg
def test_a_video_has_all_frames(path: Path, tmp_path: Path) -> None:
    lines = ("render", "cornell_box", *FAST, "--cameras", path, "-o", tmp_path / "a.####.png")
    said = succeeds(*lines, "--video", tmp_path / "a.mp4", "--fps", "8")
    assert "a.mp4: 4 frames, 0.50 s" in said.output.replace("\n", "")
    assert len(frames_of(tmp_path / "a.mp4")) == 4 * 30 * 40 * 3


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--video", "{}/a.avi"), ".mp4"),
        (("--video", "{}/none/a.mp4"), "none"),
        (("--fps", "0"), "--fps is 0"),
        (("--fps", "nan"), "--fps is nan"),
        (("--history", "--samples", "2"), "does not go with --samples"),
        (("--history", "--scheduler", "tcp://127.0.0.1:1"), "does not go with --scheduler"),
        (("--camera", "eye"), "--camera is for one picture"),
    ],
)
def test_wrong_options_are_named(path: Path, tmp_path: Path, more: tuple[str, ...], message: str) -> None:
    given = [each.format(tmp_path) for each in more]
    said = fails(tmp_path, "render", "cornell_box", *FAST, "--cameras", path, "-o", tmp_path / "a.####.png", *given)
    assert message in " ".join(said.split())


def test_options_of_shots_need_cameras_and_videos_need_png(path: Path, tmp_path: Path) -> None:
    one = ("render", "cornell_box", *FAST, "-o", tmp_path / "a.png")
    for more in (("--history",), ("--video", tmp_path / "a.mp4")):
        assert "go with --cameras" in fails(tmp_path, *one, *more)
    lines = ("render", "cornell_box", *FAST, "--cameras", path, "-o", tmp_path / "a.####.exr")
    assert "expected .png with --video" in fails(tmp_path, *lines, "--video", tmp_path / "a.mp4")
    missing = (*lines[:-3], tmp_path / "none.glb", "-o", tmp_path / "a.####.png")
    assert "there is no such file" in fails(tmp_path, *missing)


def test_a_missing_extra_is_told_before_any_work(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    lines = ("render", "cornell_box", *FAST, "--cameras", path, "-o", tmp_path / "a.####.png")
    assert "ssgi-cl[video]" in fails(tmp_path, *lines, "--video", tmp_path / "a.mp4")
