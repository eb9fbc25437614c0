"""What the lamps of a scene see: shadow maps, and the surfaces that reflect their light."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ssgi_cl.device_rsm import DeviceRsm
from ssgi_cl.lights import Environment, Light
from ssgi_cl.memory import Plane
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.shadow_map import RsmRenderer, light_cameras
from ssgi_cl.rasterize.view import device_scene
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques.shade import Lamp, ShadowMap, kind_name, power


class LightMaps:
    """Draws the maps of a frame's lamps, each face once for shadows and for reflected light.

    The faces of all lamps make one reflective shadow map, so that one bounce costs the same
    however many lamps there are, and what reflects more is looked at more.

    Args:
        runtime: the device.
        size: texels along the side of a face.
        flux: whether reflected light is asked for.
    """

    def __init__(self, runtime: Runtime, size: int, *, flux: bool) -> None:
        self.runtime = runtime
        self.size = size
        self._flux = flux
        self._renderer = RsmRenderer(runtime, size, shaded=flux)
        self._depths: dict[int, Plane] = {}
        self._rsm: DeviceRsm | None = None

    def draw(
        self, scene: Scene, lights: Sequence[Light]
    ) -> tuple[list[ShadowMap | None], DeviceRsm | None]:
        """Queue the passes.

        Returns:
            A shadow map for each light (None: it is not a lamp, or it emits nothing), and what
            reflects their light: None if nothing does, or if it was not asked for.
        """
        lamps = {
            index: light for index, light in enumerate(lights)
            if not isinstance(light, Environment) and power(light).any()
        }
        shadows: list[ShadowMap | None] = [None] * len(lights)
        for index, light in lamps.items():
            cameras = light_cameras(light, scene.bounds, self.size)
            shadows[index] = ShadowMap(self._depth(index, len(cameras)), cameras)
        rsm = self._begin(lamps, shadows) if self._flux and lamps else None
        first, lit = 0, False
        for index, light in lamps.items():
            shadow = shadows[index]
            assert shadow is not None  # noqa: S101  just made
            reached = self._draw(scene, light, shadow, rsm, first)
            first += len(shadow.cameras)
            lit |= reached
            if rsm is not None and not reached:
                self.runtime.skip(f"bounce {kind_name(light)}", "it lights nothing that reflects")
        return shadows, rsm if lit else None

    def _draw(
        self, scene: Scene, light: Lamp, shadow: ShadowMap, rsm: DeviceRsm | None, first: int
    ) -> bool:
        """Queue the passes of one lamp; return whether it lights anything, if that is asked for."""
        kept, target = device_scene(scene, self.runtime), self._renderer.target
        lit = False
        for face, camera in enumerate(shadow.cameras):
            flux = self._renderer.render(kept, light, camera, flux=rsm is not None)
            shadow.depth.copy_image(face, target.depth)
            if rsm is not None:
                rsm.write_face(first + face, target.depth, target.normal_world, flux)
                lit = lit or bool(flux.download().any())
        return lit

    def _depth(self, index: int, faces: int) -> Plane:
        """Return the plane of a lamp's depth, the same as last time if it fits."""
        plane = self._depths.get(index)
        if plane is None or plane.count != faces:
            plane = self.runtime.plane(faces, (self.size, self.size), math.inf)
            self._depths[index] = plane
        return plane

    def _begin(
        self, lamps: dict[int, Lamp], shadows: Sequence[ShadowMap | None]
    ) -> DeviceRsm:
        """Return the reflective shadow map with room for all faces, the same if it fits."""
        cameras = tuple(c for shadow in shadows if shadow is not None for c in shadow.cameras)
        if self._rsm is None or self._rsm.faces != len(cameras):
            self._rsm = DeviceRsm(self.runtime, (self.size, self.size), len(cameras))
        self._rsm.begin(next(iter(lamps.values())), cameras)
        return self._rsm
