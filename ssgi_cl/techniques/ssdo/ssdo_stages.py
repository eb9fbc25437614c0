"""Stages of SSDO around its back end: light of the senders, auxiliary cameras, blur and upsampling."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.direct.layer_shading import LitLayers
from ssgi_cl.techniques.direct.light_data import PunctualLights, ShadowMap
from ssgi_cl.techniques.direct.light_shadows import LightShadows
from ssgi_cl.techniques.filters.bilateral import Bilateral
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleParams, coarse_size
from ssgi_cl.techniques.source import Source
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.techniques.ssdo.ssdo_points import SsdoPoints
from ssgi_cl.techniques.ssdo.ssdo_views import SsdoViews, add_point_view

BackEnd = SsdoBitmask | SsdoPoints
Shadows = Sequence[ShadowMap | None] | None
"""One entry for each light (None: it casts no shadow)."""
Shape = tuple[Size, Size, int, int]
"""Size, margin, layers and layers with attributes of a G-buffer."""

SENDER_STEP = RESOLUTIONS["quarter"]
"""Pixels of the G-buffer from one value of the senders' visibility to the next."""
COARSER = 4
"""Factor by which fewer slices, taps and directions find the visibility of auxiliary cameras' senders."""


def shape_of(gbuffer: DeviceGBuffer) -> Shape:
    """Return what techniques are prepared for."""
    return gbuffer.size, gbuffer.margin, gbuffer.layers, gbuffer.attributes


def punctual_lights_of(runtime: Runtime, size: Size, params: SsdoParams) -> PunctualLights:
    """Return the pass of direct light for images of a size."""
    if params.shadow_taps == 0:
        return PunctualLights(runtime, size, kept=False)
    return LightShadows(runtime, size, params.punctual_lights(), kept=False)


def set_lights(punctual_lights: PunctualLights, params: SsdoParams) -> None:
    """Set the values of other parameters of the same shape in the pass of direct light."""
    if isinstance(punctual_lights, LightShadows):
        punctual_lights.params = params.punctual_lights()


class Senders:
    """Light that surfaces send, prepared for G-buffers of one shape.

    Surfaces send the part of the sky's light that reaches them. Without this visibility, closed
    rooms send several times too much. It has a quarter of the size: a receiver takes the mean over
    many senders, so neither size nor noise shows. With directions (all methods but "bitmask"), it
    is that of the front layer.

    Args:
        runtime: the device.
        params: of directional occlusion.
        shape: see `shape_of`.
        auxiliary: whether an auxiliary camera sees the surfaces. Few sectors are left for a camera,
            and each of its surfaces counts in few of them, so fewer taps find their visibility.
    """

    def __init__(self, runtime: Runtime, params: SsdoParams, shape: Shape, *, auxiliary: bool = False) -> None:
        self.runtime = runtime
        self.params = params
        self.auxiliary = auxiliary
        self._shape = size, margin, layers, attributes = shape
        whole = (size[0] + 2 * margin[0], size[1] + 2 * margin[1])
        self._lit = LitLayers(
            runtime,
            whole,
            layers,
            attributes,
            lambda: punctual_lights_of(runtime, whole, params),
            emission=params.emission,
            # Directions meet the side of a surface that the camera sees, and no other.
            backs=params.method == "bitmask" and attributes > 1 and not auxiliary,
        )
        self._back: BackEnd | None = None
        self._reduced: ReducedGBuffer | None = None

    def set(self, params: SsdoParams) -> None:
        """Take the values of other parameters of the same shape."""
        self.params = params
        set_lights(self._lit.lights, params)
        if self._back is not None:
            back: Any = self._back  # of the same method
            back.params = self._back_params()

    def radiance(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], shadows: Shadows, *, ambient: bool
    ) -> tuple[Any, Plane | None]:
        """Queue the passes.

        Args:
            gbuffer: of the shape that this was prepared for.
            lights, shadows: see `LitLayers.run`.
            ambient: whether the sky shines.

        Returns:
            The radiance for the back end, None if all is dark, and the irradiance by punctual
            lights, 3 images with margin, None if none shines.
        """
        if self.params.method != "bitmask":
            light: Any = self._lit.records
        else:
            light = self._lit.run if self.auxiliary else self._lit.images
        visibility = self.visibility(gbuffer) if ambient else None
        radiance = light(gbuffer, lights, shadows=shadows, visibility=visibility, step=SENDER_STEP)
        punctual_lights, self._lit.punctual_lights = self._lit.punctual_lights, None
        return radiance, punctual_lights

    def visibility(self, gbuffer: DeviceGBuffer) -> Plane:
        """Queue the passes; return a plane whose first image is A of every `SENDER_STEP`-th pixel."""
        if self._back is None or self._reduced is None:
            (size, margin, layers, _), own = self._shape, self._back_params()
            if isinstance(own, SsdoBitmaskParams):
                self._back = SsdoBitmask(self.runtime, size, own, margin, layers)
            else:
                self._back = SsdoPoints(self.runtime, coarse_size(size, SENDER_STEP), 1, own, reduced=True)
            self._reduced = ReducedGBuffer(gbuffer, SENDER_STEP)
        self._reduced.update(gbuffer)
        return self._back.run(gbuffer, self._reduced)

    def _back_params(self) -> Any:
        low = replace(self.params, resolution="quarter", bent_normals=False)
        if self.auxiliary:
            fewer = {name: -(-getattr(low, name) // COARSER) for name in ("slices", "taps", "samples")}
            low = replace(low, **fewer)
        return low.back_end(*self._shape[:2])


class ViewSenders:
    """Light and occlusion by surfaces that auxiliary cameras see, added one camera after the other."""

    def __init__(self, runtime: Runtime, params: SsdoParams) -> None:
        self.runtime = runtime
        self.params = params
        self._views = SsdoViews(runtime, params.bitmask(), params.views()) if params.method == "bitmask" else None
        self._senders: dict[Shape, Senders] = {}

    def set(self, params: SsdoParams) -> None:
        """Take the values of other parameters of the same shape."""
        self.params = params
        if self._views is not None:
            self._views.set(params.bitmask())
        for senders in self._senders.values():
            senders.set(params)

    def add(
        self,
        light: Plane,
        back: BackEnd,
        gbuffer: DeviceGBuffer,
        source: Source,
        views: Iterable[DeviceGBuffer],
        lights: Sequence[Light],
        shadows: Shadows,
        *,
        ambient: bool,
        sends: bool,
    ) -> None:
        """Queue the passes of all auxiliary cameras.

        Args:
            light: the result of the back end.
            back: that end, made with what auxiliary cameras need.
            gbuffer, source: of both.
            views: G-buffers of auxiliary cameras. Each is done with before the next is asked for.
            lights, shadows: see `LitLayers.run`.
            ambient: whether the sky shines.
            sends: whether surfaces send light, or only occlude.
        """
        if self._views is not None:
            self._views.unseen.begin(gbuffer)
        try:
            for view in views:
                radiance: Any = None
                if sends:
                    radiance = self._for(view).radiance(view, lights, shadows, ambient=ambient)[0]
                if isinstance(back, SsdoPoints):
                    add_point_view(back, light, gbuffer, view, radiance)
                else:
                    assert self._views is not None  # noqa: S101  of the same method
                    assert back.masks is not None  # noqa: S101  they were asked for
                    self._views.add(light, back.masks, gbuffer, source, view, radiance)
        finally:
            if self._views is not None:
                self._views.unseen.end()

    def _for(self, view: DeviceGBuffer) -> Senders:
        """Return the senders of views of such a shape."""
        shape = shape_of(view)
        if shape not in self._senders:
            self._senders[shape] = Senders(self.runtime, self.params, shape, auxiliary=True)
        return self._senders[shape]


class Finish:
    """Blur and upsampling of results, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the results.
        params: of directional occlusion.
    """

    def __init__(self, runtime: Runtime, size: Size, params: SsdoParams) -> None:
        self.runtime = runtime
        self.size = size
        self.params = params
        self._step = RESOLUTIONS[params.resolution]
        self._late = self._step > 1 and params.blur_resolution == "full"
        self._reduced: ReducedGBuffer | None = None
        self._blurs: dict[tuple[Size, int], Bilateral] = {}
        self._upsamples: dict[int, Upsample] = {}

    def source(self, gbuffer: DeviceGBuffer) -> Source:
        """Return the G-buffer, or it reduced to the resolution of the back end."""
        if self._step == 1:
            return gbuffer
        if self._reduced is None:
            self._reduced = ReducedGBuffer(gbuffer, self._step)
        self._reduced.update(gbuffer)
        return self._reduced

    def run(self, gbuffer: DeviceGBuffer, plane: Plane, *, source: Source | None = None) -> Plane:
        """Queue the blur and the upsampling of all images at once; return the plane at full size.

        Args:
            gbuffer: at full size.
            plane: the result of the back end.
            source: whose pixels those of `plane` are, see `source`; `gbuffer` by default.
        """
        source = gbuffer if source is None else source
        count = plane.count
        if not self._late:
            plane = self._blur(plane.size, count).run(source, plane, region=gbuffer.seen_every(self._step))
        if source is not gbuffer:
            if count not in self._upsamples:
                self._upsamples[count] = Upsample(
                    self.runtime, self.size, UpsampleParams(step=self._step), count, kept=False
                )
            plane = self._upsamples[count].run(gbuffer, plane, reduced=source)
        if self._late:
            plane = self._blur(self.size, count).run(gbuffer, plane, region=gbuffer.seen)
        return plane

    def lights(
        self, gbuffer: DeviceGBuffer, punctual_lights: Plane, lights: Sequence[Light], shadows: Shadows
    ) -> Plane:
        """Queue the blur against the noise of screen-space shadows; return the plane with the result.

        The plane stays as it is if every light has a shadow map.

        Args:
            gbuffer: the receivers.
            punctual_lights: irradiance of the G-buffer's size, or of that with its margin.
            lights: whose light it is.
            shadows: one entry for each light (None: it casts no shadow).
        """
        maps = shadows if shadows is not None else [None] * len(lights)
        marched = any(
            not isinstance(light, Environment) and shadow is None for light, shadow in zip(lights, maps, strict=True)
        )
        if not marched or self.params.shadow_taps == 0:
            return punctual_lights
        size = punctual_lights.size
        return self._blur(size, 3).run(gbuffer if size == gbuffer.size else gbuffer.layer(0), punctual_lights)

    def _blur(self, size: Size, count: int) -> Bilateral:
        key = size, count
        if key not in self._blurs:
            self._blurs[key] = Bilateral(self.runtime, size, self.params.blur, count, kept=False)
        return self._blurs[key]
