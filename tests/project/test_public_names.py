"""Public names and cost of `import ssgi_cl`."""

from __future__ import annotations

import inspect
import subprocess
import sys
from types import ModuleType

import pytest

import ssgi_cl as gi

SHOWN_MODULES = {"metrics", "rasterize", "truth"}


def test_the_package_shows_public_names_alone() -> None:
    assert dir(gi) == sorted(gi.__all__)
    modules = {name for name in dir(gi) if isinstance(getattr(gi, name), ModuleType)}
    assert modules == SHOWN_MODULES
    assert not [name for name in dir(gi) if name.startswith("_") and name != "__version__"]


@pytest.mark.parametrize("module", [gi.metrics, gi.truth])
def test_modules_of_the_package_show_public_names_alone(module: ModuleType) -> None:
    assert dir(module) == sorted(module.__all__)
    assert not [name for name in dir(module) if isinstance(getattr(module, name), ModuleType)]


@pytest.mark.parametrize("module", sorted(SHOWN_MODULES))
def test_modules_of_the_package_are_there_before_any_other_import(module: str) -> None:
    done = subprocess.run([sys.executable, "-c", f"import ssgi_cl; ssgi_cl.{module}"], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def test_every_public_name_is_what_its_module_defines() -> None:
    for name in set(dir(gi)) - SHOWN_MODULES:
        value = getattr(gi, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert value.__name__ == name
            assert value.__module__.startswith("ssgi_cl.")


def test_importing_the_package_imports_no_libraries() -> None:
    """numpy, OpenCL and the command line's libraries take most of a second."""
    text = (
        "import sys, ssgi_cl; heavy = {'numpy', 'pyopencl', 'OpenEXR', 'trimesh', 'click', 'rich'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="gtaoo"):
        _ = gi.gtaoo
