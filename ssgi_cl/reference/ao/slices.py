"""The scan in slices that HBAO, GTAO and the visibility bitmask share, in float64."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.facets import tilted
from ssgi_cl.reference.ao.occlusion import RESOLUTIONS
from ssgi_cl.reference.ao.occlusion import finished as complete
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.patterns import slice_pattern

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.slices import SliceParams

TILE = 4
"""Rows and columns after which the pattern repeats."""
GROUP = 16
"""Pixels that scan together, every `TILE`-th of a row."""
SIMILAR = 0.4
"""Those whose 1 / depth is at least this part of the nearest's share the length of its slices."""
NEAREST_TAP = 1.3
"""Distance of the nearest tap, px; rounded at any angle it is another pixel (at 45 degrees,
1.3 / sqrt(2) = .92 of a column and a row)."""
DEPTH_BIAS = 4e-6
"""Height of a tap that counts as none, relative to the distance from the eye: 67 * 2^-24."""
LEAST_N_DOT_V = 0.05
"""Least cosine between normal and view ray, in units of which heights are measured."""
FAR = 1e9
"""Offset of a tap that is not there, px."""


@dataclass(frozen=True, eq=False)
class Tap:
    """A tap in one depth layer, on one side of a slice; arrays [rows, columns].

    Lengths are over k of the receiver, see `Scan`.

    Attributes:
        there: whether a surface is.
        counts: whether one is, within the radius and above the tangent plane.
        cot: cotangent of the angle between the view ray and the surface.
        back: the same of where the surface ends, on the tap's own view ray.
        distance: from the receiver, in radii.
        depth: behind the receiver, in radii.
        f: 1 - depth of the receiver / depth of the tap; orthographic: depth behind the receiver.
        behind: `f` of where the surface ends.
        known: whether that is given, and not guessed.
        solid: `f` of where the view ray of a tap enters and leaves what of a given thickness lies within the radius;
            the former is greater where it does not.
        x, y: offset from the receiver in slope.
        px: offset along the slice.
    """

    there: NDArray[np.bool_]
    counts: NDArray[np.bool_]
    cot: Doubles
    back: Doubles
    distance: Doubles
    depth: Doubles
    f: Doubles
    behind: Doubles
    known: NDArray[np.bool_]
    solid: tuple[Doubles, Doubles]
    x: Doubles
    y: Doubles
    px: Doubles


@dataclass(frozen=True, eq=False)
class Slice:
    """A plane through the view ray; arrays [rows, columns].

    Attributes:
        edge: cotangent of the tangent plane's angle from the view ray on the first side;
            on the second it is -edge.
        lean: the same of the plane across the normal, where that is another.
        cos_normal, sin_normal: of the projected normal's angle from the view ray, towards
            the first side.
        length: of the normal's projection into the plane.
        weight: azimuth that the slice stands for, relative to the others.
        rise: change of `Tap.f` along the tangent plane from one pixel to the next.
        across: length across the view ray of an offset at the centre of the group over that
            at the pixel, for offsets along the slice.
        dither: of each pixel, in [0, 1).
        cosine, sine: of the slice's angle from +columns towards +rows.
        offset: side, 1 or -1 -> (columns, rows) of each tap, whole numbers of pixels.
    """

    edge: Doubles
    lean: Doubles
    cos_normal: Doubles
    sin_normal: Doubles
    length: Doubles
    weight: Doubles
    rise: Doubles
    across: Doubles
    dither: Doubles
    cosine: Doubles
    sine: Doubles
    offset: dict[int, list[tuple[Doubles, Doubles]]]


class Scan:
    """All pixels of a view as receivers of light.

    Args:
        view: what is seen in front.
        depths: [layers, rows, columns] of all layers, margin included, of the view's size.
        params: see `SliceParams`.
        thickness: of surfaces, radii.
        thick: [layers, rows, columns] of so many layers, from the front, scene units, margin included; -1 where it is
            not known; or None.
        end: "thickness", or "layer": no surface goes on behind the next layer.
        within: whether the taps of a side end where it leaves the arrays, for the pixel of the
            group that is the farthest from there.
        facets: whether the tangent plane is that of the triangle, where it is known.
        uniform: whether all directions weigh the same, instead of by cosine.
    """

    def __init__(
        self,
        view: SurfaceView,
        depths: Doubles,
        params: SliceParams,
        thickness: float = 0.0,
        thick: Doubles | None = None,
        end: str = "thickness",
        *,
        within: bool = False,
        facets: bool = True,
        uniform: bool = False,
    ) -> None:
        self.within, self.uniform = within, uniform
        self.view, self.depths, self.params, self.thickness = view, depths, params, thickness
        self.given, self.end = thick, end
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
        self.ray_squared = self.slope[0] ** 2 + self.slope[1] ** 2 + 1.0  # squared length
        n = self.normal
        self.n_dot_v = n[..., 0] * self.slope[0] + n[..., 1] * self.slope[1] - n[..., 2]
        self.clamped = np.minimum(self.n_dot_v, -LEAST_N_DOT_V * np.sqrt(self.ray_squared))
        # A normal that is turned away is turned back along the view ray.
        turned = np.minimum(self.n_dot_v, LEAST_N_DOT_V * np.sqrt(self.ray_squared))
        back = np.where(self.n_dot_v > 0.0, (self.n_dot_v + turned) / self.ray_squared, 0.0)
        self.normal = n - back[..., None] * np.stack([*self.slope, -np.ones_like(back)], axis=-1)
        self.n_dot_v = np.where(self.n_dot_v > 0.0, -turned, self.n_dot_v)
        self.own_normal, self.facing, self.share = self.normal, self.clamped, np.ones(depth.shape)
        self.tilted = np.zeros(depth.shape, bool)
        if facets:
            self._find_facets(n)
        wanted_px = params.radius * view.pixels_per_unit(depth)
        limit_px = params.max_radius_px / view.step
        radius_px = np.minimum(wanted_px, limit_px)
        radius = np.where(wanted_px > limit_px, params.radius * limit_px / wanted_px, params.radius)
        self.radius = np.minimum(radius / self.k, 1e3 if self.perspective else 1e6)
        self.thick = self.thickness * self.radius
        distance = depth / self.k * np.sqrt(self.ray_squared)
        if not self.perspective:
            distance = distance + np.minimum(self.radius, sum(view.depth.shape))
        self.bias = params.bias * self.radius + DEPTH_BIAS * distance
        self.active = np.isfinite(own) & (radius_px >= 1.0)
        self.reach, self.middle = self._shared()

    def _find_facets(self, given: Doubles) -> None:
        """Take the triangle's plane for the tangent plane where it is known, and keep the given normal.

        That is bent along the view ray until it faces the eye. `share` is what of the given normal's
        hemisphere lies above the triangle: by cosine, or with `uniform` by solid angle.
        """
        known, facet = tilted(self.view)
        known, facet = self.view.inner(known), self.view.inner(facet)
        view_ray = np.stack(np.broadcast_arrays(*self.slope, -np.ones(known.shape)), axis=-1)
        grazing = -LEAST_N_DOT_V * np.sqrt(self.ray_squared)
        n_dot_v, s_dot_v = (np.sum(normal * view_ray, axis=-1) for normal in (facet, given))
        facing = np.minimum(s_dot_v, grazing)
        cosine = np.clip(np.sum(facet * given, axis=-1), -1.0, 1.0)
        share = 1.0 - np.arccos(cosine) / np.pi if self.uniform else 0.5 * (1.0 + cosine)
        self.tilted = known
        self.share = np.where(known, share, 1.0)
        self.own_normal = np.where(known[..., None], given, self.normal)
        self.facing = np.where(known, facing, self.clamped)
        self.normal = np.where(known[..., None], facet, self.normal)
        self.n_dot_v = np.where(known, n_dot_v, self.n_dot_v)
        self.clamped = np.where(known, np.minimum(n_dot_v, grazing), self.clamped)

    def _shared(self) -> tuple[Doubles, Doubles]:
        """Return the radius that each pixel's slices have, a length, and its group's middle.

        A group is 16 pixels of a row, every fourth; those not much farther away than the nearest
        share its radius. The middle is a slope along rows.
        """
        rows, columns = self.view.size
        column = np.broadcast_to(np.arange(columns), (rows, columns))
        first = (column // TILE // GROUP * GROUP) * TILE + column % TILE
        centre = np.asarray(first + self.view.margin[1] + 0.5 * TILE * GROUP, np.float64)
        middle = self.view.slopes(self.row, centre)[0] * (1.0 if self.perspective else 0.0)
        unit_px = self.view.pixels_per_unit(np.ones(1))[0]
        limit = self.params.max_radius_px / self.view.step / unit_px
        if not self.perspective:
            return np.full((rows, columns), self._limited(1.0 / self.k, limit / self.k)), middle
        top = self.view.margin[0]
        near = 1.0 / self.view.depth[top : top + rows, self.view.margin[1] :]
        near = np.pad(near, ((0, 0), (0, -near.shape[1] % (TILE * GROUP))))
        near = near.reshape(rows, -1, GROUP, TILE)
        left, shared = np.ones(near.shape, bool), np.zeros(near.shape)
        while left.any():
            nearest = np.where(left, near, 0.0).max(axis=2, keepdims=True)
            alike = left & (near >= SIMILAR * nearest)
            shared[alike] = np.broadcast_to(nearest, near.shape)[alike]
            left &= ~alike
        return self._limited(shared.reshape(rows, -1)[:, :columns], limit), middle

    def _limited(self, unit: Doubles, limit: Doubles) -> Doubles:
        result: Doubles = np.minimum(np.minimum(self.params.radius * unit, limit), 1e6)
        return result

    def slices(self) -> Iterator[Slice]:
        """Yield the slices of every pixel."""
        params = self.params
        table = slice_pattern(params)
        y, x = np.indices(self.view.size)
        y, x = y % TILE, x % TILE
        normal, length = self.normal, np.sqrt(self.ray_squared)
        for s in range(params.slices):
            cos, sin = np.cos(table.angle[y, x, s]), np.sin(table.angle[y, x, s])
            ax, ay = cos * self.to_x, sin * self.to_y
            inverse = self._inverse(ax, ay)
            along = normal[..., 0] * ax + normal[..., 1] * ay
            q = ax * self.slope[0] + ay * self.slope[1]
            plane_across = (along - self.clamped * q / self.ray_squared) * inverse * length
            own_along = self.own_normal[..., 0] * ax + self.own_normal[..., 1] * ay
            across = (own_along - self.facing * q / self.ray_squared) * inverse * length
            towards = -self.facing / length
            projected = np.hypot(across, towards)
            central = np.sqrt(self.middle**2 + self.slope[1] ** 2 + 1.0)
            reach = np.minimum(self.reach * central * self._inverse(ax, ay, self.middle), self._farthest())
            span = np.maximum(reach - NEAREST_TAP, 0.0)
            offset: dict[int, list[tuple[Doubles, Doubles]]] = {}
            for side in (1, -1):
                inside = self._within(side * cos, side * sin) if self.within else span
                offset[side] = []
                for t in range(params.taps):
                    distance = table.share[y, x, s, t] * np.minimum(span, inside) + NEAREST_TAP
                    tap = np.rint(distance * cos), np.rint(distance * sin)
                    offset[side].append((side * tap[0], side * tap[1]))
            yield Slice(
                edge=-plane_across / (-self.clamped / length),
                lean=-across / towards,
                cos_normal=towards / projected,
                sin_normal=across / projected,
                length=projected,
                weight=inverse**2 * self.to_x**2,
                rise=-along / self.clamped,
                across=inverse / self._inverse(ax, ay, self.middle),
                dither=table.dither[y, x, s],
                cosine=cos,
                sine=sin,
                offset=offset,
            )

    def _farthest(self) -> int:
        """Both sides of the image as kernels have it, padded, px: no tap is farther away."""
        rows, columns = (int(count) for count in self.view.depth.shape)
        lead = -self.view.margin[1] % TILE
        quarter = -(-(columns + lead) // TILE)
        return rows + TILE * (-(-quarter // GROUP) * GROUP + GROUP)

    def _within(self, along: Doubles, down: Doubles) -> Doubles:
        """Return the px from the nearest tap to where the group's farthest pixel leaves the arrays.

        `along` and `down` are the direction's columns and rows per px.
        """
        rows, columns = self.view.depth.shape
        column, row = self.column - 0.5, self.row - 0.5
        own = column - self.view.margin[1]  # column of the result
        start = own // TILE // GROUP * GROUP * TILE + own % TILE + self.view.margin[1]
        across = np.where(along > 0.0, columns - start, start + TILE * GROUP)
        high = np.where(down > 0.0, rows - row, row + 1.0)
        reach = np.minimum(across / np.maximum(np.abs(along), 1e-6), high / np.maximum(np.abs(down), 1e-6))
        result: Doubles = np.maximum(reach - NEAREST_TAP, 0.0)
        return result

    def taps(self, plane: Slice, side: int, layer: int) -> Iterator[Tap]:
        """Yield the taps of a layer from near to far; `side` is 1 or -1."""
        for columns, rows in plane.offset[side]:
            yield self._tap(plane, side, layer, columns, rows)

    def distinct_taps(self, plane: Slice, side: int, layer: int, deeper: int) -> list[Tap]:
        """Return taps from near to far, no two of a pixel, of deeper layers every so-many-th.

        Args:
            plane, side, layer: see `taps`.
            deeper: the most taps in layers behind the first one.

        Where a pixel has fewer taps than others, its last ones are not there.
        """
        offsets = np.array(plane.offset[side])  # [taps, 2, rows, columns]
        again = np.zeros((len(offsets), *offsets.shape[2:]), bool)
        again[1:] = (offsets[1:] == offsets[:-1]).all(axis=1)
        offsets[np.broadcast_to(again[:, None], offsets.shape)] = FAR
        order = np.argsort(again, axis=0, kind="stable")
        offsets = np.take_along_axis(offsets, order[:, None], axis=0)
        every = -(-(~again).sum(axis=0) // deeper) if layer > 0 else np.ones(again.shape[1:], int)
        offsets = np.concatenate([offsets, np.full_like(offsets[:1], FAR)])
        taps = []
        for t in range(min(deeper, len(again)) if layer > 0 else len(again)):
            index = np.minimum((t + 1) * every - 1, len(again))
            columns, rows = np.take_along_axis(offsets, index[None, None], axis=0)[0]
            taps.append(self._tap(plane, side, layer, columns, rows))
        return taps

    def taps_of_all_layers(self, plane: Slice, side: int) -> Iterator[tuple[Tap, ...]]:
        """Yield the taps of all layers together, from near to far."""
        layers = (self.taps(plane, side, layer) for layer in range(len(self.depths)))
        return zip(*layers, strict=True)

    def cotangent(self, plane: Slice, side: int, f: Doubles, x: Doubles, y: Doubles) -> Doubles:
        """Return the cotangent of a point at an offset, at least that of the tangent plane."""
        scale = self.scale(f)
        along = self.normal[..., 0] * x + self.normal[..., 1] * y
        height = f * self.n_dot_v + along - self.bias * scale
        rise = np.maximum(height, 0.0) * self._inverse(x, y) * self.ray_squared / -self.clamped
        result: Doubles = side * plane.edge + np.minimum(rise, 1e6)
        return result

    def outside(self, f: Doubles, x: Doubles, y: Doubles) -> Doubles:
        """Return (squared distance - squared radius) of a point, times its scale squared."""
        scale = self.scale(f)
        q = x * self.slope[0] + y * self.slope[1]
        result: Doubles = f * (f * self.ray_squared + 2.0 * q) + x * x + y * y - (self.radius * scale) ** 2
        return result

    def scale(self, f: Doubles) -> Doubles:
        """Return the receiver's depth over that of a tap (1 with an orthographic camera)."""
        return 1.0 - f if self.perspective else np.ones_like(f)

    def _tap(self, plane: Slice, side: int, layer: int, dx: Doubles, dy: Doubles) -> Tap:
        rows, columns = self.view.depth.shape
        row, column = self.row + dy, self.column + dx
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        at = (np.clip(row, 0, rows - 1).astype(int), np.clip(column, 0, columns - 1).astype(int))
        x, y = dx * self.to_x, dy * self.to_y
        inverse = plane.across * self._inverse(x, y, self.middle)
        along = self.normal[..., 0] * x + self.normal[..., 1] * y
        steep = self.ray_squared / -self.clamped * inverse
        seen = np.where(inside, self.depths[layer][at], np.inf)
        there = self.active & np.isfinite(seen)
        seen = np.where(there, seen, self.depth)
        # All lengths are divided by k of the tap.
        f = 1.0 - self.depth / seen if self.perspective else (seen - self.depth) / self.k
        scale = self.scale(f)
        outside = self.outside(f, x, y)
        height = f * self.n_dot_v + along - self.bias * scale
        # A tap without back lies on its front.
        thickness = self._thickness(layer, inside, at)
        behind = self._behind(f, thickness, layer, inside, at)
        back = np.maximum(behind * self.n_dot_v + along, 0.0) * steep
        unit = (self.radius * scale) ** 2
        return Tap(
            there=there,
            counts=there & (outside <= 0.0) & (height > 0.0),
            cot=side * plane.edge + np.minimum(np.maximum(height, 0.0) * steep, 1e6),
            back=side * plane.edge + np.minimum(back, 1e6),
            distance=np.sqrt(np.maximum(outside / unit + 1.0, 0.0)),
            depth=f / (self.radius * scale),
            f=f,
            behind=behind,
            known=there & (thickness >= 0.0),
            solid=self._solid(f, np.where(there & (height > 0.0), thickness, 0.0), x, y),
            x=x,
            y=y,
            px=side * (dx * plane.cosine + dy * plane.sine),
        )

    def _thickness(self, layer: int, inside: NDArray[np.bool_], at: tuple[Doubles, Doubles]) -> Doubles:
        """Return the given thickness of taps at array elements that may lie inside the image, over k; else -1."""
        if self.given is None or layer >= len(self.given):
            return np.full(inside.shape, -1.0)
        given = np.where(inside, self.given[layer][at], 0.0)
        return np.where(given < 0.0, -1.0, given / self.k)

    def _reached(self, f: Doubles, thick: Doubles) -> Doubles:
        """Return `f` of what lies so far behind a tap on its view ray."""
        # 1 - scale with scale = depth / (seen + thickness).
        with np.errstate(divide="ignore"):  # infinitely far away f is 1, and stays so
            result: Doubles = 1.0 - 1.0 / (1.0 / (1.0 - f) + thick) if self.perspective else f + thick
        return result

    def _solid(self, f: Doubles, thickness: Doubles, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
        """Return `Tap.solid`."""
        # On a view ray `outside` is second f^2 + 2 half f + fixed.
        fixed = self.outside(np.zeros_like(f), x, y)
        one, other = self.outside(np.ones_like(f), x, y), self.outside(-np.ones_like(f), x, y)
        second, half = 0.5 * (one + other) - fixed, 0.25 * (one - other)
        around = second < 1e-6  # the eye is within the radius
        second = np.copysign(np.maximum(np.abs(second), 1e-6), second)
        under = half**2 - second * fixed
        root = np.sqrt(np.maximum(under, 0.0))
        enters = np.where(around, -np.inf, (-half - root) / second)
        first = np.maximum(f, enters)
        last = np.minimum(self._reached(f, thickness), (root - half) / second)
        met = (thickness > 0.0) & (under > 0.0)
        return np.where(met, first, f), np.where(met, last, f)

    def _behind(
        self, f: Doubles, thickness: Doubles, layer: int, inside: NDArray[np.bool_], at: tuple[Doubles, Doubles]
    ) -> Doubles:
        """Return `Tap.behind` of taps at array elements that may lie inside the image."""
        behind = self._reached(f, np.where(thickness < 0.0, self.thick, thickness))
        if self.end == "layer" and layer + 1 < len(self.depths):
            following = np.where(inside, self.depths[layer + 1][at], np.inf)
            there = np.isfinite(following)
            seen = np.where(there, following, 1.0)
            own = 1.0 - self.depth / seen if self.perspective else (seen - self.depth) / self.k
            behind = np.where(there, np.minimum(behind, own), behind)
        return behind

    def _inverse(self, ax: Doubles, ay: Doubles, slope: Doubles | None = None) -> Doubles:
        """1 / (what the offset (ax, ay, 0) has across the view ray, times its length)."""
        cross = (self.slope[0] if slope is None else slope) * ay - self.slope[1] * ax
        result: Doubles = 1.0 / np.sqrt(ax * ax + ay * ay + cross * cross + 1e-30)
        return result


def finished(
    gbuffer: GBuffer,
    params: SliceParams,
    visibility: Callable[[Scan], Doubles],
    thickness: float | None = None,
    end: str = "thickness",
    *,
    uniform: bool = False,
) -> Doubles:
    """Return A [rows, columns]: `visibility` of the scan, then contrast, blur and upsampling."""
    scan, full = scanned(gbuffer, params, thickness, end, uniform=uniform)
    a = np.where(scan.active, np.clip(visibility(scan), 0.0, 1.0) * scan.share, 1.0) ** params.contrast
    return complete(a, scan.view, full, params)


def scanned(
    gbuffer: GBuffer,
    params: SliceParams,
    thickness: float | None = None,
    end: str = "thickness",
    *,
    within: bool = False,
    facets: bool = True,
    uniform: bool = False,
) -> tuple[Scan, SurfaceView]:
    """Return the scan of a G-buffer at the size that is asked for, and its view at full size.

    Where surfaces end, see `Scan`: the G-buffer's own thickness counts unless `thickness` is None.
    """
    full = SurfaceView.of(gbuffer)
    step = RESOLUTIONS[params.resolution]
    view = full.reduced(step) if step > 1 else full
    depths = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *full.depth.shape)
    rows, columns = (view.origin[i] - full.origin[i] + step * np.arange(view.depth.shape[i]) for i in (0, 1))
    given = None if thickness is None else gbuffer.thickness
    thick = None
    if given is not None:
        thick = np.asarray(given, np.float64).reshape(-1, *full.depth.shape)[:, rows[:, None], columns]
    layers = depths[:, rows[:, None], columns]
    return Scan(view, layers, params, thickness or 0.0, thick, end, within=within, facets=facets, uniform=uniform), full
