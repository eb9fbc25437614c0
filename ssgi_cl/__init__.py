"""Image-space global illumination on G-buffers: numpy in, numpy out, OpenCL in between.

The public names are listed in `__init__.pyi`; each is imported when it is first used, so that
importing the package takes a few milliseconds.
"""

from importlib import import_module

import lazy_loader

from ssgi_cl.core import formats

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# The libraries of file formats take time to import: they are when a file is first read or written.
formats.provide(lambda: import_module("ssgi_cl.io.files"))
