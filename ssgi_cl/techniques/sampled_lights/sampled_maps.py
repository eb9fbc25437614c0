"""Directions that stand for all environments, and what each sees of a scene: a depth map over all of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.environment_samples import sample_environments
from ssgi_cl.core.lights import Environment, Light, are_same, environments_of
from ssgi_cl.core.sample_views import sample_views
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.beside import Beside
from ssgi_cl.device.constants import START_FEW
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import device_scene

Doubles = NDArray[np.float64]

BATCH = 256
"""Triangles that the maps' pass brings to one view after another."""
EACH = 2
"""Views of a work-item of that pass, where each has maps of its own."""
NOTHING = int(np.float32(np.inf).view(np.int32))
"""Depth in maps where nothing is, as its bits."""


class SampledMaps:
    """The maps, drawn beside what is queued after them. They are kept as long as scene and environments are the same
    objects.

    Args:
        runtime: the device.
        count: directions, a multiple of 16.
        texels: along a map's side.

    Attributes:
        directions, flux: [n, 3] towards the sky, world space, and W/m^2; none where no environment sends light.
        views: [n, 3, 4] from the scene's origin to (column, row, depth) of each map.
        diagonals: [n] of a texel, scene units.
    """

    def __init__(self, runtime: Runtime, count: int, texels: int) -> None:
        self.runtime, self.count, self.texels = runtime, count, texels
        self.directions: Doubles = np.zeros((0, 3))
        self.flux: Doubles = np.zeros((0, 3))
        self.views: Doubles = np.zeros((0, 3, 4))
        self.diagonals: Doubles = np.zeros(0)
        self._triangles = runtime.kernel("sampled_lights/sampled_triangles.cl", {"SAMPLED_RUN": START_FEW})
        self._cutouts = runtime.kernel("sampled_lights/sampled_cutouts.cl")
        self._matrices = runtime.empty(count * 12, np.float32)
        self._maps: DeviceArray | None = None
        self._drawing: tuple[Beside, DeviceArray] | None = None  # and what it reads
        self._environments: tuple[Environment, ...] = ()
        self._seen: Doubles | None = None
        self._scene: object = None  # its key, of what the maps show

    def draw(self, scene: Scene, lights: Sequence[Light], seen: Doubles | None = None) -> SampledMaps:
        """Queue the passes that draw the maps, unless they are there; return this.

        Other lights than environments are passed over. `seen` is that of `sample_environments`.
        """
        now = environments_of(lights)
        if not are_same(now, self._environments) or seen is not self._seen:
            self._scene = None
            self.directions, self.flux = sample_environments(now, self.count, seen)
            self._environments, self._seen = now, seen
        if not len(self.directions):
            return self
        if self._scene is scene.key:
            self.runtime.skip("sampled lights maps", "neither scene nor environments changed")
            return self
        self._scene = None
        if self._drawing is not None:  # for a call that failed
            self.runtime.finish()
        self._draw(scene)
        self._scene = scene.key
        return self

    def ready(self) -> DeviceArray:
        """Return the maps [n, texels, texels], which what is queued from now on may read."""
        assert self._maps is not None  # noqa: S101  drawn
        if self._drawing is not None:
            self._drawing[0].join()
            self._drawing = None
        return self._maps

    def _draw(self, scene: Scene) -> None:
        runtime, texels, count = self.runtime, self.texels, self.count
        solid = device_scene(scene, runtime)
        triangles = solid.triangles
        order, boxes = solid.by_size
        planar = runtime.transient.array(10 * solid.triangle_stride, np.float32)
        self._triangles.run(
            (1, solid.triangle_stride),
            corners=solid.corners,
            positions=solid.positions,
            cutouts=solid.cutouts,
            order=order,
            triangles=planar,
            count=triangles,
            vertex_stride=solid.vertex_stride,
        )
        self.views, self.diagonals = sample_views(self.directions, scene.bounds - scene.origin, texels)
        self._matrices.upload(self.views.astype(np.float32))
        if self._maps is None:
            self._maps = runtime.empty(count * texels * texels, np.int32)
        self._maps.fill(NOTHING)
        batches = -(-triangles // BATCH)
        rows, each, some = batches, 1, count
        if runtime.variant.lanes > 1:  # see the kernel; as few at a time as leave other kernels room between
            rows, each, some = 1, EACH, EACH * runtime.info.units
        macros = {"SAMPLED_BATCH": BATCH, "SAMPLED_RUN": START_FEW, "SAMPLED_CULL": int(scene.culls)}
        kernel = runtime.kernel("sampled_lights/sampled_depth.cl", macros)
        with runtime.second.kernels() as beside:
            self._drawing = beside, planar  # whatever fails from here on
            for begin in range(0, count, some):
                kernel.run(
                    (batches, count),
                    grid=(rows, -(-min(some, count - begin) // each)),
                    local=runtime.small_groups(1),
                    boxes=boxes,
                    triangles=planar,
                    views=self._matrices,
                    maps=self._maps,
                    runs=solid.triangle_stride // START_FEW,
                    texels=texels,
                    each=each,
                    begin=begin,
                )
            self._draw_cut_outs(scene)

    def _draw_cut_outs(self, scene: Scene) -> None:
        """Queue the pass of triangles with holes."""
        holes = np.flatnonzero(scene.cut_out)
        if not len(holes):
            return
        solid = device_scene(scene, self.runtime)
        self._cutouts.run(
            (len(holes), self.count),
            grid=(len(holes), self.count),
            chosen=self.runtime.array(holes.astype(np.int32)),
            corners=solid.corners,
            positions=solid.positions,
            uvs=solid.uvs,
            cutouts=solid.cutouts,
            materials=solid.materials,
            textures=solid.textures,
            texels=solid.texels,
            decode=solid.decode,
            views=self._matrices,
            maps=self._maps,
            triangles=solid.triangles,
            vertex_stride=solid.vertex_stride,
            side=self.texels,
        )
