"""The bounding volume hierarchy of a scene in device memory."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.bvh import bvh_of
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.wide_bvh import wide_bvh_of
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.bvh_split import bvh_split
from ssgi_cl.rasterize.raster.view import device_scene

MANY = 1 << 14
"""Triangles of a hierarchy in which rays that are not near each other are followed one by one. Among fewer, vectors of
rays are faster: in rooms of 300 by half, in one of 20,000 slower by a tenth, in one of 480,000 by half."""


class SceneBvh:
    """The arrays of a hierarchy as kernels/rays/bvh.clh reads them.

    Attributes:
        nodes, triangles: see `ssgi_cl.core.bvh.Bvh`. Coordinates are relative to the scene's origin.
        first_macros, first: macros and arguments of kernels that include kernels/rays/first.clh.
        cutouts: what kernels with RAYS_HOLES read besides, by name; empty of a scene without holes.
    """

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        chosen = np.flatnonzero(scene.cut_out)
        number = np.zeros(len(scene.triangles), np.int32)
        number[chosen] = np.arange(1, len(chosen) + 1)
        triangles = scene.triangles.T.astype(np.intp, order="C")  # what is gathered lies in its order
        corners = np.stack([column[triangles] for column in scene.positions.T], axis=1)
        bvh = bvh_of(corners, scene.culled_backs, partial(bvh_split, runtime), number)
        self.nodes = runtime.array(bvh.nodes)
        self.triangles = runtime.array(bvh.triangles)
        by_one = runtime.variant.lanes > 1 and len(bvh.triangles) > MANY
        self.first_macros = {"RAYS_ONE": int(by_one)}
        self.first: dict[str, Any] = {"nodes": self.nodes, "blocks": self.nodes, "triangles": self.triangles}
        if by_one:
            wide = wide_bvh_of(bvh, runtime.variant.lanes)
            self.first |= {"nodes": runtime.array(wide.nodes), "blocks": runtime.array(wide.blocks)}
        self.cutouts: dict[str, DeviceArray] = {}
        if len(chosen):
            solid = device_scene(scene, runtime)
            self.cutouts = {
                "cutouts": runtime.array(_cutouts(scene, chosen)),
                "textures": solid.textures, "texels": solid.texels, "decode": solid.decode,
            }  # fmt: skip


def _cutouts(scene: Scene, chosen: NDArray[np.intp]) -> NDArray[np.float32]:
    """Return [chosen triangles, 9] texture coordinates of a corner, differences to those of the others, texture,
    alpha, cut-off."""
    uvs = scene.uvs[scene.triangles[chosen]]
    values = np.array([(m.texture, m.alpha, m.alpha_cutoff) for m in scene.materials], np.float32)
    edges = (uvs[:, 1:] - uvs[:, :1]).reshape(-1, 4)
    return np.concatenate([uvs[:, 0], edges, values[scene.material_ids[chosen]]], axis=1)


def scene_bvh(scene: Scene, runtime: Runtime) -> SceneBvh:
    """Return the hierarchy of a scene; the same object for the same scene, while it is kept."""
    kept: SceneBvh = runtime.prepared((SceneBvh, scene.key), lambda: SceneBvh(runtime, scene), of=scene)
    return kept
