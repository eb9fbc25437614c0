"""The command `ssgi apply`: the library's own results, files that it adds to, and messages."""

from __future__ import annotations

import os
import resource
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.io.exr_header import read_header
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.sequences.apply_exr import ApplyExr
from ssgi_cl.sequences.exr_passes import Passes
from ssgi_cl.techniques.ao.gtao import gtao
from ssgi_cl.techniques.ao.ssao import ssao

from .commands import CAMERAS, DIRECT, SHAPE, answer, applied, fails, process, succeeds


@pytest.mark.parametrize("options", CAMERAS)
def test_apply_gives_what_the_library_gives(depth_file: Path, options: str, runtime: Runtime) -> None:
    depth = exr.read(depth_file)["Z"]
    expected = ssao(GBuffer(camera=CAMERAS[options], depth=depth), 0.3, falloff="exponential", runtime=runtime)
    settings = ("--set", "radius=0.3", "--set", "falloff=exponential")
    np.testing.assert_array_equal(applied(depth_file, *options.split(), *settings), expected)


def test_apply_writes_bent_normals_beside_visibility(depth_file: Path, runtime: Runtime) -> None:
    output = depth_file.with_name("bent.exr")
    settings = ("--set", "bent_normals=true", "--set", "blur_passes=0")
    facts = answer("apply", "gtao", depth_file, "-o", output, *settings)
    assert facts["files"] == [str(output)]
    assert "gtao" in [entry["name"] for entry in facts["passes"]]
    assert all(entry["ms"] >= 0.0 for entry in facts["passes"])
    gbuffer = GBuffer(camera=CAMERAS[""], depth=exr.read(depth_file)["Z"])
    a, bent = gtao(gbuffer, bent_normals=True, blur_passes=0, runtime=runtime)
    channels = exr.read(output)
    assert set(channels) == {"ao", "bent.X", "bent.Y", "bent.Z"}
    np.testing.assert_array_equal(channels["ao"], a)
    for i, axis in enumerate("XYZ"):
        np.testing.assert_array_equal(channels[f"bent.{axis}"], bent[..., i])


def test_apply_writes_confidence_beside_visibility(depth_file: Path, runtime: Runtime) -> None:
    output = depth_file.with_name("sure.exr")
    gbuffer = GBuffer(camera=CAMERAS[""], depth=exr.read(depth_file)["Z"])
    for settings, names in (((), {"ao"}), (("--set", "bent_normals=true"), {"ao", "bent.X", "bent.Y", "bent.Z"})):
        succeeds("apply", "gtao", depth_file, "-o", output, "--confidence", *settings)
        channels = exr.read(output)
        assert set(channels) == {"confidence", *names}
        a, confidence = gtao(gbuffer, confidence=True, runtime=runtime)
        np.testing.assert_array_equal(channels["ao"], a)
        np.testing.assert_array_equal(channels["confidence"], confidence)


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


@pytest.mark.parametrize(("name", "options"), [*zip(REGIONS, [*CAMERAS][:3] * 2, strict=True)])
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
    builtin = make_scene("cornell_box")
    camera = Camera.look_at(builtin.eye, builtin.target, yfov=0.7, width=128, height=96)
    gbuffer = gi.rasterize.gbuffer(builtin.scene, camera, overscan=0.5, runtime=runtime)
    rows, columns = gbuffer.margin
    assert columns % 64 == 0  # so that the same pixels share the length of their slices
    source, output = tmp_path / "in.exr", tmp_path / "ao.exr"
    region = (-columns, -rows, 127 + columns, 95 + rows)
    depth = np.asarray(gbuffer.depth)
    exr.write(source, {"depth": depth}, data=region, display=(0, 0, 127, 95))
    succeeds("apply", "gtao", source, "--fov", np.degrees(0.7), "--set", "radius=0.5", "-o", output)
    expected = gtao(GBuffer(camera=camera, depth=depth), 0.5, runtime=runtime)
    error = exr.read(output)["ao"][rows:-rows, columns:-columns] - expected
    # float32 roundings of the camera; at the border the groups of pixels are other ones.
    assert np.abs(error[24:-24, 32:-32]).max() < 1e-5
    assert np.sqrt(np.mean(error**2)) < 0.005
    # The same angle taken for that of the data window gives .096.


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


def test_set_help_lists_every_parameter_without_a_file() -> None:
    listed = succeeds("apply", "ssao", "--set", "help").stdout
    assert "radius=0.5" in listed
    assert "scene units" in listed
    assert max(map(len, listed.splitlines())) <= 100
    names = [row["name"] for row in answer("apply", "ssao", "--set", "help")]
    assert "falloff" in names
    assert all(f"{name}=" in listed for name in names)


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
    answer("render", corner.rename(odd / "a.obj"), *DIRECT, "-o", odd / "a.png")
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


def test_apply_has_the_method(depth_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "gi.exr"
    found = []
    for options in (["--method", "points"], ["--set", "method=points"]):
        succeeds("apply", "ssdo", depth_file, *options, "--set", "samples=4", "-o", output)
        found.append(exr.read(output))
    one, other = found
    for channel, values in one.items():
        np.testing.assert_array_equal(values, other[channel])
    message = fails(tmp_path, "apply", "gtao", depth_file, "--method", "published", "-o", output)
    assert "gtao has no parameter 'method'" in message


# ---- errors


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--set", "radius=NaN"], "radius is nan"),
        (["--set", "falloff=sudden"], "expected one of 'exponential', 'ramp'"),
        (["--set", "falloff={}"], "falloff is {}"),
        (["--set", "bias=1" + "0" * 400], "bias is 1000"),
        (["--set", "bias=1" + "0" * 5000], "bias is '1000"),
        (["--set", "radius=" + "[" * 100_000], "--set radius: the value is nested too deeply"),
        (["--set", "samples=1" + "0" * 400], "samples is 1000"),
        (["--set", "x" * 10_000], "expected NAME=VALUE"),
        (["--set", "radius"], "--set 'radius': expected NAME=VALUE"),
        (["--set", "radus=1"], "ssao has no parameter 'radus': did you mean 'radius'? It has "),
        (["--set", "runtime=1"], "ssao has no parameter 'runtime'"),
        (["--fov", 40, "--ortho", 2], "--fov, --camera, --ortho and --intrinsics exclude each other"),
        (["--ortho", 1e300], "view_height is 1e+300: expected a number >= 1e-28 and <= 1e+28 (sc"),
        (["--intrinsics", 1, 1, 1e300, 0], "shifts the image by"),
        (["--intrinsics", 0, 1, 2, 3], "fx is 0.0"),
        (["--device", "no such thing"], "no such OpenCL device"),
        (["--confidence", "--max-memory", "1GiB"], "--confidence is of the whole image: expected no --max-memory"),
    ],
)
def test_a_wrong_option_of_apply_is_named(
    depth_file: Path, tmp_path: Path, options: list[object], message: str
) -> None:
    found = fails(tmp_path, "apply", "ssao", depth_file, *options, "-o", tmp_path / "ao.exr")
    assert message in found
    assert len(found) < 400, "hostile values are cut"


def test_confidence_is_of_ambient_occlusion(depth_file: Path, tmp_path: Path) -> None:
    found = fails(tmp_path, "apply", "ssdo", depth_file, "--confidence", "-o", tmp_path / "no.exr")
    assert "--confidence is for ambient occlusion: ssdo has none" in found
    with pytest.raises(ValueError, match="max_memory is 1073741824: expected None with confidence"):
        ApplyExr(technique="gtao", parameters={"confidence": True}, passes=Passes(), max_memory=1 << 30)


def test_apply_needs_a_file_and_an_output(depth_file: Path, tmp_path: Path) -> None:
    assert "IN.exr" in fails(tmp_path, "apply", "ssao", "-o", tmp_path / "ao.exr")
    assert "--output" in fails(tmp_path, "apply", "ssao", depth_file)
    assert "'nonsense'" in fails(tmp_path, "apply", "nonsense", depth_file, "-o", "ao.exr")
    message = fails(tmp_path, "apply", "ssao", depth_file, "-o", tmp_path / "ao.png")
    assert "expected a name that ends in .exr" in message


def test_a_file_that_is_no_gbuffer_is_refused(depth_file: Path, tmp_path: Path) -> None:
    def refused() -> str:
        return fails(tmp_path, "apply", "ssao", depth_file, "-o", tmp_path / "ao.exr")

    whole = depth_file.read_bytes()
    depth_file.write_bytes(whole[: len(whole) * 2 // 3])
    assert "damaged or cut short" in refused()
    exr.write(depth_file, {"image": np.ones((4, 5, 3), np.float32)})
    assert "no depth channel; it has B, G, R" in refused()
    depth_file.write_bytes(b"")
    assert "in.exr" in refused()
    depth_file.unlink()
    assert "in.exr: No such file or directory" in refused()


def test_what_lacks_memory_is_told_in_a_line(depth_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def lacking(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 9.9 GiB")

    monkeypatch.setattr(exr, "read_with_kind", lacking)
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

    monkeypatch.setattr(exr, "read_with_kind", failing)
    message = fails(tmp_path, "apply", "gtao", depth_file, "-o", tmp_path / "a.exr")
    assert message.startswith("the OpenCL driver failed: ")


@pytest.mark.slow
def test_small_work_groups_are_refused_with_the_variable(depth_file: Path, tmp_path: Path) -> None:
    small = {**os.environ, "POCL_MAX_WORK_GROUP_SIZE": "8"}
    done = process("apply", "gtao", depth_file, "--device", "pocl", "-o", tmp_path / "a.exr", env=small)
    assert done.returncode == 1
    assert "work-groups of at most 8 work-items: expected 64 or more" in done.stderr
    assert "POCL_MAX_WORK_GROUP_SIZE" in done.stderr
    assert "Traceback" not in done.stderr


def test_pixels_that_are_not_square_are_wider_in_the_picture(depth_file: Path, runtime: Runtime) -> None:
    depth = exr.read(depth_file)["Z"]
    OpenEXR.File({"pixelAspectRatio": 2.0}, {"Z": depth}).write(str(depth_file))
    focal = 0.5 * SHAPE[0] / np.tan(np.radians(25.0))
    camera = Camera.from_intrinsics(0.5 * focal, focal, 32.0, 24.0, width=SHAPE[1], height=SHAPE[0])
    expected = ssao(GBuffer(camera=camera, depth=depth), 0.3, runtime=runtime)
    np.testing.assert_allclose(applied(depth_file, "--set", "radius=0.3"), expected, atol=1e-6)
    assert OpenEXR.File(str(depth_file.with_name("ao.exr"))).header()["pixelAspectRatio"] == 2.0


@pytest.mark.parametrize("number", [".3", "+0.3", "3e-1"])
def test_numbers_may_be_written_as_people_do(depth_file: Path, number: str) -> None:
    plain = applied(depth_file, "--set", "radius=0.3")
    np.testing.assert_array_equal(applied(depth_file, "--set", f"radius={number}"), plain)


def test_what_was_read_is_said(depth_file: Path) -> None:
    output = depth_file.with_name("ao.exr")
    assert answer("apply", "gtao", depth_file, "-o", output)["notes"] == [
        "camera: 50 degrees high are assumed, see --fov",
        "depth is read from Z",
        "depth is taken for planar: no planes tell",
    ]
    assert "depth is read from Z" in succeeds("apply", "gtao", depth_file, "-o", output).output


def test_a_misspelt_technique_names_the_nearest(depth_file: Path, tmp_path: Path) -> None:
    message = fails(tmp_path, "apply", "gtoa", depth_file, "-o", tmp_path / "ao.exr")
    assert message.endswith("; did you mean 'gtao'?")


def test_a_depth_may_stand_for_nothing(depth_file: Path, tmp_path: Path) -> None:
    depth = exr.read(depth_file)["Z"].copy()
    depth[20:23, 30] = np.inf
    exr.write(depth_file, {"depth": depth})
    expected = applied(depth_file)
    depth[20:22, 30], depth[22, 30] = 0.0, -1.0
    exr.write(depth_file, {"depth": depth})
    message = fails(tmp_path, "apply", "ssao", depth_file, "-o", tmp_path / "no.exr")
    assert "depth[20, 30] is 0.0: expected numbers > 0" in message
    assert "--invalid" in message
    np.testing.assert_array_equal(applied(depth_file, "--invalid", "0", "--invalid", "-1"), expected)
