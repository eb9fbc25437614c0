"""Mutations of Python source, found in its syntax tree.

Left out, since no test could or should tell: docstrings and other strings, annotations, decorators,
messages of exceptions, and what compiles to the same bytecode.
"""

from __future__ import annotations

import ast
from functools import lru_cache
from types import CodeType

from tools.mutate.edits import Edit

OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "//"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.MatMult: ("@", "*"),
    ast.BitXor: ("^", "&"),
}
COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">")),
    ast.LtE: ("<=", ("<", ">=")),
    ast.Gt: (">", (">=", "<")),
    ast.GtE: (">=", (">", "<=")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
OPPOSITES = {
    one: other
    for pair in (
        ("min", "max"),
        ("minimum", "maximum"),
        ("fmin", "fmax"),
        ("argmin", "argmax"),
        ("floor", "ceil"),
        ("any", "all"),
        ("sin", "cos"),
        ("zeros", "ones"),
        ("zeros_like", "ones_like"),
        ("rows", "columns"),
        ("width", "height"),
    )
    for one, other in (pair, pair[::-1])
}
COMMUTATIVE = ("min", "max", "minimum", "maximum", "fmin", "fmax", "hypot", "gcd", "dot", "allclose", "array_equal")
"""Functions whose first two arguments may be swapped."""


def edits(source: bytes) -> list[Edit]:
    """Return all mutations of a module."""
    finder = _Finder(source)
    finder.visit(ast.parse(source))
    return finder.found


def is_new(edit: Edit, source: bytes) -> bool:
    """Return whether a mutation compiles, to other bytecode than the module's."""
    try:
        mutated = compile(edit.applied(source), "module", "exec")
    except (SyntaxError, ValueError):
        return False
    return _key(mutated) != _compiled(source)


@lru_cache(maxsize=8)
def _compiled(source: bytes) -> tuple[object, ...]:
    return _key(compile(source, "module", "exec"))


def _key(code: CodeType) -> tuple[object, ...]:
    """Return what a code object does, without the lines that it came from."""
    constants = tuple(_key(c) if isinstance(c, CodeType) else (type(c), repr(c)) for c in code.co_consts)
    return (code.co_code, code.co_names, code.co_varnames, code.co_freevars, constants)


class _Finder(ast.NodeVisitor):
    def __init__(self, source: bytes) -> None:
        self.source = source
        self.found: list[Edit] = []
        self.lines = [0]
        for line in source.splitlines(keepends=True):
            self.lines.append(self.lines[-1] + len(line))

    def _span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None  # noqa: S101  the parser sets both
        assert node.end_col_offset is not None  # noqa: S101
        return (self.lines[node.lineno - 1] + node.col_offset, self.lines[node.end_lineno - 1] + node.end_col_offset)

    def _text(self, node: ast.expr | ast.stmt) -> str:
        start, end = self._span(node)
        return self.source[start:end].decode()

    def _replace(self, kind: str, node: ast.expr | ast.stmt, new: str) -> None:
        self.found.append(Edit(kind, *self._span(node), new))

    def _between(self, kind: str, one: ast.expr, other: ast.expr, old: str, new: str) -> None:
        """Replace an operator between two expressions."""
        start, end = self._span(one)[1], self._span(other)[0]
        at = self.source.find(old.encode(), start, end)
        if at >= 0:
            self.found.append(Edit(kind, at, at + len(old), new))

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave text out."""

    def visit_Raise(self, node: ast.Raise) -> None:
        """Leave messages out."""

    def visit_Import(self, node: ast.Import) -> None:
        """Leave imports out."""

    def visit_arg(self, node: ast.arg) -> None:
        """Leave annotations out."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for part in (*node.args.defaults, *node.args.kw_defaults, *node.body):
            if part is not None:
                self.visit(part)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for part in node.body:
            self.visit(part)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        texts = (isinstance(side, ast.JoinedStr) or _is_text(side) for side in (node.left, node.right))
        if not any(texts) and type(node.op) in OPERATORS:
            old, new = OPERATORS[type(node.op)]
            self._between("arithmetic", node.left, node.right, old, new)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for one, op, other in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            old, others = COMPARISONS[type(op)]
            for new in others:
                self._between("comparison", one, other, old, new)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        self._between("boolean", node.values[0], node.values[1], old, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not):
            kind = "sign" if isinstance(node.op, ast.USub) else "boolean"
            self._replace(kind, node, self._text(node.operand))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._replace("constant", node, str(not value))
        elif isinstance(value, int):
            self._replace("constant", node, str(value + 1))
        elif isinstance(value, float):
            self._replace("constant", node, repr(1.25 * value if value else 0.125))

    def visit_Name(self, node: ast.Name) -> None:
        if isinstance(node.ctx, ast.Load) and node.id in OPPOSITES:
            self._replace("function", node, OPPOSITES[node.id])

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.ctx, ast.Load) and node.attr in OPPOSITES:
            end = self._span(node)[1]
            start = end - len(node.attr)
            self.found.append(Edit("function", start, end, OPPOSITES[node.attr]))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = self._text(node.func).split(".")[-1]
        swapped = node.args[:2] if name not in COMMUTATIVE else []
        if len(swapped) == 2 and not any(
            isinstance(argument, ast.Starred | ast.JoinedStr) or _is_text(argument) for argument in swapped
        ):
            one, other = swapped
            (start, middle), (again, end) = self._span(one), self._span(other)
            glue = self.source[middle:again].decode()
            self.found.append(Edit("arguments", start, end, self._text(other) + glue + self._text(one)))
        self.generic_visit(node)

    def _negated(self, node: ast.If | ast.While | ast.IfExp) -> None:
        if self._text(node.test) != "TYPE_CHECKING":
            self._replace("condition", node.test, f"not ({self._text(node.test)})")
        self.generic_visit(node)

    visit_If = visit_While = visit_IfExp = _negated

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._replace("removed", node, "pass")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._replace("removed", node, "pass")
        self.generic_visit(node)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
