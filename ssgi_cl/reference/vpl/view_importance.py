"""View importance of the texels of reflective shadow maps, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.reference.occupancy.occupancy_grid import OccupancyGridReference
from ssgi_cl.reference.rsm.rsm import hilbert_order
from ssgi_cl.reference.rsm.rsm import texels as texels_of

Doubles = NDArray[np.float64]

EVERY, BITS = 4, 15
"""VPL_EVERY in kernels/vpl/vpl_view_importance.cl, and the bits of VPL_R2_MASK there."""
R2 = (24735, 18673)
"""VPL_R2_X and VPL_R2_Y there."""
RUN, BLOCK_RUNS = 16, 64
"""Texels of a cluster, and clusters that a map's number is a multiple of; as in curve.clh."""
GROUP, LEAST = 16, 0.01
"""VPL_GROUP and VPL_LEAST in kernels/vpl/curve.clh."""


def view_importance_reference(rsm: ReflectiveShadowMap, gbuffer: GBuffer, occupancy: OccupancyGridReference) -> Doubles:
    """Return [2, runs] the importance of the runs of a map and how many of their texels count.

    In squared scene units to the -1.

    Args:
        rsm: the map.
        gbuffer: what the camera sees.
        occupancy: what blocks light, in view space.
    """
    view, rows, columns = gbuffer.camera.view, *gbuffer.size
    turn = view[:3, :3].T
    position, normal, _ = texels_of(rsm)
    lit = (np.asarray(rsm.flux) > 0.0).any(axis=-1) & np.isfinite(rsm.depth)
    size, faces = rsm.cameras[0].size, len(rsm.cameras)
    one = hilbert_order(*size)
    face_runs = -(-len(one) // RUN)
    runs = -(-face_runs * faces // BLOCK_RUNS) * BLOCK_RUNS
    texels = np.full((runs, RUN), -1)
    for face in range(faces):
        padded = np.pad(one, (0, face_runs * RUN - len(one)), constant_values=-1 - face * len(one))
        texels[face * face_runs : (face + 1) * face_runs] = (padded + face * len(one)).reshape(-1, RUN)
    depth = gbuffer.inner(gbuffer.first("depth"))  # type: ignore[arg-type]
    seen = gbuffer.inner(gbuffer.first("normal"))  # type: ignore[arg-type]
    points = gbuffer.camera.unproject(np.where(np.isfinite(depth), depth, 1.0))
    near = len(occupancy.held) * occupancy.cell / 16.0
    found = np.zeros((2, runs))
    number = np.arange(runs)
    for i in range(RUN // EVERY):
        texel = texels[number, number % EVERY + i * EVERY]
        taken = (texel >= 0) & lit.ravel()[texel]
        step = number * (RUN // EVERY) + i
        column, row = (step * k % 2**BITS * n >> BITS for k, n in zip(R2, (columns, rows), strict=True))
        light = (position.reshape(-1, 3)[texel] + rsm.cameras[0].position) @ turn + view[:3, 3]
        axis = normal.reshape(-1, 3)[texel] @ turn
        at = points[row, column] @ turn + view[:3, 3]
        facing = seen[row, column].astype(np.float64) @ turn
        way = light - at
        squared = np.maximum(np.sum(way**2, axis=-1), 1e-300)
        received = np.maximum(np.sum(way * facing, axis=-1), 0.0)
        emitted = np.maximum(-np.sum(way * axis, axis=-1), 0.0)
        weight = received * emitted / (np.pi * squared * (squared + near**2))
        weight[~(taken & np.isfinite(depth[row, column]))] = 0.0
        some = weight > 0.0
        weight[some] *= ~occupancy.hidden(at[some], facing[some], light[some], axis[some])
        found += np.stack([weight, taken])
    return found


def run_weights(importance: Doubles) -> Doubles:
    """Return [runs] by what the luminous flux of the texels of runs counts more."""
    sums, counts = importance.reshape(2, -1, GROUP).sum(axis=-1).repeat(GROUP, axis=-1)
    mean = importance[0].sum() / max(importance[1].sum(), 1.0)
    weights: Doubles = np.sqrt(sums / (np.maximum(counts, 1.0) * max(mean, 1e-30)) + LEAST)
    return weights
