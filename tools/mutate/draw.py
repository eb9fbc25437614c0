"""Seeded random choice of mutants."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

from tools.mutate import kernel_source, python_source
from tools.mutate.edits import Edit, Mutant


def edits(path: str, source: bytes) -> list[Edit]:
    """Return all mutations of a file, by its suffix."""
    found: Callable[[bytes], list[Edit]]
    found = python_source.edits if path.endswith(".py") else kernel_source.edits
    return found(source)


def drawn(root: Path, paths: list[str], seed: int) -> Iterator[Mutant]:
    """Give mutants without end, none twice, until none is left.

    A file is drawn in proportion to its lines, then a kind of mutation, then one of its places, so
    that constants, of which there are most, don't crowd out the others.
    """
    dice = random.Random(seed)
    sources = {path: (root / path).read_bytes() for path in paths}
    left: dict[str, dict[str, list[Edit]]] = {}
    while sources:
        paths = list(sources)
        weights = [sources[path].count(b"\n") + 1 for path in paths]
        path = dice.choices(paths, weights)[0]
        if path not in left:
            left[path] = {}
            for edit in edits(path, sources[path]):
                left[path].setdefault(edit.kind, []).append(edit)
        if not left[path]:
            del sources[path]
            continue
        kind = dice.choice(sorted(left[path]))
        places = left[path][kind]
        edit = places.pop(dice.randrange(len(places)))
        if not places:
            del left[path][kind]
        if not path.endswith(".py") or python_source.is_new(edit, sources[path]):
            yield Mutant.of(path, edit, sources[path])
