"""Inputs of cases beyond the base G-buffer: layers, light maps, changed scenes and moving cameras.

What is drawn is drawn anew in every run, so that its time counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import count

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, margin_of
from ssgi_cl.techniques.direct.light_data import PunctualLight, ShadowMap
from ssgi_cl.techniques.direct.light_maps import LightMaps
from ssgi_cl.tuning.context import Context

SPECULAR, GLOSS = 0.5, 60.0
"""Reflectance and exponent of all surfaces of a polished scene."""


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


def faded(scene: Scene) -> Scene:
    """Return a scene half of each of whose surfaces is there."""
    materials = [replace(material, alpha=0.5, blends=True) for material in scene.materials]
    return replace(scene, materials=tuple(materials))


def polished(scene: Scene) -> Scene:
    """Return a scene all of whose materials mirror half of the light in a lobe."""
    materials = [replace(material, specular=(SPECULAR,) * 3, gloss=GLOSS) for material in scene.materials]
    return replace(scene, materials=tuple(materials))


@lru_cache(maxsize=1)
def with_holes(scene: Scene) -> Scene:
    """Return a scene into which the alpha of a texture, opaque all over, may cut holes."""
    cut = replace(scene.materials[0], texture=len(scene.textures), alpha_cutoff=0.5)
    opaque = np.full((1, 1, 4), 255, np.uint8)
    return replace(scene, materials=(cut, *scene.materials[1:]), textures=(*scene.textures, opaque))


STEP = 1e-3
"""Way of the camera between frames, in distances from eye to target."""
STEPS = 8
"""To the side, until the camera starts again."""


def moving_cameras(context: Context) -> Iterator[Camera]:
    """Return cameras of frames without end, each to the side of the one before."""
    view, (rows, columns) = context.view, context.size
    eye, target, up = (np.asarray(v, np.float64) for v in (view.eye, view.target, view.up))
    side = np.cross(target - eye, up)
    side /= np.linalg.norm(side) or 1.0
    for step in count():
        x, y, z = (eye + side * (STEP * (1 + step % STEPS) * np.linalg.norm(target - eye))).tolist()
        yield replace(view, eye=(x, y, z)).camera(columns, rows)
