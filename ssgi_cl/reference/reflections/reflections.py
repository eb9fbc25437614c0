"""Light within the lobes of pixels, in float64: rays on the screen, then environments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.direct.shade import world_surface
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView, view_normals
from ssgi_cl.reference.phong import Lobes

Mask = NDArray[np.bool_]

HALVINGS, NEAREST, ROUNDING = 5, 0.02, 1e-4
SHARP = 1000.0
"""See kernels/reflections/trace.clh and pattern.clh."""
FIRST, SECOND, THIRD = 0.7548776662, 0.5698402910, 0.8191725134
"""Steps of the rays' numbers, see kernels/reflections/reflect_trace.cl."""


@dataclass(frozen=True, eq=False)
class Screen:
    """Surfaces of an image by pixel: u is 1 / depth or, orthographic, -depth; greater is nearer.

    Attributes:
        gbuffer: without margin.
        u: [rows, columns], -inf where nothing is.
        normal: [rows, columns, 3], view space.
        thick: what surfaces are taken to be, scene units.
        reach: how far a ray goes, scene units.
        steps: of a ray, at most.
    """

    gbuffer: GBuffer
    u: Doubles
    normal: Doubles
    thick: float
    reach: float
    steps: int

    @classmethod
    def of(cls, gbuffer: GBuffer, thick: float, reach: float, steps: int) -> Screen:
        """Return that of a G-buffer without margin."""
        depth = np.asarray(gbuffer.first("depth"), np.float64)
        flat = gbuffer.camera.is_orthographic
        there = np.isfinite(depth)
        u = np.where(there, -depth if flat else 1.0 / depth, -np.inf)
        normal = view_normals(SurfaceView.of(gbuffer), gbuffer.first("normal"))
        return cls(gbuffer, u, normal, thick, reach, steps)

    def project(self, points: Doubles) -> tuple[Doubles, Doubles, Doubles]:
        """Return column, row and u of points [..., 3] of view space."""
        camera = self.gbuffer.camera
        sx, sy, ox, oy = camera.pixel_to_view
        depth = -points[..., 2]
        flat = camera.is_orthographic
        k = np.ones_like(depth) if flat else depth
        column, row = (points[..., 0] / k - ox) / sx, (points[..., 1] / k - oy) / sy
        return column, row, -depth if flat else 1.0 / depth

    def behind(self, seen: Doubles) -> Doubles:
        """Return the least u of what lies within the thickness behind a surface."""
        if self.gbuffer.camera.is_orthographic:
            return seen - self.thick
        return seen / (1.0 + np.maximum(seen, 0.0) * self.thick)

    def meet(self, start: Doubles, way: Doubles, jitter: Doubles) -> tuple[Mask, Doubles, Doubles]:
        """Return whether rays meet what is shown, and in which row and column.

        Args:
            start: [n, 3] view space.
            way: [n, 3] of unit length.
            jitter: [n] by how much the first step is shortened.
        """
        depth = -start[:, 2]
        towards = way[:, 2] > 0.0
        limit = depth * (1.0 - NEAREST) / np.where(towards, way[:, 2], 1.0)
        length = np.where(towards, np.minimum(self.reach, limit), self.reach)
        c0, r0, u0 = self.project(start)
        c1, r1, u1 = self.project(start + way * length[:, None])
        rows, columns = self.u.shape
        share = np.ones_like(c0)
        for at, change, size in ((c0, c1 - c0, columns), (r0, r1 - r0, rows)):
            edge = np.where(change > 0.0, size, 0.0)
            along = np.where(np.abs(change) < 1e-20, 1e-20, change)
            share = np.minimum(share, np.maximum((edge - at) / along, 0.0))
        dc, dr, du = (c1 - c0) * share, (r1 - r0) * share, (u1 - u0) * share
        steps = np.clip(np.floor(np.maximum(np.abs(dc), np.abs(dr))) + 1.0, 1.0, self.steps)

        def shown(t: Doubles) -> tuple[Doubles, Doubles, Doubles]:
            column = np.clip(np.trunc(c0 + dc * t), 0, columns - 1).astype(int)
            row = np.clip(np.trunc(r0 + dr * t), 0, rows - 1).astype(int)
            return self.u[row, column], row, column

        def is_behind(u: Doubles, seen: Doubles) -> Mask:
            with np.errstate(invalid="ignore"):
                size = np.abs(seen)
                share = np.maximum(self.gbuffer.camera.tolerance_depth(size), size / 256.0)
                result: Mask = u < seen - ROUNDING * share
            return result & np.isfinite(seen)

        found = np.zeros(len(c0), np.bool_)
        hit_row, hit_column = np.zeros(len(c0)), np.zeros(len(c0))
        going, before = np.ones(len(c0), np.bool_), np.zeros_like(c0)
        for i in range(self.steps):
            t = np.minimum((i + 1.0 - jitter) / steps, 1.0)
            seen, _, _ = shown(t)
            u, last = u0 + du * t, u0 + du * before
            passed = going & is_behind(np.minimum(u, last), seen)
            passed &= np.maximum(u, last) > self.behind(seen)
            low, high = before.copy(), t.copy()
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                there, _, _ = shown(middle)
                behind = is_behind(u0 + du * middle, there)
                low, high = np.where(behind, low, middle), np.where(behind, middle, high)
            there, row, column = shown(high)
            u = u0 + du * high
            met = passed & is_behind(u, there) & (u > self.behind(there))
            hit_row, hit_column = np.where(met, row, hit_row), np.where(met, column, hit_column)
            found |= met
            going &= ~met & (t < 1.0)
            before = t
        return found, hit_row.astype(int), hit_column.astype(int)


def arriving_reference(
    screen: Screen, radiance: Doubles, light: Doubles, sky: Doubles, rays: int
) -> tuple[Doubles, Mask]:
    """Return what arrives within lobes [rows, columns, 3] where nothing is but what is shown.

    Args:
        screen: see there.
        radiance: [rows, columns, 3] without lobes.
        light: [rows, columns, 3] irradiance over pi.
        sky: [3] radiance of an environment that is the same all round.
        rays: of a pixel.

    Returns:
        What arrives, and where any ray of a pixel meets something.
    """
    gbuffer = screen.gbuffer
    position, normal, there = world_surface(gbuffer)
    lobes = Lobes.of(gbuffer, position, normal)
    turn, shift = gbuffer.camera.view[:3, :3], gbuffer.camera.view[:3, 3]
    glossy = there & (lobes.specular > 0.0).any(axis=-1)
    row, column = np.nonzero(glossy)
    axis, n = lobes.axis[glossy] @ turn.T, normal[glossy] @ turn.T
    gloss = lobes.gloss[glossy]
    sx, sy, _, _ = gbuffer.camera.pixel_to_view
    at = position[glossy] @ turn.T + shift
    k = 1.0 if gbuffer.camera.is_orthographic else -at[:, 2:]
    start = at + n * k * max(abs(sx), abs(sy))
    total = np.zeros((len(row), 3))
    meets = np.zeros(len(row), np.bool_)
    square = np.where(gloss < SHARP, (column >> 2 & 3) + 4 * (row >> 2 & 3), 0)
    tile = (column & 3) + 4 * (row & 3) + 16 * square
    spread = np.where(glossy[..., None], lobes.specular * lobes.above[..., None], 0.0)
    for ray in range(rays):
        number = tile * rays + ray + 0.5
        way = _directions(axis, gloss, number * FIRST % 1.0, number * SECOND % 1.0)
        above = np.sum(way * n, axis=-1) > 0.0
        found, hit_row, hit_column = screen.meet(start, way, number * THIRD % 1.0)
        found &= np.sum(screen.normal[hit_row, hit_column] * way, axis=-1) < 0.0
        met = radiance[hit_row, hit_column]
        met = met + spread[hit_row, hit_column] * light[hit_row, hit_column]
        total += np.where(above[:, None], np.where(found[:, None], met, sky), 0.0)
        meets |= found & above
    result, any_hit = np.zeros(position.shape), np.zeros(there.shape, np.bool_)
    result[glossy], any_hit[glossy] = total / rays, meets
    return result, any_hit


def _directions(axis: Doubles, gloss: Doubles, u: Doubles, v: Doubles) -> Doubles:
    """Return directions [n, 3] distributed as lobes round their axes [n, 3]."""
    cosine = (1.0 - u) ** (1.0 / (gloss + 1.0))
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    x, y, z = axis.T
    sign = np.where(z < 0.0, -1.0, 1.0)
    p = -1.0 / (sign + z)
    q = x * y * p
    first = np.stack([1.0 + sign * x * x * p, sign * q, -sign * x], axis=-1)
    second = np.stack([q, sign + y * y * p, -y], axis=-1)
    a, b = np.cos(2.0 * np.pi * v) * sine, np.sin(2.0 * np.pi * v) * sine
    result: Doubles = a[:, None] * first + b[:, None] * second + cosine[:, None] * axis
    return result


def added_reference(gbuffer: GBuffer, arriving: Doubles) -> Doubles:
    """Return what the lobes of a G-buffer without margin add to radiance, [rows, columns, 3].

    A pixel takes the mean of 5 x 5 pixels of its own surface, of which those at the sides count
    half, and then of such means 4 pixels apart unless its lobe is sharp.
    """
    position, normal, there = world_surface(gbuffer)
    lobes = Lobes.of(gbuffer, position, normal)
    glossy = there & (lobes.specular > 0.0).any(axis=-1)
    near = np.where(glossy[..., None], _mean(gbuffer, lobes, arriving, 1), 0.0)
    far = _mean(gbuffer, lobes, near, 4)
    mean = np.where((lobes.gloss < SHARP)[..., None], far, near)
    result: Doubles = np.where(there[..., None], lobes.specular * mean, 0.0)
    return result


def _mean(gbuffer: GBuffer, lobes: Lobes, arriving: Doubles, stride: int) -> Doubles:
    """Return the mean of 5 x 5 pixels of the same surface, so many pixels apart."""
    view = SurfaceView.of(gbuffer)
    camera = gbuffer.camera
    depth = np.asarray(gbuffer.first("depth"), np.float64)
    flat = camera.is_orthographic
    depth = np.where(np.isfinite(depth), depth, 1e30)
    u = depth if flat else 1.0 / depth
    rows, columns = depth.shape
    n = view_normals(view, gbuffer.first("normal"))
    sx, sy, ox, oy = camera.pixel_to_view
    column, row = np.arange(columns) + 0.5, (np.arange(rows) + 0.5)[:, None]
    slope_x, slope_y = (0.0, 0.0) if flat else (column * sx + ox, row * sy + oy)
    least = -0.0017 - 0.00085 * (slope_x**2 + slope_y**2)
    slope = np.minimum(n[..., 0] * slope_x + n[..., 1] * slope_y - n[..., 2], least)
    change = -1.0 / slope if flat else u / slope
    gloss = lobes.gloss
    total, weights = np.zeros_like(arriving), np.zeros(depth.shape)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            y, x = np.arange(rows)[:, None] + stride * dy, np.arange(columns) + stride * dx
            inside = (y >= 0) & (y < rows) & (x >= 0) & (x < columns)
            at = np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)
            plane = u + change * (stride * (n[..., 0] * sx * dx + n[..., 1] * sy * dy))
            off = (50.0 * (u[at] - plane) / np.abs(u)) ** 2
            turned = 20.0 * (1.0 - np.sum(n * n[at], axis=-1))
            fit = np.maximum(1.0 - off - turned, 0.0)
            given = np.asarray(gbuffer.first("gloss"), np.float64)[at]
            alike = inside & (np.abs(given - gloss) < 0.02 * gloss)
            share = (0.5 if abs(dx) == 2 else 1.0) * (0.5 if abs(dy) == 2 else 1.0)
            weight = np.ones(depth.shape) if dx == dy == 0 else np.where(alike, fit * share, 0.0)
            total += weight[..., None] * arriving[at]
            weights += weight
    result: Doubles = total / weights[..., None]
    return result
