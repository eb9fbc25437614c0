"""The command `ssgi render`: what it writes, what it prints, and what it says when something fails."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.io import exr
from ssgi_cl.rasterize.scenes import make_scene

from .commands import DIRECT, SHAPE, SMALL, answer, fails, process, succeeds

CAMERA = {"origin": [0, 1, 4], "forward": [0, 0, -1], "up": [0, 1, 0], "fov_deg": 60, "width": 40, "height": 30}


def test_render_writes_a_picture_of_the_size_asked_for(tmp_path: Path) -> None:
    result = succeeds("render", "cornell_box", *SMALL, "-o", tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert (image.size, image.mode) == ((64, 48), "RGB")
        assert np.ptp(np.asarray(image)) > 100, "the picture shows next to nothing"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.png"]
    assert f"wrote {tmp_path / 'a.png'}" in result.stdout
    assert re.search(r"tonemap +\S* +\d+\.\d\d", result.stdout)
    assert result.stderr == ""


def test_channels_have_usual_names_and_radiance_is_linear(tmp_path: Path) -> None:
    arguments = ("render", "cornell_box", *DIRECT, "--exposure", 1, "-o")
    for name, ambient in (("a", 0.0), ("b", 1.0), ("c", 2.0)):
        succeeds(*arguments, tmp_path / f"{name}.exr", "--ambient", ambient)
    channels = exr.read(tmp_path / "b.exr")
    expected = {*"RGBZ", "ao", "N.X", "N.Y", "N.Z", *(f"albedo.{c}" for c in "RGB")}
    assert expected <= set(channels)
    assert set(channels) - expected <= {f"emission.{c}" for c in "RGB"}
    assert all(plane.shape == SHAPE for plane in channels.values())
    assert channels["ao"].min() >= 0.0
    assert channels["ao"].max() <= 1.0
    length = np.hypot(np.hypot(channels["N.X"], channels["N.Y"]), channels["N.Z"])
    # float32 roundings of a unit vector.
    np.testing.assert_allclose(length[np.isfinite(channels["Z"])], 1.0, rtol=0, atol=1e-5)
    dark, once, twice = (exr.read(tmp_path / f"{name}.exr")["R"] for name in "abc")
    # Light adds up; float32 roundings of sums.
    np.testing.assert_allclose(twice - dark, 2.0 * (once - dark), rtol=1e-3, atol=1e-4)


def test_render_adds_indirect_light_and_writes_it(tmp_path: Path) -> None:
    options = ["--indirect", "vpl", "--vpls", "200", "--layers", "2"]
    facts = answer("render", "cornell_box", *SMALL, *options, "-o", tmp_path / "a.exr")
    assert {"occupancy_voxelize", "vpl_interleaved"} <= {p["name"] for p in facts["passes"]}
    channels = exr.read(tmp_path / "a.exr")
    assert all(channels[f"indirect.{c}"].mean() > 0.0 for c in "RGB")


def test_render_dims_ambient_light_by_the_technique_asked_for(tmp_path: Path) -> None:
    arguments = ("render", "cornell_box", *DIRECT, "--ambient", 0.5, "-o", tmp_path / "a.exr")
    for name, more in (("ssao", ["--ao-samples", 8]), ("none", [])):
        facts = answer(*arguments, "--ao", name, *more)
        assert (name in {p["name"] for p in facts["passes"]}) == (name != "none")
        assert ("ao" in exr.read(tmp_path / "a.exr")) == (name != "none")


def test_render_writes_views_beside_the_picture(tmp_path: Path) -> None:
    facts = answer("render", "cornell_box", *DIRECT, "--ambient", 1, "--views", "-o", tmp_path / "a.png")
    names = {"a.png", "a.exr", "a.ao.png", "a.depth.png", "a.normal.png", "a.albedo.png"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert {Path(name).name for name in facts["files"]} == names
    for path in tmp_path.glob("*.png"):
        with Image.open(path) as image:
            assert image.size == (64, 48)
    succeeds("render", "cornell_box", *DIRECT, "--views", "-o", tmp_path / "b.exr")
    assert (tmp_path / "b.exr").is_file()
    assert not (tmp_path / "b.png").exists()


def test_render_reports_passes_and_device(tmp_path: Path, runtime: Runtime) -> None:
    arguments = ("render", "cornell_box", *DIRECT, "-o", tmp_path / "a.png")
    facts = answer(*arguments)
    assert facts["device"] == runtime.info.label
    assert (facts["scene"], facts["width"], facts["height"]) == ("cornell_box", 64, 48)
    assert facts["triangles"] == 32
    assert facts["wall_ms"] > 0.0
    assert "form" not in facts
    assert facts["variant"] == str(runtime.variant)
    # What an API's caller gives for the same picture.
    box = make_scene("cornell_box")
    camera = box.camera(64, 48)
    np.testing.assert_allclose(facts["camera"]["eye"], camera.position, rtol=0, atol=1e-12)  # roundings of float64
    np.testing.assert_allclose(facts["camera"]["forward"], -camera.view[2, :3], rtol=0, atol=1e-12)
    assert facts["camera"]["fov"] == pytest.approx(np.degrees(box.yfov))
    assert [light["kind"] for light in facts["lights"]] == [type(light).__name__ for light in box.lights]
    frame = render(box.scene, camera, box.lights, bounces=0, ao_radius=box.ao_radius, shadow_size=64, runtime=runtime)
    assert facts["exposure"] == frame.exposure
    passes = {entry["name"]: entry for entry in facts["passes"]}
    assert passes["tonemap"]["ms"] >= 0.0
    assert passes["tonemap"]["skipped"] is None
    # The built-in box has no ambient light, so that nothing needs occlusion.
    assert "ambient" in passes["bitmask_ao"]["skipped"]
    shown = succeeds(*arguments).stdout
    assert "skipped: no ambient light" in shown
    assert f"exposure {frame.exposure:.4g}\n" in shown


def test_render_takes_a_mesh_file_and_suffixes_in_upper_case(corner: Path, tmp_path: Path) -> None:
    mesh = corner.rename(tmp_path / "CORNER.OBJ")
    facts = answer("render", mesh, *DIRECT, "-o", tmp_path / "A.EXR")
    assert facts["triangles"] == 4
    channels = exr.read(tmp_path / "A.EXR")
    assert channels["Z"].shape == SHAPE
    assert np.isfinite(channels["Z"]).mean() > 0.2, "the mesh is hardly in view"
    assert channels["ao"].min() < 0.9, "the corner is not occluded"


def depth_of(scene: Path | str, output: Path, *options: object) -> np.ndarray:
    """Return the depths of a picture."""
    succeeds("render", scene, *DIRECT, *options, "-o", output)
    return exr.read(output)["Z"]


def test_eye_and_target_place_the_camera(corner: Path, tmp_path: Path) -> None:
    size = ("--width", 33, "--height", 33)
    depth = depth_of(corner, tmp_path / "a.exr", *size, "--eye", 0.2, 1, 4, "--target", 0.2, 1, -1)
    # The wall z = -1, 5 units straight ahead; float32 roundings of depth.
    np.testing.assert_allclose(depth[16, 16], 5.0, rtol=1e-5)


def test_fov_is_vertical_and_in_degrees(corner: Path, tmp_path: Path) -> None:
    # From z = 1, the wall of height 2 at z = -1 just fills 53.13 degrees.
    options = ("--width", 20, "--height", 200, "--eye", 0, 1, 1, "--target", 0, 1, -1, "--fov")
    less, more = (depth_of(corner, tmp_path / "a.exr", *options, fov) for fov in (52.0, 55.0))
    assert np.isfinite(less[0]).all()
    assert not np.isfinite(more[0]).any()


def test_a_camera_file_places_the_camera_and_sets_the_size(corner: Path, tmp_path: Path) -> None:
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(CAMERA))
    given = ("--bounces", 0, "--shadow-size", 64, "-o", tmp_path / "a.exr")
    succeeds("render", corner, "--camera", camera, *given)
    depth = exr.read(tmp_path / "a.exr")["Z"]
    assert depth.shape == (30, 40)
    np.testing.assert_allclose(depth[15, 20], 5.0, rtol=1e-5)  # float32 roundings of depth
    (tmp_path / "corner.scene.json").write_text(json.dumps({"camera": CAMERA}))
    facts = answer("render", corner, *given)
    assert (facts["width"], facts["height"]) == (40, 30), "the file beside the scene is found"
    camera.write_text(json.dumps({**CAMERA, "origin": [0.28, 0.27, -0.8], "forward": [0, 0, 1]}))
    facts = answer("render", "cornell_box", "--camera", camera, *given)
    assert (facts["width"], facts["height"]) == (40, 30)


def test_eye_and_up_alone_move_the_camera_of_a_built_in_scene(tmp_path: Path) -> None:
    ours, moved, turned = (
        depth_of("cornell_box", tmp_path / "a.exr", *options)
        for options in ((), ("--eye", 0.3, 0.3, -1.0), ("--up", 1, 0, 0))
    )
    assert not np.array_equal(ours, moved)
    assert not np.array_equal(ours, turned)


def test_up_turns_the_picture(corner: Path, tmp_path: Path) -> None:
    aim = ("--eye", 0.2, 6, 0.1, "--target", 0.2, 0, 0.1)
    message = fails(tmp_path, "render", corner, *SMALL, *aim, "-o", tmp_path / "a.exr")
    assert "up is [0.0, 1.0, 0.0]: expected a direction not parallel" in message
    message = fails(tmp_path, "render", corner, "--eye", 1, 2, 3, "-o", tmp_path / "a.png")
    assert message == "--eye and --target go together"
    assert "--up needs --eye" in fails(tmp_path, "render", corner, "--up", 0, 0, 1, "-o", tmp_path / "c.exr")
    square = ("--width", 48, "--height", 48, *aim, "--up")
    one, other = (depth_of(corner, tmp_path / "a.exr", *square, 0, 0, z) for z in (-1, 1))
    # A quarter turn twice; float32 roundings of depth.
    np.testing.assert_allclose(one, other[::-1, ::-1], rtol=1e-5)
    assert not np.allclose(one, other)


def test_ao_radius_is_in_scene_units(corner: Path, tmp_path: Path) -> None:
    arguments = ("render", corner, *DIRECT, "--ao", "ssao", "--ao-samples", 8, "-o", tmp_path / "a.exr")
    found = []
    for radius in (0.05, 0.8):
        succeeds(*arguments, "--ao-radius", radius)
        found.append((exr.read(tmp_path / "a.exr")["ao"] < 0.95).sum())
    assert found[1] > 2 * found[0]


def test_rendering_twice_gives_the_same_file(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        succeeds("render", "cornell_box", *DIRECT, "-o", tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_render_has_the_method(tmp_path: Path) -> None:
    size = ("--width", 48, "--height", 36, "--shadow-size", 64, "--rsm-size", 64)
    arguments = ("render", "cornell_box", *size, "--indirect", "gather", "-o", tmp_path / "a.png", "--method")
    facts = answer(*arguments, "published")
    assert "rsm_published_interpolate" in {p["name"] for p in facts["passes"]}
    assert "method is 'paper': expected one of 'unbiased', 'published'" in fails(tmp_path, *arguments, "paper")


# ---- errors


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--width", 0], "width is 0"),
        (["--width", 100000], "width is 100000"),
        (["--fov", 0], "--fov is 0.0: expected a number >= 0.01 and <= 179 (degrees)"),
        (["--ao-radius", -1], "radius is -1.0"),
        (["--ao", "ssao", "--ao-samples", 0], "samples is 0"),
        (["--ao-samples", 8], "ao_samples is 8: expected None with ao=True"),
        (["--ao", "best"], "'best' is not one of 'ssao', 'hbao', 'gtao', 'bitmask_ao', 'none'"),
        (["--indirect", "vpl", "--vpls", 0], "vpls is 0"),
        (["--layers", 0], "layers is 0"),
        (["--shadow-size", 1], "shadow_size is 1"),
        (["--rsm-size", 1], "rsm_size is 1"),
        (["--exposure", "nan"], "exposure is nan"),
        (["--ambient", -1], "expected numbers >= 0"),
        (["--eye", 1, 2, 3, "--target", 1, 2, 3], "expected two points"),
        (["--device", "no such thing"], "no such OpenCL device. Devices found: "),
        (["--camera", "nowhere.json"], "nowhere.json cannot be read"),
        (["--camera", "a.json", "--fov", 40], "--camera and --fov exclude each other"),
        (["--width", "wide"], "'wide' is not a valid integer"),
    ],
)
def test_a_wrong_option_of_render_is_named(tmp_path: Path, options: list[object], message: str) -> None:
    assert message in fails(tmp_path, "render", "cornell_box", *options, "-o", tmp_path / "a.png")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "there is no such file"),
        ("mesh.xyz", "1 2 3", "ends in '.xyz': expected one of .glb, .gltf, .obj, .ply"),
        ("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
        ("junk.glb", "not a glb", "junk.glb"),
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
    (tmp_path / "b.normal.png").mkdir()
    error = fails(tmp_path, "render", "cornell_box", *SMALL, "--views", "-o", tmp_path / "b.png")
    assert "b.normal.png: it is a folder" in error


def test_a_failed_render_keeps_the_picture_that_was_there(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"precious")
    fails(tmp_path, "render", "cornell_box", *SMALL, "--ao-radius", -1, "-o", tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == b"precious"


def test_a_full_disk_is_told_with_the_name_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    output = tmp_path / "a.png"
    message = fails(tmp_path, "render", "cornell_box", *DIRECT, "-o", output)
    assert message == f"{output}: cannot write the file: No space left on device"


# ---- as a process


def test_the_command_runs_as_a_process_with_json_alone_on_standard_output(tmp_path: Path) -> None:
    done = process("render", "cornell_box", *map(str, DIRECT), "--json", "-o", "a.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    # On a machine that has compiled none of the kernels the line that says so is there.
    assert [line for line in done.stderr.splitlines() if not line.startswith("compiling kernels")] == []
    assert json.loads(done.stdout)["files"] == ["a.png"]
    assert (tmp_path / "a.png").is_file()


def test_a_failing_process_says_so_on_standard_error_alone(tmp_path: Path) -> None:
    done = process("render", "nothing.obj", "--json", "-o", "a.png", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "Error: nothing.obj: there is no such file\n"
    assert list(tmp_path.iterdir()) == []


def test_a_misspelt_scene_names_the_nearest(tmp_path: Path) -> None:
    assert fails(tmp_path, "render", "halll", "-o", tmp_path / "a.png").endswith("; did you mean 'hall'?")
