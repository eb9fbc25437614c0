"""Pass: edges of surfaces, smooth in the picture."""

from __future__ import annotations

from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CAMERA, GBUFFER, SCENE, SMOOTH
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.filters.smooth_edges import SmoothEdges


def smooth_edges(build: Build) -> list[Stage]:
    """Return the pass; none where parameters turn it off."""
    if not build.params.edge_places:
        return []
    technique = SmoothEdges(build.runtime, build.size, build.params.edge_places)
    behind = build.lit

    def run(r: Declared) -> Plane:
        solid = device_scene(scene_parts(r[SCENE]).solid, build.runtime)
        return technique.run(r[GBUFFER], r[behind], scene=solid, camera=r[CAMERA])

    return [
        Stage(name="smooth edges", reads=(GBUFFER, SCENE, CAMERA, behind), writes=(SMOOTH,), run=run, on_demand=True)
    ]
