"""The layout of the BMFR sequences: written from a scene of known cameras, and read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from ssgi_cl.bench.experiments import bmfr
from ssgi_cl.core.camera import Camera
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize.scenes import make_scene

ROWS, COLUMNS = 36, 48


def cameras(count: int) -> list[Camera]:
    room = make_scene("cornell_box")
    return [
        Camera.look_at(
            np.add(room.eye, (0.03 * n, 0, 0)), room.target, yfov=room.yfov, width=COLUMNS, height=ROWS, far=20.0
        )
        for n in range(count)
    ]


def matrix_of(camera: Camera, *, down: bool) -> NDArray[np.float64]:
    """Return the matrix of row vectors; with `down` its second coordinate grows towards the last row of the image."""
    result = (camera.projection @ camera.view).T.copy()
    result[:, 1] *= -1.0 if down else 1.0
    return result


def written(folder: Path, count: int, runtime: Runtime, *, down: bool) -> list[Camera]:
    """Write a sequence of which color is albedo times noise of mean 1, and references albedo."""
    rng = np.random.default_rng(3)
    scene, chosen = make_scene("cornell_box").scene, cameras(count)
    blocks = []
    for number, camera in enumerate(chosen):
        seen = drawn(scene, camera, runtime=runtime)
        depth, normal, albedo = (np.asarray(seen.first(name)) for name in ("depth", "normal", "albedo"))
        row, column = np.indices((ROWS, COLUMNS)) + 0.5
        sx, sy, ox, oy = camera.pixel_to_view
        safe = np.where(np.isfinite(depth), depth, 0.0)
        view = np.stack([(sx * column + ox) * safe, (sy * row + oy) * safe, -safe], axis=-1)
        world = view @ camera.view[:3, :3] + camera.position
        world[~np.isfinite(depth)] = camera.position  # in front of no pixel
        color = albedo * rng.uniform(0.0, 2.0, (ROWS, COLUMNS, 1))
        own = {"color": color, "albedo": albedo, "shading_normal": normal}
        for name, array in {**own, "world_position": world, "reference": albedo}.items():
            exr.write(folder / f"{name}{number}.exr", {"": array if down else array[::-1]})
        text = ",\n".join("{" + ", ".join(f"{v:.9g}" for v in line) + "}" for line in matrix_of(camera, down=down))
        blocks.append("{\n" + text + "\n}")
    (folder / bmfr.HEADER).write_text(
        "// written 2026\nconst float position_limit_squared = 0.01;\n"
        f"const float camera_matrices[{count}][4][4] = {{\n" + ",\n".join(blocks) + "\n};\n"
        f"const float pixel_offsets[{count}][2] = {{\n" + ",\n".join(["{ 0.5, 0.5 }"] * count) + "\n};\n"
    )
    return chosen


@pytest.mark.parametrize("down", [True, False])
def test_cameras_and_depths_come_back(runtime: Runtime, tmp_path: Path, *, down: bool) -> None:
    chosen = written(tmp_path, 2, runtime, down=down)
    scene = make_scene("cornell_box").scene
    found = list(bmfr.frames_of(tmp_path))
    assert len(found) == 2
    for frame, camera in zip(found, chosen, strict=True):
        # Nine digits of each number.
        np.testing.assert_allclose(frame.gbuffer.camera.view, camera.view, atol=1e-6)
        np.testing.assert_allclose(frame.gbuffer.camera.pixel_to_view, camera.pixel_to_view, atol=1e-6)
        depth = np.asarray(drawn(scene, camera, runtime=runtime).first("depth"))
        np.testing.assert_allclose(np.asarray(frame.gbuffer.depth), depth, rtol=1e-5)


def test_history_errs_less_in_the_table(runtime: Runtime, tmp_path: Path) -> None:
    written(tmp_path, 10, runtime, down=True)
    result = CliRunner().invoke(bmfr.main, [str(tmp_path), "--reference", str(tmp_path / "reference"), "--first", "6"])
    assert result.exit_code == 0, result.output
    one, history = (float(line.split("|")[2]) for line in result.output.splitlines()[2:])
    # Seven frames and more would give 1 / sqrt(7) = .38 everywhere; some pixels begin anew.
    assert 0.0 < history < 0.6 * one


def test_wrong_files_are_named(runtime: Runtime, tmp_path: Path) -> None:
    written(tmp_path, 1, runtime, down=True)
    header = tmp_path / bmfr.HEADER
    text = header.read_text()
    header.write_text(text.replace("camera_matrices", "other"))
    with pytest.raises(ValueError, match="0 numbers for camera_matrices: expected 16 for each frame"):
        list(bmfr.frames_of(tmp_path))
    header.write_text(text)
    exr.write(tmp_path / "albedo0.exr", {"": np.ones((ROWS, COLUMNS + 1, 3), np.float32)})
    with pytest.raises(ValueError, match="the images of frame 0"):
        list(bmfr.frames_of(tmp_path))
    (tmp_path / "albedo0.exr").unlink()
    with pytest.raises(FileNotFoundError):
        list(bmfr.frames_of(tmp_path))
