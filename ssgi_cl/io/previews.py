"""Pictures of a G-buffer's arrays."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ssgi_cl.core.gbuffer import Floats, GBuffer

Picture = NDArray[np.uint8]

MOST_ACROSS = 1800
GAP = 4
"""Pixels of the picture of a whole G-buffer: how wide it is, and between two of its parts."""

VIEWS = ("depth", "normal", "albedo")
"""The arrays of which `gbuffer_views` makes pictures."""


def depth_view(depth: Floats) -> Picture:
    """Return [rows, columns] uint8: white is nearest, dark grey furthest, black nothing."""
    seen = np.isfinite(depth)
    view = np.zeros(depth.shape, np.uint8)
    if seen.any():
        nearness = depth[seen].astype(np.float64)
        # An orthographic camera may have depths of 0 and less.
        nearness = 1.0 / nearness if nearness.min() > 0.0 else -nearness
        least, most = np.percentile(nearness, [0.5, 99.5])
        share = (nearness - least) / max(most - least, 1e-300)
        view[seen] = np.rint(40.0 + 215.0 * np.clip(share, 0.0, 1.0))
    return view


def normal_view(normal: Floats) -> Picture:
    """Return [rows, columns, 3] uint8: -1 is 0 and 1 is 255; mid-grey where nothing is."""
    share = np.clip(normal, -1.0, 1.0) * np.float32(0.5) + np.float32(0.5)
    return _bytes(share * np.float32(255.0))


def share_view(share: Floats) -> Picture:
    """Return [rows, columns] uint8: 0 is black and 1 is white, without gamma."""
    return _bytes(np.clip(share, 0.0, 1.0) * np.float32(255.0))


LEVELS = {32: (255, 255, 255), 16: (255, 255, 255), 8: (90, 90, 255), 4: (0, 210, 210), 2: (0, 210, 0), 1: (255, 70, 0)}
"""Colours of the levels of a `MultiresGrid`, by pixels between points: coarse, finer, finest."""


def levels_view(steps: NDArray[np.int32]) -> Picture:
    """Return [rows, columns, 3] uint8: which level computed a pixel; black: interpolated.

    Args:
        steps: [rows, columns] as `MultiresGrid.computed` returns them.
    """
    view = np.zeros((*steps.shape, 3), np.uint8)
    for step, colour in LEVELS.items():
        view[steps == step] = colour
    return view


def gbuffer_views(gbuffer: GBuffer) -> dict[str, Picture]:
    """Return name -> picture of depth, normal and albedo, without the margin."""
    depth = gbuffer.first("depth")
    views = {"depth": depth_view(gbuffer.inner(depth))} if depth is not None else {}
    normal, albedo = gbuffer.first("normal"), gbuffer.first("albedo")
    if normal is not None:
        views["normal"] = normal_view(gbuffer.inner(normal))
    if albedo is not None:
        # sRGB's curve is close to a power of 2.2, enough for a debug view.
        views["albedo"] = share_view(gbuffer.inner(albedo) ** np.float32(1.0 / 2.2))
    return views


def gbuffer_png(gbuffer: GBuffer) -> bytes:
    """Return the pictures of `gbuffer_views` side by side, at most some `MOST_ACROSS` pixels wide, as PNG."""
    views = list(gbuffer_views(gbuffer).values())
    step = -(-len(views) * views[0].shape[1] // MOST_ACROSS)
    colours = [np.broadcast_to(np.atleast_3d(view), (*view.shape[:2], 3))[::step, ::step] for view in views]
    gap = np.full((len(colours[0]), GAP, 3), 255, np.uint8)
    parts = [part for colour in colours for part in (gap, colour)][1:]
    file = io.BytesIO()
    Image.fromarray(np.concatenate(parts, axis=1)).save(file, format="PNG", compress_level=1)
    return file.getvalue()


def _bytes(values: Floats) -> Picture:
    picture: Picture = np.rint(values).astype(np.uint8)
    return picture
