"""Image-space global illumination on G-buffers: numpy in, numpy out, OpenCL in between.

The public names are listed in `__init__.pyi`; each is imported when it is first used, so that
importing the package takes a few milliseconds.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

import lazy_loader

from ssgi_cl import former_names

_import, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
former_names.install()


def __getattr__(name: str) -> Any:
    new = former_names.ATTRIBUTES.get(name)
    if new is not None:
        warnings.warn(f"ssgi_cl.{name} is now ssgi_cl.{new}", DeprecationWarning, stacklevel=2)
    elif f"ssgi_cl.{name}" in former_names.MODULES and name not in __all__:
        return import_module(f"ssgi_cl.{name}")
    return _import(new or name)
