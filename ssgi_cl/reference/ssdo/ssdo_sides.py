"""Which sides of depth layers nobody sees, in numpy, as kernels/ssdo/ssdo_sides.cl defines it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView, view_normals


def sides_of(gbuffer: GBuffer, view: SurfaceView) -> Doubles:
    """Return [layers, rows, columns]: 1 for outer sides of what is closed, -1 for inner, else 0.

    0 everywhere unless there are several layers, and all have attributes.
    """
    depths = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *view.depth.shape)
    result: Doubles = np.zeros(depths.shape)
    given = (gbuffer.normal, gbuffer.albedo, gbuffer.emission)
    if len(depths) == 1 or all(array is None or np.ndim(array) < 4 for array in given):
        return result
    normals = np.zeros((*depths.shape, 3))
    if gbuffer.normal is not None:
        of_layers = np.asarray(gbuffer.normal, np.float64).reshape(-1, *view.depth.shape, 3)
        normals[: len(of_layers)] = of_layers
    turned = np.stack(
        [
            np.sum(view_normals(replace(view, depth=depth), normal) * (normal @ gbuffer.camera.view[:3, :3].T), axis=-1)
            for depth, normal in zip(depths, normals, strict=True)
        ]
    )
    for row, column in np.argwhere(np.isfinite(depths[0])):
        begun: list[int] = []
        found = np.zeros(len(depths))
        for layer in np.flatnonzero(np.isfinite(depths[:, row, column])).tolist():
            side = turned[layer, row, column]
            if side > 0.0:
                begun.append(layer)
            elif side == 0.0 or not begun:
                break
            else:
                found[begun.pop()], found[layer] = 1.0, -1.0
        else:
            result[:, row, column] = found
    return result
