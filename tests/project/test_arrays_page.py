"""Each block of docs/arrays.md runs as written, on files of its kind, and sees what the arrays show."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.io import exr as files

PAGE = Path(__file__).parents[2] / "docs" / "arrays.md"
BLOCKS = dict(re.findall(r"```python (\w+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL))

SIZE = ROWS, COLUMNS = 48, 64
FOCAL = 60.0
CENTRE = (31.0, 24.5)  # of pixel centres at integers
POSE = np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 1.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]])
"""Camera to world, the camera looking down -z."""


def step() -> tuple[Any, Any, Any]:
    """Depth of a floor with a box on it, its normals in OpenCV's camera space, and the distance along the ray."""
    x, y = ((np.arange(n) - c) / FOCAL for n, c in ((COLUMNS, CENTRE[0]), (ROWS, CENTRE[1])))
    x, y = np.broadcast_arrays(x, y[:, None])
    depth = 3.0 / (1.0 + 0.5 * y)
    normal = np.tile(np.array([0.0, -0.5, -1.0]) / np.sqrt(1.25), (*SIZE, 1))
    box = (np.abs(x) < 0.2) & (np.abs(y) < 0.2)
    depth, normal[box] = np.where(box, 2.0, depth), (0.0, 0.0, -1.0)
    return depth.astype(np.float32), normal, depth * np.sqrt(1.0 + x**2 + y**2)


DEPTH, NORMAL, DISTANCE = step()
K = (FOCAL, FOCAL, *CENTRE)


def save_png(path: Path, scale: float) -> None:
    Image.fromarray(np.round(DEPTH * scale).astype(np.uint16)).save(path)


def moge(folder: Path) -> dict[str, Any]:
    scaled = np.diag([FOCAL / COLUMNS, FOCAL / ROWS, 1.0])
    scaled[:2, 2] = (CENTRE[0] + 0.5) / COLUMNS, (CENTRE[1] + 0.5) / ROWS
    return {"predicted": {"depth": DEPTH, "normal": NORMAL, "intrinsics": scaled, "mask": DEPTH > 0}}


def relative(folder: Path) -> dict[str, Any]:
    return {"predicted": (1.0 / DEPTH - 0.1) / 0.4}


def camera(folder: Path) -> dict[str, Any]:
    return {"measured": np.round(DEPTH * 1e3).astype(np.uint16), "K": K}


def relief(folder: Path) -> dict[str, Any]:
    return {"predicted": DEPTH}


def relight(folder: Path) -> dict[str, Any]:
    return {"predicted": DEPTH, "photograph": np.full((*SIZE, 3), 90, np.uint8)}


def batch(folder: Path) -> dict[str, Any]:
    return {"depths": np.stack([DEPTH] * 2)}


def chw(folder: Path) -> dict[str, Any]:
    return {"depths": DEPTH[None, None], "normals": np.moveaxis(NORMAL, -1, 0)[None]}


def nerfstudio(folder: Path) -> dict[str, Any]:
    save_png(folder / "depth.png", 1e3)
    frame = {"depth_file_path": "depth.png", "transform_matrix": POSE.tolist()}
    meta = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": CENTRE[0] + 0.5, "cy": CENTRE[1] + 0.5, "frames": [frame]}
    (folder / "transforms.json").write_text(json.dumps(meta))
    return {}


def scannet(folder: Path) -> dict[str, Any]:
    save_png(folder / "0.png", 1e3)
    matrix = np.diag([FOCAL, FOCAL, 1.0, 1.0])
    matrix[:2, 2] = CENTRE
    np.savetxt(folder / "intrinsic_depth.txt", matrix)
    np.savetxt(folder / "0.txt", POSE @ np.diag([1.0, -1.0, -1.0, 1.0]))
    return {}


def replica(folder: Path) -> dict[str, Any]:
    save_png(folder / "depth000000.png", 6553.5)
    camera = {"fx": FOCAL, "fy": FOCAL, "cx": CENTRE[0], "cy": CENTRE[1], "scale": 6553.5}
    (folder / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return {}


def exr(folder: Path) -> dict[str, Any]:
    normal = (NORMAL * [1.0, -1.0, -1.0]).astype(np.float32)  # in the space of the camera, +y up
    arrays = {"ViewLayer.Depth.Z": DEPTH}
    arrays |= {f"ViewLayer.Normal.{c}": np.ascontiguousarray(normal[..., i]) for i, c in enumerate("XYZ")}
    files.write(folder / "shot.exr", arrays)
    return {"eye": (0, 0, 0), "target": (0, 0, -1)}


def elevation(folder: Path) -> dict[str, Any]:
    heights = np.zeros((60, 80))
    heights[:, 40:] = 30.0
    return {"heights": heights}


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, made: Callable[[Path], dict[str, Any]]) -> dict[str, Any]:
    """Return the names that a block has defined."""
    names = {"gi": gi, "np": np, "json": json, "Path": Path, "Image": Image, **made(folder)}
    monkeypatch.chdir(folder)
    exec(BLOCKS[made.__name__], names)
    return names


@pytest.mark.parametrize("made", [moge, relative, nerfstudio, scannet, replica], ids=lambda f: f.__name__)
def test_a_block_sees_the_floor_and_the_box(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, made: Callable[[Path], dict[str, Any]]
) -> None:
    gbuffer = run(monkeypatch, tmp_path, made)["gbuffer"]
    np.testing.assert_allclose(gbuffer.depth, DEPTH, atol=6e-4)  # half a millimetre, rounded
    if made is not relative:
        expected = gi.Camera.from_intrinsics(FOCAL, FOCAL, CENTRE[0] + 0.5, CENTRE[1] + 0.5, width=COLUMNS, height=ROWS)
        np.testing.assert_allclose(gbuffer.camera.projection, expected.projection)
    if made in (nerfstudio, scannet):
        np.testing.assert_allclose(gbuffer.camera.view @ POSE, np.eye(4), atol=1e-12)
    if made is moge:
        np.testing.assert_allclose(gbuffer.normal, NORMAL * [1.0, -1.0, -1.0], atol=1e-6)  # the camera's world
        assert "'opencv'" in gbuffer.notes[0]


def test_hypersims_distances_become_depth(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    x, y = np.arange(1024) - 511.5, np.arange(768)[:, None] - 383.5
    distance = 4.0 * np.sqrt(1.0 + (x**2 + y**2) / 886.81**2)  # of a wall
    distance[:100] = np.nan  # the sky
    parts = {"depth_meters": distance, "normal_cam": np.tile([0.0, 0.0, 1.0], (768, 1024, 1))}
    for name, array in parts.items():
        with h5py.File(tmp_path / f"frame.0000.{name}.hdf5", "w") as file:
            file["dataset"] = array.astype(np.float16 if name == "normal_cam" else np.float32)

    def hypersim(folder: Path) -> dict[str, Any]:
        return {"h5py": h5py}

    gbuffer = run(monkeypatch, tmp_path, hypersim)["gbuffer"]
    np.testing.assert_allclose(gbuffer.depth[100:], 4.0, rtol=1e-6)
    assert np.isinf(gbuffer.depth[:100]).all()


@pytest.mark.parametrize("made", [batch, chw], ids=lambda f: f.__name__)
def test_batches_have_images_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, made: Callable[[Path], dict[str, Any]]
) -> None:
    names = run(monkeypatch, tmp_path, made)
    assert names["ao"].shape == (len(names["depths"]), *SIZE)
    for gbuffer in names["gbuffers"]:
        np.testing.assert_array_equal(gbuffer.depth, DEPTH)


def test_measured_depth_is_cleaned(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run(monkeypatch, tmp_path, camera)
    np.testing.assert_allclose(found["depth"], DEPTH, atol=2e-3)  # of millimetres
    assert found["ao"].shape == SIZE


def test_passes_of_a_renderer_are_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = run(monkeypatch, tmp_path, exr)
    np.testing.assert_array_equal(found["gbuffer"].depth, DEPTH)
    assert found["ao"].shape == SIZE
    assert "depth is read from ViewLayer.Depth.Z" in capsys.readouterr().out


@pytest.mark.parametrize("made", [relief, relight], ids=lambda f: f.__name__)
def test_a_picture_shows_the_box(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, made: Callable[[Path], dict[str, Any]]
) -> None:
    picture = run(monkeypatch, tmp_path, made)["picture"]
    assert (picture.shape, picture.dtype) == ((*SIZE, 3), np.uint8)
    box = DEPTH == 2.0
    # The box faces the viewer, the floor is tilted by 27 degrees: another light.
    assert abs(float(picture[box].mean()) - float(picture[~box].mean())) > 5.0


def test_device_memory_is_read_and_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def device(folder: Path) -> dict[str, Any]:
        return {
            "height": SIZE[0],
            "width": SIZE[1],
            "cameras": [gi.Camera.from_intrinsics(*K, width=64, height=48)] * 2,
        }

    found = run(monkeypatch, tmp_path, device)
    found["done"].wait()
    np.testing.assert_allclose(found["ao"].get(), 1.0, atol=1e-3)  # of a plane across the view


def test_sky_view_of_a_cliff_is_the_closed_form(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run(monkeypatch, tmp_path, elevation)["sky_view"]
    # Of a horizontal receiver before an endless wall with its upper edge at the angle h: (1 + cos h) / 2.
    distance = 2.0 * (40 - np.arange(25, 40) - 0.5)
    expected = 0.5 * (1.0 + np.cos(np.arctan(30.0 / distance)))
    np.testing.assert_allclose(found[30, 25:40], expected, atol=0.03)  # 8 slices, 64 taps, a blur of 3 pixels
    np.testing.assert_allclose(found[:, 60:], 1.0, atol=1e-6)  # on the plateau


def test_every_block_of_the_page_is_run() -> None:
    assert set(BLOCKS) == {
        "moge",
        "relative",
        "batch",
        "chw",
        "hypersim",
        "nerfstudio",
        "scannet",
        "replica",
        "elevation",
        "relief",
        "relight",
        "exr",
        "camera",
        "device",
    }
