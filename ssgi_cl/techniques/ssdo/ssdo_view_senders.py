"""Senders that auxiliary cameras alone see, added to directional occlusion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.layer_shading import LitLayers
from ssgi_cl.techniques.direct.light_data import ShadowMap
from ssgi_cl.techniques.source import Source
from ssgi_cl.techniques.ssdo.ssdo_back import BackEnd, SenderVisibility
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask
from ssgi_cl.techniques.ssdo.ssdo_lights import punctual_lights_of, set_lights
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.techniques.ssdo.ssdo_point_views import SsdoPointViews
from ssgi_cl.techniques.ssdo.ssdo_points import SsdoPoints
from ssgi_cl.techniques.ssdo.ssdo_views import SsdoViews, ViewsParams

COARSER = 4
"""How many times fewer slices and taps find A of the surfaces that auxiliary cameras see."""


class ViewSenders:
    """Lights what auxiliary cameras see and adds it, one camera after the other.

    Attributes:
        views: how their depths are read, as `SsdoParams.view_taps` says.
    """

    def __init__(self, runtime: Runtime, params: SsdoParams) -> None:
        self.runtime = runtime
        self.params = params
        # Four taps in two directions, 16 in four, 64 in eight.
        self.views = ViewsParams(strata=max(ViewsParams().strata, math.isqrt(params.view_taps)), taps=params.view_taps)
        self._technique: SsdoViews | SsdoPointViews
        if params.method != "bitmask":
            self._technique = SsdoPointViews(runtime)
        else:
            self._technique = SsdoViews(runtime, params.bitmask(), self.views)
        self._senders: dict[Any, tuple[LitLayers, SenderVisibility]] = {}

    def set(self, params: SsdoParams) -> None:
        """Take the values of other parameters of the same shape."""
        if isinstance(self._technique, SsdoViews):
            self._technique.set(params.bitmask())
        for lit, visibility in self._senders.values():
            visibility.set(_coarse(params))
            set_lights(lit.lights, params)
        self.params = params

    def begin(self, gbuffer: DeviceGBuffer) -> None:
        """Forget all cameras but the first one, whose G-buffer is given."""
        if isinstance(self._technique, SsdoViews):
            self._technique.begin(gbuffer)

    def end(self) -> None:
        """Forget all cameras."""
        if isinstance(self._technique, SsdoViews):
            self._technique.end()

    def add(
        self,
        light: Plane,
        back: BackEnd,
        gbuffer: DeviceGBuffer,
        source: Source,
        view: DeviceGBuffer,
        lights: Sequence[Light],
        shadows: Sequence[ShadowMap | None] | None,
        *,
        sends: bool,
    ) -> None:
        """Queue the passes of one auxiliary camera.

        Args:
            light: what the back end gathered.
            back: that end, which kept what it found covered.
            gbuffer, source: what it was made from.
            view: what the camera sees.
            lights, shadows: see `LitLayers.run`.
            sends: whether surfaces send light, or hide it alone.
        """
        radiance: Any = None
        if sends:
            senders, visibility = self._for(view)
            ambient = any(isinstance(light, Environment) and np.any(light.radiance) for light in lights)
            open_ = visibility.run(view) if ambient else None
            points = isinstance(self._technique, SsdoPointViews)
            light_up = senders.records if points else senders.run
            radiance = light_up(view, lights, shadows=shadows, visibility=open_, step=visibility.step)
            senders.punctual_lights = None
        if isinstance(self._technique, SsdoPointViews):
            assert isinstance(back, SsdoPoints)  # noqa: S101  of the same method
            self._technique.add(light, back, gbuffer, view, radiance)
        else:
            assert isinstance(back, SsdoBitmask)  # noqa: S101  likewise
            assert back.masks is not None  # noqa: S101  they were asked for
            self._technique.add(light, back.masks, gbuffer, source, view, radiance)

    def _for(self, view: DeviceGBuffer) -> tuple[LitLayers, SenderVisibility]:
        """Return what lights a view of such a shape; views share it."""
        shape = (view.size, view.margin, view.layers, view.attributes)
        if shape not in self._senders:
            lit = LitLayers(
                self.runtime,
                view.whole,
                view.layers,
                view.attributes,
                punctual_lights_of(self.runtime, view.whole, self.params),
                emission=self.params.emission,
            )
            visibility = SenderVisibility(self.runtime, view.size, _coarse(self.params), view.margin, view.layers)
            self._senders[shape] = lit, visibility
        return self._senders[shape]


def _coarse(params: SsdoParams) -> SsdoParams:
    """Return what A of the surfaces that auxiliary cameras see is found with.

    Few sectors are left for a camera, and each of its surfaces counts in few of them.
    """
    return replace(
        params,
        slices=-(-params.slices // COARSER),
        taps=-(-params.taps // COARSER),
        samples=-(-params.samples // COARSER),
    )
