"""The hand-written part: what is mutated, which tests cover it, which mutants are equivalent."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from tools.mutate.covering import Covering
from tools.mutate.edits import Mutant

MOST_FILES = 4
"""Test files that are run for a source file without a row."""


@dataclass(frozen=True)
class Table:
    """`table.toml`, see there."""

    mutated: list[str]
    spared: list[str]
    unused: list[str]
    tests: dict[str, list[str]]
    equivalent: list[dict[str, str]]

    @classmethod
    def read(cls, path: Path) -> Table:
        """Return the table of a file."""
        with path.open("rb") as file:
            rows: dict[str, Any] = tomllib.load(file)
        return cls(rows["mutated"], rows["spared"], rows["unused"], rows["tests"], rows.get("equivalent", []))

    def files(self, root: Path, only: tuple[str, ...]) -> list[str]:
        """Return the paths of all files to mutate, of those that `only` names or holds."""
        found = {file.relative_to(root).as_posix() for pattern in self.mutated for file in root.glob(pattern)}
        return sorted(
            path
            for path in found
            if not any(fnmatchcase(path, pattern) for pattern in self.spared)
            and (not only or any(path == o or path.startswith(o.rstrip("/") + "/") for o in only))
        )

    def covering(self, path: str, graph: Covering) -> list[str]:
        """Return the test files to run for a source file.

        Those that a row of its path asks for come first, then those of its name, then those of rows
        with patterns; without a row, the nearest.
        """
        named, others = graph.of(path)
        own = [f"tests/{test}" for test in self.tests.get(path, [])]
        rows = [f"tests/{test}" for pattern, row in self.tests.items() if fnmatchcase(path, pattern) for test in row]
        found = [test for test in [*named, *others] if test not in self.unused]
        most = len([test for test in named if test in found]) if rows else MOST_FILES
        return list(dict.fromkeys([*own, *found[:most], *rows]))

    def proof(self, mutant: Mutant) -> str:
        """Return why a mutant is equivalent; the empty text if it isn't known to be."""
        for row in self.equivalent:
            if (row["path"], row["text"], row["old"], row["new"]) == (
                mutant.path,
                mutant.text,
                mutant.old,
                mutant.edit.new,
            ):
                return row["reason"]
        return ""
