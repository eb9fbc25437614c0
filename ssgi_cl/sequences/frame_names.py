"""Names of the frames of a sequence: "shot.####.exr" or "shot.%04d.exr", and ranges such as 1-240 or 1-99x2,120."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

from ssgi_cl.core.errors import shown

MOST_FRAMES = 1_000_000
"""Frames of a range, at most: a slip of a digit is told, and no list of 10^12 numbers is made."""
_PLACE = re.compile(r"(#+)|%0?(\d*)d")
_RANGE = re.compile(r"(-?\d+)(?:-(-?\d+)(?:x(\d+))?)?")


class FrameNames(NamedTuple):
    """A pattern of file names with one place for a number.

    Attributes:
        folder: of the files.
        before, after: parts of the name round the number.
        digits: least number of digits.
    """

    folder: Path
    before: str
    after: str
    digits: int

    @classmethod
    def of(cls, text: str | os.PathLike[str]) -> FrameNames | None:
        """Return the pattern of a path, None of a path without a place for a number.

        Raises:
            ValueError: there are several places, or one in the name of a folder.
        """
        path = Path(text)
        places = list(_PLACE.finditer(path.name))
        if _PLACE.search(str(path.parent)) or len(places) > 1:
            raise ValueError(f"{shown(str(path))}: expected one place for a number, such as ####, in the file's name")
        if not places:
            return None
        (place,) = places
        digits = len(place[1]) if place[1] else int(place[2] or 1)
        return cls(path.parent, path.name[: place.start()], path.name[place.end() :], digits)

    def path(self, number: int) -> Path:
        """Return the file of a frame."""
        return self.folder / f"{self.before}{number:0{self.digits + (number < 0)}d}{self.after}"

    def found(self) -> list[int]:
        """Return the numbers of the frames that are there, in order.

        Raises:
            FileNotFoundError: the folder does not exist.
        """
        wanted = re.compile(f"{re.escape(self.before)}(-?[0-9]{{{self.digits},}}){re.escape(self.after)}")
        with os.scandir(self.folder) as entries:
            numbers = [int(match[1]) for entry in entries if (match := wanted.fullmatch(entry.name))]
        return sorted(number for number in numbers if self.path(number).exists())

    def __str__(self) -> str:
        return str(self.folder / f"{self.before}{'#' * self.digits}{self.after}")


def frame_range(text: str) -> list[int]:
    """Return the numbers of a range: parts "a", "a-b" or "a-bxSTEP", separated by commas, in order, once each.

    Raises:
        ValueError: the text is something else, a part runs backwards, or there are too many frames.
    """
    numbers: dict[int, None] = {}
    for part in text.split(","):
        match = _RANGE.fullmatch(part.strip())
        if match is None:
            raise ValueError(
                f"frames is {shown(text)}: expected parts such as 7, 1-240 or 1-240x2, separated by commas"
            )
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if last < first or step < 1:
            raise ValueError(f"frames has {shown(part)}: expected first-last with first <= last, and a step above 0")
        if len(numbers) + (last - first) // step + 1 > MOST_FRAMES:
            raise ValueError(f"frames is {shown(text)}: expected at most {MOST_FRAMES} frames")
        numbers.update(dict.fromkeys(range(first, last + 1, step)))
    return list(numbers)


def gaps(numbers: list[int]) -> list[int]:
    """Return the numbers between the first and the last that are not there."""
    return sorted(set(range(min(numbers), max(numbers) + 1)) - set(numbers)) if numbers else []
