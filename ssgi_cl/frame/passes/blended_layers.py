"""Pass: surfaces that are seen through, each layer lit like what is behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes import resources as of
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.stage import Declared, Stage, run_in_order
from ssgi_cl.rasterize.raster.blended_layers import BlendedLayers
from ssgi_cl.rasterize.raster.view import device_scene


def blended_layers(build: Build, lit: Callable[[Build], Sequence[Stage]]) -> Stage:
    """Return the pass.

    Args:
        build: what it is prepared for.
        lit: returns the passes that light the surfaces of a G-buffer: a subgraph, run for each
            layer with techniques and so memory of its own. Called once a scene has such surfaces.
    """
    runtime, size = build.runtime, build.size
    whole = build.params.kind == "whole"
    lit_layer = build.lit
    behind = of.SMOOTH if build.params.edge_places else lit_layer
    scene_light = (of.CASTING, of.SKY_MAPS, of.SURFELS, of.LIGHT_VOLUME, of.EVEN_LIGHT) if whole else ()
    shared = (of.LIGHTS, of.SHADOWS, of.SKY, of.MULTI_BOUNCE, *scene_light)
    hints = (of.RSM,) if whole else ()
    made: list[tuple[BlendedLayers, Sequence[Stage], Plane]] = []

    def blend(step: int, radiance: Plane, over: Plane, through: Plane, **layer: Any) -> None:
        runtime.kernel("blended/blended.cl", {"BLENDED_STEP": step}).run(
            size, radiance=radiance, **layer, over=over, through=through
        )

    def run(r: Declared) -> Plane:
        radiance: Plane = r[behind]
        part = scene_parts(r[of.SCENE]).blended
        if part is None:
            return radiance
        if not made:
            made.append((BlendedLayers(runtime, size, matt=not whole), lit(build.for_layers()), runtime.plane(3, size)))
        layers, passes, over = made[0]
        through = runtime.transient.plane(3, size)
        given = {name: r[name] for name in shared + hints}
        found = False
        for layer in layers.drawn(device_scene(part, runtime), r[of.CAMERA], r[of.GBUFFER]):
            values = run_in_order(passes, {**given, of.GBUFFER: layer})
            blend(int(found), values[lit_layer], over, through, opacity=layer.opacity, transmitted=layer.transmitted)
            found = True
        if found:
            blend(2, radiance, over, through)
        return over if found else radiance

    return Stage(
        name="blended layers",
        reads=(of.GBUFFER, of.SCENE, of.CAMERA, behind, *shared),
        hints=hints,
        writes=(of.RADIANCE,),
        run=run,
    )
