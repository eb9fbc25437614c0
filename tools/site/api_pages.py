"""A page for each public name, in reStructuredText, from `ssgi_cl/__init__.pyi` and `__all__` of the public modules."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tools.site.docstrings import escaped

STUB = Path("ssgi_cl/__init__.pyi")
"""Seen from the root of the checkout."""

MODULES: Mapping[str, str] = {
    "ssgi_cl.rasterize": "meshes to G-buffers",
    "ssgi_cl.rasterize.scenes": "built-in and generated scenes",
    "ssgi_cl.truth": "references by rays and paths",
    "ssgi_cl.metrics": "errors",
}
"""Public modules, and what the index says of them."""

HIDDEN = {"BUILTIN_SCENES", "KINDS", "REPORTED", "SCENE_NAMES", "TUNED_ON", "TUNING_SEEDS", "VALIDATED_ON"}
HIDDEN |= {"VALIDATION_ROOMS", "VALIDATION_SEEDS", "generated", "PIXELS_PER_DEGREE", "REGIONS", "__version__"}
"""Constants and modules, which have no docstring of their own."""


def stub_names(root: Path) -> list[str]:
    """Return the public names of the package, modules among them, as the stub lists them."""
    text = (root / STUB).read_text(encoding="utf-8")
    return sorted(set(re.findall(r"^from \S+ import \w+ as (\w+)$", text, re.MULTILINE)))


def public_objects(root: Path) -> dict[str, Any]:
    """Return full name -> object of every public class, function and type, each under its first name."""
    package = importlib.import_module("ssgi_cl")
    found = {f"ssgi_cl.{name}": getattr(package, name) for name in stub_names(root) if name not in HIDDEN}
    for module in MODULES:
        held = importlib.import_module(module) if module != "ssgi_cl.metrics" else package.metrics
        shown = getattr(held, "__all__", None) or [name for name in dir(held) if name[0] != "_"]
        found |= {f"{module}.{name}": getattr(held, name) for name in shown if name not in HIDDEN}
    once: dict[int, str] = {}
    for name, value in found.items():
        if not inspect.ismodule(value):
            once.setdefault(id(value), name)
    return {name: found[name] for name in once.values()}


def kind(value: Any) -> str:
    """Return the heading of the index under which an object stands."""
    if inspect.isclass(value) and issubclass(value, BaseException):
        return "Errors and warnings"
    if inspect.isclass(value) and value.__name__.endswith("Params"):
        return "Parameters"
    if inspect.isfunction(value):
        return "Functions"
    return "Classes and types"


def page(name: str, value: Any) -> str:
    """Return the page of a public name."""
    title = name.removeprefix("ssgi_cl.")
    lines = [title, "=" * len(title), ""]
    if inspect.isclass(value):
        lines += [f".. autoclass:: {name}", "   :members:"]
        lines += ["   :inherited-members: object, tuple, Exception, int, Enum"]
    elif inspect.isfunction(value):
        lines += [f".. autofunction:: {name}"]
    else:
        lines += [f".. autodata:: {name}", "   :no-value:"]
    return "\n".join([*lines, ""])


def index(objects: Mapping[str, Any]) -> str:
    """Return the index of all pages, by module and kind, each with the first line of its docstring."""
    lines = ["API reference", "=============", "", "``import ssgi_cl as gi``; every name below is public.", ""]
    groups: dict[str, list[str]] = {}
    for name, value in objects.items():
        module = name.rpartition(".")[0]
        groups.setdefault(kind(value) if module == "ssgi_cl" else f"{module}: {MODULES[module]}", []).append(name)
    order = ["Functions", "Classes and types", "Parameters", "Errors and warnings"]
    for group in sorted(groups, key=lambda group: order.index(group) if group in order else len(order)):
        names = sorted(groups[group], key=str.lower)
        lines += [group, "-" * len(group), "", ".. list-table::", "   :widths: 35 65", ""]
        for name in names:
            lines += [f"   * - :py:obj:`~{name}`", f"     - {escaped(summary(objects[name]))}"]
        lines += ["", ".. toctree::", "   :hidden:", "", *(f"   {name}" for name in names), ""]
    return "\n".join(lines)


def summary(value: Any) -> str:
    """Return the first paragraph of an object's docstring, on one line."""
    doc = (inspect.getdoc(value) or "") if callable(value) else ""
    return " ".join(doc.partition("\n\n")[0].split())


def write(root: Path, folder: Path) -> None:
    """Write all pages and their index into a folder; remove pages of names that are no more."""
    objects = public_objects(root)
    texts = {f"{name}.rst": page(name, value) for name, value in objects.items()} | {"index.rst": index(objects)}
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.glob("*.rst"):
        if path.name not in texts:
            path.unlink()
    for name, text in texts.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
