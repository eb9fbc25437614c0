"""One mutation: a replaced piece of a source file."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Edit:
    """A piece of UTF-8 source text and what replaces it.

    Attributes:
        kind: class of the mutation, such as "comparison".
        start, end: bytes of the source that are replaced.
        new: what replaces them.
    """

    kind: str
    start: int
    end: int
    new: str

    def applied(self, source: bytes) -> bytes:
        """Return the mutated source."""
        return source[: self.start] + self.new.encode() + source[self.end :]

    def old(self, source: bytes) -> str:
        """Return the text that is replaced."""
        return source[self.start : self.end].decode()

    def line(self, source: bytes) -> int:
        """Return the line, from 1, where the replaced text begins."""
        return source.count(b"\n", 0, self.start) + 1


@dataclass(frozen=True)
class Mutant:
    """A mutation of a file.

    Attributes:
        path: of the file from the root of the repository, with slashes.
        edit: what changes.
        line: where, from 1.
        text: the source line, without indentation.
        old: the text that is replaced.
    """

    path: str
    edit: Edit
    line: int
    text: str
    old: str

    @classmethod
    def of(cls, path: str, edit: Edit, source: bytes) -> Mutant:
        """Return the mutant of a file that an edit of its source makes."""
        line = edit.line(source)
        return cls(path, edit, line, source.splitlines()[line - 1].decode().strip(), edit.old(source))

    def __str__(self) -> str:
        old, new = (" ".join(text.split())[:60] for text in (self.old, self.edit.new))
        return f"{self.path}:{self.line} {self.edit.kind}: {old!r} -> {new!r} in {self.text[:90]!r}"
