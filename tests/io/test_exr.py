"""OpenEXR files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.io import exr
from ssgi_cl.io.exr_header import read_header, read_headers

Arrays = dict[str, NDArray[np.float32]]


def arrays_of(rows: int, columns: int) -> Arrays:
    rng = np.random.default_rng(7)
    arrays = {
        name: rng.normal(size=(rows, columns, 3)).astype(np.float32)
        for name in ("image", "normal", "albedo", "emission", "bounce")
    }
    arrays["depth"] = rng.uniform(1, 1e6, (rows, columns)).astype(np.float32)
    arrays["ao"] = rng.uniform(0, 1, (rows, columns)).astype(np.float32)
    arrays["depth"][0, 0] = np.inf
    return arrays


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    exr.write(tmp_path / "a.exr", arrays_of(64, 48))
    return tmp_path / "a.exr"


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (17, 31), (64, 48)])
def test_what_is_written_is_read_back_to_the_bit(tmp_path: Path, rows: int, columns: int) -> None:
    arrays = arrays_of(rows, columns)
    exr.write(tmp_path / "a.exr", arrays)
    channels = exr.read(tmp_path / "a.exr")
    names = ["R", "G", "B", "N.X", "N.Y", "N.Z", "Z", "ao"]
    names += [f"{stem}.{c}" for stem in ("albedo", "emission", "bounce") for c in "RGB"]
    assert sorted(channels) == sorted(names)
    assert {channel.dtype for channel in channels.values()} == {np.dtype(np.float32)}
    for stem, suffixes in (("", "RGB"), ("N.", "XYZ"), ("albedo.", "RGB"), ("bounce.", "RGB")):
        name = {"": "image", "N.": "normal"}.get(stem, stem[:-1])
        together = np.stack([channels[stem + c] for c in suffixes], axis=-1)
        np.testing.assert_array_equal(together, arrays[name])
    np.testing.assert_array_equal(channels["Z"], arrays["depth"])
    np.testing.assert_array_equal(channels["ao"], arrays["ao"])
    found = exr.read_gbuffer(tmp_path / "a.exr")
    assert found.pop("notes")[0] == "depth is read from Z"
    assert sorted(found) == ["albedo", "depth", "emission", "normal"]
    for name, array in found.items():
        np.testing.assert_array_equal(array, arrays[name])
        assert array.dtype == np.float32
        assert array.flags.c_contiguous
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_infinities_nan_and_views_with_strides_are_kept(tmp_path: Path) -> None:
    odd = np.array([[np.inf, -np.inf, np.nan, 3e38, 1e-45]] * 10, np.float32)
    wide = np.arange(20 * 15, dtype=np.float32).reshape(20, 15)
    exr.write(tmp_path / "a.exr", {"odd": odd, "depth": wide[::-2, ::3], "turned": wide.T[:10, :5]})
    channels = exr.read(tmp_path / "a.exr")
    np.testing.assert_array_equal(channels["odd"], odd)
    np.testing.assert_array_equal(channels["Z"], wide[::-2, ::3])
    np.testing.assert_array_equal(channels["turned"], wide.T[:10, :5])


def test_half_becomes_single_and_integers_stay(tmp_path: Path) -> None:
    half = np.linspace(0, 1, 12, dtype=np.float16).reshape(3, 4)
    ids = np.arange(12, dtype=np.uint32).reshape(3, 4)
    OpenEXR.File({}, {"Z": half, "id": ids}).write(str(tmp_path / "a.exr"))
    channels = exr.read(tmp_path / "a.exr")
    assert channels["Z"].dtype == np.float32
    np.testing.assert_array_equal(channels["Z"], half.astype(np.float32))
    np.testing.assert_array_equal(channels["id"], ids)
    exr.write(tmp_path / "b.exr", {"": np.ones((2, 3, 1))})  # a nameless image of one channel is luminance
    assert list(exr.read(tmp_path / "b.exr")) == ["Y"]


@pytest.mark.parametrize(
    ("depth", "normal", "albedo"),
    [
        ("Z", "N.X", "albedo.R"),
        ("depth", "normal.X", "diffuse_albedo.R"),
        ("depth.V", "Normal.X", "DiffCol.R"),
        ("ViewLayer.Depth.Z", "ViewLayer.Normal.X", "ViewLayer.DiffCol.R"),
        ("A.B.Depth.Z", "A.B.Normal.X", "A.B.DiffCol.R"),
        ("Z", "N.R", "Albedo.R"),
    ],
)
def test_usual_names_are_found(tmp_path: Path, depth: str, normal: str, albedo: str) -> None:
    plane = np.ones((3, 4), np.float32)
    channels = {depth: plane}
    for first in (normal, albedo):
        suffixes = "XYZ" if first[-1] == "X" else "RGB"
        channels |= {first[:-1] + c: plane * (i + 2) for i, c in enumerate(suffixes)}
    OpenEXR.File({}, channels).write(str(tmp_path / "a.exr"))
    found = exr.read_gbuffer(tmp_path / "a.exr")
    np.testing.assert_array_equal(found["depth"], plane)
    np.testing.assert_array_equal(found["normal"][0, 0], [2, 3, 4])
    np.testing.assert_array_equal(found["albedo"][0, 0], [2, 3, 4])


def test_given_names_win(tmp_path: Path) -> None:
    plane = np.ones((3, 4), np.float32)
    channels = {"Z": plane, "far": plane * 2, "a": plane * 3, "b": plane * 4, "c": plane * 5}
    channels |= {"shade.R": plane * 6, "shade.G": plane * 7, "shade.B": plane * 8}
    OpenEXR.File({}, channels).write(str(tmp_path / "a.exr"))
    mapping: dict[str, str | tuple[str, ...]] = {"depth": "far", "normal": ("c", "b", "a"), "albedo": "shade"}
    found = exr.read_gbuffer(tmp_path / "a.exr", mapping)
    assert found["depth"][0, 0] == 2
    np.testing.assert_array_equal(found["normal"][0, 0], [5, 4, 3])
    np.testing.assert_array_equal(found["albedo"][0, 0], [6, 7, 8])


def test_blenders_background_is_infinitely_far(tmp_path: Path) -> None:
    depth = np.array([[1.0, 9.9e9, 1e10, 2e10, np.inf]], np.float32)
    exr.write(tmp_path / "a.exr", {"depth": depth})
    found = exr.read_gbuffer(tmp_path / "a.exr")["depth"]
    np.testing.assert_array_equal(found, np.array([[1.0, 9.9e9, np.inf, np.inf, np.inf]], "f"))


def test_without_depth_the_channels_are_listed(tmp_path: Path) -> None:
    exr.write(tmp_path / "a.exr", {"normal": np.zeros((2, 2, 3)), "mist": np.zeros((2, 2))})
    with pytest.raises(ValueError, match=r"no depth channel; it has N.X, N.Y, N.Z, mist"):
        exr.read_gbuffer(tmp_path / "a.exr")


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"depth": "W"}, "no channel 'W'; it has Z"),
        ({"normal": ("Z", "Z", "q")}, "no channel 'q'; it has Z"),
        ({"albedo": "Base"}, "no channel 'Base.*'; it has Z"),
        ({"normal": ("Z", "Z")}, "expected 3 channel name"),
        ({"depth": ("Z", "Z")}, "expected 1 channel name"),
        ({"colour": "Z"}, "names 'colour': expected 'depth'"),
    ],
)
def test_a_wrong_mapping_is_explained(tmp_path: Path, mapping: dict[str, str | tuple[str, ...]], message: str) -> None:
    exr.write(tmp_path / "a.exr", {"depth": np.ones((2, 2))})
    with pytest.raises(ValueError, match=message):
        exr.read_gbuffer(tmp_path / "a.exr", mapping)


def test_a_missing_file_is_named_and_a_folder_not_read(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.exr"):
        exr.read(tmp_path / "none.exr")
    with pytest.raises(IsADirectoryError):
        exr.read(tmp_path)


@pytest.mark.parametrize("content", [b"", b"v", b"\x89PNG\r\n\x1a\n" * 40, b"hello " * 99])
def test_what_is_no_exr_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.exr is not an OpenEXR file"):
        exr.read(tmp_path / "a.exr")


@pytest.mark.parametrize("part", [0.0001, 0.001, 0.01, 0.5, 0.99, 0.999999])
def test_a_file_cut_short_is_refused(damaged: Path, part: float) -> None:
    content = damaged.read_bytes()
    damaged.write_bytes(content[: max(5, int(len(content) * part))])
    with pytest.raises(ValueError, match=r"a\.exr is damaged or cut short"):
        exr.read(damaged)


def in_parts(path: Path, **parts: Arrays) -> None:
    """Write parts with one display window."""
    made = []
    for name, channels in parts.items():
        rows, columns = next(iter(channels.values())).shape
        first, last = np.zeros(2, np.int32), np.array([columns - 1, rows - 1], np.int32)
        windows = {"dataWindow": (first, last), "displayWindow": (first, np.array([3, 2], np.int32))}
        made.append(OpenEXR.Part({"name": name, **windows}, channels))
    OpenEXR.File(made).write(str(path))


def test_channels_of_parts_have_their_names(tmp_path: Path) -> None:
    path, plane = tmp_path / "a.exr", np.ones((3, 4), np.float32)
    in_parts(path, left={"Z": plane}, right={"Z": 2 * plane})
    found = exr.read(path)
    np.testing.assert_array_equal(found["right.Z"], 2 * plane)
    with pytest.raises(ValueError, match="layers 'left', 'right' have a depth each"):
        exr.read_gbuffer(path)
    np.testing.assert_array_equal(exr.read_gbuffer(path, part="right")["depth"], 2 * plane)
    with pytest.raises(ValueError, match="has no part 'middle'; it has 'left', 'right'"):
        exr.read_gbuffer(path, part="middle")
    with pytest.raises(ValueError, match="has 2 parts: expected a file with one"):
        exr.add(path, {"ao": plane})


def test_a_gbuffer_lies_in_several_parts(tmp_path: Path) -> None:
    path, plane = tmp_path / "a.exr", np.ones((3, 4), np.float32)
    small = np.ones((2, 2), np.float32)
    in_parts(
        path,
        rgba={c: plane for c in "RGB"},
        depth={"Z": 3 * plane},
        normals={c: (i + 4) * plane for i, c in enumerate("XYZ")},
        matte={"id": small},  # of another size, and not read
    )
    found = exr.read_gbuffer(path)
    np.testing.assert_array_equal(found["depth"], 3 * plane)
    np.testing.assert_array_equal(found["normal"][0, 0], [4, 5, 6])
    with pytest.raises(ValueError, match=r"part 'matte' has the data window .* expected one"):
        exr.read(path)


def test_windows_and_attributes_of_another_file_are_kept(tmp_path: Path) -> None:
    plane, data = np.ones((4, 6), np.float32), (np.array([2, 3], np.int32), np.array([7, 6], np.int32))
    header = {"dataWindow": data, "pixelAspectRatio": 2.0, "camera": "left eye"}
    OpenEXR.File(header, {"Z": plane}).write(str(tmp_path / "a.exr"))
    assert read_headers(tmp_path / "a.exr")[0].pixel_aspect == 2.0
    exr.write(tmp_path / "b.exr", {"ao": plane}, like=tmp_path / "a.exr")
    kept = OpenEXR.File(str(tmp_path / "b.exr")).header()
    assert (kept["pixelAspectRatio"], kept["camera"]) == (2.0, "left eye")
    assert read_header(tmp_path / "b.exr").data == (2, 3, 7, 6)
    assert list(exr.read(tmp_path / "b.exr")) == ["ao"]
    with pytest.raises(ValueError, match=r"the arrays has 2 rows and 2 columns: expected 4 x 6 as the data window"):
        exr.write(tmp_path / "b.exr", {"ao": np.ones((2, 2))}, like=tmp_path / "a.exr")


def put_window(path: Path, name: str, window: Sequence[int]) -> None:
    """Change a window in the header of a file."""
    content, head = bytearray(path.read_bytes()), f"{name}\0box2i\0".encode()
    place = content.index(head) + len(head) + 4
    content[place : place + 16] = np.array(window, np.int32).tobytes()
    path.write_bytes(content)


def regional(path: Path, left: int, top: int, right: int, bottom: int) -> None:
    """Write 4 x 6 pixels whose display window exceeds the data window by the given pixels."""
    exr.write(path, {"depth": np.arange(24).reshape(4, 6) + 1})
    put_window(path, "displayWindow", (-left, -top, 5 + right, 3 + bottom))


@pytest.mark.parametrize(
    ("window", "message"),
    [
        *((window, r"a\.exr is damaged: its window runs from column")
          for window in ((0, 3, 5, 0), (5, 0, 0, 3), (5, 3, 0, 0))),
        ((0, 0, (1 << 24) - 1, 3), "16777216 x 4 pixels of 2 channels can't lie in"),
    ],
)  # fmt: skip
def test_a_file_that_claims_another_window_is_refused(tmp_path: Path, window: Sequence[int], message: str) -> None:
    exr.write(tmp_path / "a.exr", dict.fromkeys(("depth", "ao"), np.arange(24).reshape(4, 6)))
    put_window(tmp_path / "a.exr", "dataWindow", window)
    with pytest.raises(ValueError, match=message):
        exr.read(tmp_path / "a.exr")


@pytest.mark.parametrize("window", [(1, 0, 0, 0), (0, 0, 0, 2), (-1, 0, 0, 0), (1, 1, 1, 1)])
def test_other_windows_need_a_camera_of_the_data_window(tmp_path: Path, window: tuple[int, int, int, int]) -> None:
    path = tmp_path / "a.exr"
    regional(path, -2, -1, -2, -1)  # overscan is read with its margin
    np.testing.assert_array_equal(exr.read(path)["Z"], np.arange(24).reshape(4, 6) + 1.0)
    regional(path, *window)
    header = read_header(path)
    left, top, right, bottom = header.display
    whole = Camera.look_at((0, 0, 0), (0, 0, -1), width=right - left + 1, height=bottom - top + 1)
    with pytest.raises(ValueError, match=r"data window .* and the display window"):
        GBuffer.from_exr(path, camera=whole)
    depth = exr.read(path)["Z"]
    np.testing.assert_array_equal(depth, np.arange(24, dtype=np.float32).reshape(4, 6) + 1.0)
    seen = whole.cropped(header.data[0] - left, header.data[1] - top, 6, 4)
    np.testing.assert_array_equal(GBuffer.from_exr(path, camera=seen).depth, depth)


def test_windows_are_written_and_read_back(tmp_path: Path) -> None:
    data, display = (-3, 5, 2, 8), (-1, 6, 10, 20)
    exr.write(tmp_path / "a.exr", {"depth": np.ones((4, 6))}, data=data, display=display)
    header = read_header(tmp_path / "a.exr")
    assert (header.data, header.display, header.size) == (data, display, (4, 6))
    with pytest.raises(ValueError, match="expected a window of 6 columns and 4 rows"):
        exr.write(tmp_path / "a.exr", {"depth": np.ones((4, 6))}, data=(0, 0, 6, 3))
    with pytest.raises(ValueError, match=r"ao has 6 rows and 4 columns: expected 4 x 6"):
        exr.add(tmp_path / "a.exr", {"ao": np.ones((6, 4))})


@pytest.mark.parametrize("kind", [name for name in dir(OpenEXR) if name.startswith("HTJ2K")])
def test_htj2k_is_read(tmp_path: Path, kind: str) -> None:
    depth = np.arange(300 * 7, dtype=np.float32).reshape(300, 7) / 3
    OpenEXR.File({"compression": getattr(OpenEXR, kind)}, {"Z": depth}).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(exr.read(tmp_path / "a.exr")["Z"], depth)
    assert read_header(tmp_path / "a.exr").compression == kind.removesuffix("_COMPRESSION")


def test_an_unknown_compression_is_named(damaged: Path) -> None:
    content = bytearray(damaged.read_bytes())
    mark = b"compression\0compression\0\1\0\0\0"
    content[content.index(mark) + len(mark)] = 77
    damaged.write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.exr has the compression number 77: expected .*ZIP"):
        exr.read(damaged)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({}, "arrays is empty"),
        ({"depth": np.zeros(3)}, r"depth has shape \(3,\)"),
        ({"depth": np.zeros((0, 3))}, r"depth has shape \(0, 3\)"),
        ({"ao": np.zeros((2, 2, 2))}, r"ao has shape \(2, 2, 2\)"),
        ({"a": np.zeros((2, 2)), "b": np.zeros((2, 3))}, "b has 2 rows and 3 columns"),
        ({"depth": np.zeros((2, 2)), "Z": np.zeros((2, 2))}, "'Z', which is taken"),
        ({"depth": np.zeros((2, 2), complex)}, "depth has dtype complex"),
    ],
)
def test_wrong_arrays_are_refused(tmp_path: Path, arrays: Arrays, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        exr.write(tmp_path / "a.exr", arrays)
    assert not list(tmp_path.iterdir())


def test_a_writer_that_fails_leaves_the_old_file(damaged: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = damaged.read_bytes()

    class Failing:
        def __init__(self, header: object, channels: object) -> None:
            pass

        def write(self, path: str) -> None:
            Path(path).write_bytes(b"half a file")
            raise RuntimeError(f"no space left for {path}")

    monkeypatch.setattr(OpenEXR, "File", Failing)
    with pytest.raises(OSError, match=r"no space left for .*a\.exr"):
        exr.write(damaged, {"depth": np.ones((2, 2))})
    assert damaged.read_bytes() == old
    assert [path.name for path in damaged.parent.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("parts", [False, True])
@pytest.mark.parametrize("half", [False, True])
def test_a_gbuffer_comes_back_with_its_camera(
    tmp_path: Path, rng: np.random.Generator, half: bool, parts: bool
) -> None:
    camera = Camera.look_at((1, 2, 3), (0, 0.5, 0), (0.1, 1, 0), width=30, height=20)
    normal = rng.normal(size=(24, 34, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    depth = rng.uniform(1.0, 9.0, (24, 34))
    depth[3:6] = np.inf
    given = GBuffer(camera=camera, depth=depth, normal=normal, albedo=rng.uniform(size=(24, 34, 3)))
    given.save(tmp_path / "a.exr", half=half, parts=parts)
    found = GBuffer.from_exr(tmp_path / "a.exr", normal_space="world", depth_kind="planar")
    assert found.margin == given.margin == (2, 2)
    np.testing.assert_array_equal(found.depth, given.depth)  # of depth no bit is lost
    for name in ("normal", "albedo"):
        np.testing.assert_allclose(getattr(found, name), getattr(given, name), atol=2.0**-11 if half else 0.0)
    np.testing.assert_allclose(found.camera.view, camera.view, atol=1e-6)
    np.testing.assert_allclose(found.camera.pixel_to_view, camera.pixel_to_view, atol=1e-6)
    headers = read_headers(tmp_path / "a.exr")
    assert [header.name for header in headers] == (["depth", "N", "albedo"] if parts else [""])
    assert {c.bytes for h in headers for c in h.channels if c.name != "Z"} == {2 if half else 4}


def test_what_half_floats_cannot_hold_is_refused(tmp_path: Path) -> None:
    plane = np.full((3, 4), 7e4, np.float32)
    with pytest.raises(ValueError, match="channel 'ao' has values beyond 65504: expected half=False"):
        exr.write(tmp_path / "a.exr", {"ao": plane}, half=True)
    assert not (tmp_path / "a.exr").exists()
    exr.write(tmp_path / "a.exr", {"ao": np.where(plane > 0, np.inf, plane), "depth": plane}, half=True)
    assert exr.read(tmp_path / "a.exr")["Z"][0, 0] == np.float32(7e4)
