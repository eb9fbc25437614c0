"""Lights of directional occlusion: with the shadows of their maps, or of what the camera sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.light_data import PunctualLights, ShadowMap
from ssgi_cl.techniques.direct.light_shadows import LightShadows
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams


def punctual_lights_of(runtime: Runtime, size: Size, params: SsdoParams) -> Callable[[], PunctualLights]:
    """Return the pass of direct light for images of a size."""
    if params.shadow_taps == 0:
        return lambda: PunctualLights(runtime, size, kept=False)
    return lambda: LightShadows(runtime, size, params.punctual_lights(), kept=False)


def set_lights(punctual_lights: PunctualLights, params: SsdoParams) -> None:
    """Bring the values of parameters to what `punctual_lights_of` made for such ones."""
    if isinstance(punctual_lights, LightShadows):
        punctual_lights.params = params.punctual_lights()


class LightBlur:
    """Edge-aware blur against the noise of shadows that are looked for in the image."""

    def __init__(self, runtime: Runtime, params: SsdoParams) -> None:
        self.runtime = runtime
        self.params = params
        self._blurs: dict[Size, Bilateral] = {}

    def run(
        self,
        gbuffer: DeviceGBuffer,
        punctual_lights: Plane,
        *,
        lights: Sequence[Light] = (),
        shadows: Sequence[ShadowMap | None] | None = None,
    ) -> Plane:
        """Queue the blur, unless every light has a map; return the plane that holds the result.

        Args:
            gbuffer: what is lit.
            punctual_lights: of the G-buffer's size, or of that with its margin.
            lights: whose light it is.
            shadows: one entry for each light (None: it casts no shadow).
        """
        maps = shadows if shadows is not None else [None] * len(lights)
        looked_for = any(
            not isinstance(light, Environment) and shadow is None for light, shadow in zip(lights, maps, strict=True)
        )
        if not looked_for or self.params.shadow_taps == 0:
            return punctual_lights
        size = punctual_lights.size
        if size not in self._blurs:
            blur = BilateralParams(radius=self.params.blur_radius, passes=self.params.blur_passes)
            self._blurs[size] = Bilateral(self.runtime, size, blur, 3, kept=False)
        source = gbuffer if size == gbuffer.size else gbuffer.layer(0)
        return self._blurs[size].run(source, punctual_lights)
