"""The scan in slices that HBAO, GTAO and the visibility bitmask share, in float64."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.bilateral import bilateral_reference
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.upsample import upsample_reference
from ssgi_cl.techniques.bilateral import BilateralParams
from ssgi_cl.techniques.occlusion import RESOLUTIONS
from ssgi_cl.techniques.slices import (
    DEPTH_BIAS,
    LEAST_FACING,
    NEAREST_TAP,
    TILE,
    SliceParams,
    pattern,
)


@dataclass(frozen=True, eq=False)
class Tap:
    """What one tap sees in one depth layer, on one side of a slice; arrays [rows, columns].

    Attributes:
        counts: whether a surface is there, within the radius and above the tangent plane.
        cot: cotangent of the angle between the line of sight and the surface.
        back: the same of a point `thickness` further along the tap's own line of sight.
        distance: from the receiver, in radii.
        depth: behind the receiver, in radii.
    """

    counts: NDArray[np.bool_]
    cot: Doubles
    back: Doubles
    distance: Doubles
    depth: Doubles


@dataclass(frozen=True, eq=False)
class Slice:
    """A plane through the line of sight; arrays [rows, columns].

    Attributes:
        edge: cotangent of the tangent plane's angle from the line of sight on the first side;
            on the second it is -edge.
        cos_normal, sin_normal: of the projected normal's angle from the line of sight, towards
            the first side.
        length: of the normal's projection into the plane.
        weight: azimuth that the slice stands for, relative to the others.
        dither: of each pixel, in [0, 1).
        offset: (columns, rows) of each tap, whole numbers of pixels on the first side.
    """

    edge: Doubles
    cos_normal: Doubles
    sin_normal: Doubles
    length: Doubles
    weight: Doubles
    dither: Doubles
    offset: list[tuple[Doubles, Doubles]]


class Scan:
    """All pixels of a view as receivers of light.

    Args:
        view: what is seen in front.
        depths: [layers, rows, columns] of all layers, margin included, of the view's size.
        params: see `SliceParams`.
        thickness: of surfaces, scene units.
    """

    def __init__(
        self, view: SurfaceView, depths: Doubles, params: SliceParams, thickness: float = 0.0
    ) -> None:
        self.view, self.depths, self.params, self.thickness = view, depths, params, thickness
        self.perspective = not view.camera.is_orthographic
        own = view.inner(view.depth)
        depth = np.where(np.isfinite(own), own, 1.0)
        row, column = view.centres()
        self.row, self.column = view.inner(row), view.inner(column)
        self.depth = depth
        self.normal = view.inner(view.normal)
        slope_x, slope_y = view.slopes(self.row, self.column)
        nearby = view.slopes(self.row + 1.0, self.column + 1.0)
        self.to_x, self.to_y = nearby[0] - slope_x, nearby[1] - slope_y
        # Lengths are over k: the depth, or a pixel's width with an orthographic camera.
        self.k = depth if self.perspective else np.abs(self.to_x)
        if not self.perspective:
            self.to_x, self.to_y = self.to_x / self.k, self.to_y / self.k
        self.slope = (slope_x, slope_y) if self.perspective else (0.0 * depth, 0.0 * depth)
        self.sight = self.slope[0] ** 2 + self.slope[1] ** 2 + 1.0  # squared length
        n = self.normal
        self.facing = n[..., 0] * self.slope[0] + n[..., 1] * self.slope[1] - n[..., 2]
        self.clamped = np.minimum(self.facing, -LEAST_FACING * np.sqrt(self.sight))
        wanted_px = params.radius * view.pixels_per_unit(depth)
        limit_px = params.max_radius_px / view.step
        radius_px = np.minimum(wanted_px, limit_px)
        radius = np.where(wanted_px > limit_px, params.radius * limit_px / wanted_px, params.radius)
        self.radius = np.minimum(radius / self.k, 1e6)
        self.thick = self.thickness * self.radius
        distance = depth / self.k * np.sqrt(self.sight)
        if not self.perspective:
            distance = distance + np.minimum(self.radius, sum(view.depth.shape))
        self.bias = params.bias * self.radius + DEPTH_BIAS * distance
        self.active = np.isfinite(own) & (radius_px >= 1.0)

    def slices(self) -> Iterator[Slice]:
        """Give the slices of every pixel."""
        params = self.params
        table = pattern(params)
        y, x = np.indices(self.view.size)
        y, x = y % TILE, x % TILE
        normal, length = self.normal, np.sqrt(self.sight)
        for s in range(params.slices):
            cos, sin = np.cos(table.angle[y, x, s]), np.sin(table.angle[y, x, s])
            ax, ay = cos * self.to_x, sin * self.to_y
            inverse = self._inverse(ax, ay)
            along = normal[..., 0] * ax + normal[..., 1] * ay
            q = ax * self.slope[0] + ay * self.slope[1]
            across = (along - self.clamped * q / self.sight) * inverse * length
            towards = -self.clamped / length
            projected = np.hypot(across, towards)
            reach = np.minimum(self.radius * length * inverse, sum(self.view.depth.shape))
            span = np.maximum(reach - NEAREST_TAP, 0.0)
            offset = []
            for t in range(params.taps):
                distance = table.share[y, x, s, t] * span + NEAREST_TAP
                offset.append((np.rint(distance * cos), np.rint(distance * sin)))
            yield Slice(
                edge=-across / towards,
                cos_normal=towards / projected,
                sin_normal=across / projected,
                length=projected,
                weight=inverse**2 * self.to_x**2,
                dither=table.dither[y, x, s],
                offset=offset,
            )

    def taps(self, plane: Slice, side: int, index: int) -> Iterator[Tap]:
        """Give what the tap number `index` sees in each layer; `side` is 1 or -1."""
        rows, columns = self.view.depth.shape
        dx, dy = (side * offset for offset in plane.offset[index])
        row, column = self.row + dy, self.column + dx
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        at = (
            np.clip(row, 0, rows - 1).astype(int),
            np.clip(column, 0, columns - 1).astype(int),
        )
        ax, ay = dx * self.to_x, dy * self.to_y
        inverse = self._inverse(ax, ay)
        square = ax * ax + ay * ay
        q = ax * self.slope[0] + ay * self.slope[1]
        along = self.normal[..., 0] * ax + self.normal[..., 1] * ay
        steep = self.sight / -self.clamped * inverse
        for layer in self.depths:
            seen = np.where(inside, layer[at], np.inf)
            there = self.active & np.isfinite(seen)
            seen = np.where(there, seen, self.depth)
            # All lengths are divided by k of the tap.
            scale = self.depth / seen if self.perspective else np.ones_like(seen)
            f = 1.0 - scale if self.perspective else (seen - self.depth) / self.k
            squared = np.maximum(f * (f * self.sight + 2.0 * q) + square, 0.0)
            height = f * self.facing + along - self.bias * scale
            behind = self._behind(f)
            # A tap without back lies on its front.
            back = np.maximum(behind * self.facing + along, 0.0) * steep
            yield Tap(
                counts=there & (squared <= (self.radius * scale) ** 2) & (height > 0.0),
                cot=side * plane.edge + np.minimum(np.maximum(height, 0.0) * steep, 1e6),
                back=side * plane.edge + np.minimum(back, 1e6),
                distance=np.sqrt(squared) / (self.radius * scale),
                depth=f / (self.radius * scale),
            )

    def _behind(self, f: Doubles) -> Doubles:
        if not self.perspective:
            return f + self.thick
        # 1 - scale with scale = depth / (seen + thickness).
        return 1.0 - 1.0 / (1.0 / (1.0 - f) + self.thick)

    def _inverse(self, ax: Doubles, ay: Doubles) -> Doubles:
        """1 / (what the offset (ax, ay, 0) has across the line of sight, times its length)."""
        cross = self.slope[0] * ay - self.slope[1] * ax
        result: Doubles = 1.0 / np.sqrt(ax * ax + ay * ay + cross * cross)
        return result


def finished(
    gbuffer: GBuffer,
    params: SliceParams,
    openness: Callable[[Scan], Doubles],
    thickness: float = 0.0,
) -> Doubles:
    """Return A [rows, columns]: `openness` of the scan, then contrast, blur and upsampling."""
    full = SurfaceView.of(gbuffer)
    step = RESOLUTIONS[params.resolution]
    view = full.reduced(step) if step > 1 else full
    depths = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *full.depth.shape)
    rows, columns = (
        view.origin[i] - full.origin[i] + step * np.arange(view.depth.shape[i]) for i in (0, 1)
    )
    scan = Scan(view, depths[:, rows[:, None], columns], params, thickness)
    a = np.where(scan.active, np.clip(openness(scan), 0.0, 1.0), 1.0) ** params.contrast
    blur = BilateralParams(radius=params.blur_radius, passes=params.blur_passes)
    a = bilateral_reference(a, view, blur)
    return upsample_reference(a, full, step=step, background=1.0) if step > 1 else a
