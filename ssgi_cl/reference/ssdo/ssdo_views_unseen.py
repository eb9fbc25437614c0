"""Surfaces that no earlier view shows, as defined in `techniques.ssdo.ssdo_views_unseen`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

ALIKE = 0.5
"""Cosine between the normals of one surface, at least."""


def unseen_reference(other: GBuffer, earlier: Sequence[GBuffer], nearest: float) -> Doubles:
    """Return the depth [layers, rows, columns] of `other`, +inf where an earlier view shows it.

    Args:
        other: an auxiliary view, all of whose layers have normals.
        earlier: the views before it, likewise.
        nearest: least depth at which a camera shows a point, scene units.
    """
    depth = np.array(other.depth, np.float64).reshape(-1, *np.shape(other.depth)[-2:])
    for layer, view in enumerate(_layers(other)):
        there = np.isfinite(depth[layer])
        position = view.position(*view.centres(), np.where(there, depth[layer], 1.0))
        normal = view.normal
        for each in earlier:
            turn = each.camera.view[:3, :3] @ other.camera.view[:3, :3].T
            shift = each.camera.view[:3, 3] - turn @ other.camera.view[:3, 3]
            shown = _shown(each, position @ turn.T + shift, normal @ turn.T, nearest)
            depth[layer] = np.where(there & shown, np.inf, depth[layer])
    return depth


def _shown(earlier: GBuffer, point: Doubles, normal: Doubles, nearest: float) -> Doubles:
    """Return where a view shows points [rows, columns, 3] of its own view space."""
    views = _layers(earlier)
    rows, columns = views[0].depth.shape
    to_x, to_y, _, _ = earlier.camera.pixel_to_view
    ahead = -point[..., 2] > nearest
    safe = np.where(ahead[..., None], point, [0.0, 0.0, -1.0])
    row, column = views[0].pixel(safe)
    inside = ahead & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    pixel = max(abs(to_x), abs(to_y)) * (np.ones(ahead.shape) if earlier.camera.is_orthographic else -safe[..., 2])
    shown = np.zeros(ahead.shape, bool)
    for down in (-0.5, 0.5):
        for along in (-0.5, 0.5):
            r = np.floor(np.clip(row + down, 0, rows - 1)).astype(int)
            c = np.floor(np.clip(column + along, 0, columns - 1)).astype(int)
            for view in views:
                depth = view.depth[r, c]
                there = np.isfinite(depth)
                surface = view.position(r + 0.5, c + 0.5, np.where(there, depth, 1.0))
                apart = np.abs(np.sum(normal * (surface - point), axis=-1))
                alike = np.abs(np.sum(normal * view.normal[r, c], axis=-1)) >= ALIKE
                shown |= there & (apart <= pixel) & alike
    result: Doubles = shown & inside
    return result


def _layers(gbuffer: GBuffer) -> list[SurfaceView]:
    depth = np.asarray(gbuffer.depth).reshape(-1, *np.shape(gbuffer.depth)[-2:])
    normal = np.asarray(gbuffer.normal)
    normal = normal if normal.ndim == 4 else normal[None]
    return [
        SurfaceView.of(GBuffer(camera=gbuffer.camera, depth=each, normal=facing))
        for each, facing in zip(depth, normal, strict=True)
    ]
