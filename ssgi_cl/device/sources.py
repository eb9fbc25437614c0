"""Kernel sources: which kernels exist, and their text with every include put in place."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.resources import files

from ssgi_cl.core.errors import KernelSourceError
from ssgi_cl.device.constants import definitions

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

    Constants that it has from the host are defined before, see `ssgi_cl.device.constants`.

    Args:
        path: relative to `kernels/`, such as "ssao/ssao.cl".
        prelude: generated text that comes first (struct definitions).

    `#line` directives keep the compiler's messages pointing at the files in `kernels/`.

    Raises:
        KernelSourceError: a file does not exist; the message names it and who includes it.
    """
    lines: list[str] = []
    _append_file(path, "the library", set(), lines)
    return _generated(prelude, lines)


def flatten_text(text: str, name: str, prelude: str = "") -> str:
    """Return a kernel text that is in no file with its includes in place; see `flatten`.

    Args:
        text: OpenCL C that may include files of `kernels/`.
        name: what the compiler's messages call the text.
        prelude: generated text that comes first (struct definitions).
    """
    lines: list[str] = []
    _append(text, name, name, set(), lines)
    return _generated(prelude, lines)


def _generated(prelude: str, lines: list[str]) -> str:
    """Return a text behind its prelude and the constants that it has from the host."""
    text = "\n".join(lines)
    generated = ['#line 1 "generated"', *definitions(text), *prelude.splitlines()]
    return "\n".join(generated) + f"\n{text}\n"


def _append_file(path: str, wanted_by: str, seen: set[str], lines: list[str]) -> None:
    if path in seen:
        return
    seen.add(path)
    file = files("ssgi_cl.kernels").joinpath(*path.split("/"))
    if not file.is_file():
        raise KernelSourceError(f"kernels/{path} does not exist; {wanted_by} asks for it")
    _append(file.read_text(encoding="utf-8"), path, f"kernels/{path}", seen, lines)


def _append(text: str, name: str, shown: str, seen: set[str], lines: list[str]) -> None:
    lines.append(f'#line 1 "{name}"')
    for number, line in enumerate(text.splitlines(), start=1):
        include = _INCLUDE.match(line)
        if include:
            _append_file(include[1], f"{shown}:{number}", seen, lines)
            lines.append(f'#line {number + 1} "{name}"')
        else:
            lines.append(line)
