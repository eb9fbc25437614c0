"""The rasteriser: G-buffers by their number of layers."""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import MOST_LAYERS, device_scene
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context


class GBuffers(Own):
    """A G-buffer with view normals; the setting is the number of depth layers."""

    SETTINGS = ("1", "4")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the rasteriser ready."""
        layers = count_of(setting, "a number of layers", 1, MOST_LAYERS)
        rasterizer = Rasterizer(context.runtime, context.size, layers=layers)
        scene = device_scene(context.view.scene, context.runtime)

        def run() -> None:
            rasterizer.render(scene, context.camera)
            rasterizer.target.derive()

        return Subject(run=run)


FAMILIES: Mapping[str, Family] = {"gbuffer": GBuffers()}
