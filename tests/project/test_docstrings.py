"""Docstrings: parameters that exist and all that do; the papers that techniques implement."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator
from enum import EnumType
from typing import Any

import pytest

import ssgi_cl
import ssgi_cl as gi
from ssgi_cl.techniques.catalogue import CATALOGUE

BESIDE = {
    "Choice",
    "ao",
    "ao_confidence",
    "auxiliary_cameras",
    "choose_vpls",
    "normals_from_depth",
    "relight",
    "shade_depth",
}
"""Parts of techniques, and what is made of them, of no paper of their own."""
TECHNIQUES = {
    name: value
    for name in gi.__all__
    if callable(value := getattr(gi, name))
    and value.__module__.startswith(("ssgi_cl.techniques.", "ssgi_cl.truth.ray_ao"))
    and not name.endswith("Params")
    and name not in BESIDE
}


def test_every_technique_is_looked_at() -> None:
    functions = {name for name, value in TECHNIQUES.items() if inspect.isfunction(value)}
    assert functions == {*CATALOGUE, "multi_bounce", "ray_ao"}


@pytest.mark.parametrize("name", sorted(TECHNIQUES))
def test_a_technique_names_its_paper_and_where_it_departs(name: str) -> None:
    value: Any = TECHNIQUES[name]
    text = " ".join((inspect.getdoc(value) or "").split())
    # An author and a year, such as "Kopf et al. 2007".
    assert re.search(r"\b[A-Z][a-z]+\b[\w ,.]* (19|20)\d\d\b", text), text
    assert re.search(r"\bDeparts\b|[Aa]s published", text), text


def stated(doc: str) -> list[str]:
    """Return the names that the section Args of a docstring begins its entries with."""
    section = re.search(r"^Args:\n((?:    .*\n?|\n)*)", doc, re.MULTILINE)
    entries = re.findall(r"^    (\*{0,2}\w+(?:, \*{0,2}\w+)*):", section[1] if section else "", re.MULTILINE)
    return [name.strip("*") for entry in entries for name in entry.split(", ")]


def parameters(value: Any) -> list[str]:
    kinds = inspect.Parameter
    return [
        name
        for name, parameter in inspect.signature(value).parameters.items()
        if name not in ("self", "cls") and parameter.kind is not kinds.VAR_KEYWORD and not name.startswith("_")
    ]


def methods(value: Any) -> Iterator[tuple[str, Any]]:
    for name, held in vars(value).items() if inspect.isclass(value) else ():
        function = getattr(held, "__func__", held)
        if inspect.isfunction(function) and function.__doc__:
            yield name, function


def test_parameters_that_docstrings_describe_exist() -> None:
    absent = {}
    for found in pkgutil.walk_packages(ssgi_cl.__path__, "ssgi_cl."):
        if found.name.endswith("__main__"):
            continue
        module = importlib.import_module(found.name)
        for name, value in vars(module).items():
            if getattr(value, "__module__", None) == found.name and callable(value):
                for path, described in ((name, value), *((f"{name}.{part}", f) for part, f in methods(value))):
                    names = stated(inspect.getdoc(described) or "")
                    missing = set(names) - set(inspect.signature(described).parameters) if names else ()
                    if missing:
                        absent[f"{found.name}.{path}"] = missing
    assert not absent


def public(module: Any) -> dict[str, Any]:
    """Public functions and classes but enumerations, and methods that have a section Args."""
    named = {name: getattr(module, name) for name in module.__all__}
    named = {name: value for name, value in named.items() if inspect.isclass(value) or inspect.isfunction(value)}
    named = {name: value for name, value in named.items() if not issubclass(type(value), EnumType)}
    inner = {f"{name}.{part}": f for name, value in named.items() for part, f in methods(value) if part[0] != "_"}
    return named | {name: value for name, value in inner.items() if stated(inspect.getdoc(value) or "")}


def described(value: Any, module: Any) -> set[str]:
    """The words of a docstring, with the parameters of what it sends the reader to."""
    doc = inspect.getdoc(value) or ""
    words = set(re.findall(r"\w+", doc))
    for other in re.findall(r"(?:rest is as in|see|[Aa]s in) `([\w.]+)`", doc):
        for holder in (sys.modules[value.__module__], inspect.getmodule(value), module):
            target = getattr(holder, other, None)
            words |= set(re.findall(r"\w+", inspect.getdoc(target) or "")) if target else set()
    if dataclasses.is_dataclass(value):
        words |= {field.name for field in dataclasses.fields(value) if field.metadata.get("doc")}
    return words


@pytest.mark.parametrize("module", [gi, gi.metrics, gi.truth], ids=lambda module: module.__name__)
def test_every_public_parameter_is_described(module: Any) -> None:
    missing = {
        name: lacking
        for name, value in public(module).items()
        if not (inspect.isclass(value) and issubclass(value, Exception))
        and (lacking := [p for p in parameters(value) if p not in described(value, module)])
    }
    assert not missing
