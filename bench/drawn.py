"""What a case needs beyond the base G-buffer, drawn anew in every run so that its time counts."""

from __future__ import annotations

from collections.abc import Sequence

from ssgi_cl.core.scene import Scene
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, margin_of
from ssgi_cl.techniques.direct.light_data import PunctualLight, ShadowMap
from ssgi_cl.techniques.direct.light_maps import LightMaps
from ssgi_cl.tuning.context import Context


class DrawnView:
    """The camera's G-buffer with depth layers and overscan.

    With one layer and no overscan it is the base G-buffer, which every case gets for nothing, and
    nothing is drawn.

    Args:
        context: the scene and its view.
        layers: depth layers, >= 1.
        overscan: share of the image on every side, >= 0.
        attributes: layers whose attributes are drawn beside their depth.

    Attributes:
        gbuffer: the target, drawn once.
        counted: what a run draws, in words; "" for the base G-buffer.
    """

    def __init__(self, context: Context, layers: int, overscan: float, attributes: int = 1) -> None:
        self._context = context
        self._rasterizer: Rasterizer | None = None
        self.counted = ""
        if layers == 1 and overscan == 0.0:
            self.gbuffer = context.gbuffer
            return
        self._rasterizer = Rasterizer(
            context.runtime,
            context.size,
            layers=layers,
            margin=margin_of(context.camera, overscan),
            attributes=attributes,
        )
        parts = [f"{layers} layers"] if layers > 1 else []
        parts += [f"{100.0 * overscan:.0f} % overscan"] if overscan else []
        self.counted = f"G-buffer of {' and '.join(parts)} drawn"
        with context.runtime.frame():
            self.gbuffer = self.draw()
        context.runtime.finish()

    def draw(self) -> DeviceGBuffer:
        """Queue the passes; return the G-buffer."""
        if self._rasterizer is None:
            return self.gbuffer
        context = self._context
        scene = device_scene(context.view.scene, context.runtime)
        target = self._rasterizer.render(scene, context.camera)
        target.derive()
        return target


class DrawnMaps:
    """The maps of a view's lights.

    Args:
        context: the scene and its lights.
        size: texels along the side of a face.
        flux: whether reflected light is drawn beside depth.
        glossy: whether what glossy surfaces mirror is drawn too.
        scene: in place of the view's.
        lights: in place of the view's.

    Raises:
        ValueError: the view has no light.
    """

    counted = "light maps drawn"

    def __init__(
        self,
        context: Context,
        size: int,
        *,
        flux: bool = True,
        glossy: bool = False,
        scene: Scene | None = None,
        punctual_lights: Sequence[PunctualLight] | None = None,
    ) -> None:
        self._punctual_lights = tuple(context.punctual_lights if punctual_lights is None else punctual_lights)
        if not self._punctual_lights:
            raise ValueError(f"{context.view.name} has no light: expected at least one")
        self._scene = scene or context.view.scene
        self._maps = LightMaps(context.runtime, size, flux=flux, glossy=glossy)

    def shadows(self) -> list[ShadowMap | None]:
        """Queue the passes; return a shadow map for each light."""
        return self._maps.draw(self._scene, self._punctual_lights, keep=False)[0]

    def reflective(self) -> list[DeviceRsm]:
        """Queue the passes; return the reflective shadow map of all lights, [] if none reflects."""
        rsm = self._maps.draw(self._scene, self._punctual_lights, keep=False)[1]
        return [] if rsm is None else [rsm]
