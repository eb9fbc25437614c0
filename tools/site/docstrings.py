"""Docstrings in Google style as reStructuredText that Sphinx takes without a warning."""

from __future__ import annotations

import re

_LISTED = re.compile(r"^( *)\*\*params:")
_FIELD = re.compile(r"^( +)(\w+): (.*)$")
_KIND = re.compile(r"^( +)(`\w+`):$")


def escaped(text: str) -> str:
    """Return a line with what would be taken for marks escaped; names in backticks and entries stay."""
    entry = re.match(r"^ *\*{1,2}\w+:", text)
    start = entry[0] if entry else ""
    parts = re.split(r"(`[^`]*`)", text[len(start) :])
    return start + "".join(part if part.startswith("`") else re.sub(r"(?<!\\)([*|])", r"\\\1", part) for part in parts)


def as_lists(lines: list[str]) -> list[str]:
    """Return the lines of a docstring with the fields that follow `**params` as a list."""
    made: list[str] = []
    inside, seen = -1, False
    for line in lines:
        indent = len(line) - len(line.lstrip())
        start = _LISTED.match(line)
        if start:
            inside, seen = len(start[1]), False
        elif inside >= 0 and (not line.strip() or indent <= inside):
            inside = -1
        elif inside >= 0:
            field, kind = _FIELD.match(line), _KIND.match(line)
            least = inside + 4
            if kind:
                made += ["", f"{' ' * least}{kind[2]}:", ""]
                seen = True
                continue
            if field and (seen or indent == least):
                made += [] if seen else [""]
                made.append(f"{' ' * least}* ``{field[2]}``: {field[3]}")
                seen = True
                continue
            if seen:
                made.append(f"{' ' * (least + 2)}{line.strip()}")
                continue
        made.append(line)
    return made


def prepared(lines: list[str]) -> list[str]:
    """Return the lines of a docstring as Napoleon is to read them."""
    return [escaped(line) if not line.lstrip().startswith("* ``") else line for line in as_lists(lines)]
