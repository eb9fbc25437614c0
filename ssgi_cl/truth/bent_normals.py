"""World truth of bent normals: the mean of the directions in which rays meet nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import ssgi_cl.truth.raycast
from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.sampling import basis, directions, hashed, r2_points, wrapped
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Progress
from ssgi_cl.truth.digests import camera_description, scene_digest
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.occlusion import inner_digest, split
from ssgi_cl.truth.ray_ao import BLOCK_RAYS, in_blocks
from ssgi_cl.truth.raycast import RayCaster, Spots
from ssgi_cl.truth.store import Truth, accumulated


def bent_normals(
    scene: Scene, gbuffer: GBuffer, radius: float, rays: int = 512, *, rebuild: bool = False, progress: Progress = None
) -> Truth:
    """Return the mean unoccluded directions of what pixels show, by cosine-weighted rays.

    Args:
        scene, gbuffer, radius: see `ssgi_cl.ray_ao`.
        rays: per pixel, 1 to 2^20; rounded up to a multiple of the number of passes, 2 to 16.
        rebuild: make it anew, whatever is kept.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.

    Returns:
        World-space directions [rows, columns, 3] float32 of unit length, 0 where nothing is seen
        or no ray gets away; and the standard error of their components.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
        TruthError: what is kept is damaged; see `ssgi_cl.truth.store.accumulated`.
        MissingExtraError: embreex is not installed; it comes with the extra `truth`.
    """
    version = ssgi_cl.truth.raycast.embree_version()
    radius = checks.number("radius", radius, low=0, above=True, unit="scene units", infinite=True)
    passes, share = split(rays)
    caster = RayCaster(scene)
    sums = accumulated(
        {
            "kind": "bent",
            "scene": scene_digest(scene),
            "camera": camera_description(gbuffer.camera),
            "radius": radius,
            "rays": share,
            "gbuffer": inner_digest(gbuffer),
            "embreex": version,
            "estimator": versioned("bent normals"),
        },
        passes,
        lambda number: _means(caster, gbuffer, radius, share, number),
        rebuild=rebuild,
        progress=progress,
    )
    length = np.maximum(np.linalg.norm(sums.mean, axis=-1, keepdims=True), np.float32(1e-30))
    return Truth(sums.mean / length, np.minimum(sums.error / length, 1.0), sums.passes, sums.key)


def _means(caster: RayCaster, gbuffer: GBuffer, radius: float, rays: int, seed: int) -> NDArray[np.float32]:
    """Return the sum of the open directions over the number of rays, [rows, columns, 3]."""
    result = np.zeros((gbuffer.size[0] * gbuffer.size[1], 3), np.float32)

    def work(block: slice) -> None:
        spots = caster.spots(gbuffer.camera, block, gbuffer)
        if len(spots.pixel):
            result[spots.pixel] = _open(caster, spots, radius, rays, seed)

    in_blocks(gbuffer.size, work)
    return result.reshape(*gbuffer.size, 3)


def _open(caster: RayCaster, spots: Spots, radius: float, rays: int, seed: int) -> NDArray[np.float64]:
    """Return the mean over the rays of each spot, a ray that meets something being 0."""
    count = len(spots.pixel)
    reach = np.float32(radius * caster.scale)
    total = np.zeros((count, 3))
    step = max(1, BLOCK_RAYS // count)
    for first in range(0, rays, step):
        way, below = cosine_rays(spots, first, min(first + step, rays), seed)
        reaches = np.where(below, np.float32(-1.0), reach)  # negative: not traced
        start = np.broadcast_to(spots.start, way.shape).reshape(-1, 3)
        blocked = caster.blocked(start, way.reshape(-1, 3), reaches.ravel()).reshape(below.shape)
        total += np.einsum("knd,kn->nd", way, (~(blocked | below)).astype(np.float32))
    return total / rays


def cosine_rays(spots: Spots, first: int, last: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return directions [rays, spots, 3] and which start into their surface [rays, spots].

    Each pixel moves the points by other numbers round the unit square (Cranley-Patterson).
    """
    keys = spots.pixel.astype(np.uint64)[None, :] * np.uint64(2)
    shift = hashed(keys + np.arange(2, dtype=np.uint64)[:, None], seed)
    point = r2_points(first, last)
    u, v = (wrapped(point[:, d, None] + shift[d]) for d in (0, 1))
    way = directions(u, v, basis(spots.axis), "cosine")
    return way, np.einsum("knd,nd->kn", way, spots.normal) <= 0.0
