"""Readers and writers of files for `ssgi_cl.core`, as `ssgi_cl.core.formats.Files`."""

from ssgi_cl.io.environment import read_environment
from ssgi_cl.io.exr import read_camera, read_motion, read_with_kind, write
from ssgi_cl.io.png import write as write_picture
from ssgi_cl.io.previews import gbuffer_png

__all__ = ["gbuffer_png", "read_camera", "read_environment", "read_motion", "read_with_kind", "write", "write_picture"]
