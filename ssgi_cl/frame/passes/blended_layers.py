"""Pass: surfaces that are seen through, each layer lit like what is behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CAMERA, GBUFFER, RADIANCE, RSM, SCENE
from ssgi_cl.frame.stage import Stage, Values, run_in_order
from ssgi_cl.rasterize.raster.blended_layers import BlendedLayers
from ssgi_cl.rasterize.raster.view import device_scene


def blended_layers(
    build: Build, behind: str, shared: tuple[str, ...], layer_passes: Callable[[], Sequence[Stage]]
) -> Stage:
    """Return the pass.

    Args:
        build: what it is prepared for.
        behind: the resource of the radiance of what is behind all layers.
        shared: resources that layers have in common with what is behind them.
        layer_passes: returns the passes that light a layer, with techniques and so memory of their
            own: a subgraph, run for each layer with its G-buffer. The last writes `behind`. Called
            once a scene has such surfaces.
    """
    runtime, size = build.runtime, build.size
    made: list[tuple[BlendedLayers, Sequence[Stage]]] = []

    def blend(step: int, radiance: Plane, over: Plane, through: Plane, **layer: Any) -> None:
        runtime.kernel("blended/blended.cl", {"BLENDED_STEP": step}).run(
            size, radiance=radiance, **layer, over=over, through=through
        )

    def run(r: Values) -> Plane:
        radiance: Plane = r[behind]
        part = scene_parts(r[SCENE]).blended
        if part is None:
            return radiance
        if not made:
            made.append((BlendedLayers(runtime, size, matt=build.params.kind != "whole"), layer_passes()))
        layers, passes = made[0]
        over, through = (runtime.transient.plane(3, size) for _ in range(2))
        found = False
        for layer in layers.drawn(device_scene(part, runtime), r[CAMERA], r[GBUFFER]):
            values = run_in_order(passes, {**{name: r[name] for name in shared}, GBUFFER: layer})
            blend(int(found), values[behind], over, through, opacity=layer.opacity, transmitted=layer.transmitted)
            found = True
        if found:
            blend(2, radiance, over, through)
            radiance.copy_image(0, over, radiance.count)
        return radiance

    return Stage(
        name="blended layers",
        reads=tuple(dict.fromkeys((GBUFFER, SCENE, CAMERA, behind, *(name for name in shared if name != RSM)))),
        hints=(RSM,) if RSM in shared else (),
        writes=(RADIANCE,),
        run=run,
    )
