"""Test files that cover a source file: those of its name, and those that use it, near ones first.

The graph has an edge from a module to each that it imports, from a module to each kernel whose path
it holds as a string, and from a kernel to what it includes.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

PACKAGES = {
    "ssgi_cl.kernels": "kernels",
    "ssgi_cl.rasterize": "rasterize",
    "ssgi_cl.bench": "bench",
    "ssgi_cl": "ssgi_cl",
    "tests": "tests",
}
"""Import names -> folders, the longer names first."""
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
_KERNEL = re.compile(r'"(\w+/\w+\.cl)"')
_IMPORT = re.compile(r"^[ \t]*((?:from [\w.]+ )?import (?:\([^)]*\)|[^(\n]+))", re.MULTILINE)


class Covering:
    """The test files of a source tree.

    Args:
        root: of the tree.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.users: dict[str, set[str]] = defaultdict(set)
        self.tests: list[str] = []
        self.exported = _exports(root)
        for folder in PACKAGES.values():
            for file in sorted((root / folder).rglob("*.py")):
                if "__pycache__" in file.parts or file.is_relative_to(root / "ssgi_cl/kernels"):
                    continue
                path = file.relative_to(root).as_posix()
                if file.name.startswith("test_"):
                    self.tests.append(path)
                for used in self._used(file, path):
                    self.users[used].add(path)
        for file in (root / "kernels").rglob("*.cl*"):
            path = file.relative_to(root).as_posix()
            for include in _INCLUDE.findall(file.read_text(encoding="utf-8")):
                self.users[f"kernels/{include}"].add(path)

    def of(self, path: str) -> tuple[list[str], list[str]]:
        """Return the test files of a file's name, and others that use it, the nearest first."""
        distance = self._distances(path)
        names = _names(path)
        named = [test for test in self.tests if _fits(test, names) and _package(test) == _package(path)]
        others = sorted(set(distance) & set(self.tests) - set(named), key=lambda test: (distance[test], test))
        return named, others

    def _distances(self, path: str) -> dict[str, int]:
        found, front, step = {path: 0}, [path], 0
        while front:
            step += 1
            front = sorted(
                {
                    user
                    for one in front
                    for user in self.users[one]
                    if user not in found and not user.endswith("/__init__.py")
                }
            )
            found |= dict.fromkeys(front, step)
        return found

    def _used(self, file: Path, path: str) -> Iterator[str]:
        text = file.read_text(encoding="utf-8")
        if not path.startswith("tests/"):
            yield from (f"kernels/{name}" for name in _KERNEL.findall(text))
        # Statements alone: parsing all of every file takes twenty times as long.
        for node in ast.parse("\n".join(_IMPORT.findall(text))).body:
            if isinstance(node, ast.Import):
                for alias in node.names:
                    yield from self._file(alias.name)
            elif isinstance(node, ast.ImportFrom):
                package = ""
                if node.level:
                    parents = PurePosixPath(path).parts[: -node.level]
                    package = ".".join(parents) + ("." if node.module else "")
                module = package + (node.module or "")
                for alias in node.names:
                    name = f"{module}.{alias.name}"
                    yield from self._file(self.exported.get(name, name))
                yield from self._file(module)

    def _file(self, module: str) -> Iterator[str]:
        for package, folder in PACKAGES.items():
            if module == package or module.startswith(package + "."):
                stem = folder + module.removeprefix(package).replace(".", "/")
                for path in (f"{stem}.py", f"{stem}/__init__.py"):
                    if (self.root / path).is_file():
                        yield path
                return


def _exports(root: Path) -> dict[str, str]:
    """Return what `ssgi_cl` exports, as its stub lists it -> the module that has it."""
    found: dict[str, str] = {}
    text = (root / "ssgi_cl" / "__init__.pyi").read_text(encoding="utf-8")
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"ssgi_cl.{alias.name}": f"ssgi_cl.{node.module}" for alias in node.names}
    return found


def _package(path: str) -> str:
    """Return "bench" or "truth" of sources and tests of these, which have tests of their own."""
    return next((name for name in ("bench", "truth") if name in path.split("/")[:2]), "")


def _names(path: str) -> list[str]:
    """Return the stems that tests of a file have: its own; of a kernel, also its folder's."""
    file = PurePosixPath(path)
    if file.parts[:2] == ("kernels", "common"):
        return [f"common_{file.stem}"]
    if file.parts[0] == "kernels":
        return [file.stem, file.parent.name]
    if file.stem == "__init__":
        return [file.parent.name]
    return [file.stem]


def _fits(test: str, names: list[str]) -> bool:
    """Return whether a test file is named after one of these."""
    stem = test.rpartition("/")[2].removesuffix(".py").removeprefix("test_")
    return any(stem == name or stem.startswith(f"{name}_") for name in names)
