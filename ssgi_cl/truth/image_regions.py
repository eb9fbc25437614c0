"""Regions of an image by what it shows: where errors tend to sit, and where blotches can be told from edges.

Masks are [rows, columns], of the first layer of a G-buffer without its margin.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer

Doubles = NDArray[np.float64]
Mask = NDArray[np.bool_]

REGIONS = ("border", "thin", "silhouettes", "creases", "elsewhere")
"""Regions of an image, in the order in which they claim a pixel."""

STEP = 0.02
"""A silhouette: each of two neighbours is off the other's tangent plane by this share of depth (orthographic: of the
view's height)."""
CREASE_ANGLE = math.radians(25.0)
"""A crease: normals of neighbours on one surface turn by more than this, radians."""
REACH = 3
"""Pixels round a silhouette or crease that belong to it: error reaches that far, at least."""
BORDER = 0.05
"""Share of the shorter side of the image that its border takes on every side."""
THIN = 5
"""Columns or rows that a thin part covers, at most."""
MATERIAL_STEP = 0.25
"""An edge of materials: a reflectance, exponent or emission of neighbours differs by more than this share of the
larger one."""
LEAST = 400
"""Pixels of a smooth surface, at least: those of a square as wide as the Gaussian of mottling."""


def smooth_surfaces(gbuffer: GBuffer) -> Mask:
    """Return where blotches can be told from edges, [rows, columns].

    Those are surfaces without a silhouette, a crease (see `regions`) or an edge of materials within
    3 pixels, of at least 400 pixels that share sides. A material's edge: albedo, specular, gloss or
    emission of two neighbours differ by more than 25 % of the larger one.

    Args:
        gbuffer: its first layer; normals that it lacks are taken from its depth.
    """
    depth = inner_array(gbuffer, "depth").astype(np.float64)
    away, _, _, turned = _edges(gbuffer, depth, *_normals(gbuffer, depth))
    found = np.isfinite(depth) & ~_grown(away | turned | _material_edges(gbuffer), REACH)
    for region, own in connected(found):
        if own.sum() < LEAST:
            found[region] &= ~own
    return found


def regions(gbuffer: GBuffer) -> dict[str, Mask]:
    """Return where errors of screen-space methods tend to sit, each a mask [rows, columns].

    Every pixel that shows a surface is in exactly one of `REGIONS`; one that would fit several is
    in the first:

    - border: within 5 % of the image's shorter side from its edge, at least 1 pixel;
    - thin: what a row or column of the image crosses in at most 5 pixels between a silhouette on
      which it is the nearer side and another one;
    - silhouettes: within 3 pixels of two neighbours of which each lies off the other's tangent
      plane by more than 2 % of the smaller depth, or one shows nothing;
    - creases: within 3 pixels of two other neighbours whose normals, turned to the viewer, differ
      by more than 25 degrees;
    - elsewhere.

    Args:
        gbuffer: its first layer; normals that it lacks are taken from its depth.
    """
    depth = inner_array(gbuffer, "depth").astype(np.float64)
    seen = np.isfinite(depth)
    normal, known = _normals(gbuffer, depth)
    away, nearer, farther, turned = _edges(gbuffer, depth, normal, known)
    rows, columns = depth.shape
    margin = max(1, math.ceil(BORDER * min(rows, columns)))
    border = np.ones_like(seen)
    border[margin : rows - margin, margin : columns - margin] = False
    thin = np.zeros_like(seen)
    for axis in (0, 1):
        thin |= _between(farther[axis], nearer[axis], axis)
    claims = {
        "border": border,
        "thin": thin,
        "silhouettes": _grown(away, REACH),
        "creases": _grown(turned, REACH),
        "elsewhere": np.ones_like(seen),
    }
    free = seen.copy()
    result = {}
    for name, claim in claims.items():
        result[name] = claim & free
        free &= ~claim
    return result


def connected(mask: Mask) -> Iterator[tuple[tuple[slice, slice], Mask]]:
    """Give the box round each set of pixels that share sides, and where it is in its box."""
    from scipy import ndimage  # takes a fifth of a second, which other commands do without

    labels, _ = ndimage.label(mask)
    for number, region in enumerate(ndimage.find_objects(labels), start=1):
        yield region, labels[region] == number


def inner_array(gbuffer: GBuffer, name: str) -> NDArray[np.float32]:
    """Return an array of the first layer without the margin; ValueError if there is none."""
    array = gbuffer.first(name)
    if array is None:
        raise ValueError(f"gbuffer has no {name}")
    return gbuffer.inner(array)


def _normals(gbuffer: GBuffer, depth: Doubles) -> tuple[Doubles, Mask]:
    """Return normals [rows, columns, 3] that face the viewer, and where they are known.

    Without any, the cross product of the differences of position to the neighbour that is nearer
    in depth, on both axes.
    """
    # View rays and positions in view space, whose origin is near.
    position = _positions(gbuffer, depth)
    if gbuffer.normal is not None:
        world = inner_array(gbuffer, "normal").astype(np.float64)
        normal = world @ gbuffer.camera.view[:3, :3].T
    else:
        normal = np.cross(_slope(position, 0), _slope(position, 1))
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    known = np.isfinite(depth) & (length[..., 0] > 0.0) & np.isfinite(length[..., 0])
    normal = np.where(known[..., None], normal / np.where(known[..., None], length, 1.0), 0.0)
    view_ray = np.array([0.0, 0.0, -1.0]) if gbuffer.camera.is_orthographic else position
    n_dot_v = np.sum(np.where(known[..., None], normal * view_ray, 0.0), axis=-1)
    return np.where(n_dot_v[..., None] > 0.0, -normal, normal), known


def _positions(gbuffer: GBuffer, depth: Doubles) -> Doubles:
    """Return positions [rows, columns, 3] in view space; 0 where nothing is."""
    camera = gbuffer.camera
    sx, sy, ox, oy = camera.pixel_to_view
    deep = np.where(np.isfinite(depth), depth, 0.0)
    k = np.ones_like(deep) if camera.is_orthographic else deep
    x = (sx * (np.arange(camera.width) + 0.5) + ox) * k
    y = (sy * (np.arange(camera.height) + 0.5) + oy)[:, None] * k
    position: Doubles = np.stack([x, y, -deep], axis=-1)
    position[~np.isfinite(depth)] = 0.0
    return position


def _slope(position: Doubles, axis: int) -> Doubles:
    """Return the difference to the neighbour before or after, whichever is closer in depth."""
    size = position.shape[axis]
    if size < 2:
        return np.zeros_like(position)
    step = np.diff(position, axis=axis)
    nothing = position[..., 2] == 0.0
    ends = [np.take(nothing, np.arange(i, size - 1 + i), axis=axis) for i in (0, 1)]
    step[ends[0] | ends[1]] = np.inf
    rim = np.full_like(np.take(step, [0], axis=axis), np.inf)
    before = np.concatenate([rim, step], axis=axis)
    after = np.concatenate([step, rim], axis=axis)
    closer = np.abs(before[..., 2:]) < np.abs(after[..., 2:])
    chosen = np.where(closer, before, after)
    return np.where(np.isfinite(chosen), chosen, 0.0)


def _edges(gbuffer: GBuffer, depth: Doubles, normal: Doubles, known: Mask) -> tuple[Mask, list[Mask], list[Mask], Mask]:
    """Compare neighbours.

    Returns:
        Where a pixel is next to a silhouette; for each axis whether the step to the next pixel
        leads to something farther, [size - 1 along the axis], or nearer, as (nearer, farther)
        lists; where a pixel is next to a crease.
    """
    position = _positions(gbuffer, depth)
    seen = np.isfinite(depth)
    away, turned = np.zeros_like(seen), np.zeros_like(seen)
    nearer, farther = [], []
    for axis in (0, 1):
        size = depth.shape[axis]
        one = tuple(slice(0, size - 1) if a == axis else slice(None) for a in (0, 1))
        two = tuple(slice(1, size) if a == axis else slice(None) for a in (0, 1))
        step = position[two] - position[one]
        least = np.minimum(depth[one], depth[two])
        off = np.minimum(
            *(np.where(known[side], np.abs(np.sum(step * normal[side], axis=-1)), np.inf) for side in (one, two))
        )
        both = seen[one] & seen[two]
        # Off both tangent planes: a crease lies off one of them by less than the step in depth.
        apart = both & (off > STEP * gbuffer.camera.tolerance_depth(np.where(both, least, 1.0)))
        edge = apart | (seen[one] != seen[two])
        with np.errstate(invalid="ignore"):
            farther.append(edge & (depth[two] > depth[one]))
            nearer.append(edge & (depth[two] < depth[one]))
        bend = np.sum(normal[one] * normal[two], axis=-1) < math.cos(CREASE_ANGLE)
        bend &= both & ~edge & known[one] & known[two]
        for mask, found in ((away, edge), (turned, bend)):
            mask[one] |= found
            mask[two] |= found
    return away, nearer, farther, turned


def _between(farther: Mask, nearer: Mask, axis: int) -> Mask:
    """Return the pixels between a step nearer and, within `THIN` pixels, a step farther."""
    shape = list(farther.shape)
    shape[axis] += 1
    entered, left = np.moveaxis(nearer, axis, 0), np.moveaxis(farther, axis, 0)
    found = np.moveaxis(np.zeros(shape, np.bool_), axis, 0)
    size = len(found)
    for width in range(1, THIN + 1):
        # Pixels i + 1 to i + width: step i enters, step i + width leaves.
        count = size - 1 - width
        if count <= 0:
            break
        here = entered[:count] & left[width : width + count]
        for k in range(width):
            found[1 + k : 1 + k + count] |= here
    return np.moveaxis(found, 0, axis)


def _material_edges(gbuffer: GBuffer) -> Mask:
    """Return where a pixel is next to one of another material."""
    found = np.zeros(gbuffer.size, np.bool_)
    for name in ("albedo", "specular", "gloss", "emission"):
        if getattr(gbuffer, name) is None:
            continue
        values = np.nan_to_num(inner_array(gbuffer, name).astype(np.float64))
        values = values.reshape(*values.shape[:2], -1)
        for axis in (0, 1):
            one, two = (np.moveaxis(values, axis, 0)[part] for part in (slice(None, -1), slice(1, None)))
            apart = np.any(np.abs(one - two) > MATERIAL_STEP * np.maximum(np.abs(one), np.abs(two)), axis=-1)
            along = np.moveaxis(found, axis, 0)
            along[:-1] |= apart
            along[1:] |= apart
    return found


def _grown(mask: Mask, reach: int) -> Mask:
    """Return the mask with all pixels within `reach` rows and columns of it."""
    from scipy.ndimage import binary_dilation  # takes a fifth of a second, which other commands do without

    side = 2 * reach + 1
    grown: Mask = binary_dilation(mask, np.ones((side, side), np.bool_))
    return grown
