"""Names and ranges of frames."""

from pathlib import Path

import pytest

from ssgi_cl.sequences.frame_names import FrameNames, frame_range, gaps


@pytest.mark.parametrize(
    ("text", "number", "name"),
    [
        ("a/shot.####.exr", 7, "a/shot.0007.exr"),
        ("shot.%04d.exr", 12345, "shot.12345.exr"),
        ("shot_#.png", 10, "shot_10.png"),
        ("%d.exr", 3, "3.exr"),
        ("f.###.exr", -5, "f.-005.exr"),
    ],
)
def test_a_pattern_gives_names(text: str, number: int, name: str) -> None:
    names = FrameNames.of(text)
    assert names is not None
    assert names.path(number) == Path(name)


def test_what_is_no_pattern_and_what_has_two_places() -> None:
    assert FrameNames.of("shot.0001.exr") is None
    for text in ("a.##.##.exr", "shot##/a.exr"):
        with pytest.raises(ValueError, match="expected one place for a number"):
            FrameNames.of(text)


def test_frames_are_found(tmp_path: Path) -> None:
    for name in ("a.0003.exr", "a.0001.exr", "a.12345.exr", "a.01.exr", "a.0002.png", "b.0002.exr", "a.0004.exr.part"):
        (tmp_path / name).touch()
    names = FrameNames.of(tmp_path / "a.####.exr")
    assert names is not None
    assert names.found() == [1, 3, 12345]
    assert gaps([1, 3, 6]) == [2, 4, 5]
    assert gaps([]) == []


@pytest.mark.parametrize(
    ("text", "numbers"), [("7", [7]), ("1-4", [1, 2, 3, 4]), ("1-9x4,2,5", [1, 5, 9, 2]), ("-2-1", [-2, -1, 0, 1])]
)
def test_ranges(text: str, numbers: list[int]) -> None:
    assert frame_range(text) == numbers


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected parts such as"),
        ("a-b", "expected parts such as"),
        ("9-1", "first <= last"),
        ("1-9x0", "a step above 0"),
        ("1-99999999999", "at most 1000000 frames"),
    ],
)
def test_a_wrong_range_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        frame_range(text)
