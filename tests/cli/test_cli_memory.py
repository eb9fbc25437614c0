"""`ssgi apply --max-memory`: files by bands of rows, the same bytes as those of whole images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.io import exr
from ssgi_cl.techniques import bands

ROWS, COLUMNS = 403, 310


@pytest.fixture(autouse=True)
def low(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bands, "_first_guess", lambda *_: 64)
    monkeypatch.setattr(bands, "GROWN", float("inf"))
    monkeypatch.setattr(bands, "FILLED", 0.0)


@pytest.fixture(scope="module")
def room() -> gi.GBuffer:
    from ssgi_cl.rasterize.scenes import hall

    scene = hall()
    return gi.rasterize.gbuffer(scene.scene, scene.camera(COLUMNS, ROWS))


def stored(room: gi.GBuffer, kind: str) -> dict[str, Any]:
    """Return the arrays of a file that has depth of a kind."""
    depth, normal = np.asarray(room.depth), np.asarray(room.normal)
    if kind == "ray":
        to_x, to_y, at_x, at_y = room.camera.pixel_to_view
        x = to_x * (np.arange(COLUMNS) + 0.5) + at_x
        y = (to_y * (np.arange(ROWS) + 0.5) + at_y)[:, None]
        depth = (depth * np.sqrt(1.0 + x * x + y * y)).astype(np.float32)
    if kind == "camera normals":
        normal = (normal @ room.camera.view[:3, :3].T).astype(np.float32)
    return {"depth": depth} if kind in ("no normals", "ray") else {"depth": depth, "normal": normal}


def apply(*arguments: str) -> Any:
    result = CliRunner().invoke(main, ["apply", *arguments])
    assert result.exit_code == 0, result.output
    return result


@pytest.mark.parametrize(
    ("kind", "technique", "settings"),
    [
        ("world normals", "gtao", ("bent_normals=true", "resolution=half")),
        ("camera normals", "hbao", ()),
        ("no normals", "ssao", ()),
    ],
)
def test_bands_give_the_bytes_of_the_whole(
    kind: str, technique: str, settings: tuple[str, ...], room: gi.GBuffer, tmp_path: Path
) -> None:
    source, whole, banded = (tmp_path / name for name in ("in.exr", "whole.exr", "banded.exr"))
    exr.write(source, stored(room, kind), camera=room.camera)
    options = [text for setting in settings for text in ("--set", setting)]
    apply(technique, str(source), "-o", str(whole), *options)
    said = apply(technique, str(source), "-o", str(banded), "--max-memory", "4GiB", *options)
    assert banded.read_bytes() == whole.read_bytes()
    assert "depth is read from Z" in said.output


def test_depth_along_the_ray_is_found_in_the_thinned_image(room: gi.GBuffer, tmp_path: Path) -> None:
    source, whole, banded = (tmp_path / name for name in ("in.exr", "whole.exr", "banded.exr"))
    exr.write(source, stored(room, "ray"), camera=room.camera)
    apply("gtao", str(source), "-o", str(whole))
    said = apply("gtao", str(source), "-o", str(banded), "--max-memory", "4GiB")
    assert "distance along the view ray" in said.output
    # The lengths of rays are those of the rows' own cameras: a rounding of the depth here and there.
    assert np.abs(exr.read(banded)["ao"] - exr.read(whole)["ao"]).mean() < 1e-5


def test_a_sequence_is_resumed(room: gi.GBuffer, tmp_path: Path) -> None:
    for number in (1, 2):
        exr.write(tmp_path / f"in.{number:04d}.exr", stored(room, "no normals"), camera=room.camera)
    names = [str(tmp_path / "in.####.exr"), "-o", str(tmp_path / "out.####.exr"), "--max-memory", "4GiB"]
    assert "2 done" in apply("gtao", *names).output
    (tmp_path / "out.0002.exr").unlink()
    assert "1 done, 1 skipped" in apply("gtao", *names).output


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["gtao", "--max-memory", "much"], "'much': expected a number of bytes, such as 4GiB or 512MiB"),
        (["gtao", "--max-memory", "10"], "max_memory is 10"),
        (["ssdo", "--max-memory", "4GiB"], "--max-memory is for ambient occlusion"),
    ],
)
def test_wrong_options(options: list[str], message: str, room: gi.GBuffer, tmp_path: Path) -> None:
    source = tmp_path / "in.exr"
    exr.write(source, stored(room, "no normals"), camera=room.camera)
    result = CliRunner().invoke(main, ["apply", options[0], str(source), "-o", str(tmp_path / "o.exr"), *options[1:]])
    assert result.exit_code != 0
    assert message in " ".join(result.output.split())
    assert not (tmp_path / "o.exr").exists()


def test_nan_in_a_band_is_named_with_its_place(room: gi.GBuffer, tmp_path: Path) -> None:
    source, arrays = tmp_path / "in.exr", stored(room, "no normals")
    arrays["depth"] = arrays["depth"].copy()
    arrays["depth"][300, 7] = np.nan
    exr.write(source, arrays, camera=room.camera)
    names = [str(source), "-o", str(tmp_path / "o.exr"), "--max-memory", "4GiB"]
    result = CliRunner().invoke(main, ["apply", "gtao", *names])
    assert result.exit_code != 0
    assert "of rows from" in result.output
    assert not (tmp_path / "o.exr").exists()
    apply("gtao", *names, "--nan", "hole")


def test_a_picture_in_bands_is_written(tmp_path: Path) -> None:
    picture = tmp_path / "box.png"
    size = ["--width", "64", "--height", "48", "--max-memory", "4GiB"]
    result = CliRunner().invoke(main, ["render", "cornell_box", "-o", str(picture), *size])
    assert result.exit_code == 0, result.output
    assert picture.exists()
    result = CliRunner().invoke(main, ["render", "cornell_box", "-o", str(tmp_path / "box.exr"), *size])
    assert result.exit_code == 2
    assert "--max-memory gives a picture alone" in result.output
