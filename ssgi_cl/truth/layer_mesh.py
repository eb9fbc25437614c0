"""The surfaces that the depth layers of a G-buffer hold, as triangles between pixel centres."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera_rays import visibility_rays
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.truth.image_regions import STEP

Doubles = NDArray[np.float64]
Joined = NDArray[np.bool_]

FARTHEST = 1e38
"""Coordinate, scene units."""

JOINS = ("surface", "layer", "always")
"""Rules by which a pixel of a layer is joined with the next; see `ssgi_cl.truth.layered_occlusion`."""


def layer_positions(gbuffer: GBuffer) -> Doubles:
    """Return [layers, rows, columns, 3] float64: where the layers are seen, margin included.

    World space, relative to the camera's position; 0 where nothing is.
    """
    whole = gbuffer.camera.with_margin(gbuffer.margin)
    depth = _depths(gbuffer)[..., None]
    # Relative to the eye roundings are small where pixels are.
    start, along = (
        line.reshape(*whole.size, 3) for line in visibility_rays(whole, slice(0, whole.height), gbuffer.camera.position)
    )
    there = np.isfinite(depth)
    return np.where(there, start + np.where(there, depth, 0.0) * along, 0.0)


def layer_mesh(gbuffer: GBuffer, joins: str) -> Scene | None:
    """Return the triangles between neighbouring pixel centres of all layers, world space.

    Args:
        gbuffer: whose depth layers count, margin included.
        joins: one of `JOINS`.

    Returns:
        A scene without normals, relative to the camera's position; None if no pixel is joined with
        two others. A triangle has one pixel and its neighbours in a row and a column; where four
        pixels are joined all round, two triangles fill the square between them.
    """
    depth = _depths(gbuffer)
    nothing = ~np.isfinite(depth)
    depth[nothing] = np.nan
    # On a plane this is linear in the pixel position.
    linear = depth if gbuffer.camera.is_orthographic else 1.0 / depth
    size = gbuffer.camera.tolerance_depth(linear)
    right = _joined(linear, size, joins)
    down = _joined(linear.swapaxes(1, 2), size.swapaxes(1, 2), joins).swapaxes(2, 3)
    triangles = _triangles(right, down, -depth if gbuffer.camera.is_orthographic else linear)
    if len(triangles) == 0:
        return None
    # A depth that float32 holds may be seen at a coordinate that it does not.
    exact = np.clip(layer_positions(gbuffer).reshape(-1, 3), -FARTHEST, FARTHEST)
    positions = exact.astype(np.float32)
    zeros = np.zeros_like(positions)
    return Scene(
        origin=gbuffer.camera.position,
        positions=positions,
        normals=zeros,
        uvs=zeros[:, :2],
        colors=zeros,
        triangles=triangles,
        material_ids=np.zeros(len(triangles), np.int32),
    )


def _depths(gbuffer: GBuffer) -> Doubles:
    """Return [layers, rows, columns] float64, a copy."""
    depth = np.asarray(gbuffer.depth, np.float64)
    return depth.reshape(gbuffer.layers, *depth.shape[-2:])


def _joined(linear: Doubles, size: Doubles, joins: str) -> Joined:
    """Return which layers of a column are joined with which of the next.

    Args:
        linear: [layers, rows, columns], linear in the column on every plane; NaN where nothing is.
        size: likewise, what misses are relative to.
        joins: one of `JOINS`.

    Returns:
        [layers, layers of the next column, rows, columns - 1].
    """
    here, there = linear[..., :-1], linear[..., 1:]
    layers = range(len(linear))
    joined = np.zeros((len(linear), *here.shape), np.bool_)
    if joins == "always":
        for a in layers:
            joined[a, a] = np.isfinite(here[a]) & np.isfinite(there[a])
        return joined
    ahead = _extrapolated(linear)[..., :-1]
    behind = _extrapolated(linear[..., ::-1])[..., ::-1][..., 1:]
    best_here, best_there = np.full(here.shape, -1), np.full(here.shape, -1)
    least_here, least_there = np.full(here.shape, np.inf), np.full(here.shape, np.inf)
    for a in layers:
        for b in layers if joins == "surface" else (a,):
            over, under = ahead[a] - there[b], here[a] - behind[b]
            miss = np.fmin(np.abs(over) / size[b][..., 1:], np.abs(under) / size[a][..., :-1])
            within = miss <= STEP
            # Lines that meet between the pixels are a crease: one may go on behind the other.
            joined[a, b] = over * under <= 0.0
            for best, least, mine, other in ((best_here, least_here, a, b), (best_there, least_there, b, a)):
                better = within & (miss < least[mine])
                best[mine][better], least[mine][better] = other, miss[better]
    for a in layers:
        for b in layers:
            joined[a, b] |= (best_here[a] == b) & (best_there[b] == a)
    return joined


def _extrapolated(linear: Doubles) -> Doubles:
    """Return what a line through a pixel and the previous column's has in the next column.

    The previous pixel's layer is the nearest; without any, the line is level.
    """
    result = linear.copy()
    here, before = linear[..., 1:], linear[..., :-1]
    gap, nearest = np.full(here.shape, np.inf), here.copy()
    for layer in before:
        distance = np.abs(here - layer)
        closer = distance < gap
        gap = np.where(closer, distance, gap)
        nearest = np.where(closer, layer, nearest)
    result[..., 1:] = 2.0 * here - nearest
    return result


def _triangles(right: Joined, down: Joined, near: Doubles) -> NDArray[np.int32]:
    """Return [triangles, 3] indices into the flattened layers.

    Args:
        right, down: of each pixel and the next in its row and in its column, as of `_joined`.
        near: [layers, rows, columns], the greater the nearer.
    """
    number = np.arange(near.size, dtype=np.int32).reshape(near.shape)
    found = [np.zeros((0, 3), np.int32)]
    for flip_rows, flip_columns in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        flipped = np.s_[..., ::flip_rows, ::flip_columns]
        corner, height = number[flipped], near[flipped]
        across = (right if flip_columns == 1 else right.swapaxes(0, 1))[flipped]
        along = (down if flip_rows == 1 else down.swapaxes(0, 1))[flipped]
        for a, b, c in product(range(len(near)), repeat=3):
            row, column = np.nonzero(across[a, b, :-1] & along[a, c, :, :-1])
            places = ((a, row, column), (b, row, column + 1), (c, row + 1, column))
            # A square that is joined all round is split along the diagonal that is farther, so
            # that a crease along the other one is not filled.
            whole = along[b][:, row, column + 1] & across[c][:, row + 1, column]
            own = height[places[1]] + height[places[2]]
            other = height[places[0]] + height[:, row + 1, column + 1]
            least = own < other if flip_rows == flip_columns else own <= other
            keep = ~(whole & ~least).any(axis=0)
            found.append(np.stack([corner[place][keep] for place in places], axis=-1))
    return np.concatenate(found)
