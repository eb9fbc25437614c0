"""An off-screen OpenGL context, made by pyrender's EGL platform."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

from ssgi_cl.core.errors import MissingExtraError


@contextmanager
def context() -> Iterator[Any]:
    """Make an off-screen OpenGL context current, give PyOpenGL's `GL`, and take it away again.

    The environment variable EGL_DEVICE_ID chooses the device, as in pyrender. A context that was
    current before is current again afterwards.

    Raises:
        MissingExtraError: pyrender, EGL or an OpenGL driver is missing.
    """
    try:
        if not os.environ.get("DISPLAY"):
            os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        _teach_pyopengl()
        # pyrender first: PyOpenGL 3.1.0 fails to import GL once it has imported EGL.
        egl = import_module("pyrender.platforms.egl")
        gl, native = import_module("OpenGL.GL"), import_module("OpenGL.EGL")
        before = (
            native.eglGetCurrentDisplay(),
            native.eglGetCurrentSurface(native.EGL_DRAW),
            native.eglGetCurrentSurface(native.EGL_READ),
            native.eglGetCurrentContext(),
        )
        device = egl.get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0")))
        platform = egl.EGLPlatform(1, 1, device=device)
        platform.init_context()
        platform.make_current()
    except Exception as error:  # whatever the bindings raise for what isn't there
        raise MissingExtraError(
            "the pyrender backend needs the extra 'opengl' (pip install 'ssgi-cl[opengl]') and an "
            "OpenGL driver with EGL (Debian: libegl1 libgl1-mesa-dri); it failed with "
            f"{type(error).__name__}: {error}"
        ) from error
    display, current = native.eglGetCurrentDisplay(), native.eglGetCurrentContext()
    try:
        yield gl
    finally:
        import_module("OpenGL.contextdata").cleanupContext()
        native.eglMakeCurrent(display, native.EGL_NO_SURFACE, native.EGL_NO_SURFACE, native.EGL_NO_CONTEXT)
        # Not the platform's own clean-up: it would end every other context of the display too.
        native.eglDestroyContext(display, current)
        if before[3]:
            with suppress(import_module("OpenGL.error").Error):  # its display may have ended
                native.eglMakeCurrent(*before)


def _teach_pyopengl() -> None:
    """Tell PyOpenGL 3.1.0, which pyrender insists on, how Python 3.12+ names `ctypes.byref`."""
    kind = type(ctypes.byref(ctypes.c_int()))
    known = import_module("OpenGL").plugins.FormatHandler
    if known.match(kind) is None:
        handler = "OpenGL.arrays.ctypesparameters.CtypesParameterHandler"
        known("ssgi_byref", handler, [f"{kind.__module__}.{kind.__name__}"])
