"""The floor of screen space: ambient occlusion by rays against what depth layers hold."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ssgi_cl.truth.layer_mesh as mesh
import ssgi_cl.truth.ray_ao as estimator
import ssgi_cl.truth.raycast
from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Progress, part_of, told
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.truth.digests import camera_description, digest
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.occlusion import of_rays, split
from ssgi_cl.truth.raycast import OFFSET, RayCaster, Spots
from ssgi_cl.truth.store import Truth, accumulated


def layered_occlusion(
    gbuffer: GBuffer,
    radius: float,
    rays: int = 512,
    *,
    joins: str = "surface",
    weighting: str = "cosine",
    attenuation: str | ArrayLike = "none",
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return A by rays against the geometry that depth layers hold alone; kept on disk.

    How far this is from `ambient_occlusion` is how far every technique is that knows no more than
    these layers, and does not guess: its floor. Each layer is a height field over the pixel
    centres, margin included, of triangles between neighbours in rows and columns that are joined:

    - "surface": with whichever layer of the neighbour continues it, since a surface gets another
      number where something begins to cover it. One continues the other where a line in 1 / depth
      (orthographic: depth) through two pixels on either side misses it by at most 2 % of the depth
      (orthographic: of the view's height), if none does so better; or where both lines meet between
      the two pixels, as at a crease;
    - "layer": with the same layer alone, under the same condition;
    - "always": with the same layer wherever both show something, so that jumps are bridged.

    Rays start from the first layer at the pixel centres, round the G-buffer's normals, in the
    directions of `ambient_occlusion` with equal `rays`: where both meet the same, both err alike.

    Args:
        gbuffer: depth layers, and the first one's normals if there are any.
        joins: "surface", "layer" or "always".
        radius, rays, weighting, attenuation, rebuild, progress: see `ambient_occlusion`.

    Returns:
        Mean A [rows, columns] float32 in [0, 1] and its standard error, as `ambient_occlusion`;
        1 and 0 where nothing is seen.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
        TruthError: what is kept is damaged; see `ssgi_cl.truth.store.accumulated`.
        MissingExtraError: embreex is not installed; it comes with the extra `truth`.
    """
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected an ssgi_cl.GBuffer")
    version = ssgi_cl.truth.raycast.embree_version()
    passes, share = split(rays)
    joins = checks.choice("joins", joins, mesh.JOINS)
    description: dict[str, Any] = {
        "kind": "layers",
        "camera": camera_description(gbuffer.camera),
        "gbuffer": digest(gbuffer.depth, gbuffer.first("normal")),
        "joins": joins,
        **of_rays(radius, share, weighting, attenuation),
        "embreex": version,
        "estimator": versioned("layered occlusion"),
    }
    if gbuffer.camera.is_orthographic:
        description["misses"] = "of the view's height"

    @cache
    def caster() -> _LayerAo | None:
        held = mesh.layer_mesh(gbuffer, joins)
        return None if held is None else _LayerAo(held, gbuffer)

    with told(progress, "ambient occlusion") as tell:

        def make(number: int) -> NDArray[np.float32]:
            made = caster()
            if made is None:
                return np.ones(gbuffer.size, np.float32)
            return made(
                gbuffer.camera,
                radius,
                share,
                weighting=weighting,
                attenuation=attenuation,
                estimate_error=False,
                seed=number,
                progress=part_of(tell, number / passes, (number + 1) / passes),
            )[0]

        return accumulated(description, passes, make, rebuild=rebuild, progress=tell)


class _LayerAo(estimator.RayAo):
    """Ambient occlusion of what layers hold, as their camera sees it."""

    def __init__(self, held: Scene, gbuffer: GBuffer) -> None:
        self._caster = _LayerCaster(held, gbuffer)


class _LayerCaster(RayCaster):
    """Rays that start from the pixel centres of the first layer."""

    def __init__(self, held: Scene, gbuffer: GBuffer) -> None:
        super().__init__(held)
        view = SurfaceView.of(gbuffer)
        self._axis = view.inner(view.normal) @ gbuffer.camera.view[:3, :3]
        self._start = view.inner(mesh.layer_positions(gbuffer)[0]) * self.scale
        self._size = view.inner(_sizes(held)[: view.depth.size].reshape(view.depth.shape))
        self._size *= self.scale
        self._seen = np.isfinite(view.inner(view.depth))

    def spots(self, camera: Camera, rows: slice, gbuffer: GBuffer | None) -> Spots:
        """Return what the layers' own camera sees through the pixel centres of some rows."""
        seen = self._seen[rows]
        start, axis = self._start[rows][seen], self._axis[rows][seen]
        height = OFFSET * self._size[rows][seen]
        normal = axis.astype(np.float32)
        return Spots(
            np.flatnonzero(seen) + rows.start * camera.width,
            (start + height[:, None] * axis).astype(np.float32),
            normal,
            normal,
        )


def _sizes(held: Scene) -> NDArray[np.float64]:
    """Return [vertices] the greatest coordinate of the triangles round each, scene units."""
    of_vertex = np.abs(held.positions).max(axis=-1).astype(np.float64)
    of_triangle = of_vertex[held.triangles].max(axis=-1)
    sizes: NDArray[np.float64] = of_vertex.copy()
    for corner in held.triangles.T:
        np.maximum.at(sizes, corner, of_triangle)
    return sizes
