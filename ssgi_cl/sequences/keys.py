"""Keys of results: what a file was made of, kept in the file, so that a run that begins again knows what is done.

A key is the hash of the input's content, of the function with its arguments, and of the library's version. It
stands in the output itself, as an attribute of OpenEXR and a text of PNG, so that the two cannot come apart.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import struct
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ssgi_cl.io.exr_header import read_attributes
from ssgi_cl.version import __version__

NAME = "ssgi_cl/key"
"""Of the attribute and of the text."""
_PIECE = 1 << 20


def described(function: Callable[..., Any], arguments: Mapping[str, Any]) -> str:
    """Return the hash of what is done to every input, which one process finds for all.

    Args:
        function: by its name and source text; of a partial function also by what it is given.
        arguments: of the function, by name.
    """
    whole = hashlib.blake2b(digest_size=16)
    _add(whole, ("ssgi_cl", __version__))
    _add_function(whole, function)
    _add(whole, dict(arguments))
    return whole.hexdigest()


def hashed(*values: Any) -> str:
    """Return the hash of values: arrays, numbers, texts, dataclasses, and lists and maps of such."""
    whole = hashlib.blake2b(digest_size=16)
    _add(whole, values)
    return whole.hexdigest()


def key_of(work: str, source: Any) -> str:
    """Return the key of a result.

    Args:
        work: what `described` returns.
        source: the input; of a path the content of the file counts, of anything else its value.

    Raises:
        FileNotFoundError, OSError: the input is a path that can't be read.
    """
    whole = hashlib.blake2b(digest_size=16)
    _add(whole, work)
    if isinstance(source, (str, os.PathLike)):
        with open(source, "rb") as file:
            whole.update(b"file")
            while piece := file.read(_PIECE):
                whole.update(piece)
    else:
        _add(whole, source)
    return whole.hexdigest()


def stored_key(path: Path) -> str | None:
    """Return the key in a file; None without one, or where there is no such file or it is damaged."""
    try:
        if path.suffix.lower() == ".exr":
            value = read_attributes(path).get(NAME)
            return None if value is None else value.decode("ascii")
        if path.suffix.lower() == ".png":
            return _png_text(path)
    except (OSError, ValueError):
        pass
    return None


def _png_text(path: Path) -> str | None:
    with open(path, "rb") as file:
        if file.read(8) != b"\x89PNG\r\n\x1a\n":
            return None
        while len(head := file.read(8)) == 8:
            (size,) = struct.unpack(">I", head[:4])
            if head[4:] == b"IDAT":
                return None
            data = file.read(size + 4)[:size]
            if head[4:] == b"tEXt" and data.startswith(NAME.encode() + b"\0"):
                return data.split(b"\0", 1)[1].decode("latin-1")
    return None


def _add_function(whole: Any, function: Callable[..., Any]) -> None:
    if isinstance(function, partial):
        _add(whole, (function.args, function.keywords))
        function = function.func
    named = function if hasattr(function, "__qualname__") else type(function)
    _add(whole, (named.__module__, named.__qualname__))
    try:
        _add(whole, inspect.getsource(named))
    except (OSError, TypeError):  # of a terminal, or not of Python
        code = getattr(function, "__code__", None)
        _add(whole, code.co_code if code is not None else b"")
    if named is not function:
        _add(whole, vars(function) if hasattr(function, "__dict__") else repr(function))


def _add(whole: Any, value: Any) -> None:
    """Add a value to the hash: its type, size and content, so that different values never run together."""
    if isinstance(value, np.ndarray):
        head, body = f"array {value.dtype.str} {value.shape}", np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Mapping):
        whole.update(f"map {len(value)};".encode())
        for name in sorted(value, key=repr):
            _add(whole, name)
            _add(whole, value[name])
        return
    elif isinstance(value, (tuple, list)):
        whole.update(f"list {len(value)};".encode())
        for each in value:
            _add(whole, each)
        return
    elif is_dataclass(value):
        _add(whole, (type(value).__qualname__, {each.name: getattr(value, each.name) for each in fields(value)}))
        return
    else:
        head, body = type(value).__qualname__, value if isinstance(value, bytes) else repr(value).encode()
    whole.update(f"{head} {len(body)};".encode() + body)
