"""Mutations of OpenCL C, found by patterns in its text without comments and directives.

The code has one statement a line or more and spaces round binary operators, so that `a * b` is told
from `float *a`. What does not compile is found when it is run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from tools.mutate.edits import Edit

SWAPS = {
    " + ": (" - ",),
    " - ": (" + ",),
    " * ": (" / ",),
    " / ": (" * ",),
    " % ": (" / ",),
    " += ": (" -= ",),
    " -= ": (" += ",),
    " *= ": (" /= ",),
    " << ": (" >> ",),
    " >> ": (" << ",),
    " < ": (" <= ", " > "),
    " <= ": (" < ", " >= "),
    " > ": (" >= ", " < "),
    " >= ": (" > ", " <= "),
    " == ": (" != ",),
    " != ": (" == ",),
    " && ": (" || ",),
    " || ": (" && ",),
    " & ": (" | ",),
    " | ": (" & ",),
    " ^ ": (" & ",),
}
_KINDS = {
    "<": "comparison",
    ">": "comparison",
    "=": "comparison",
    "!": "comparison",
    "&": "boolean",
    "|": "boolean",
    "^": "boolean",
}
_PAIRS = (
    ("v_min", "v_max"),
    ("v_imin", "v_imax"),
    ("min", "max"),
    ("fmin", "fmax"),
    ("v_lt", "v_le"),
    ("v_gt", "v_ge"),
    ("v_ilt", "v_ile"),
    ("floor", "ceil"),
    ("sin", "cos"),
    ("v_lt", "v_gt"),
    ("v_le", "v_ge"),
)
CALLS = [(one, other) for pair in _PAIRS for one, other in (pair, pair[::-1])]
"""Functions and what replaces their names."""

COMMUTATIVE = (
    "v_fma",
    "fma",
    "v_min",
    "v_max",
    "v_imin",
    "v_imax",
    "min",
    "max",
    "hypot",
    "v_eq",
    "v_ne",
    "v_ieq",
    "v_ine",
    "dot",
)
"""Functions whose first two arguments may be swapped."""

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_DEFINE = re.compile(r"#define \w+(\([\w, ]*\))? ")
_OPERATOR = re.compile("|".join(re.escape(text) for text in sorted(SWAPS, key=len, reverse=True)))
_CALL = re.compile(r"\b(\w+)\((?=[^()])")
_NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|\d+\.?e[+-]?\d+|\d+)(f?)(?![\w.])")
_AXIS = re.compile(r"(?<=[\w\])])\.([xy])\b")
_SIGN = re.compile(r"(?<=[(,=*/+] )-(?=[\w(])|(?<=\()-(?=[\w(])")
_ARGUMENTS = re.compile(r"\b(\w+)\(([\w.\[\]]+), ([\w.\[\]]+)(?=[,)])")
_CONDITION = re.compile(r"\bif \(")
_STATEMENT = re.compile(r"^[ ]+[\w.\[\]>-]+ [-+*/|&^]?= [^;{}]*;|^[ ]+ssgi_store\([^;{}]*;", re.MULTILINE)


def edits(source: bytes) -> list[Edit]:
    """Return all mutations of a kernel file."""
    text = source.decode()
    if len(text) != len(source):
        raise ValueError("kernels are ASCII")
    code = without_comments(text)
    found = [edit for edit in _found(code) if edit.new != edit.old(source)]
    return sorted(set(found), key=lambda edit: (edit.start, edit.end, edit.new))


def _found(code: str) -> Iterator[Edit]:
    for match in _OPERATOR.finditer(code):
        kind = _KINDS.get(match[0].strip()[0], "arithmetic")
        for new in SWAPS[match[0]]:
            yield Edit(kind, *match.span(), new)
    for match in _CALL.finditer(code):
        for name, new in CALLS:
            if match[1] == name:
                yield Edit("function", *match.span(1), new)
    for match in _NUMBER.finditer(code):
        yield Edit("constant", *match.span(), _changed(match[1]) + match[2])
    for match in _AXIS.finditer(code):
        yield Edit("axis", *match.span(1), "y" if match[1] == "x" else "x")
    for match in _SIGN.finditer(code):
        yield Edit("sign", *match.span(), "")
    for match in _ARGUMENTS.finditer(code):
        if match[1] not in COMMUTATIVE:
            yield Edit("arguments", match.start(2), match.end(3), f"{match[3]}, {match[2]}")
    for match in _CONDITION.finditer(code):
        end = _closing(code, match.end())
        if end > 0:
            yield Edit("condition", match.end(), end, f"!({code[match.end() : end]})")
    for match in _STATEMENT.finditer(code):
        start = match.start() + len(match[0]) - len(match[0].lstrip())
        yield Edit("removed", start, match.end(), ";")


def _changed(number: str) -> str:
    if number.isdigit():
        return str(int(number) + 1)
    return repr(1.25 * float(number) if float(number) else 0.125)


def _closing(code: str, start: int) -> int:
    """Return where the parenthesis closes whose inside begins at `start`; -1 if nowhere."""
    depth = 1
    for at in range(start, len(code)):
        depth += {"(": 1, ")": -1}.get(code[at], 0)
        if depth == 0:
            return at
    return -1


def without_comments(text: str) -> str:
    """Return the text with blanks for comments and directives, but for values of macros.

    Positions stay.
    """
    text = _COMMENT.sub(lambda match: _blank(match[0]), text)
    lines, continued = [], False
    for line in text.splitlines(keepends=True):
        value = None if continued else _DEFINE.match(line)
        directive = continued or line.lstrip().startswith("#")
        hidden = value.end() if value else len(line) if directive else 0
        lines.append(_blank(line[:hidden]) + line[hidden:])
        continued = directive and line.rstrip().endswith("\\")
    return "".join(lines)


def _blank(text: str) -> str:
    return re.sub(r"[^\n]", " ", text)
