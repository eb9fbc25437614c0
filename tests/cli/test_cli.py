"""The command line: what it writes, what it prints where, and what it says when something fails."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from click.testing import CliRunner, Result
from PIL import Image

import ssgi_cl as gi
from ssgi_cl import __main__ as program
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.cli.command import main
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device import drivers
from ssgi_cl.device.drivers import DeviceInfo
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.io.exr_header import read_header
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.ao.gtao import gtao
from ssgi_cl.techniques.ao.ssao import ssao

SMALL = ("--width", "64", "--height", "48")
SHAPE = (48, 64)
DIRECT = ("--bounces", 0)
"""For tests of what no bounced light changes."""
COMMAND = [sys.executable, "-m", "ssgi_cl.cli.command"]

# Two walls that meet: something for ambient occlusion to darken.
CORNER_OBJ = """
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
v 1 2 -1
v -1 2 -1
f 4 3 2 1
f 1 2 5 6
"""


@pytest.fixture(autouse=True)
def wide_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")


def ssgi(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def succeeds(*arguments: object) -> Result:
    result = ssgi(*arguments)
    assert result.exit_code == 0, result.output
    return result


def answer(*arguments: object) -> Any:
    """What a command with --json prints; nothing but JSON on standard output, nothing else."""
    result = succeeds(*arguments, "--json")
    assert result.stderr == ""
    return json.loads(result.stdout)


def process(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """The finished process of a command."""
    return subprocess.run(
        [*COMMAND, *map(os.fspath, arguments)],  # type: ignore[call-overload]
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        **options,
    )


def fails(folder: Path, *arguments: object) -> str:
    """The message of a command that has to fail; no new file may be left in `folder`."""
    before = sorted(folder.rglob("*"))
    result = ssgi(*arguments)
    assert result.exit_code in (1, 2), result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert sorted(folder.rglob("*")) == before, "it left a file"
    lines = result.stderr.strip().splitlines()
    errors = [line for line in lines if line.startswith("Error: ")]
    assert len(errors) == 1
    # A misused option adds click's usage lines above; the message itself is the last line.
    assert lines[-1] == errors[0]
    assert len(lines) == 1 or (lines[0].startswith("Usage: ") and result.exit_code == 2)
    return errors[0].removeprefix("Error: ")


@pytest.fixture
def corner(tmp_path: Path) -> Path:
    path = tmp_path / "corner.obj"
    path.write_text(CORNER_OBJ)
    return path


@pytest.fixture
def depth_file(tmp_path: Path, rng: np.random.Generator) -> Path:
    """A G-buffer with depth alone: steps of random height, and a corner where nothing is."""
    depth = np.kron(rng.uniform(2.0, 2.4, (6, 8)), np.ones((8, 8))).astype(np.float32)
    depth[:5, :5] = np.inf
    path = tmp_path / "in.exr"
    exr.write(path, {"depth": depth})
    return path


# ---- render


def test_render_writes_a_picture_of_the_size_asked_for(tmp_path: Path) -> None:
    result = succeeds("render", "cornell_box", *SMALL, "-o", tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert (image.size, image.mode) == ((64, 48), "RGB")
        assert np.ptp(np.asarray(image)) > 100, "the picture shows next to nothing"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.png"]
    assert f"wrote {tmp_path / 'a.png'}" in result.stdout
    assert re.search(r"tonemap +\S* +\d+\.\d\d", result.stdout)
    assert result.stderr == ""


def test_render_writes_linear_channels_with_usual_names(tmp_path: Path) -> None:
    succeeds("render", "cornell_box", *SMALL, "--ambient", 0.5, "-o", tmp_path / "a.exr")
    channels = exr.read(tmp_path / "a.exr")
    expected = {*"RGBZ", "ao", "N.X", "N.Y", "N.Z", *(f"albedo.{c}" for c in "RGB")}
    assert expected <= set(channels)
    assert set(channels) - expected <= {f"{n}.{c}" for n in ("emission", "indirect") for c in "RGB"}
    assert all(plane.shape == SHAPE for plane in channels.values())
    assert channels["ao"].min() >= 0.0
    assert channels["ao"].max() <= 1.0
    length = np.hypot(np.hypot(channels["N.X"], channels["N.Y"]), channels["N.Z"])
    # float32 roundings of a unit vector.
    np.testing.assert_allclose(length[np.isfinite(channels["Z"])], 1.0, rtol=0, atol=1e-5)


def test_radiance_in_the_file_is_linear(tmp_path: Path) -> None:
    arguments = ("render", "cornell_box", *SMALL, "--bounces", 0, "--shadow-size", 128, "--exposure", 1, "-o")
    succeeds(*arguments, tmp_path / "a.exr")
    succeeds(*arguments, tmp_path / "b.exr", "--ambient", 1.0)
    succeeds(*arguments, tmp_path / "c.exr", "--ambient", 2.0)
    dark, once, twice = (exr.read(tmp_path / f"{name}.exr")["R"] for name in "abc")
    # Light adds up; float32 roundings of sums.
    np.testing.assert_allclose(twice - dark, 2.0 * (once - dark), rtol=1e-3, atol=1e-4)


def test_render_adds_indirect_light_and_writes_it(tmp_path: Path) -> None:
    options = ["--shadow-size", "128", "--indirect", "vpl", "--vpls", "200", "--layers", "2"]
    facts = answer("render", "cornell_box", *SMALL, *options, "-o", tmp_path / "a.exr")
    assert {"occupancy_voxelize", "vpl_interleaved"} <= {p["name"] for p in facts["passes"]}
    channels = exr.read(tmp_path / "a.exr")
    assert all(channels[f"indirect.{c}"].mean() > 0.0 for c in "RGB")


def test_render_dims_ambient_light_by_the_technique_asked_for(tmp_path: Path) -> None:
    arguments = ("render", "cornell_box", *SMALL, "--bounces", 0, "--ambient", 0.5, "-o", tmp_path / "a.exr")
    for name, more in (("ssao", ["--ao-samples", 8]), ("hbao", []), ("none", [])):
        facts = answer(*arguments, "--ao", name, *more)
        assert (name in {p["name"] for p in facts["passes"]}) == (name != "none")
        assert ("ao" in exr.read(tmp_path / "a.exr")) == (name != "none")


def test_render_writes_views_beside_the_picture(tmp_path: Path) -> None:
    facts = answer("render", "cornell_box", *SMALL, "--ambient", 1, "--views", "-o", tmp_path / "a.png")
    names = {"a.png", "a.exr", "a.ao.png", "a.depth.png", "a.normal.png", "a.albedo.png"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert {Path(name).name for name in facts["files"]} == names
    for path in tmp_path.glob("*.png"):
        with Image.open(path) as image:
            assert image.size == (64, 48)


def test_views_beside_an_exr_do_not_add_the_picture(tmp_path: Path) -> None:
    succeeds("render", "cornell_box", *SMALL, "--views", "-o", tmp_path / "a.exr")
    assert (tmp_path / "a.exr").is_file()
    assert not (tmp_path / "a.png").exists()


def test_render_reports_passes_and_device_as_json(tmp_path: Path, runtime: Runtime) -> None:
    facts = answer("render", "cornell_box", *SMALL, "--bounces", 0, "-o", tmp_path / "a.png")
    assert facts["device"] == runtime.info.label
    assert (facts["scene"], facts["width"], facts["height"]) == ("cornell_box", 64, 48)
    assert facts["triangles"] == 32
    assert facts["wall_ms"] > 0.0
    passes = {entry["name"]: entry for entry in facts["passes"]}
    assert passes["tonemap"]["ms"] >= 0.0
    assert passes["tonemap"]["skipped"] is None
    # The built-in box has no ambient light, so that nothing needs occlusion.
    assert "ambient" in passes["gtao"]["skipped"]


def test_passes_that_were_skipped_say_why_in_the_table(tmp_path: Path) -> None:
    result = succeeds("render", "cornell_box", *SMALL, "--bounces", 0, "-o", tmp_path / "a.png")
    assert "skipped: no ambient light" in result.stdout


def test_render_takes_a_mesh_file(corner: Path, tmp_path: Path) -> None:
    facts = answer("render", corner, *SMALL, "--bounces", 0, "-o", tmp_path / "a.exr")
    assert facts["triangles"] == 4
    channels = exr.read(tmp_path / "a.exr")
    assert np.isfinite(channels["Z"]).mean() > 0.2, "the mesh is hardly in view"
    assert channels["ao"].min() < 0.9, "the corner is not occluded"


def test_suffixes_may_be_upper_case(corner: Path, tmp_path: Path) -> None:
    mesh = corner.rename(tmp_path / "CORNER.OBJ")
    succeeds("render", mesh, *SMALL, *DIRECT, "-o", tmp_path / "A.EXR")
    assert exr.read(tmp_path / "A.EXR")["Z"].shape == SHAPE


def test_eye_and_target_place_the_camera(corner: Path, tmp_path: Path) -> None:
    options = ["--width", "33", "--height", "33", "--eye", "0.2", "1", "4", "--target", "0.2", "1", "-1"]
    succeeds("render", corner, *options, *DIRECT, "-o", tmp_path / "a.exr")
    depth = exr.read(tmp_path / "a.exr")["Z"]
    # The wall z = -1, 5 units straight ahead; float32 roundings of depth.
    np.testing.assert_allclose(depth[16, 16], 5.0, rtol=1e-5)


def test_fov_is_vertical_and_in_degrees(corner: Path, tmp_path: Path) -> None:
    # From z = 1, the wall of height 2 at z = -1 just fills 53.13 degrees.
    options = ["--width", "20", "--height", "200", "--eye", "0", "1", "1", "--target", "0", "1", "-1"]
    for name, fov in (("less", 52.0), ("more", 55.0)):
        succeeds("render", corner, *options, "--fov", fov, *DIRECT, "-o", tmp_path / f"{name}.exr")
    less, more = (exr.read(tmp_path / f"{name}.exr")["Z"] for name in ("less", "more"))
    assert np.isfinite(less[0]).all()
    assert not np.isfinite(more[0]).any()


CAMERA = {"origin": [0, 1, 4], "forward": [0, 0, -1], "up": [0, 1, 0], "fov_deg": 60, "width": 40, "height": 30}


def test_camera_file_places_the_camera_and_sets_the_size(corner: Path, tmp_path: Path) -> None:
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(CAMERA))
    succeeds("render", corner, "--camera", camera, *DIRECT, "-o", tmp_path / "a.exr")
    depth = exr.read(tmp_path / "a.exr")["Z"]
    assert depth.shape == (30, 40)
    np.testing.assert_allclose(depth[15, 20], 5.0, rtol=1e-5)  # float32 roundings of depth


def test_camera_file_beside_the_scene_is_found(corner: Path, tmp_path: Path) -> None:
    (tmp_path / "corner.scene.json").write_text(json.dumps({"camera": CAMERA}))
    facts = answer("render", corner, *DIRECT, "-o", tmp_path / "a.png")
    assert (facts["width"], facts["height"]) == (40, 30)


def test_camera_file_serves_a_built_in_scene_too(tmp_path: Path) -> None:
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps({**CAMERA, "origin": [0.28, 0.27, -0.8], "forward": [0, 0, 1]}))
    facts = answer("render", "cornell_box", "--camera", camera, "-o", tmp_path / "a.png")
    assert (facts["width"], facts["height"]) == (40, 30)


def test_an_eye_alone_moves_the_camera_of_a_built_in_scene(tmp_path: Path) -> None:
    arguments = ("render", "cornell_box", *SMALL, *DIRECT, "-o")
    succeeds(*arguments, tmp_path / "a.exr")
    succeeds(*arguments, tmp_path / "b.exr", "--eye", 0.3, 0.3, -1.0)
    ours, theirs = (exr.read(tmp_path / f"{name}.exr")["Z"] for name in "ab")
    assert not np.array_equal(ours, theirs)


def test_ao_radius_is_in_scene_units(corner: Path, tmp_path: Path) -> None:
    arguments = ("render", corner, *SMALL, "--ao", "ssao", "-o")
    succeeds(*arguments, tmp_path / "a.exr", "--ao-radius", 0.05)
    succeeds(*arguments, tmp_path / "b.exr", "--ao-radius", 0.8)
    near, far = (exr.read(tmp_path / f"{name}.exr")["ao"] for name in "ab")
    assert (far < 0.95).sum() > 2 * (near < 0.95).sum()


def test_rendering_twice_gives_the_same_file(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        succeeds("render", "terrace", *SMALL, "--shadow-size", 128, "-o", tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


# ---- apply


def applied(source: Path, *arguments: object) -> np.ndarray[Any, Any]:
    output = source.with_name("ao.exr")
    succeeds("apply", "ssao", source, "-o", output, *arguments)
    channels = exr.read(output)
    assert set(channels) == {"ao"}
    return channels["ao"]


CAMERAS = {
    "--fov 40": Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(40.0), width=64, height=48),
    "--ortho 3": Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=3.0, width=64, height=48),
    "--intrinsics 70 72 30 25": Camera.from_intrinsics(70, 72, 30, 25, width=64, height=48),
    "": Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(50.0), width=64, height=48),
}


@pytest.mark.parametrize("options", CAMERAS)
def test_apply_gives_what_the_library_gives(depth_file: Path, options: str, runtime: Runtime) -> None:
    depth = exr.read(depth_file)["Z"]
    expected = ssao(GBuffer(camera=CAMERAS[options], depth=depth), 0.3, falloff="exponential", runtime=runtime)
    settings = ("--set", "radius=0.3", "--set", "falloff=exponential")
    np.testing.assert_array_equal(applied(depth_file, *options.split(), *settings), expected)


def test_apply_writes_bent_normals_beside_visibility(depth_file: Path, runtime: Runtime) -> None:
    output = depth_file.with_name("bent.exr")
    succeeds("apply", "gtao", depth_file, "-o", output, "--set", "bent_normals=true")
    gbuffer = GBuffer(camera=CAMERAS[""], depth=exr.read(depth_file)["Z"])
    a, bent = gtao(gbuffer, bent_normals=True, runtime=runtime)
    channels = exr.read(output)
    assert set(channels) == {"ao", "bent.X", "bent.Y", "bent.Z"}
    np.testing.assert_array_equal(channels["ao"], a)
    for i, axis in enumerate("XYZ"):
        np.testing.assert_array_equal(channels[f"bent.{axis}"], bent[..., i])


def test_settings_take_lists_booleans_and_infinity(depth_file: Path, runtime: Runtime) -> None:
    depth = exr.read(depth_file)["Z"]
    expected = ssao(
        GBuffer(camera=CAMERAS[""], depth=depth), [0.1, 0.3], hemisphere=False, falloff=[1.0, 0.5, 0.0], runtime=runtime
    )
    settings = ("radius=[0.1, 0.3]", "hemisphere=False", "falloff=[1, 0.5, 0]", "near_px=inf")
    result = applied(depth_file, *(word for text in settings for word in ("--set", text)))
    np.testing.assert_array_equal(result, expected)


def test_normals_in_the_file_are_used_unless_told_otherwise(depth_file: Path, tmp_path: Path) -> None:
    plain = applied(depth_file)
    depth = exr.read(depth_file)["Z"]
    normal = np.broadcast_to(np.float32([0.6, 0.0, 0.8]), (*SHAPE, 3))
    both = tmp_path / "both.exr"
    exr.write(both, {"depth": depth, "normal": normal})
    assert not np.array_equal(applied(both, "--normals", "camera"), plain)
    message = fails(tmp_path, "apply", "gtao", both, "-o", tmp_path / "no.exr")
    assert "'camera' is" in message
    assert "Say it by --normals" in message
    np.testing.assert_array_equal(applied(both, "--no-normals"), plain)


REGIONS = {
    "overscan": ((-8, -4, 71, 51), (0, 0, 63, 47)),
    "moved overscan": ((92, 46, 171, 101), (100, 50, 163, 97)),
    "moved": ((100, 50, 163, 97), (100, 50, 163, 97)),
    "negative": ((-64, -48, -1, -1), (-64, -48, -1, -1)),
    "one side": ((0, -8, 75, 47), (0, 0, 63, 47)),
    "crop": ((8, 12, 55, 43), (0, 0, 63, 47)),
}


@pytest.mark.parametrize("options", ["--fov 40", "--ortho 3", "--intrinsics 70 72 30 25"])
@pytest.mark.parametrize("name", REGIONS)
def test_the_camera_is_that_of_the_display_window(
    tmp_path: Path, rng: np.random.Generator, name: str, options: str, runtime: Runtime
) -> None:
    (left, top, right, bottom), display = REGIONS[name]
    depth = np.kron(rng.uniform(2.0, 2.4, (14, 20)), np.ones((4, 4))).astype(np.float32)
    depth = np.ascontiguousarray(depth[: bottom - top + 1, : right - left + 1])
    source, output = tmp_path / "in.exr", tmp_path / "ao.exr"
    exr.write(source, {"depth": depth}, data=(left, top, right, bottom), display=display)
    succeeds("apply", "gtao", source, *options.split(), "-o", output)
    header = read_header(output)
    assert (header.data, header.display) == ((left, top, right, bottom), display)
    whole = CAMERAS[options]
    seen = whole.cropped(left - display[0], top - display[1], depth.shape[1], depth.shape[0])
    # The point that a pixel of the data window shows is the one that the whole image's camera sees.
    at = (display[0] - left, display[1] - top)
    sx, sy, ox, oy = whole.pixel_to_view
    np.testing.assert_allclose(seen.pixel_to_view, (sx, sy, ox - sx * at[0], oy - sy * at[1]), rtol=1e-12, atol=1e-15)
    expected = gtao(GBuffer(camera=seen, depth=depth), runtime=runtime)
    np.testing.assert_array_equal(exr.read(output)["ao"], expected)


def test_overscan_gives_what_a_gbuffer_with_a_margin_gives(tmp_path: Path, runtime: Runtime) -> None:
    builtin = make_scene("hall")
    camera = Camera.look_at(builtin.eye, builtin.target, yfov=0.7, width=320, height=240)
    gbuffer = gi.rasterize.gbuffer(builtin.scene, camera, overscan=0.2, runtime=runtime)
    rows, columns = gbuffer.margin
    assert columns % 64 == 0  # so that the same pixels share the length of their slices
    source, output = tmp_path / "in.exr", tmp_path / "ao.exr"
    region = (-columns, -rows, 319 + columns, 239 + rows)
    depth = np.asarray(gbuffer.depth)
    exr.write(source, {"depth": depth}, data=region, display=(0, 0, 319, 239))
    succeeds("apply", "gtao", source, "--fov", np.degrees(0.7), "-o", output)
    expected = gtao(GBuffer(camera=camera, depth=depth), runtime=runtime)
    error = exr.read(output)["ao"][rows:-rows, columns:-columns] - expected
    # float32 roundings of the camera; at the border the groups of pixels are other ones.
    assert np.abs(error[60:-60, 80:-80]).max() < 1e-5
    assert np.sqrt(np.mean(error**2)) < 0.005
    # The same angle taken for that of the data window gives .034.


@pytest.mark.parametrize("link", [None, "symbolic", "hard"])
def test_apply_does_not_replace_its_input_unless_told(
    tmp_path: Path, rng: np.random.Generator, link: str | None
) -> None:
    source = output = tmp_path / "in.exr"
    shape = (12, 16)
    half = rng.uniform(0, 1, shape).astype(np.float16)
    ids = rng.integers(2**24, 2**32, shape, np.uint32)
    depth = rng.uniform(1, 2, shape).astype(np.float32)
    header = {
        "dataWindow": (np.int32([-2, -1]), np.int32([13, 10])),
        "displayWindow": (np.int32([0, 0]), np.int32([11, 9])),
        "owner": "me",
    }
    OpenEXR.File(header, {"Z": depth, "h": half, "id": ids, "ao": depth}).write(str(source))
    if link is not None:
        output = tmp_path / "other.exr"
        output.symlink_to(source) if link == "symbolic" else output.hardlink_to(source)
    before = source.read_bytes()
    message = fails(tmp_path, "apply", "gtao", source, "-o", output)
    assert "that is the input; --overwrite adds" in message
    assert source.read_bytes() == before
    succeeds("apply", "gtao", source, "-o", output, "--overwrite")
    file = OpenEXR.File(str(output), separate_channels=True)
    channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(channels) == {"Z", "h", "id", "ao"}
    for name, old in (("Z", depth), ("h", half), ("id", ids)):
        assert channels[name].dtype == old.dtype
        np.testing.assert_array_equal(channels[name], old)
    assert channels["ao"].max() <= 1.0  # it was a depth
    assert file.header()["owner"] == "me"
    assert read_header(output).data == (-2, -1, 13, 10)
    assert read_header(output).display == (0, 0, 11, 9)


def test_apply_reports_passes_and_files_as_json(depth_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "ao.exr"
    facts = answer("apply", "ssao", depth_file, "-o", output)
    assert facts["files"] == [str(output)]
    assert "ssao" in [entry["name"] for entry in facts["passes"]]
    assert all(entry["ms"] >= 0.0 for entry in facts["passes"])


def test_set_help_lists_every_parameter_without_a_file() -> None:
    listed = succeeds("apply", "ssao", "--set", "help").stdout
    assert "radius=0.5" in listed
    assert "scene units" in listed
    assert max(map(len, listed.splitlines())) <= 100
    names = [row["name"] for row in answer("apply", "ssao", "--set", "help")]
    assert "falloff" in names
    assert all(f"{name}=" in listed for name in names)


# ---- devices


def invented(**changes: Any) -> DeviceInfo:
    speeds = {"1 lane, image": 234.0, "1 lane, buffer": 856.0, "8 lanes, buffer": 3500.0, "16 lanes, buffer": 3400.0}
    entry = {
        "driver": "/some/driver.icd",
        "platform": 0,
        "device": 0,
        "kind": "cpu",
        "units": 2,
        "label": "A Platform 1.2: a processor with a long name",
        "speeds": speeds,
    }
    return DeviceInfo(**{**entry, **changes})


def test_devices_lists_what_there_is(runtime: Runtime) -> None:
    listed = succeeds("devices").stdout
    assert runtime.info.label in listed.replace("\n", " ")
    assert listed.count("used by default") == 1


def test_devices_as_json_gives_the_speed_of_each_form(runtime: Runtime) -> None:
    listed = answer("devices")
    ours = next(entry for entry in listed if entry["label"] == runtime.info.label)
    assert ours["variant"] in ours["million_reads_per_second"]
    assert ours["units"] >= 1


@pytest.mark.parametrize("columns", [60, 80])
def test_devices_fit_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    reason = "kernels/probe/probe_gather.cl does not compile on it: " + "why not " * 20
    broken = invented(label="Broken", speeds={variant: reason for variant in invented().speeds})
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(drivers, "devices", lambda: (invented(), broken))
    lines = succeeds("devices").stdout.splitlines()
    assert max(map(len, lines)) <= columns
    # A device, what it is, and a line for each form: no row is torn apart.
    assert lines[0] == "A Platform 1.2: a processor with a long name"
    assert lines[1].split() == ["cpu,", "2", "compute", "units,", "used", "by", "default"]
    assert [line.split()[-1] for line in lines[2:4]] == ["234", "856"]
    assert lines[5].split()[:5] == ["*", "16", "lanes,", "buffer", "3400"]
    assert lines[5].endswith("in use: widest within 15 %")
    assert any("no kernel variant runs on it" in line for line in lines)


def test_no_device_is_an_error_that_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(drivers, "devices", lambda: ())
    assert "pip install" in fails(tmp_path, "devices")
    assert answer("devices") == []


# ---- help


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ("render", "apply", "devices")),
        (("render",), ("Pixels", "degrees", "cene units", "W m^-2 sr^-1", "horizontal", "world space")),
        (("render",), ("Texels", "milliseconds", "cornell_box")),
        (("apply",), ("degrees", "scene units", "in pixels", "+z towards the viewer", "--set")),
        (("devices",), ("--json",)),
    ],
)
def test_help_names_units(arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    text = " ".join(succeeds(*arguments, "--help").stdout.split())
    for word in words:
        assert word in text
    assert ssgi(*arguments, "-h").stdout == ssgi(*arguments, "--help").stdout


def test_version_is_printed() -> None:
    assert re.fullmatch(r"ssgi, version \d+\.\d+\S*\n", succeeds("--version").stdout)


# ---- errors


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--width", 0], "width is 0"),
        (["--height", -5], "height is -5"),
        (["--width", 100000], "width is 100000"),
        (["--fov", 0], "--fov is 0.0: expected a number >= 0.01 and <= 179 (degrees)"),
        (["--fov", 180], "--fov is 180.0"),
        (["--ao-radius", -1], "radius is -1.0"),
        (["--ao-radius", 0], "radius is 0.0"),
        (["--ao", "ssao", "--ao-samples", 0], "samples is 0"),
        (["--ao-samples", 8], "ao_samples is 8: expected None with ao='gtao'"),
        (["--ao", "best"], "'best' is not one of 'ssao', 'hbao', 'gtao', 'bitmask_ao', 'none'"),
        (["--indirect", "vpl", "--vpls", 0], "vpls is 0"),
        (["--layers", 0], "layers is 0"),
        (["--shadow-size", 1], "shadow_size is 1"),
        (["--rsm-size", 1], "rsm_size is 1"),
        (["--exposure", 0], "exposure is 0.0"),
        (["--exposure", "nan"], "exposure is nan"),
        (["--ambient", -1], "expected numbers >= 0"),
        (["--eye", "nan", 0, 0, "--target", 0, 0, 0], "nan"),
        (["--eye", 1, 2, 3, "--target", 1, 2, 3], "expected two points"),
        (["--device", "no such thing"], "no such OpenCL device. Devices found: "),
        (["--camera", "nowhere.json"], "nowhere.json cannot be read"),
        (["--camera", "a.json", "--fov", 40], "--camera and --fov exclude each other"),
        (["--width", "wide"], "'wide' is not a valid integer"),
    ],
)
def test_a_wrong_option_of_render_is_named(tmp_path: Path, options: list[object], message: str) -> None:
    assert message in fails(tmp_path, "render", "cornell_box", *options, "-o", tmp_path / "a.png")


def test_eye_of_a_file_needs_a_target(corner: Path, tmp_path: Path) -> None:
    message = fails(tmp_path, "render", corner, "--eye", 1, 2, 3, "-o", tmp_path / "a.png")
    assert message == "--eye and --target go together"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "there is no such file"),
        ("no_such_scene", None, "there is no such file"),
        ("mesh.xyz", "1 2 3", "ends in '.xyz': expected one of .glb, .gltf, .obj, .ply"),
        ("empty.obj", "", "empty.obj"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "points.obj"),
        ("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
        ("point.obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "point.obj"),
        ("junk.glb", "not a glb", "junk.glb"),
        ("junk.ply", "not a ply", "junk.ply"),
    ],
)
def test_a_scene_that_cannot_be_read_is_named(tmp_path: Path, name: str, content: str | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    error = fails(tmp_path, "render", path, *SMALL, "-o", tmp_path / "a.png")
    assert message in error
    assert name in error


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.jpg", "expected a name that ends in .png or .exr"),
        ("a", "expected a name that ends in .png or .exr"),
        ("missing/a.png", "there is no folder"),
        ("file.txt/a.png", "there is no folder"),
        ("folder.png", "it is a folder"),
    ],
)
def test_an_output_that_cannot_be_written_is_named(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file.txt").write_text("")
    output = tmp_path / name
    error = fails(tmp_path, "render", "cornell_box", *SMALL, "-o", output)
    assert message in error
    assert str(output) in error


def test_a_view_that_cannot_be_written_stops_it_before_any_file(tmp_path: Path) -> None:
    (tmp_path / "a.normal.png").mkdir()
    error = fails(tmp_path, "render", "cornell_box", *SMALL, "--views", "-o", tmp_path / "a.png")
    assert "a.normal.png: it is a folder" in error


def test_a_failed_render_keeps_the_picture_that_was_there(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"precious")
    fails(tmp_path, "render", "cornell_box", *SMALL, "--ao-radius", -1, "-o", tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == b"precious"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--set", "radius=-1"], "radius is -1: expected a number > 0"),
        (["--set", "radius=NaN"], "radius is nan"),
        (["--set", "radius=wide"], "radius is 'wide'"),
        (["--set", "radius=null"], "radius is None"),
        (["--set", "falloff=sudden"], "expected one of 'exponential', 'ramp'"),
        (["--set", "falloff={}"], "falloff is {}"),
        (["--set", "samples=1.5"], "samples is 1.5: expected an integer"),
        (["--set", "hemisphere=3"], "hemisphere is 3: expected True or False"),
        (["--set", "resolution=[1]"], "resolution is [1]"),
        (["--set", "radius"], "--set 'radius': expected NAME=VALUE"),
        (["--set", "radus=1"], "ssao has no parameter 'radus': did you mean 'radius'? It has "),
        (["--set", "runtime=1"], "ssao has no parameter 'runtime'"),
        (["--set", "=1"], "ssao has no parameter ''"),
        (["--fov", 40, "--ortho", 2], "--fov, --ortho and --intrinsics exclude each other"),
        (["--fov", 0], "--fov is 0.0"),
        (["--ortho", 0], "view_height is 0.0"),
        (["--ortho", 1e300], "view_height is 1e+300: expected a number >= 1e-28 and <= 1e+28 (sc"),
        (["--intrinsics", 1e300, 1e300, 0, 0], "scales are"),
        (["--intrinsics", 1, 1, 1e300, 0], "shifts the image by"),
        (["--intrinsics", 0, 1, 2, 3], "fx is 0.0"),
        (["--device", "no such thing"], "no such OpenCL device"),
    ],
)
def test_a_wrong_option_of_apply_is_named(
    depth_file: Path, tmp_path: Path, options: list[object], message: str
) -> None:
    output = tmp_path / "ao.exr"
    assert message in fails(tmp_path, "apply", "ssao", depth_file, *options, "-o", output)


def test_apply_needs_a_file_and_an_output(depth_file: Path, tmp_path: Path) -> None:
    assert "IN.exr" in fails(tmp_path, "apply", "ssao", "-o", tmp_path / "ao.exr")
    assert "--output" in fails(tmp_path, "apply", "ssao", depth_file)
    assert "'nonsense'" in fails(tmp_path, "apply", "nonsense", depth_file, "-o", "ao.exr")


def test_apply_writes_exr_only(depth_file: Path, tmp_path: Path) -> None:
    message = fails(tmp_path, "apply", "ssao", depth_file, "-o", tmp_path / "ao.png")
    assert "expected a name that ends in .exr" in message


def written(**channels: Any) -> bytes:
    """The bytes of an OpenEXR file."""
    with tempfile.TemporaryDirectory() as folder:
        exr.write(Path(folder) / "a.exr", channels)
        return (Path(folder) / "a.exr").read_bytes()


HOLE = np.where(np.arange(20).reshape(4, 5) == 7, np.nan, 1.0).astype(np.float32)
WHOLE = written(depth=np.random.default_rng(3).uniform(2.0, 2.4, SHAPE).astype(np.float32))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (written(image=np.ones((4, 5, 3), np.float32)), "no depth channel; it has B, G, R"),
        (written(depth=HOLE), "depth[1, 2] is nan"),
        (b"", "in.exr"),
        (b"junk", "in.exr"),
        (b"\x76\x2f\x31\x01" + b"\0" * 50, "in.exr"),
        (WHOLE[: len(WHOLE) * 2 // 3], "damaged or cut short"),
        (None, "in.exr: No such file or directory"),
    ],
)
def test_a_file_that_is_no_gbuffer_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    if content is not None:
        (tmp_path / "in.exr").write_bytes(content)
    assert message in fails(tmp_path, "apply", "ssao", tmp_path / "in.exr", "-o", tmp_path / "ao.exr")


# ---- as a process


def test_the_command_runs_as_a_process_with_json_alone_on_standard_output(tmp_path: Path) -> None:
    done = process("render", "cornell_box", *SMALL, "--json", "-o", "a.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert json.loads(done.stdout)["files"] == ["a.png"]
    assert (tmp_path / "a.png").is_file()


def test_a_failing_process_says_so_on_standard_error_alone(tmp_path: Path) -> None:
    done = process("render", "nothing.obj", "--json", "-o", "a.png", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "Error: nothing.obj: there is no such file\n"
    assert list(tmp_path.iterdir()) == []


# ---- hostile values, names and limits


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("radius=1" + "0" * 400, "radius is 1000"),
        ("radius=1" + "0" * 5000, "radius is "),
        ("radius=-1" + "0" * 400, "radius is -1000"),
        ("radius=" + "[" * 100_000, "--set radius: the value is nested too deeply"),
        ("taps=1" + "0" * 400, "taps is 1000"),
        ("x" * 10_000, "expected NAME=VALUE"),
    ],
)
def test_hostile_settings_are_refused_in_a_line(depth_file: Path, tmp_path: Path, setting: str, message: str) -> None:
    text = fails(tmp_path, "apply", "gtao", depth_file, "--set", setting, "-o", tmp_path / "a.exr")
    assert message in text
    assert len(text) < 400


def test_deeply_nested_json_is_refused(corner: Path, tmp_path: Path) -> None:
    deep = tmp_path / "deep.json"
    deep.write_text('{"camera": ' * 100_000)
    assert "deep.json is not JSON" in fails(tmp_path, "render", corner, "--camera", deep, "-o", tmp_path / "a.png")
    assert "deep.json is not JSON" in fails(tmp_path, "bench", "--compare", deep, deep)
    assert "deep.json is not JSON" in fails(tmp_path, "bench", "gtao", "--scene", deep, "--list")


@pytest.mark.parametrize("name", [".", "nothing", "nothing.xyz"])
def test_a_name_that_is_no_scene_is_answered_with_those_that_are(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bench = ("bench", "gtao", "--scene", name, "--list")
    for arguments in (("render", name, "-o", "a.png"), bench):
        message = fails(tmp_path, *arguments)
        assert f"scene is '{name}'" in message
        assert "cornell_box, hall" in message
        assert "KIND-SEED" in message
    assert ("it is a folder" in fails(tmp_path, "render", name, "-o", "a.png")) == (name == ".")


def test_up_turns_the_picture(corner: Path, tmp_path: Path) -> None:
    aim = ("--eye", 0.2, 6, 0.1, "--target", 0.2, 0, 0.1)
    message = fails(tmp_path, "render", corner, *SMALL, *aim, "-o", tmp_path / "a.exr")
    assert "up is [0.0, 1.0, 0.0]: expected a direction not parallel" in message
    square = ("--width", 48, "--height", 48, *DIRECT)
    for name, up in (("a", (0, 0, -1)), ("b", (0, 0, 1))):
        succeeds("render", corner, *square, *aim, "--up", *up, "-o", tmp_path / f"{name}.exr")
    one, other = (exr.read(tmp_path / f"{name}.exr")["Z"] for name in "ab")
    # A quarter turn twice; float32 roundings of depth.
    np.testing.assert_allclose(one, other[::-1, ::-1], rtol=1e-5)
    assert not np.allclose(one, other)
    box = ("render", "cornell_box", *SMALL, *DIRECT, "--up", 1, 0, 0, "-o", tmp_path / "box.exr")
    succeeds(*box)
    succeeds(*box[:6], *DIRECT, "-o", tmp_path / "upright.exr")
    one, other = (exr.read(tmp_path / f"{name}.exr")["Z"] for name in ("box", "upright"))
    assert not np.array_equal(one, other)
    assert "--up needs --eye" in fails(tmp_path, "render", corner, "--up", 0, 0, 1, "-o", tmp_path / "c.exr")


def test_a_full_disk_is_told_with_the_name_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    output = tmp_path / "a.png"
    message = fails(tmp_path, "render", "cornell_box", *SMALL, "-o", output)
    assert message == f"{output}: cannot write the file: No space left on device"


@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux")
def test_names_that_are_not_utf8_work_and_are_shown(depth_file: Path, corner: Path, tmp_path: Path) -> None:
    odd = tmp_path / os.fsdecode(b"\xff")
    odd.mkdir()
    source, output = odd / os.fsdecode(b"in\xfe.exr"), odd / os.fsdecode(b"out\xfe.exr")
    depth_file.rename(source)
    result = succeeds("apply", "gtao", source, "-o", output)
    assert r"out\xfe.exr" in "".join(result.stdout.split())
    assert set(exr.read(output)) == {"ao"}
    succeeds("apply", "gtao", source, "-o", source, "--overwrite")
    assert set(exr.read(source)) == {"Z", "ao"}
    answer("render", corner.rename(odd / "a.obj"), *SMALL, "-o", odd / "a.png")
    message = fails(tmp_path, "render", odd / os.fsdecode(b"c\xfe.obj"), "-o", odd / "c.png")
    assert r"\xff/c\xfe.obj: there is no such file" in message


def test_ambient_occlusion_needs_neither_albedo_nor_emission(depth_file: Path, tmp_path: Path) -> None:
    depth = exr.read(depth_file)["Z"]
    colours = {"albedo": np.full((*SHAPE, 3), 1.5), "emission": np.full((*SHAPE, 3), np.inf)}
    both = tmp_path / "both.exr"
    exr.write(both, {"depth": depth, **colours})
    np.testing.assert_array_equal(applied(both), applied(depth_file))
    message = fails(tmp_path, "apply", "ssdo", both, "-o", tmp_path / "gi.exr")
    assert "albedo[0, 0, 0] is 1.5: expected numbers >= 0 and <= 1" in message


def test_nan_may_stand_for_holes(depth_file: Path, tmp_path: Path) -> None:
    depth = exr.read(depth_file)["Z"]
    normal = np.tile(np.float32([0.6, 0.0, 0.8]), (*SHAPE, 1))
    holes, broken = tmp_path / "holes.exr", tmp_path / "broken.exr"
    open_, wrong, zero = depth.copy(), depth.copy(), normal.copy()
    open_[20:23, 30], wrong[20:23, 30] = np.inf, np.nan
    normal[30, 30], zero[30, 30] = np.nan, 0.0
    exr.write(holes, {"depth": open_, "normal": zero})
    exr.write(broken, {"depth": wrong, "normal": normal})
    space = ("--normals", "camera")
    assert "depth[20, 30] is nan" in fails(tmp_path, "apply", "ssao", broken, *space, "-o", tmp_path / "ao.exr")
    np.testing.assert_array_equal(applied(broken, *space, "--nan", "hole"), applied(holes, *space))


def test_what_lacks_memory_is_told_in_a_line(depth_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def lacking(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 9.9 GiB")

    monkeypatch.setattr(exr, "read_gbuffer", lacking)
    output = tmp_path / "a.exr"
    message = fails(tmp_path, "apply", "gtao", depth_file, "-o", output)
    assert message.startswith("out of memory: Unable to allocate 9.9 GiB")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (3 << 30, 3 << 30))
    message = fails(tmp_path, "apply", "gtao", depth_file, "-o", output)
    assert message.endswith("(ulimit -v allows the process 3072 MiB)")


def test_a_driver_that_fails_is_told_in_a_line(
    depth_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyopencl as cl

    def failing(*_: object, **__: object) -> None:
        raise cl.LogicError("clSomething failed", -54, "INVALID_WORK_GROUP_SIZE")

    monkeypatch.setattr(exr, "read_gbuffer", failing)
    message = fails(tmp_path, "apply", "gtao", depth_file, "-o", tmp_path / "a.exr")
    assert message.startswith("the OpenCL driver failed: ")


def test_a_bench_that_measures_nothing_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = replace(FAMILIES["ssao"], missing=lambda: "it is not installed")
    monkeypatch.setitem(FAMILIES, "ssao", absent)  # type: ignore[arg-type]
    result = ssgi("bench", "ssao.16.cornell_box", "--size", "64x48", "--seconds", 0.01)
    assert result.exit_code == 1
    assert "Error: nothing was measured: it is not installed" in result.stderr


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (KeyboardInterrupt(), "Aborted!"),
        (MemoryError(), "Error: ssgi can't start: out of memory (see ulimit -v)"),
        (
            ImportError("x.so: failed to map segment from shared object"),
            "Error: ssgi can't start: out of memory (see ulimit -v)",
        ),
        (ImportError("No module named 'rich'"), "Error: ssgi can't start: No module named 'rich'"),
    ],
)
def test_an_import_that_is_interrupted_ends_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: BaseException, line: str
) -> None:
    class Interrupted:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            if name == "ssgi_cl.cli.command":
                raise error

    monkeypatch.delitem(sys.modules, "ssgi_cl.cli.command")
    monkeypatch.setattr(sys, "meta_path", [Interrupted, *sys.meta_path])
    assert program.main() == 1
    assert capsys.readouterr().err == f"{line}\n"


@pytest.mark.slow
def test_small_work_groups_are_refused_with_the_variable(depth_file: Path, tmp_path: Path) -> None:
    small = {**os.environ, "POCL_MAX_WORK_GROUP_SIZE": "8"}
    done = process("apply", "gtao", depth_file, "--device", "pocl", "-o", tmp_path / "a.exr", env=small)
    assert done.returncode == 1
    assert "work-groups of at most 8 work-items: expected 64 or more" in done.stderr
    assert "POCL_MAX_WORK_GROUP_SIZE" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_process_that_is_interrupted_as_it_starts_says_so(tmp_path: Path) -> None:
    started = subprocess.Popen(
        [sys.executable, "-c", "import ssgi_cl.__main__ as c, sys; print(flush=True); sys.exit(c.main())", "devices"],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert started.stdout is not None
    started.stdout.readline()
    time.sleep(0.3)
    started.send_signal(signal.SIGINT)
    _, errors = started.communicate(timeout=60)
    assert started.returncode == 1
    assert errors == "Aborted!\n"
