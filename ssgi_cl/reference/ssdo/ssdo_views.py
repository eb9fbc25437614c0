"""Numpy reference of auxiliary cameras of SSDO in float64, see `ssgi_cl.techniques.ssdo.ssdo_views`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.patterns import slice_pattern
from ssgi_cl.reference.ssdo.ssdo_points import NEAREST, Receivers, layers_of, pixel_of, receivers, transform

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.slices import SliceParams
    from ssgi_cl.techniques.ssdo.ssdo_views import ViewsParams

DEPTH_BIAS = 4e-6
"""Bias relative to depth: roundings of float32 positions in two view spaces, 2^-24 each."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
BEFORE = 2.0
"""Distance before the receiver, in pixels, at which the distances of taps begin to grow."""
FINEST = 2.0**-10
"""Least width of a pixel, in radii."""
LEAST_N_DOT_V = 0.05
"""Cosine between normal and view ray that a grazing or averted normal is taken to have."""
ALIKE = 0.5
"""Least cosine between the normals of one surface."""


@dataclass(frozen=True, eq=False)
class Added:
    """Contribution of an auxiliary camera.

    Attributes:
        hidden: [rows, columns] decrease of A.
        bounce: [rows, columns, 3] irradiance, W/m^2.
        masks: [2 slices, rows, columns] uint32, a bit for each covered sector, old and new, and
            for each of them whose sender is still unknown.
    """

    hidden: Doubles
    bounce: Doubles
    masks: NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class _Other:
    """The auxiliary camera's image, and the receivers in its view space."""

    view: SurfaceView
    depth: Doubles  # [layers, rows, columns]
    normal: Doubles  # [layers that have normals, rows, columns, 3]
    radiance: Doubles
    at: Receivers
    pixel: Doubles  # width of one at the receivers


def ssdo_views_reference(
    gbuffer: GBuffer,
    masks: NDArray[np.uint32],
    other: GBuffer,
    radiance: NDArray[np.float64],
    slices: SliceParams,
    params: ViewsParams,
    *,
    step: int = 1,
    unseen: Doubles | None = None,
) -> Added:
    """Return the contribution of an auxiliary camera to the bitmask of every `step`-th pixel.

    Args:
        gbuffer: what the first camera sees.
        masks: [2 slices, rows, columns], a bit for each sector that is covered so far, and for
            each of them whose sender is unknown.
        other: what the auxiliary camera sees.
        radiance: [layers that send, rows, columns, 3] of it, with margin.
        slices: the parameters of the bitmask.
        params: see `ViewsParams`.
        step: 1, 2 or 4.
        unseen: [layers, rows, columns] depth of `other`, +inf where earlier views show its
            surfaces (see `unseen_reference`); None if there are no earlier views.
    """
    view = SurfaceView.of(gbuffer)
    view = view.reduced(step) if step > 1 else view
    row, column = (view.inner(centre) for centre in view.centres())
    at = receivers(view, slices.radius, slices.max_radius_px / step)
    turn, shift = transform(gbuffer, other)
    seen = replace(at, position=at.position @ turn.T + shift, normal=at.normal @ turn.T)
    further = _other(other, unseen, radiance, seen, -at.position[..., 2], slices.radius, params)
    shape = at.there.shape
    tile_row, tile_column = np.indices(shape)
    made = slice_pattern(slices)
    eye = _to_eye(view, row, column)
    hidden, total = np.zeros(shape), np.full(shape, 1e-30)
    bounce, result = np.zeros((*shape, 3)), masks.copy()
    for s in range(slices.slices):
        angle = made.angle[tile_row % 4, tile_column % 4, s]
        dither = made.dither[tile_row % 4, tile_column % 4, s]
        slice_ = _Slice(view, eye, angle, at.normal)
        total += slice_.share
        start, first = np.zeros(shape, int), np.zeros(shape)
        for j in range(params.strata):
            low, high = (2.0 * n / params.strata - 1.0 for n in (j, j + 1))
            end = slice_.sector(high) if j + 1 < params.strata else np.full(shape, 32.0)
            stop = np.clip(end + dither, 0.0, 32.0).astype(int)
            stop = stop if j + 1 < params.strata else np.full(shape, 32)
            number = np.arange(32)
            free = (number >= start[..., None]) & (number < stop[..., None])
            known = masks[s] & ~masks[slices.slices + s]
            free &= (known[..., None] >> number.astype(np.uint32)) & 1 == 0
            free &= at.active[..., None]
            offset = np.mod(7.0 * dither + np.float32(s * params.strata + j) * GOLDEN, 1.0)
            place = np.minimum(start + (offset * (stop - start)).astype(int), 31)
            later = free & (number >= place[..., None])
            later = np.where(later.any(axis=-1, keepdims=True), later, free)
            chosen = np.argmax(later, axis=-1)
            part = (chosen + 0.5 - dither - first) / np.maximum(end - first, 1e-3)
            sine = low + np.clip(part, 0.0, 1.0) * (high - low)
            way = slice_.direction(eye, sine) @ turn.T
            open_ = np.any(free, axis=-1)
            hit, light = _march(further, way, open_, offset, slices.radius, params)
            count = free.sum(axis=-1)
            fresh = free & ((masks[s][..., None] >> number.astype(np.uint32)) & 1 == 0)
            hidden += np.where(hit, slice_.share * fresh.sum(axis=-1) / 32.0, 0.0)
            bounce += (slice_.share * count / 32.0)[..., None] * light
            bits = np.sum(free.astype(np.uint64) << number.astype(np.uint64), axis=-1)
            found = np.where(hit, bits, 0).astype(np.uint32)
            result[s] |= found
            result[slices.slices + s] &= ~found
            start, first = stop, end
    return Added(hidden / total, math.pi * bounce / total[..., None], result)


class _Slice:
    """Slice of each receiver, and the cosine-weighted measure of its directions."""

    def __init__(self, view: SurfaceView, eye: Doubles, angle: Doubles, normal: Doubles) -> None:
        to_x, to_y, _, _ = view.camera.pixel_to_view
        # One pixel along the slice.
        pixel = np.stack(
            [np.cos(angle) * to_x * view.step, np.sin(angle) * to_y * view.step, np.zeros(angle.shape)], axis=-1
        )
        across = pixel - np.sum(pixel * eye, axis=-1, keepdims=True) * eye
        self.across = across / np.linalg.norm(across, axis=-1, keepdims=True)
        n_dot_v = np.maximum(np.sum(normal * eye, axis=-1), LEAST_N_DOT_V)
        side = np.sum(normal * self.across, axis=-1)
        projected = np.hypot(n_dot_v, side)
        self.cosine, self.sine = n_dot_v / projected, side / projected
        self.first = self._measure(self.sine, -self.cosine)
        whole = self._measure(-self.sine, self.cosine) - self.first
        self.scale = 32.0 / whole
        # Squared sine of the angle between pixel and view ray, per squared depth.
        width = np.sum(across**2, axis=-1) / eye[..., 2] ** 2
        self.share = (to_x * view.step) ** 2 / width * projected * whole

    def _measure(self, cosine: Doubles, sine: Doubles) -> Doubles:
        """Return the measure from the view ray to a direction at an angle of this cosine and sine."""
        flat = np.abs(sine)
        turned = np.arccos(np.clip(cosine, -1.0, 1.0)) - flat * cosine
        result: Doubles = 0.5 * (self.cosine * flat * sine + self.sine * turned)
        return result

    def _turned(self, sine: Doubles | float) -> tuple[Doubles, Doubles]:
        """Return cosine and sine to the view ray of a direction with a sine to the normal."""
        cosine = np.sqrt(np.maximum(1.0 - np.asarray(sine) ** 2, 0.0))
        return self.cosine * cosine - self.sine * sine, self.cosine * sine + self.sine * cosine

    def sector(self, sine: float) -> Doubles:
        """Return the sector, not rounded, of a direction with a sine to the normal."""
        result: Doubles = (self._measure(*self._turned(sine)) - self.first) * self.scale
        return result

    def direction(self, eye: Doubles, sine: Doubles) -> Doubles:
        """Return the direction [..., 3] with a sine to the normal, view space."""
        cosine, sine = self._turned(sine)
        result: Doubles = cosine[..., None] * eye + sine[..., None] * self.across
        return result


def _to_eye(view: SurfaceView, row: Doubles, column: Doubles) -> Doubles:
    """Return the direction to the eye [rows, columns, 3], unit length."""
    if view.camera.is_orthographic:
        return np.broadcast_to([0.0, 0.0, 1.0], (*row.shape, 3))
    view_ray = view.position(row, column, np.ones(row.shape))
    eye: Doubles = -view_ray / np.linalg.norm(view_ray, axis=-1, keepdims=True)
    return eye


def _other(
    other: GBuffer,
    unseen: Doubles | None,
    radiance: NDArray[np.float64],
    seen: Receivers,
    depth: Doubles,
    reach: float,
    params: ViewsParams,
) -> _Other:
    """Return the auxiliary camera's image; `seen` are the receivers, `depth` to the first camera."""
    views = layers_of(other)
    normals = len(views) if np.asarray(other.normal).ndim == 4 else 1
    to_x, to_y, _, _ = other.camera.pixel_to_view
    ahead = 1.0 if other.camera.is_orthographic else np.maximum(-seen.position[..., 2], NEAREST * reach)
    pixel = np.maximum(FINEST * seen.radius, max(abs(to_x), abs(to_y)) * ahead)
    return _Other(
        view=views[0],
        depth=np.stack([view.depth for view in views]) if unseen is None else unseen,
        normal=np.stack([view.normal for view in views[:normals]]),
        radiance=np.asarray(radiance, np.float64),
        at=replace(seen, floor=params.bias * pixel + DEPTH_BIAS * depth),
        pixel=pixel,
    )


def _march(
    other: _Other, way: Doubles, open_: NDArray[np.bool_], offset: Doubles, reach: float, params: ViewsParams
) -> tuple[NDArray[np.bool_], Doubles]:
    """Return where directions meet a surface, and its radiance."""
    met, light = np.zeros(open_.shape, bool), np.zeros((*open_.shape, 3))
    apart = BEFORE * other.pixel
    growth = (1.0 + other.at.radius / apart) ** (1.0 / params.taps)
    near = np.zeros(open_.shape)
    for tap in range(params.taps):
        grown = apart * growth ** (tap + offset)
        far = grown * np.sqrt(growth) - apart if tap + 1 < params.taps else other.at.radius
        point = other.at.position + (grown - apart)[..., None] * way
        inside, row, column = pixel_of(other.view, point, NEAREST * reach)
        centre = row.astype(np.float64) + 0.5, column.astype(np.float64) + 0.5
        nearest, sent = np.full(open_.shape, np.inf), np.zeros((*open_.shape, 3))
        for layer, depth in enumerate(other.depth):
            front = depth[row, column]
            there = open_ & ~met & inside & np.isfinite(front)
            surface = other.view.position(*centre, np.where(there, front, 1.0))
            height = np.sum((surface - other.at.position) * other.at.normal, axis=-1)
            facing = np.array([0.0, 0.0, 1.0])
            if layer < len(other.normal):
                facing = other.normal[layer, row, column]
            # Where the ray meets the tap's tangent plane.
            away = np.sum((surface - other.at.position) * facing, axis=-1)
            speed = np.sum(way * facing, axis=-1)
            crosses = there & (height > other.at.floor) & (speed != 0.0)
            distance = away / np.where(crosses, speed, 1.0)
            hit = crosses & (distance >= near) & (distance < far) & (distance < nearest)
            nearest = np.where(hit, distance, nearest)
            lit = np.zeros_like(sent)
            if layer < len(other.radiance):
                lit = np.where((away < 0.0)[..., None], other.radiance[layer, row, column], 0.0)
            sent = np.where(hit[..., None], lit, sent)
        hit = np.isfinite(nearest)
        light += np.where(hit[..., None], sent, 0.0)
        met |= hit
        near = far
    return met, light


def unseen_reference(other: GBuffer, earlier: Sequence[GBuffer], nearest: float) -> Doubles:
    """Return the depth [layers, rows, columns] of `other`, +inf where an earlier view shows it.

    Args:
        other: an auxiliary view, all of whose layers have normals.
        earlier: the views before it, likewise.
        nearest: least depth at which a camera shows a point, scene units.
    """
    depth = np.array(other.depth, np.float64).reshape(-1, *np.shape(other.depth)[-2:])
    for layer, view in enumerate(layers_of(other)):
        there = np.isfinite(depth[layer])
        position = view.position(*view.centres(), np.where(there, depth[layer], 1.0))
        normal = view.normal
        for each in earlier:
            turn, shift = transform(other, each)
            shown = _shown(each, position @ turn.T + shift, normal @ turn.T, nearest)
            depth[layer] = np.where(there & shown, np.inf, depth[layer])
    return depth


def _shown(earlier: GBuffer, point: Doubles, normal: Doubles, nearest: float) -> Doubles:
    """Return where a view shows points [rows, columns, 3] of its own view space."""
    views = layers_of(earlier)
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
