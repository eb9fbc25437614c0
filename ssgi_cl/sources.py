"""Kernel sources: which kernels exist, and their text with every include put in place."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.resources import files

from ssgi_cl.errors import KernelSourceError

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"\s*$')


def kernel_names() -> list[str]:
    """Return the path of every kernel file relative to `kernels/`, such as "ssao/ssao.cl"."""
    root = files("ssgi_cl.kernels")
    return sorted(
        f"{folder.name}/{file.name}"
        for folder in root.iterdir()
        if folder.is_dir()
        for file in folder.iterdir()
        if file.name.endswith(".cl")
    )


@lru_cache(maxsize=256)
def flatten(path: str, prelude: str = "") -> str:
    """Return the text of a kernel file with its includes in place, each once.

    Args:
        path: relative to `kernels/`, such as "ssao/ssao.cl".
        prelude: generated text that comes first (struct definitions).

    `#line` directives keep the compiler's messages pointing at the files in `kernels/`.

    Raises:
        KernelSourceError: a file does not exist; the message names it and who includes it.
    """
    seen: set[str] = set()
    lines = ['#line 1 "generated"', *prelude.splitlines()]
    _append(path, "the library", seen, lines)
    return "\n".join(lines) + "\n"


def _append(path: str, wanted_by: str, seen: set[str], lines: list[str]) -> None:
    if path in seen:
        return
    seen.add(path)
    file = files("ssgi_cl.kernels").joinpath(*path.split("/"))
    if not file.is_file():
        raise KernelSourceError(f"kernels/{path} does not exist; {wanted_by} asks for it")
    lines.append(f'#line 1 "{path}"')
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        include = _INCLUDE.match(line)
        if include:
            _append(include[1], f"kernels/{path}:{number}", seen, lines)
            lines.append(f'#line {number + 1} "{path}"')
        else:
            lines.append(line)
