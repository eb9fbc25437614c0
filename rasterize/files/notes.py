"""Lines on what of a file is not drawn: what it is, and how many of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

_MOST_NAMES = 4


def material_notes(features: Iterable[tuple[str, Iterable[str]]]) -> Iterator[str]:
    """Yield a line for each feature, with the materials that have it.

    Args:
        features: name of a material, fit to be printed, and what of it is not drawn as the file says.
    """
    names: dict[str, list[str]] = {}
    for name, texts in features:
        for text in texts:
            names.setdefault(text, []).append(name)
    for text, having in names.items():
        more = len(having) - _MOST_NAMES
        listed = ", ".join(having[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
        yield f"material{'s' if len(having) > 1 else ''} {listed}: {text}"


def not_drawn(number: int, one: str, several: str = "") -> str:
    """Return the line on things that are left out, such as "2 lines are not drawn"."""
    return f"1 {one} is not drawn" if number == 1 else f"{number} {several or one + 's'} are not drawn"
