"""What all passes of a frame are prepared for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer


@dataclass(eq=False)
class Build:
    """What all passes of a frame are prepared for.

    Attributes:
        runtime: the device.
        size: (rows, columns) of the pictures.
        params: of the frame.
    """

    runtime: Runtime
    size: Size
    params: FrameParams

    @property
    def margin(self) -> Size:
        """(rows, columns) by which the G-buffer exceeds the picture on every side."""
        return self.params.margin(self.size)

    @cached_property
    def techniques(self) -> tuple[Any, Any]:
        """Parameters of ambient occlusion and of one bounce, of the shape that frames have; or None."""
        return self.params.techniques(1.0)

    @property
    def ssdo(self) -> bool:
        """Whether the frame is lit by SSDO, which reads attributes of all layers."""
        return self.params.kind == "ssdo"

    @cached_property
    def rasterizer(self) -> Rasterizer:
        """What draws the G-buffer."""
        whole = self.params.kind == "whole"
        return Rasterizer(
            self.runtime,
            self.size,
            layers=self.params.layers,
            margin=self.margin,
            attributes=self.params.layers if self.ssdo else 1,
            regions="region" in self.params.skips,
            world="until released" if self.ssdo else "until derived",
            matt=not whole,
            lobes=whole,
        )
