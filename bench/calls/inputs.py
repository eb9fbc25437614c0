"""What every technique is called with: one room, as some cameras and lights see it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import Scene
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm as drawn_map
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

Array = NDArray[Any]


@dataclass(frozen=True)
class Inputs:
    """What the techniques are given: one room, as some cameras and lights see it.

    Attributes:
        scene: the room.
        gbuffer: two layers with all attributes and a margin.
        single: one layer without a margin or normals.
        view: what a auxiliary camera sees.
        maps: of a spot light, and of a point light.
        lights: those two, the sun and an environment that is an image.
        image: [rows, columns, 3] of the size of `gbuffer`'s results: noise over 8 orders.
    """

    scene: Scene
    gbuffer: GBuffer
    single: GBuffer
    view: GBuffer
    maps: tuple[ReflectiveShadowMap, ReflectiveShadowMap]
    lights: tuple[Any, ...]
    image: NDArray[np.float32]


def inputs(runtime: Runtime, size: Size, texels: int) -> Inputs:
    """Draw the inputs.

    Args:
        runtime: the device that draws them.
        size: (rows, columns) of the images.
        texels: along a side of the lights' maps.
    """
    made = BUILTIN_SCENES["cornell_box"]()
    rows, columns = size
    camera = made.camera(columns, rows)
    punctual_light = PointLight(camera.position + np.array([0.0, 0.3, 0.1]), (1.0, 2.0, 3.0))
    spot = next(light for light in made.lights if isinstance(light, SpotLight))
    spot_map, light_map = (
        drawn_map(made.scene, light, size=texels, runtime=runtime) for light in (spot, punctual_light)
    )
    rng = np.random.default_rng(5)
    single = drawn(made.scene, camera, runtime=runtime)
    return Inputs(
        scene=made.scene,
        gbuffer=drawn(made.scene, camera, layers=2, overscan=0.1, attributes="all", runtime=runtime),
        single=GBuffer(camera=camera, depth=single.depth),
        view=drawn(made.scene, made.camera(-(-columns // 2), -(-rows // 2)), runtime=runtime),
        maps=(spot_map, light_map),
        lights=(
            spot,
            punctual_light,
            DirectionalLight((0.3, -1.0, -0.5), (3.0, 2.0, 1.0), angle=0.05),
            Environment(rng.random((4, 8, 3))),
        ),
        image=(10.0 ** rng.uniform(-4.0, 4.0, (*size, 3))).astype(np.float32),
    )


Call = Callable[[Inputs, Runtime], Iterator[Array]]
"""What yields the results of a technique, the same number of the same shapes always."""
