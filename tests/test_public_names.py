"""What `import ssgi_cl` shows, what it costs, and the names that things had before."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
from types import ModuleType

import pytest

import ssgi_cl as gi
from ssgi_cl import former_names

SHOWN_MODULES = {"metrics", "rasterize", "truth"}


def test_the_package_shows_public_names_alone() -> None:
    assert dir(gi) == sorted(gi.__all__)
    modules = {name for name in dir(gi) if isinstance(getattr(gi, name), ModuleType)}
    assert modules == SHOWN_MODULES
    assert not [name for name in dir(gi) if name.startswith("_") and name != "__version__"]


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


@pytest.mark.parametrize("name", sorted(former_names.MODULES))
def test_a_module_is_found_under_its_former_name_for_one_release(name: str) -> None:
    sys.modules.pop(name, None)
    with pytest.warns(DeprecationWarning, match=f"{name} is now {former_names.MODULES[name]}"):
        found = importlib.import_module(name)
    present = importlib.import_module(former_names.MODULES[name])
    public = [each for each in vars(present) if not each.startswith("_")]
    assert all(getattr(found, each) is getattr(present, each) for each in public)


def test_former_names_of_functions_serve_and_warn() -> None:
    for former, name in former_names.ATTRIBUTES.items():
        vars(gi).pop(former, None)  # a module of this name may have been imported
        with pytest.warns(DeprecationWarning, match=f"ssgi_cl.{former} is now ssgi_cl.{name}"):
            assert getattr(gi, former) is getattr(gi, name)


def test_a_former_module_leaves_the_function_of_its_name_callable() -> None:
    sys.modules.pop("ssgi_cl.render", None)
    with pytest.warns(DeprecationWarning, match="ssgi_cl.render is now"):
        importlib.import_module("ssgi_cl.render")
    with pytest.raises(TypeError, match="camera is None"):
        gi.render(None, None, (), bounces=0)  # type: ignore[arg-type]
