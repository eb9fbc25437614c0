"""Image-space global illumination on G-buffers: numpy in, numpy out, OpenCL in between.

The public names are listed in `__init__.pyi`; each is imported when it is first used, so that
importing the package takes a few milliseconds.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
