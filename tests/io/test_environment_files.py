"""Environments from image files: Radiance pictures in all encodings, OpenEXR, and damage."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.core.errors import AssumedWarning
from ssgi_cl.io import exr, radiance_hdr

Texels = NDArray[np.uint8]

HEADER = b"#?RADIANCE\n# made by a test\nFORMAT=32-bit_rle_rgbe\n"


def texels_of(rows: int, columns: int, seed: int = 3) -> Texels:
    """RGBE texels [rows, columns, 4], the left half of each line constant for runs."""
    rng = np.random.default_rng(seed)
    texels = rng.integers(2, 256, (rows, columns, 4)).astype(np.uint8)
    texels[..., 3] = rng.integers(120, 140, (rows, columns))
    texels[:, : columns // 2] = texels[:, :1]
    return texels


def radiance_of(texels: Texels) -> NDArray[np.float64]:
    """The definition, one texel at a time."""
    flat = [
        [mantissa * 2.0 ** (int(e) - 136) if e else 0.0 for mantissa in (r, g, b)]
        for r, g, b, e in texels.reshape(-1, 4).tolist()
    ]
    return np.reshape(flat, (*texels.shape[:2], 3))


def flat_line(line: Texels) -> bytes:
    return line.tobytes()


def repeated_line(line: Texels) -> bytes:
    """The older encoding: texel, then (1, 1, 1, low byte), (1, 1, 1, high byte) of repetitions."""
    out, column = b"", 0
    while column < len(line):
        same = 1
        while column + same < len(line) and (line[column + same] == line[column]).all():
            same += 1
        out += line[column].tobytes()
        rest = same - 1
        while rest:
            out += bytes((1, 1, 1, rest & 255))
            rest >>= 8
        column += same
    return out


def channel_line(line: Texels) -> bytes:
    """The newer encoding: runs of up to 127 of each channel."""
    out = b"\x02\x02" + struct.pack(">H", len(line))
    for channel in line.T.tolist():
        column = 0
        while column < len(channel):
            run = 1
            while run < 127 and channel[column : column + run + 1] == [channel[column]] * (run + 1):
                run += 1
            if run > 2:
                out += bytes((128 + run, channel[column]))
            else:
                run = min(100, len(channel) - column)
                out += bytes((run, *channel[column : column + run]))
            column += run
    return out


ENCODINGS = {"flat": flat_line, "repeated": repeated_line, "channels": channel_line}


def picture(path: Path, texels: Texels, encoding: str = "flat", *, header: bytes = HEADER, size: str = "") -> Path:
    lines, length = texels.shape[:2]
    size = size or f"-Y {lines} +X {length}"
    body = b"".join(map(ENCODINGS[encoding], texels))
    path.write_bytes(header + b"\n" + size.encode() + b"\n" + body)
    return path


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("size", [(1, 1), (3, 7), (2, 8), (4, 1000)])
def test_every_encoding_gives_the_same_radiance(tmp_path: Path, encoding: str, size: tuple[int, int]) -> None:
    if encoding == "channels" and size[1] < 8:
        pytest.skip("shorter lines have no runs per channel")
    texels = texels_of(*size)
    found = radiance_hdr.read(picture(tmp_path / "a.hdr", texels, encoding))
    assert found.dtype == np.float32
    # Mantissas of 8 bits and powers of two: exact in float32.
    np.testing.assert_array_equal(found, radiance_of(texels))


def test_long_repetitions_take_several_codes(tmp_path: Path) -> None:
    texels = np.tile(np.array([200, 100, 50, 130], np.uint8), (1, 70000, 1))
    path = picture(tmp_path / "a.hdr", texels, "repeated")
    assert path.stat().st_size < 200
    np.testing.assert_array_equal(radiance_hdr.read(path), np.broadcast_to(radiance_of(texels[:1, :1]), (1, 70000, 3)))


def test_exposures_of_the_header_are_divided_out_and_an_exponent_of_zero_is_black(tmp_path: Path) -> None:
    texels = texels_of(2, 3)
    texels[0, 0, 3] = 0
    header = HEADER + b"EXPOSURE=4\nEXPOSURE= 0.5\n"
    found = radiance_hdr.read(picture(tmp_path / "a.hdr", texels, header=header))
    np.testing.assert_array_equal(found, radiance_of(texels) / 2.0)
    assert found[0, 0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("down", ["-Y", "+Y"])
@pytest.mark.parametrize("right", ["+X", "-X"])
@pytest.mark.parametrize("by_columns", [False, True])
def test_lines_run_as_the_header_says(tmp_path: Path, down: str, right: str, by_columns: bool) -> None:
    texels = texels_of(2, 3)
    stored = texels[:: 1 if down == "-Y" else -1, :: 1 if right == "+X" else -1]
    size = f"{down} 2 {right} 3"
    if by_columns:
        stored, size = stored.transpose(1, 0, 2), f"{right} 3 {down} 2"
    path = picture(tmp_path / "a.hdr", np.ascontiguousarray(stored), size=size)
    np.testing.assert_array_equal(radiance_hdr.read(path), radiance_of(texels))


def test_mitsuba_reads_the_same(tmp_path: Path) -> None:
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    image = np.random.default_rng(2).random((40, 90, 3)).astype(np.float32) ** 4 * 100.0
    image[20:] = 0.5
    mitsuba.Bitmap(image).write(str(tmp_path / "a.hdr"))
    theirs = mitsuba.Bitmap(str(tmp_path / "a.hdr")).convert(
        mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32, srgb_gamma=False
    )
    np.testing.assert_array_equal(gi.Environment.load(tmp_path / "a.hdr").radiance, theirs)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_cut_file_is_refused_wherever_it_ends(tmp_path: Path, encoding: str) -> None:
    whole = picture(tmp_path / "a.hdr", texels_of(2, 16), encoding).read_bytes()
    for length in range(len(whole)):
        (tmp_path / "b.hdr").write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"b\.hdr (is|has)"):
            radiance_hdr.read(tmp_path / "b.hdr")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PNG", "is no Radiance picture"),
        (b"#?RADIANCE\n\n-Y 2 +Y 2\n" + bytes(16), "has the size"),
        (b"#?RADIANCE\n\n-Y 0 +X 2\n" + bytes(16), "0 lines"),
        (b"#?RADIANCE\n\n2 x 2\n" + bytes(16), "has the size"),
        (b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n" + bytes(4), "32-bit_rle_rgbe"),
        (b"#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n" + bytes(4), "EXPOSURE of 0"),
        (b"#?RADIANCE\nEXPOSURE=x\n\n-Y 1 +X 1\n" + bytes(4), "EXPOSURE of 0"),
        (b"#?RADIANCE\n\n-Y 99999 +X 99999\n" + bytes(99), "at most"),
        (b"#?RADIANCE\n\n-Y 9000 +X 9000\n" + bytes(99), "do not fit"),
        (b"#?RADIANCE\n\n-Y 1 +X 2\n\1\1\1\1" + bytes(4), "in line 0"),
        (b"#?RADIANCE\n\n-Y 1 +X 8\n\2\2\0\x09" + bytes(40), "in line 0"),
        (b"#?RADIANCE\n\n-Y 1 +X 8\n\2\2\0\x08\x89\0" + bytes(40), "in line 0"),
        (b"#?RADIANCE\n\n-Y 1 +X 8\n\2\2\0\x08\0\0" + bytes(40), "in line 0"),
    ],
)
def test_damage_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "a.hdr").write_bytes(content)
    with pytest.raises(ValueError, match=message) as caught:
        gi.Environment.load(tmp_path / "a.hdr")
    assert "a.hdr" in str(caught.value)


@pytest.mark.parametrize("size", [(1, 1), (6, 9), (1, 100_000), (3000, 1)])
def test_openexr_of_any_size_is_read(tmp_path: Path, size: tuple[int, int]) -> None:
    image = np.random.default_rng(4).random((*size, 3)).astype(np.float32)
    exr.write(tmp_path / "a.exr", {"image": image})
    np.testing.assert_array_equal(gi.Environment.load(tmp_path / "a.exr").radiance, image)
    exr.write(tmp_path / "grey.exr", {"image": image[..., 0]})
    np.testing.assert_array_equal(gi.Environment.load(tmp_path / "grey.exr").radiance, image[..., :1].repeat(3, -1))


@pytest.mark.parametrize(("value", "taken"), [(np.inf, 65504.0), (-0.01, 0.0)])
def test_overflow_and_ringing_are_clamped_and_said(tmp_path: Path, value: float, taken: float) -> None:
    image = np.ones((4, 5, 3), np.float32)
    image[0, 0] = 60000.0  # near the largest half
    image[2, 3, 1] = image[3, 0] = value
    exr.write(tmp_path / "a.exr", {"image": image})
    with pytest.warns(AssumedWarning, match=rf"a\.exr has 2 texel\(s\), first in row 2, column 3, .* {taken:g} \(W"):
        found = gi.Environment.load(tmp_path / "a.exr").radiance
    image[2, 3, 1] = image[3, 0] = taken
    np.testing.assert_array_equal(found, image)


@pytest.mark.parametrize("value", [np.nan, -np.inf, -0.5, 2e38])
def test_texels_that_are_no_radiance_are_named(tmp_path: Path, value: float) -> None:
    image = np.ones((4, 5, 3), np.float32)
    image[2, 3, 1] = image[3, 0] = value
    exr.write(tmp_path / "a.exr", {"image": image})
    with pytest.raises(ValueError, match=r"a\.exr .* in row 2, column 3 \(2 such texels"):
        gi.Environment.load(tmp_path / "a.exr")


def test_openexr_that_is_no_whole_sphere_is_refused(tmp_path: Path) -> None:
    image = np.ones((4, 5, 3), np.float32)
    exr.write(tmp_path / "a.exr", {"image": image}, display=(0, 0, 9, 9))
    with pytest.raises(ValueError, match="whole sphere"):
        gi.Environment.load(tmp_path / "a.exr")
    exr.write(tmp_path / "b.exr", {"normal": image})
    with pytest.raises(ValueError, match=r"has no channel 'Y'.*N\.X"):
        gi.Environment.load(tmp_path / "b.exr")


def test_files_of_no_known_kind_or_that_are_missing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"ends in '\.png': expected \.exr, \.hdr"):
        gi.Environment.load("a.png")
    with pytest.raises(FileNotFoundError, match=r"nothing\.hdr: there is no such file"):
        gi.Environment.load(tmp_path / "nothing.hdr")


def rendered(tmp_path: Path, *options: str) -> NDArray[np.float32]:
    size = ["--width", "40", "--height", "30", "--bounces", "0"]
    done = CliRunner().invoke(
        main, ["render", "cornell_box", "-o", str(tmp_path / "out.exr"), *size, "--json", *options]
    )
    assert done.exit_code == 0, done.output
    json.loads(done.stdout)
    channels = exr.read(tmp_path / "out.exr")
    return np.stack([channels[name] for name in "RGB"], axis=-1)


def test_the_command_takes_an_image_or_one_radiance(tmp_path: Path) -> None:
    exr.write(tmp_path / "sky.exr", {"image": np.full((4, 8, 3), (0.5, 1.0, 2.0))})
    constant = rendered(tmp_path, "--environment", "0.5,1,2")
    image = rendered(tmp_path, "--environment", str(tmp_path / "sky.exr"))
    darker = rendered(tmp_path, "--environment", "0,0,0")
    assert (constant > darker).mean() > 0.5
    # The image is filtered to a map of 32 x 32 texels; its errors are below a hundredth.
    np.testing.assert_allclose(image.mean(axis=(0, 1)), constant.mean(axis=(0, 1)), rtol=0.02)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1,2", "expected a file or R,G,B"),
        ("1,2,-3", "radiance is"),
        ("none.hdr", "no such file"),
        ("1,2,nan", "radiance"),
        ("sky.jpg", "expected .exr, .hdr"),
    ],
)
def test_the_command_says_what_is_wrong_with_an_environment(value: str, message: str) -> None:
    arguments = ["render", "cornell_box", "-o", "x.png", "--environment", value]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code != 0
    assert message in done.output
