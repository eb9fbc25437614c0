"""Shadow maps and reflective shadow maps of the lights of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.shadow_map import RsmRenderer, every_nth, light_cameras
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.direct.kept_crops import KeptCrops
from ssgi_cl.techniques.direct.light_data import PunctualLight, ShadowMap, kind_name, power
from ssgi_cl.techniques.direct.seen_depths import Seen
from ssgi_cl.techniques.direct.shadow_blocks import ShadowBlocks
from ssgi_cl.techniques.direct.shadow_fit import Crop, most_crops, whole


@dataclass(frozen=True, eq=False)
class _Memory:
    """Device memory of the shadow map of one light.

    Attributes:
        depth: its images.
        blocks: those of `ShadowBlocks`.
        table: of its crops.
        found: images whose blocks are up to date.
    """

    depth: Plane
    blocks: Plane
    table: DeviceArray
    found: set[int] = field(default_factory=set)


class LightMaps:
    """Maps of a frame's lights: each face is drawn once for shadows and for reflected light.

    The faces of all lights make one reflective shadow map, so that one bounce costs the same
    however many lights there are, and surfaces that reflect more are sampled more. A light's maps
    are kept as long as it and the scene stay the same, and each image of a shadow map as long as
    the visible surfaces need that part of the light's view; once all are kept, the bounds of their
    blocks are computed too, so that shading reads fewer texels.

    Args:
        runtime: the device.
        size: texels along the side of a face.
        rsm_size: most texels along the side of a face that reflect light, every n-th.
        flux: whether reflected light is asked for.
        glossy: whether the mirrored light of glossy surfaces is separate; else it is a part of
            the reflected light.
    """

    def __init__(self, runtime: Runtime, size: int, *, flux: bool, glossy: bool = False, rsm_size: int = 8192) -> None:
        self.runtime = runtime
        self.size = size
        self._flux = flux
        self._glossy = glossy
        self._step = -(-size // rsm_size) if flux else 1
        self._renderer = RsmRenderer(runtime, size, step=self._step, flux=flux, matt=not glossy)
        self._blocks = ShadowBlocks(runtime, size)
        self._memory: dict[int, _Memory] = {}
        self._rsm: DeviceRsm | None = None
        self._lit: NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._scene: object = None  # its key
        self._punctual_lights: dict[int, PunctualLight] = {}
        self._shadows: dict[int, ShadowMap] = {}

    def draw(
        self,
        scene: Scene,
        lights: Sequence[Light],
        *,
        keep: bool = True,
        seen: Seen | None = None,
        crops_before: KeptCrops | None = None,
    ) -> tuple[list[ShadowMap | None], DeviceRsm | None]:
        """Queue the passes.

        Without `keep` all are drawn. Shadow maps are fitted to what is `seen`; without it they show
        all that a light sees. In a sequence their crops stay, which `crops_before` knows.
        Which lights reflect anything is read back, 4 bytes a face, when a map was drawn.

        Returns:
            A shadow map for each light (None for an environment, and where it emits nothing), and what
            reflects their light: None if nothing does, or if it was not asked for.
        """
        punctual_lights = {
            index: light
            for index, light in enumerate(lights)
            if not isinstance(light, Environment) and power(light).any()
        }
        shadows: list[ShadowMap | None] = [None] * len(lights)
        kept = self._kept(scene, punctual_lights) if keep else set()
        before = self._shadows
        # Should anything fail, nothing is taken for drawn.
        self._scene, self._punctual_lights, self._shadows = None, {}, {}
        cameras = {
            index: before[index].cameras if index in kept else light_cameras(light, scene.bounds, self.size)
            for index, light in punctual_lights.items()
        }
        images = {
            index: len(faces) if seen is None else most_crops(len(faces), len(punctual_lights))
            for index, faces in cameras.items()
        }
        fit = (crops_before or KeptCrops()).fitted
        crops = {
            index: whole(len(faces)) if seen is None else fit(index, faces, seen, images[index])
            for index, faces in cameras.items()
        }
        self._require(scene, images, sum(map(len, cameras.values())), len(lights))
        held = self._rsm_of(scene, punctual_lights, cameras, kept) if self._flux and punctual_lights else None
        first = 0
        for index, light in punctual_lights.items():
            old = before.get(index) if index in kept else None
            memory = self._memory_of(index, images[index])
            shadow, missing = self._shadow(memory, cameras[index], crops[index], old, is_fitted=seen is not None)
            reflects = held if index not in kept else None
            if not missing and reflects is None:
                self.runtime.skip(f"map {kind_name(light)}", "neither it nor the scene changed")
                shadow = self._with_blocks(memory, shadow)
            else:
                with self.runtime.part(f"map {kind_name(light)}"):
                    self._draw(scene, light, shadow, missing, reflects, first)
                self._memory[index].found.difference_update(shadow.images[number] for number in missing)
            shadows[index] = self._shadows[index] = shadow
            first += len(shadow.cameras)
        if held is not None and len(kept) < len(punctual_lights):
            self._lit = held.lit()
        self._scene, self._punctual_lights = scene.key, punctual_lights
        return shadows, held if held is not None and self._reflects(punctual_lights, shadows) else None

    def _shadow(
        self,
        memory: _Memory,
        cameras: tuple[Camera, ...],
        crops: tuple[Crop, ...],
        old: ShadowMap | None,
        *,
        is_fitted: bool,
    ) -> tuple[ShadowMap, list[int]]:
        """Return the map of a light, and which of its crops are not drawn yet.

        `old` is the map that was drawn of the same light.
        """
        depth = memory.depth
        drawn: dict[Crop, int] = {}
        if old is not None and old.depth is depth and old.is_fitted == is_fitted:
            if old.crops == crops:
                return old, []
            drawn = dict(zip(old.crops, old.images, strict=True))
        held = {drawn[crop] for crop in crops if crop in drawn}
        free = iter([image for image in range(depth.count) if image not in held])
        images = tuple(drawn[crop] if crop in drawn else next(free) for crop in crops)
        missing = [number for number, crop in enumerate(crops) if crop not in drawn]
        return ShadowMap.of(depth, cameras, crops, images, memory.table, is_fitted=is_fitted), missing

    def _require(self, scene: Scene, images: dict[int, int], faces: int, lights: int) -> None:
        """Free the maps of lights that are gone; check that there is memory for the missing ones.

        `images` are those of each light's shadow map, `faces` those of all lights.

        Raises:
            DeviceMemoryError: there is none; nothing was allocated or drawn.
        """
        for index in [index for index in self._memory if index >= lights]:
            del self._memory[index]

        def make() -> None:
            for index, count in images.items():
                if not self._has_memory(index, count):
                    self.runtime.plane(count, (self.size, self.size))
                    self._blocks.plane(count)
            glossy = self._glossy and kept.glossy
            if self._flux and faces and not self._fits(faces, glossy):
                side = -(-self.size // self._step)
                DeviceRsm(self.runtime, (side, side), faces, glossy=glossy)

        kept = device_scene(scene, self.runtime)
        total = sum(images.values())
        self.runtime.require(
            self.runtime.memory.needed(make),
            f"for {total} shadow maps (a light may have several) of {self.size} x {self.size} "
            "texels: take fewer lights or a smaller shadow_size",
        )

    def _has_memory(self, index: int, images: int) -> bool:
        return index in self._memory and self._memory[index].depth.count == images

    def _fits(self, faces: int, glossy: bool) -> bool:
        rsm = self._rsm
        return rsm is not None and rsm.faces == faces and (rsm.lobes is not None) == glossy

    def _kept(self, scene: Scene, punctual_lights: dict[int, PunctualLight]) -> set[int]:
        """Return which lights' maps are up to date."""
        before = self._punctual_lights
        same = {
            index
            for index, light in punctual_lights.items()
            if self._scene is scene.key and index in before and _equal(light, before[index])
        }
        if not self._flux:
            return same
        # All faces are in one map whose positions count from the first light.
        kinds, old_kinds = ([(i, type(light)) for i, light in x.items()] for x in (punctual_lights, before))
        return same if kinds == old_kinds and min(punctual_lights, default=0) in same else set()

    def _with_blocks(self, memory: _Memory, shadow: ShadowMap) -> ShadowMap:
        """Return a kept map with its blocks, queueing their pass for images that lack them."""
        missing = set(shadow.images) - memory.found
        if missing:
            perspective = not shadow.cameras[0].is_orthographic
            self._blocks.find(shadow.depth, memory.blocks, sorted(missing), perspective=perspective)
            memory.found.update(missing)
        return shadow if shadow.blocks is not None else replace(shadow, blocks=memory.blocks)

    def _draw(
        self,
        scene: Scene,
        light: PunctualLight,
        shadow: ShadowMap,
        missing: Sequence[int],
        rsm: DeviceRsm | None,
        first: int,
    ) -> None:
        """Queue the passes of one light: images of its shadow map, and faces of `rsm` from `first`
        on if there is one."""
        try:
            done = set() if rsm is None else self._draw_faces(scene, light, shadow, rsm, first)
            kept = device_scene(scene, self.runtime)
            for number in missing:
                if number not in done:
                    crop = shadow.crops[number]
                    camera = crop.camera(shadow.cameras[crop.face])
                    self._renderer.render(kept, light, camera, flux=False)
                    self._renderer.write_depth(shadow.depth, shadow.images[number])
        finally:
            self._renderer.release()

    def _draw_faces(
        self, scene: Scene, light: PunctualLight, shadow: ShadowMap, rsm: DeviceRsm, first: int
    ) -> set[int]:
        """Queue the passes of the faces that reflect; return the crops that they draw too."""
        kept, renderer = device_scene(scene, self.runtime), self._renderer
        done = set()
        crops = {crop.face: number for number, crop in enumerate(shadow.crops) if crop.is_whole}
        for face, camera in enumerate(shadow.cameras):
            renderer.render(kept, light, camera)
            if face in crops:
                renderer.write_depth(shadow.depth, shadow.images[crops[face]])
                done.add(crops[face])
            target = renderer.target
            rsm.write_face(first + face, target.depth, target.normal_world, renderer.flux)
            if rsm.lobes is not None:
                renderer.render_lobes(kept, light)
                rsm.write_lobes(target.depth, target.normal_world, renderer.specular_flux, renderer.gloss)
        return done

    def _reflects(self, punctual_lights: dict[int, PunctualLight], shadows: Sequence[ShadowMap | None]) -> bool:
        """Note in the frame which lights reach no reflecting surface; return whether any does."""
        first = 0
        for index, light in punctual_lights.items():
            shadow = shadows[index]
            assert shadow is not None  # noqa: S101  a light has one
            faces = len(shadow.cameras)
            if not self._lit[first : first + faces].any():
                self.runtime.skip(f"bounce {kind_name(light)}", "it lights nothing that reflects")
            first += faces
        return bool(self._lit.any())

    def _memory_of(self, index: int, images: int) -> _Memory:
        """Return the memory of a light's shadow map, the same as last time if it fits."""
        if not self._has_memory(index, images):
            self._memory.pop(index, None)
            depth = self.runtime.plane(images, (self.size, self.size), math.inf)
            table = ShadowMap.new_table(self.runtime, images)
            self._memory[index] = _Memory(depth, self._blocks.plane(images), table)
        return self._memory[index]

    def _rsm_of(
        self,
        scene: Scene,
        punctual_lights: dict[int, PunctualLight],
        faces: dict[int, tuple[Camera, ...]],
        kept: set[int],
    ) -> DeviceRsm:
        """Return the reflective shadow map with room for all faces, the same if it fits."""
        cameras = tuple(every_nth(camera, self._step) for of in faces.values() for camera in of)
        glossy = self._glossy and device_scene(scene, self.runtime).glossy
        if self._rsm is None or not self._fits(len(cameras), glossy):
            self._rsm = None  # so that both need not fit at a time
            self._rsm = DeviceRsm(self.runtime, cameras[0].size, len(cameras), glossy=glossy)
        if len(kept) < len(punctual_lights):
            texels = (c.pixel_to_view[:2] for c in cameras)
            widest = max(abs(to_x * to_y) for to_x, to_y in texels)
            self._rsm.begin(
                next(iter(punctual_lights.values())),
                cameras,
                reach=float(np.abs(scene.bounds - cameras[0].position).max()),
                brightest=widest * max(float(power(light).max()) for light in punctual_lights.values()),
            )
        return self._rsm


def _equal(a: PunctualLight, b: PunctualLight) -> bool:
    return a is b or (
        type(a) is type(b) and all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    )
