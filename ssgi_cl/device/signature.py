"""What a kernel takes: the names, types and order of its parameters, read from its own text.

The compiler could be asked instead (clGetKernelArgInfo). The text is read because every driver
keeps it, no build option is needed, and a test compares both where a driver has the information.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from ssgi_cl.core.errors import KernelSourceError

PLANE = "ssgi_plane"
"""The type of a plane that a kernel reads: an image or a buffer, see kernels/common/gbuffer.clh."""

OPTIONAL = "ssgi_optional"
"""Marks memory that may be absent, see kernels/common/gbuffer.clh."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kernel.

    Attributes:
        name: as in the kernel.
        type: "ssgi_plane", the type that a pointer points to, or that of a value: "float", "int",
            "int2" or the name of a struct.
        memory: whether it is a plane or a pointer to `__global` memory.
        written: whether the kernel writes there: a pointer without `const`.
        optional: whether the memory may be absent.
    """

    name: str
    type: str
    memory: bool = False
    written: bool = False
    optional: bool = False

    @property
    def declaration(self) -> str:
        """The parameter in OpenCL C, without `restrict`."""
        if self.type == PLANE:
            return f"{PLANE} {self.name}"
        if not self.memory:
            return f"const {self.type} {self.name}"
        kind = f"__global {self.type} *" if self.written else f"__global const {self.type} *"
        return f"{OPTIONAL} {kind}{self.name}" if self.optional else f"{kind}{self.name}"


@dataclass(frozen=True)
class Signature:
    """What a kernel takes, as it was built.

    Attributes:
        kernel: its name.
        parameters: in order.
        absent: names of those that it has with other macros alone.
    """

    kernel: str
    parameters: tuple[Parameter, ...]
    absent: frozenset[str] = frozenset()

    @classmethod
    def of(cls, kernel: str, text: str, macros: Mapping[str, int]) -> Signature:
        """Return the signature of a kernel.

        Args:
            kernel: its name.
            text: its flattened source, see `sources.flatten`. Conditionals may stand between
                parameters; what they test are `macros` and macros that the text defines, never
                what a compiler predefines (which counts as undefined here).
            macros: name -> integer, as the build defines them.

        Raises:
            KernelSourceError: no such kernel, or a parameter or a condition that is not
                understood.
        """
        begin = re.search(rf"\b__kernel\s+void\s+{kernel}\s*\(", text)
        if begin is None:
            raise KernelSourceError(f"the text has no kernel {kernel}")
        before = _COMMENT.sub("", text[: begin.start()])
        code = text[begin.end() : text.find("{", begin.end())]
        listed = _COMMENT.sub("", code)
        active = "".join(_active(f"{before}\n{_BEGIN}{listed}", macros)).rsplit(_BEGIN, 1)[-1]
        parameters = tuple(_parameter(kernel, text) for text in _declarations(active))
        names = {text.split()[-1].lstrip("*") for text in _declarations(_DIRECTIVE.sub("", listed))}
        return cls(kernel, parameters, frozenset(names - {p.name for p in parameters}))


_BEGIN = "\x00"
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_DIRECTIVE = re.compile(r"^[ \t]*#[ \t]*(\w+)((?:\\\n|[^\n])*)$", re.MULTILINE)
_OBJECT_MACRO = re.compile(r"\s*(\w+)(?!\w|\()(.*)", re.DOTALL)
_PARAMETER = re.compile(
    rf"(?P<optional>{OPTIONAL}\s+)?"
    rf"(?:(?P<plane>{PLANE})\s+"
    r"|__global\s+(?P<read>const\s+)?(?P<memory>\w+)\s*\*\s*(?:restrict\s+)?"
    r"|(?:const\s+)?(?P<value>\w+)\s+)"
    r"(?P<name>\w+)"
)


def _declarations(listed: str) -> list[str]:
    """Return the declarations of a parameter list, up to its closing bracket."""
    declarations = [text.strip() for text in listed[: listed.rindex(")")].split(",")]
    return [] if declarations in ([""], ["void"]) else declarations


def _parameter(kernel: str, declaration: str) -> Parameter:
    match = _PARAMETER.fullmatch(declaration)
    if match is None:
        raise KernelSourceError(
            f"kernel {kernel} has the parameter {declaration!r}: expected {PLANE} NAME, "
            "__global [const] TYPE *[restrict] NAME or [const] TYPE NAME"
        )
    found = match.groupdict()
    memory = found["plane"] or found["memory"]
    if found["optional"] and not found["memory"]:
        raise KernelSourceError(
            f"kernel {kernel} has the parameter {declaration!r}: only a pointer to __global memory "
            f"can be {OPTIONAL} (put a plane into #if)"
        )
    return Parameter(
        found["name"],
        memory or found["value"],
        bool(memory),
        bool(found["memory"] and not found["read"]),
        bool(found["optional"]),
    )


def _active(text: str, macros: Mapping[str, int]) -> Iterator[str]:
    """Yield the parts of a text without comments that the preprocessor keeps, directives aside."""
    defined = {name: str(value) for name, value in macros.items()}
    # Of each open conditional: whether the text around it is kept, and whether a branch was.
    stack: list[tuple[bool, bool]] = []
    active, last = True, 0
    for match in _DIRECTIVE.finditer(text):
        if active:
            yield text[last : match.start()]
        last = match.end()
        word, rest = match[1], match[2].replace("\\\n", " ").strip()
        if word in ("if", "ifdef", "ifndef"):
            stack.append((active, False))
            active = active and _holds(word, rest, defined)
            stack[-1] = (stack[-1][0], active)
        elif word in ("elif", "else"):
            around, taken = stack[-1]
            active = around and not taken and (word == "else" or _holds("if", rest, defined))
            stack[-1] = (around, taken or active)
        elif word == "endif":
            active = stack.pop()[0]
        elif active and word == "define":
            macro = _OBJECT_MACRO.fullmatch(rest)
            if macro:
                defined[macro[1]] = macro[2].strip()
        elif active and word == "undef":
            defined.pop(rest, None)
    if active:
        yield text[last:]


def _holds(word: str, rest: str, defined: Mapping[str, str]) -> bool:
    if word == "if":
        return bool(_Expression(rest, defined).value())
    return (rest in defined) == (word == "ifdef")


_TOKEN = re.compile(r"\s*(0[xX][0-9a-fA-F]+|\d+|\w+|&&|\|\||[=!<>]=|[-+*/%<>!()])[uUlL]*")
_BINARY: dict[str, tuple[int, Callable[[int, int], int]]] = {
    "||": (1, lambda a, b: int(bool(a or b))),
    "&&": (2, lambda a, b: int(bool(a and b))),
    "==": (3, operator.eq),
    "!=": (3, operator.ne),
    "<": (4, operator.lt),
    ">": (4, operator.gt),
    "<=": (4, operator.le),
    ">=": (4, operator.ge),
    "+": (5, operator.add),
    "-": (5, operator.sub),
    "*": (6, operator.mul),
    "/": (6, lambda a, b: a // b if b else 0),
    "%": (6, lambda a, b: a % b if b else 0),
}


class _Expression:
    """A condition of the preprocessor; division is of numbers >= 0 alone."""

    def __init__(self, text: str, defined: Mapping[str, str]) -> None:
        self._text = text
        self._defined = defined
        self._tokens: list[str] = []
        place = 0
        while text[place:].strip():
            match = _TOKEN.match(text, place)
            if match is None:
                raise KernelSourceError(f"the condition #if {text} is not understood")
            self._tokens.append(match[1])
            place = match.end()
        self._tokens.append("")

    def value(self) -> int:
        value = self._binary(1)
        if self._tokens != [""]:
            raise KernelSourceError(f"the condition #if {self._text} is not understood")
        return value

    def _next(self, *wanted: str) -> str:
        token = self._tokens.pop(0) if len(self._tokens) > 1 else ""
        if token == "" or (wanted and token not in wanted):
            raise KernelSourceError(f"the condition #if {self._text} is not understood")
        return token

    def _binary(self, least: int) -> int:
        left = self._unary()
        while self._tokens[0] in _BINARY and _BINARY[self._tokens[0]][0] >= least:
            level, apply = _BINARY[self._next()]
            left = int(apply(left, self._binary(level + 1)))
        return left

    def _unary(self) -> int:
        token = self._next()
        if token == "(":
            value = self._binary(1)
            self._next(")")
            return value
        if token in ("!", "-", "+"):
            value = self._unary()
            return int(not value) if token == "!" else -value if token == "-" else value
        if token == "defined":
            name = self._next()
            if name == "(":
                name = self._next()
                self._next(")")
            return int(name in self._defined)
        if token[0].isdigit():
            return int(token, 0) if token == "0" or token[0] != "0" or token[1] in "xX" else int(token, 8)
        if self._tokens[0] == "(":  # such as __has_builtin(...)
            while self._next() != ")":
                pass
            return 0
        body = self._defined.get(token)
        if not body:
            return 0
        known = {name: text for name, text in self._defined.items() if name != token}
        return _Expression(body, known).value()
