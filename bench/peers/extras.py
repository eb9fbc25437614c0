"""Optional packages: their presence, and the extra that brings them."""

from __future__ import annotations

from importlib import import_module

PACKAGES = {"vtkmodules": "vtk"}
"""Module -> what it is installed as, where the names differ."""


def missing_package(module: str, extra: str) -> str:
    """Return why `module` can't be imported, with the extra that brings it; "" if it can."""
    try:
        import_module(module)
    except Exception as error:  # a damaged installation raises whatever it likes
        package = module.partition(".")[0]
        reason = " ".join(str(error).split())
        why = "is not installed" if _absent(error, package) else f"does not load ({reason})"
        return f"{PACKAGES.get(package, package)} {why}: pip install 'ssgi-cl[{extra}]'"
    return ""


def _absent(error: Exception, package: str) -> bool:
    return isinstance(error, ModuleNotFoundError) and (error.name or "").startswith(package)
