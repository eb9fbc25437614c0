"""`ssgi render --cameras`: a picture a camera, the same as one by one, and what is done is skipped."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ssgi_cl.cli import frame_arguments, views
from ssgi_cl.io import exr
from ssgi_cl.rasterize.raster.default_camera import cameras_from_json

from .commands import fails, process, succeeds

FAST = ("--shadow-size", "64", "--bounces", "0", "--exposure", "1")


def camera(x: float, **more: object) -> dict[str, object]:
    return {
        "origin": [x, 1, 4],
        "forward": [0, 0, -1],
        "up": [0, 1, 0],
        "fov_deg": 60,
        "width": 40,
        "height": 30,
    } | more


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Cameras of three pictures, the last one of another size."""
    file = tmp_path / "path.json"
    file.write_text(json.dumps([camera(0.0), camera(0.3), camera(0.6, width=24)]))
    return file


def pictures(folder: Path, name: str = "a") -> list[np.ndarray[Any, Any]]:
    found = []
    for number in (1, 2, 3):
        with Image.open(folder / f"{name}.{number:04d}.png") as image:
            found.append(np.asarray(image))
    return found


def test_each_picture_is_that_of_its_camera(path: Path, tmp_path: Path) -> None:
    said = succeeds("render", "cornell_box", *FAST, "--cameras", path, "-o", tmp_path / "a.####.png")
    assert "3 frames: 3 done" in said.output
    for number, (x, width) in enumerate(((0.0, 40), (0.3, 40), (0.6, 24)), 1):
        one = tmp_path / "one.json"
        one.write_text(json.dumps(camera(x, width=width)))
        succeeds("render", "cornell_box", *FAST, "--camera", one, "-o", tmp_path / f"b.{number:04d}.png")
    for one_of_many, alone in zip(pictures(tmp_path), pictures(tmp_path, "b"), strict=True):
        np.testing.assert_array_equal(one_of_many, alone)


def test_files_hold_what_those_of_one_picture_hold(path: Path, tmp_path: Path) -> None:
    arguments = ("render", "cornell_box", *FAST, "--ambient", "1", "-o")
    succeeds(*arguments, tmp_path / "a.####.exr", "--cameras", path, "--frames", "2")
    path.write_text(json.dumps(camera(0.3)))
    succeeds(*arguments, tmp_path / "b.exr", "--camera", path)
    one, other = exr.read(tmp_path / "a.0002.exr"), exr.read(tmp_path / "b.exr")
    assert one.keys() == other.keys()
    for name, plane in other.items():
        np.testing.assert_array_equal(one[name], plane)
    assert not (tmp_path / "a.0001.exr").exists()


def test_what_is_done_is_skipped_until_scene_camera_or_options_change(
    corner: Path, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads = []
    ready = views.frame_arguments
    monkeypatch.setattr(views, "frame_arguments", lambda *given: loads.append(1) or ready(*given))
    corner.write_text("mtllib c.mtl\nusemtl m\n" + corner.read_text())
    library = corner.with_name("c.mtl")
    library.write_text("newmtl m\nKd 1 0 0\n")

    def counts(*more: object) -> str:
        said = succeeds("render", corner, *FAST, "--cameras", path, "-o", tmp_path / "a.####.png", *more).output
        return str(said.strip().splitlines()[-1].split(": ")[1])

    assert counts() == "3 done, 0 skipped, 0 failed"
    assert len(loads) == 1, "the scene was made ready more than once"
    before = pictures(tmp_path)
    assert counts() == "0 done, 3 skipped, 0 failed"
    assert len(loads) == 1, "the scene was made ready, and nothing drawn"
    assert counts("--again") == "3 done, 0 skipped, 0 failed"
    for one, other in zip(before, pictures(tmp_path), strict=True):
        np.testing.assert_array_equal(one, other)
    library.write_text("newmtl m\nKd 0 1 0\n")
    assert counts() == "3 done, 0 skipped, 0 failed"
    assert np.abs(before[0].astype(int) - pictures(tmp_path)[0]).max() > 10
    path.write_text(json.dumps({"cameras": [camera(0.0), camera(0.5), {"camera": camera(0.6, width=24)}]}))
    assert counts() == "1 done, 2 skipped, 0 failed"
    assert counts("--exposure", "2", "--frames", "1,3") == "2 done, 0 skipped, 0 failed"


def test_lights_are_the_same_whatever_part_of_the_cameras_is_drawn(corner: Path, tmp_path: Path) -> None:
    """The sun stands behind the first camera, not behind the one whose picture it is."""
    back = camera(0.0, origin=[0, 1, -4], forward=[0, 0, 1])
    cameras, alone = tmp_path / "path.json", tmp_path / "one.json"
    cameras.write_text(json.dumps([camera(0.0), camera(0.5), back]))
    alone.write_text(json.dumps(back))
    arguments = ("render", corner, *FAST, "-o")
    succeeds(*arguments, tmp_path / "a.####.png", "--cameras", cameras)
    succeeds(*arguments, tmp_path / "b.####.png", "--cameras", cameras, "--frames", "3")
    assert (tmp_path / "a.0003.png").read_bytes() == (tmp_path / "b.0003.png").read_bytes()
    succeeds(*arguments, tmp_path / "c.png", "--camera", alone)
    with Image.open(tmp_path / "a.0003.png") as one, Image.open(tmp_path / "c.png") as other:
        assert np.abs(np.asarray(one).astype(int) - np.asarray(other)).max() > 10


@pytest.mark.slow
def test_workers_write_the_same_bytes(path: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask distributed is not installed (extra 'cluster')")
    arguments = ("render", "cornell_box", *FAST, "--cameras", path, "-o")
    succeeds(*arguments, tmp_path / "a.####.png")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local:
        said = succeeds(*arguments, tmp_path / "b.####.png", "--scheduler", local.scheduler_address).output
    assert "3 frames: 3 done" in said
    for number in (1, 2, 3):
        one, other = (tmp_path / f"{name}.{number:04d}.png" for name in "ab")
        assert one.read_bytes() == other.read_bytes()


def test_an_environment_counts_by_its_content(path: Path, tmp_path: Path) -> None:
    sky = tmp_path / "sky.exr"
    arguments = ("render", "cornell_box", *FAST, "--environment", sky, "--cameras", path, "-o", tmp_path / "a.####.png")
    exr.write(sky, {"image": np.ones((4, 8, 3))})
    assert "3 done" in succeeds(*arguments).output
    assert "3 skipped" in succeeds(*arguments).output
    exr.write(sky, {"image": np.full((4, 8, 3), 2.0)})
    assert "3 done" in succeeds(*arguments).output


def test_a_scene_that_changes_meanwhile_is_not_drawn(path: Path, corner: Path, tmp_path: Path) -> None:
    first = cameras_from_json(path, None, None)[0]
    options = {"environment": None, "device": None, "camera": None, "fov": None}
    options |= dict.fromkeys(("eye", "target", "up", "width", "height", "ambient", "bounces", "indirect"))
    options |= dict.fromkeys(frame_arguments._AS_GIVEN)
    work = views.RenderView(
        scene=str(corner),
        options=options | {"ao": "none", "ao_radius": 1.0, "no_skips": False},
        first=first,
        content="0",
        as_exr=False,
    )
    with pytest.raises(ValueError, match="has changed since the run began"):
        work(first)


def test_lines_for_farms(path: Path, tmp_path: Path) -> None:
    done = process("render", "cornell_box", *FAST, "--cameras", path, "-o", tmp_path / "a.####.png", "--json")
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert [Path(line["output"]).name for line in told[:-1]] == [f"a.{n:04d}.png" for n in (1, 2, 3)]
    assert told[-1] == {"frames": 3, "done": 3, "skipped": 0, "failed": 0}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-o", "a.png"), "expected #### for the numbers of frames in its name, as in view.####.png"),
        (("-o", "a.####.jpg"), "expected a name that ends in .png or .exr"),
        (("-o", "nowhere/a.####.png"), "there is no folder"),
        (("-o", "a.####.png", "--frames", "2-4"), "there is no camera 4; "),
        (("-o", "a.####.png", "--frames", "0"), "there is no camera 0; "),
        (("-o", "a.####.png", "--views"), "--views is for one picture"),
        (("-o", "a.####.png", "--fov", "40"), "--fov is for one picture"),
    ],
)
def test_a_wrong_call_is_told(path: Path, tmp_path: Path, options: tuple[str, ...], message: str) -> None:
    output = tmp_path / options[1]
    assert message in fails(tmp_path, "render", "hall", "--cameras", path, "-o", output, *options[2:])


def test_options_of_sequences_need_cameras(tmp_path: Path) -> None:
    assert "go with --cameras" in fails(tmp_path, "render", "hall", "-o", tmp_path / "a.png", "--frames", "1")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"cameras": []}, "holds no list of cameras"),
        (camera(0.0), "holds no list of cameras"),
        ([camera(0.0), {"origin": [0, 0, 0]}], "camera 2 of {path} lacks forward, up, fov_deg"),
        ([camera(0.0), camera(0.0, fov_deg=200)], "camera 2 of {path}: fov_deg is 200"),
        ([camera(0.0, origin=[1, "a", 2])], "camera 1 of {path}: origin"),
        ([camera(0.0), 3], "camera 2 of {path} lacks origin"),
    ],
)
def test_a_wrong_entry_is_named(path: Path, content: object, message: str) -> None:
    path.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=re.escape(message.format(path=path))):
        cameras_from_json(path, None, None)
