"""Meshes to G-buffers and reflective shadow maps."""

from ssgi_cl.core.scene import Material, Scene

from .load import load_scene
from .rasterizer import Rasterizer
from .shadow_map import rsm
from .view import gbuffer

__all__ = ["Material", "Rasterizer", "Scene", "gbuffer", "load_scene", "rsm"]
