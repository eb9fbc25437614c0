"""Build: runtime, size, parameters and techniques that the passes of a frame share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams, WholeFrameParams
from ssgi_cl.frame.passes.resources import AO, DIRECT, GLOSSY, INDIRECT, MATT, SKY_LIGHT, STEADY
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.techniques.direct.shade import Shade
from ssgi_cl.techniques.ssdo.ssdo import Ssdo


@dataclass(eq=False)
class Build:
    """What all passes of a frame are prepared for.

    Attributes:
        runtime: the device.
        size: (rows, columns) of the pictures.
        params: of the frame.
        layer: whether the passes light layers that are seen through.
        history: whether light becomes its mean over frames.
    """

    runtime: Runtime
    size: Size
    params: FrameParams
    layer: bool = False
    history: bool = False

    def for_layers(self) -> Build:
        """Return the build of the passes of layers, with techniques and so memory of its own."""
        return replace(self, layer=True, history=False)

    @cached_property
    def averaged(self) -> tuple[str, ...]:
        """The resources that become their means over frames; without a history none."""
        light = {"whole": (DIRECT, SKY_LIGHT, INDIRECT), "one bounce": (INDIRECT,), "ssdo": (DIRECT, INDIRECT)}
        occlusion = (AO,) if self.techniques[0] is not None else ()
        return (*occlusion, *light.get(self.params.kind, ())) if self.history else ()

    def steady(self, name: str) -> str:
        """Return the resource that stands for light or occlusion in the picture: its mean over frames if it has one."""
        return STEADY[name] if name in self.averaged else name

    @property
    def margin(self) -> Size:
        """(rows, columns) by which the G-buffer exceeds the picture on every side."""
        return self.params.margin(self.size)

    @property
    def keeps_direct_light(self) -> bool:
        """Whether direct light stays for other frames; else it lives until it is summed up, made for each sum."""
        return self.params.kind != "direct" and not self.layer

    @property
    def lit(self) -> str:
        """The resource that has all light of the surfaces of a G-buffer."""
        return GLOSSY if self.params.kind == "whole" else MATT

    def varied(self) -> Callable[[DeviceGBuffer], Region | None]:
        """Return what tells the pixels outside of which the picture is the same everywhere; None if it is nowhere."""
        shade, reach = self.shade, 2 if self.params.edge_places else 0

        def pixels(gbuffer: DeviceGBuffer) -> Region | None:
            seen = shade.seen(gbuffer)
            # A pixel that has none of a surface's centres may have a part of it.
            return None if seen is None else seen.grown(reach).inside(self.size)

        return pixels

    @cached_property
    def techniques(self) -> tuple[Any, Any]:
        """Parameters of ambient occlusion and of one bounce, or None; see `FrameParams.techniques`."""
        return self.params.techniques()

    @property
    def whole(self) -> WholeFrameParams:
        """Parameters of the whole picture, of a frame that is one."""
        assert self.params.whole is not None  # noqa: S101  asked for in whole frames alone
        return self.params.whole

    @cached_property
    def rasterizer(self) -> Rasterizer:
        """The rasteriser of the G-buffer."""
        whole, ssdo = (self.params.kind == kind for kind in ("whole", "ssdo"))
        return Rasterizer(
            self.runtime,
            self.size,
            layers=self.params.layers,
            margin=self.margin,
            attributes=self.params.layers if ssdo else 1,
            regions="region" in self.params.skips,
            world="until released" if ssdo else "until derived",
            matt=not whole,
            lobes=whole,
        )

    @cached_property
    def shade(self) -> Shade:
        """Direct light and the sum of all light."""
        return Shade(
            self.runtime,
            self.size,
            punctual_lights=self.layer or self.params.kind != "ssdo",
            smooth=self.params.edge_places > 0,
            kept=self.keeps_direct_light,
        )

    @cached_property
    def ssdo(self) -> Ssdo | None:
        """SSDO, in a frame that it lights: it reads attributes of all layers."""
        if self.params.kind != "ssdo":
            return None
        layers = self.params.layers
        return Ssdo(self.runtime, self.size, self.techniques[1], self.margin, layers, layers)
