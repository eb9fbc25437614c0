"""Meshes to G-buffers and reflective shadow maps."""

from .load import load_scene
from .rasterizer import Rasterizer
from .scene import Material, Scene
from .shadow_map import rsm
from .view import gbuffer

__all__ = ["Material", "Rasterizer", "Scene", "gbuffer", "load_scene", "rsm"]
