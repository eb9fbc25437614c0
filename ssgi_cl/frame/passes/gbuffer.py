"""Pass: the G-buffer, the surfaces that the camera sees."""

from __future__ import annotations

from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import AO, CAMERA, GBUFFER, HISTORY, SCENE
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.rasterize.raster.rasterizer import Before
from ssgi_cl.rasterize.raster.view import device_scene


def gbuffer(build: Build) -> Stage:
    """Return the pass."""
    runtime, rasterizer = build.runtime, build.rasterizer
    regions = rasterizer.regions

    def run(r: Declared) -> DeviceGBuffer:
        parts = scene_parts(r[SCENE])
        # What is seen through may lie beyond the region of what is not.
        rasterizer.regions = regions and parts.blended is None
        before = None
        if build.history and (moved := r[HISTORY].before(r[SCENE])) is not None:
            before = Before(device_scene(scene_parts(moved[0]).solid, runtime), moved[1])
        scene = device_scene(parts.solid, runtime)
        # A G-buffer that is an output has it whatever reads it.
        ends = build.params.draws_thickness and (r.foresees(AO) or rasterizer.target.world == "kept")
        rasterizer.thickness = ends and scene.has_solids
        seen: DeviceGBuffer = rasterizer.render(scene, r[CAMERA], before=before)
        if seen.region is not None:
            rows, columns = seen.region.rows, seen.region.columns
            runtime.skip("region", f"nothing is seen outside of {columns} x {rows} pixels", 0.0)
        seen.derive()
        if build.ssdo is not None:
            build.ssdo.look(seen)  # needs normals in world space, whose memory goes to others then
        seen.release_world()
        return seen

    reads = (SCENE, CAMERA, HISTORY) if build.history else (SCENE, CAMERA)
    foresees = (AO,) if build.params.draws_thickness else ()
    return Stage(name="G-buffer", reads=reads, writes=(GBUFFER,), foresees=foresees, run=run, releases=("ssdo",))
