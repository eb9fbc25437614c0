"""Meshes to G-buffers and reflective shadow maps."""

from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.moved import moved
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.shadow_map import rsm
from ssgi_cl.rasterize.raster.view import gbuffer

__all__ = ["Material", "Rasterizer", "Scene", "gbuffer", "load_scene", "moved", "rsm"]
