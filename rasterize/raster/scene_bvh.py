"""The bounding volume hierarchy of a scene in device memory."""

from __future__ import annotations

from ssgi_cl.core.bvh import bvh_of
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime


class SceneBvh:
    """The arrays of a hierarchy as kernels/rays/bvh.clh reads them.

    Attributes:
        nodes, triangles: see `ssgi_cl.core.bvh.Bvh`. Coordinates are relative to the scene's origin.
    """

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        bvh = bvh_of(scene.positions[scene.triangles], scene.culled_backs)
        self.nodes = runtime.array(bvh.nodes)
        self.triangles = runtime.array(bvh.triangles)


def scene_bvh(scene: Scene, runtime: Runtime) -> SceneBvh:
    """Return the hierarchy of a scene; the same object for the same scene, while it is kept."""
    kept: SceneBvh = runtime.prepared((SceneBvh, scene.key), lambda: SceneBvh(runtime, scene), of=scene)
    return kept
