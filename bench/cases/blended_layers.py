"""Layers of surfaces that are seen through."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice

from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.rasterize.raster.blended_layers import MOST_LAYERS, BlendedLayers
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context


class Layers(Own):
    """The scene as if half of each surface were there; the setting is the number of layers."""

    SETTINGS = ("1", "4")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the rasteriser ready, and what nothing is seen through: nothing."""
        layers = count_of(setting, "a number of layers", 1, MOST_LAYERS)
        runtime, parts = context.runtime, scene_parts(faded(context.view.scene))
        assert parts.blended is not None  # noqa: S101  all of it is seen through
        solid, blended = device_scene(parts.solid, runtime), device_scene(parts.blended, runtime)
        opaque, technique = Rasterizer(runtime, context.size), BlendedLayers(runtime, context.size, matt=False)
        with runtime.frame():
            front = opaque.render(solid, context.camera)

        def run() -> None:
            with runtime.frame():
                for _ in islice(technique.drawn(blended, context.camera, front), layers):
                    pass

        return Subject(run=run)


def faded(scene: Scene) -> Scene:
    """Return a scene half of each of whose surfaces is there."""
    materials = [replace(material, alpha=0.5, blends=True) for material in scene.materials]
    return replace(scene, materials=tuple(materials))


FAMILIES: Mapping[str, Family] = {"blended-layers": Layers()}
