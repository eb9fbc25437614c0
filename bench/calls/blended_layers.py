"""Calls of layers that are seen through, and of the frame that blends them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.rasterize.raster.blended_layers import blended_layers

from .inputs import Array, Call, Inputs


def seen_through(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield opacity of all layers, and radiance of a frame, of the room as if half of it were there."""
    faded = tuple(replace(material, alpha=0.5, blends=True) for material in given.scene.materials)
    scene, camera = replace(given.scene, materials=faded), given.gbuffer.camera
    yield np.sum([layer.opacity for layer in blended_layers(scene, camera, runtime=runtime)], axis=0)
    yield np.asarray(render(scene, camera, given.lights, bounces=0, ao=False, shadow_size=16, runtime=runtime).radiance)


CALLS: Mapping[str, Call] = {"blended layers": seen_through}
