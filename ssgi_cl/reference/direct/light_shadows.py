"""Screen-space shadows of lights in float64, as defined in `techniques.direct.light_shadows`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.reference.direct.shade import PunctualLight, direct_reference
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.patterns import tile_disk

if TYPE_CHECKING:
    from ssgi_cl.techniques.direct.light_shadows import LightShadowParams

DEPTH_BIAS = 2e-6
"""Height of a surface that counts as none, relative to depth: 34 * 2^-24."""
ONSET = 0.02  # radii
NEAREST_TAP = 1.3  # px
NEAREST_END = 0.01
"""A way that comes nearer to the eye than this share of the receiver's depth ends there."""


def light_shadows_reference(gbuffer: GBuffer, lights: Sequence[Light], params: LightShadowParams) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 of all lights, none with a shadow map."""
    view = SurfaceView.of(gbuffer)
    depth = np.asarray(gbuffer.depth, np.float64)
    layers = depth if depth.ndim == 3 else depth[None]
    row, column = (view.inner(centre) for centre in view.centres())
    own = view.inner(view.depth)
    there = np.isfinite(own)
    position = view.position(row, column, np.where(there, own, 1.0))
    normal = view.inner(view.normal)
    turn, shift = gbuffer.camera.view[:3, :3], gbuffer.camera.view[:3, 3]
    total = np.zeros((*gbuffer.size, 3))
    for light in lights:
        if isinstance(light, Environment):
            continue
        direct = direct_reference(light, (position - shift) @ turn, normal @ turn)
        shadow = _shadow(view, layers, gbuffer.first("thickness"), position, normal, light, params)
        total += direct * (1.0 - shadow)[..., None]
    return np.where(there[..., None], total, 0.0)


def _ways(view: SurfaceView, position: Doubles, light: PunctualLight, radius: float) -> Doubles:
    """Return [..., 3] from each receiver to a point of the light's disc, at most the radius far."""
    turn, shift = view.camera.view[:3, :3], view.camera.view[:3, 3]
    if isinstance(light, DirectionalLight):
        towards = np.broadcast_to(-turn @ np.asarray(light.direction), position.shape)
        distance, reach = np.ones(position.shape[:-1]), np.full(position.shape[:-1], radius)
        extent = np.tan(light.angle)
    else:
        towards = turn @ np.asarray(light.position) + shift - position
        distance = np.maximum(np.linalg.norm(towards, axis=-1), 1e-18)
        towards = towards / distance[..., None]
        reach, extent = np.minimum(radius / distance, 1.0), light.radius
    x, y, z = np.moveaxis(towards, -1, 0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    east = np.stack([1.0 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1)
    north = np.stack([x * y * a, sign + y * y * a, -y], axis=-1)
    rows, columns = np.indices(position.shape[:2])
    points = tile_disk()[0][rows % 4, columns % 4] * extent
    way = towards * distance[..., None] + points[..., :1] * east + points[..., 1:] * north
    scaled: Doubles = way * reach[..., None]
    return scaled


def _shadow(
    view: SurfaceView,
    layers: Doubles,
    given: NDArray[np.float32] | None,
    position: Doubles,
    normal: Doubles,
    light: PunctualLight,
    params: LightShadowParams,
) -> Doubles:
    """Return the occluded share of a light, [rows, columns] in [0, 1]."""
    way = _ways(view, position, light, params.radius)
    depth = -position[..., 2]
    towards_eye = np.maximum(way[..., 2], (1.0 - NEAREST_END) * depth)
    end = position + way * np.minimum((1.0 - NEAREST_END) * depth / towards_eye, 1.0)[..., None]
    own_row, own_column = (view.inner(centre) for centre in view.centres())
    to_row, to_column = view.pixel(end)
    dy, dx = to_row - own_row, to_column - own_column
    square = np.maximum(dx * dx + dy * dy, 1e-12)
    nearest = NEAREST_TAP / np.sqrt(square)
    rows, columns = view.depth.shape
    most = np.minimum(1.0, np.minimum(_inside(own_column, dx, columns), _inside(own_row, dy, rows)))
    span = (most - nearest) / params.taps
    tile_row, tile_column = np.indices(depth.shape)
    jitter = tile_disk()[1][tile_row % 4, tile_column % 4]
    start, change = view.flatness(depth), view.flatness(-end[..., 2]) - view.flatness(depth)
    floor = params.bias * params.radius + DEPTH_BIAS * depth
    shadow = np.zeros(depth.shape)
    for tap in range(params.taps):
        part = nearest + span * (jitter + tap)
        column = np.clip(np.trunc(own_column + part * dx), 0, columns - 1).astype(int)
        row = np.clip(np.trunc(own_row + part * dy), 0, rows - 1).astype(int)
        passed = ((column + 0.5 - own_column) * dx + (row + 0.5 - own_row) * dy) / square
        flat = start + np.clip(passed, 0.0, 1.0) * change
        at = flat if view.camera.is_orthographic else 1.0 / flat
        for number, layer in enumerate(layers):
            deeper = layers[number + 1][row, column] if number + 1 < len(layers) else np.inf
            seen = layer[row, column]
            thick: float | Doubles = params.thickness * params.radius
            if given is not None and number == 0:
                own = given[row, column].astype(np.float64)
                thick = np.where(own < 0.0, thick, own)
            back = np.minimum(seen + thick, deeper)
            within = (span > 0.0) & (at > seen) & (at < back)
            front = np.where(within, seen, depth)
            surface = view.position(row + 0.5, column + 0.5, front)
            above = np.sum((surface - position) * normal, axis=-1) - floor
            share = np.minimum(at - front, above) / (ONSET * params.radius)
            shadow = np.maximum(shadow, np.where(within, np.clip(share, 0.0, 1.0), 0.0))
    return shadow


def _inside(at: Doubles, change: Doubles, size: int) -> NDArray[np.float64]:
    """Return the part of the way up to the border of the arrays."""
    border = np.where(change > 0.0, size, 0.0)
    result: Doubles = (border - at) / np.copysign(np.maximum(np.abs(change), 1e-6), change)
    return result
