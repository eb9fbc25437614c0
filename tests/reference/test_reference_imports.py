"""The numpy reference implementations share nothing with what they check, but for data classes."""

from __future__ import annotations

import ast
import dataclasses
import enum
import importlib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pytest

import ssgi_cl

ALLOWED = {
    "ssgi_cl.core.camera": {"Camera"},
    "ssgi_cl.core.environment_samples": {"Strata"},
    "ssgi_cl.core.gbuffer": {"GBuffer"},
    "ssgi_cl.core.history": {"History", "Reset"},
    "ssgi_cl.core.reflective_shadow_map": {"ReflectiveShadowMap"},
    "ssgi_cl.core.lights": {"DirectionalLight", "Environment", "Light", "PointLight", "SpotLight"},
    "ssgi_cl.core.scene": {"Scene"},
    "ssgi_cl.core.vpls": {"Vpls"},
}
"""Modules and what reference implementations may take from them: the user's data."""
ROOT = Path(str(files(ssgi_cl)))
REFERENCES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "reference").rglob("*.py"))


def imports(text: str) -> Iterator[tuple[str, str, bool]]:
    """Give the module and name of each import of the library, and whether types alone need it."""
    tree = ast.parse(text)
    annotations = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for statement in node.body
        for inner in ast.walk(statement)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "ssgi_cl":
                    yield alias.name, "*", node in annotations
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: expected absolute imports"
            if (node.module or "").split(".")[0] == "ssgi_cl":
                for alias in node.names:
                    yield str(node.module), alias.name, node in annotations


def is_allowed(module: str, name: str, *, annotation: bool) -> bool:
    """Return whether a reference implementation may import a name."""
    if module.startswith("ssgi_cl.reference."):
        return True
    if name in ALLOWED.get(module, ()):
        return True
    # For annotations alone, parameters of techniques.
    return annotation and module.startswith("ssgi_cl.techniques.") and name.endswith("Params")


@pytest.mark.parametrize("path", REFERENCES)
def test_nothing_is_imported_from_what_is_checked(path: str) -> None:
    text = (ROOT / path).read_text(encoding="utf-8")
    for module, name, annotation in imports(text):
        assert is_allowed(module, name, annotation=annotation), f"{module}.{name}"
    assert "import_module" not in text
    assert "__import__" not in text


@pytest.mark.parametrize(
    ("text", "allowed"),
    [
        ("from ssgi_cl.core.gbuffer import GBuffer", True),
        ("from ssgi_cl.reference.ao.slices import Scan", True),
        ("from ssgi_cl.techniques.ao.ssao import SsaoParams", False),
        ("if TYPE_CHECKING:\n    from ssgi_cl.techniques.ao.ssao import SsaoParams", True),
        ("if TYPE_CHECKING:\n    from ssgi_cl.techniques.ao.ssao import TILE_ORDER", False),
        ("def inner():\n    from ssgi_cl.techniques.ao.slices import pattern", False),
        ("import ssgi_cl.techniques.ao.slices as slices", False),
        ("from ssgi_cl import techniques", False),
        ("from ssgi_cl.core.vpls import cut_evenly", False),
        ("from ssgi_cl.techniques.presets.choose import choose", False),
    ],
)
def test_the_check_tells_these_apart(text: str, allowed: bool) -> None:
    ((module, name, annotation),) = imports(text)
    assert is_allowed(module, name, annotation=annotation) is allowed


def test_what_is_allowed_holds_data() -> None:
    for module, names in ALLOWED.items():
        for name in names - {"Light"}:  # a union of the others
            found = getattr(importlib.import_module(module), name)
            assert dataclasses.is_dataclass(found) or issubclass(found, enum.Enum), name
