"""Layer shading: radiance of the surfaces of every layer of a G-buffer under the lights of a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import TypedDict, Unpack

import numpy as np

from ssgi_cl.core.lights import Light
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.device.transient import ImageParts, TransientPlane
from ssgi_cl.techniques.direct.ambient import Ambient
from ssgi_cl.techniques.direct.light_data import PunctualLights, ShadowMap
from ssgi_cl.techniques.source import camera_of, margin_values

LIT = Struct(
    "LitParams",
    (
        *floats(*ROTATION, "facing"),
        *ints("layer", "image", "margin_columns", "margin_rows", "open_columns", "open_rows"),
    ),
)


class Shading(TypedDict, total=False):
    """Keyword arguments of `LitLayers.run`."""

    shadows: Sequence[ShadowMap | None] | None
    visibility: Plane | None
    step: int


class SenderRecords:
    """Radiance and normals of surfaces, side by side for each pixel.

    Args:
        runtime: the device.
        whole: (rows, columns) of the G-buffers, with their margin.
        layers: of them that send.

    Attributes:
        array: int32, as kernels/direct/records.clh has it; undefined where nothing is.
    """

    def __init__(self, runtime: Runtime, whole: Size, layers: int) -> None:
        self.runtime = runtime
        self.layers = layers
        self.array: DeviceArray = runtime.empty(4 * layers * whole[0] * -(-whole[1] // 16) * 16, np.int32)

    def pack(self, gbuffer: DeviceGBuffer, radiance: Plane) -> None:
        """Queue the pass that packs normals and radiance, 3 images for each layer."""
        kernel = self.runtime.kernel("direct/layer_shading.cl", _macros(emission=True, records=True), (LIT,))
        for layer in range(self.layers):
            values = {**dict.fromkeys(LIT.dtype.names or (), 0), "facing": 1.0}
            kernel.run(
                gbuffer.whole,
                # Without light, the pass writes emission.
                depth=gbuffer.depth,
                normal=gbuffer.normal,
                albedo=radiance,
                emission=radiance,
                records=self.array,
                params=LIT.pack({**values, "layer": layer, "image": layer}),
            )


class LitLayers:
    """Radiance of the surfaces of every layer, prepared for images of one size.

    Args:
        runtime: the device.
        whole: (rows, columns) of the G-buffers, with their margin.
        layers: depth layers of the G-buffers.
        attributes: layers of them that have normals, albedo and emission: 1, or all by default.
            The rest is dark.
        punctual_lights: makes the pass of direct light for images of size `whole`; by default
            `PunctualLights` that keep nothing.
        emission: whether emission is added.
        backs: whether the sides that the camera doesn't see are lit too. Closed surfaces turn the
            outer side of every other layer away from the camera.

    Attributes:
        lights: the pass of punctual lights.
        punctual_lights: 3 images of `whole`: irradiance by lights on the front layer, W/m^2, or
            None if no light shone on the last frame. Setting it to None frees its memory.
    """

    def __init__(
        self,
        runtime: Runtime,
        whole: Size,
        layers: int = 1,
        attributes: int | None = None,
        punctual_lights: Callable[[], PunctualLights] | None = None,
        *,
        emission: bool = True,
        backs: bool = False,
    ) -> None:
        self.runtime = runtime
        self.whole = whole
        self.layers = layers
        self.attributes = layers if attributes is None else attributes
        self.punctual_lights: Plane | None = None
        self._emission = emission
        self._sides = (False, True) if backs else (False,)
        self.lights = punctual_lights() if punctual_lights else PunctualLights(runtime, whole, kept=False)
        self._ambient = Ambient(runtime)
        self._records: SenderRecords | None = None

    def run(
        self,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        *,
        shadows: Sequence[ShadowMap | None] | None = None,
        visibility: Plane | None = None,
        step: int = 1,
    ) -> Plane | None:
        """Queue the passes.

        Args:
            gbuffer: whose layers are lit as far as they have normals, albedo and emission.
            lights: any number of lights.
            shadows: one entry for each light (None: it casts no shadow).
            visibility: its first image is A of every `step`-th pixel of the image; dims the light
                of environments on all layers and on the margin, for which the nearest pixel stands.
            step: 1, 2 or 4.

        Returns:
            3 images for each layer (number 3 layer + channel), W m^-2 sr^-1, 0 where nothing is,
            with `backs` as many more behind them; None if all is dark.
        """
        options: Shading = {"shadows": shadows, "visibility": visibility, "step": step}
        if not self._start(gbuffer, lights, options):
            return None
        radiance = self.runtime.transient.plane(3 * self.layers * len(self._sides), self.whole)
        if self.attributes < self.layers and isinstance(radiance, TransientPlane):
            radiance.clear()
        self._run(gbuffer, lights, options, radiance)
        return radiance

    def images(self, gbuffer: DeviceGBuffer, lights: Sequence[Light], **options: Unpack[Shading]) -> ImageParts | None:
        """Return the images of `run` in parts of 3, whose passes are queued as they are asked for."""
        if not self._start(gbuffer, lights, options):
            return None
        return ImageParts(
            3 * self.layers * len(self._sides),
            self.whole,
            self.attributes == self.layers,
            self._parts(self.punctual_lights, gbuffer, lights, options),
        )

    def records(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], **options: Unpack[Shading]
    ) -> SenderRecords | None:
        """Queue the passes of `run` for the sides that the camera sees; return their results as records."""
        if self._records is None:
            self._records = SenderRecords(self.runtime, self.whole, self.attributes)
        if not self._start(gbuffer, lights, options):
            return None
        self._run(gbuffer, lights, options, self._records)
        return self._records

    def _start(self, gbuffer: DeviceGBuffer, lights: Sequence[Light], options: Shading) -> bool:
        """Queue the light on the front layer; return whether any surface is lit."""
        given = (gbuffer.whole, gbuffer.layers, gbuffer.attributes)
        if given != (self.whole, self.layers, self.attributes):
            raise ValueError(
                "the G-buffer's size with margin, layers and layers with attributes are "
                f"{given}: expected {(self.whole, self.layers, self.attributes)}"
            )
        self._ambient.set(lights)
        self.punctual_lights = None
        self.punctual_lights = self.lights.run(gbuffer.layer(0), lights, shadows=options.get("shadows"))
        lit = self.punctual_lights is not None or self._ambient.shines or self._emits(gbuffer)
        if not lit:
            self.runtime.skip("lit layers", "no light and no emission")
        return lit

    def _parts(
        self, punctual_lights: Plane | None, gbuffer: DeviceGBuffer, lights: Sequence[Light], options: Shading
    ) -> Iterator[tuple[int, Plane]]:
        """Yield the parts of `images`, given `self.punctual_lights` as it was at the call."""
        for back, number in product(self._sides, range(self.attributes)):
            layer = gbuffer.layer(number, back=back)
            if back or number:
                punctual_lights = None  # its memory is the next one's
                punctual_lights = self.lights.run(layer, lights, shadows=options.get("shadows"))
            part = self.runtime.transient.plane(3, self.whole)
            region = part.within(layer.region) if isinstance(part, TransientPlane) else None
            self._light(layer, punctual_lights, options, gbuffer.margin, part, 0, region)
            yield 3 * (number + (self.layers if back else 0)), part
            del part

    def _run(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], options: Shading, to: Plane | SenderRecords
    ) -> None:
        records = isinstance(to, SenderRecords)
        punctual_lights, region = self.punctual_lights, gbuffer.region
        if isinstance(to, TransientPlane):
            region = to.within(region)
        for back, number in product((False,) if records else self._sides, range(self.attributes)):
            layer = gbuffer.layer(number, back=back)
            if back or number:
                punctual_lights = None
                punctual_lights = self.lights.run(layer, lights, shadows=options.get("shadows"))
            image = number + (self.layers if back else 0)
            self._light(layer, punctual_lights, options, gbuffer.margin, to, image if records else 3 * image, region)

    def _emits(self, gbuffer: DeviceGBuffer) -> bool:
        return gbuffer.emits and self._emission

    def _light(
        self,
        layer: DeviceGBuffer,
        punctual_lights: Plane | None,
        options: Shading,
        margin: Size,
        to: Plane | SenderRecords,
        image: int,
        region: Region | None,
    ) -> None:
        visibility = options.get("visibility")
        kernel = self.runtime.kernel(
            "direct/layer_shading.cl",
            _macros(
                punctual_lights=punctual_lights is not None,
                ambient=self._ambient.shines,
                visibility=visibility is not None,
                emission=self._emits(layer),
                records=isinstance(to, SenderRecords),
                step=options.get("step", 1),
            )
            | self._ambient.macros,
            (LIT,),
        )
        rows, columns = visibility.size if visibility is not None else (1, 1)
        values = {
            **rotation_values(camera_of(layer).view[:3, :3].T),
            "facing": layer.facing,
            "layer": layer.front,
            "image": image,
            **margin_values(margin),
            "open_columns": columns,
            "open_rows": rows,
        }
        kernel.run(
            self.whole,
            region=region,
            depth=layer.depth,
            normal=layer.normal,
            albedo=layer.albedo,
            emission=layer.emission if self._emits(layer) else None,
            punctual_lights=punctual_lights,
            visibility=visibility,
            ambient=self._ambient.irradiance if self._ambient.shines else None,
            **({"records": to.array} if isinstance(to, SenderRecords) else {"radiance": to}),
            params=LIT.pack(values),
        )


def _macros(
    *,
    punctual_lights: bool = False,
    ambient: bool = False,
    visibility: bool = False,
    emission: bool = False,
    records: bool = False,
    step: int = 1,
) -> dict[str, int]:
    return {
        "LAYERS_LIGHTS": int(punctual_lights),
        "LAYERS_AMBIENT": int(ambient),
        "LAYERS_VISIBILITY": int(visibility),
        "LAYERS_EMISSION": int(emission),
        "LAYERS_RECORDS": int(records),
        "LAYERS_STEP": step,
        "AMBIENT_SIZE": 0,
    }
