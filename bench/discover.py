"""What the modules of a package declare under one name, so that none has to be listed."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any


def declared(package: str, attribute: str, order: Sequence[str] = (), *, prefix: str = "") -> dict[str, Any]:
    """Return a mapping that modules of a package declare, all parts of it joined.

    Args:
        package: its full name.
        attribute: of the modules; those without it are passed over.
        order: modules whose parts come first, in this order; the others follow by name.
        prefix: what the names of the modules begin with.

    Raises:
        ValueError: two modules declare the same key, or `order` names a module that is not there.
    """
    folder = import_module(package).__path__
    names = sorted(m.name for m in pkgutil.iter_modules(folder) if m.name.startswith(prefix))
    unknown = [name for name in order if name not in names]
    if unknown:
        raise ValueError(f"order names {unknown[0]!r}: {package} has no such module")
    joined: dict[str, Any] = {}
    for name in (*order, *(name for name in names if name not in order)):
        part: Mapping[str, Any] = getattr(import_module(f"{package}.{name}"), attribute, {})
        twice = sorted(joined.keys() & part.keys())
        if twice:
            raise ValueError(f"{attribute} of {package}.{name}: {twice[0]!r} is declared already")
        joined.update(part)
    return joined
