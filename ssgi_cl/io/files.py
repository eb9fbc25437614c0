"""Readers and writers of files for `ssgi_cl.core`, as `ssgi_cl.core.formats.Files`."""

from ssgi_cl.io.environment import read_environment
from ssgi_cl.io.exr import read_gbuffer, write
from ssgi_cl.io.png import write as write_picture

__all__ = ["read_environment", "read_gbuffer", "write", "write_picture"]
