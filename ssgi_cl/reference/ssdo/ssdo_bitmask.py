"""Numpy reference of the visibility bitmask of SSDO in float64, sector by sector, and of closed surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.bitmask_ao import SECTORS, sector_of, sorted_pair, whole_of
from ssgi_cl.reference.ao.slices import Scan, Slice, Tap, scanned
from ssgi_cl.reference.direct.sky import cones_of, looked_up
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView, view_normals

if TYPE_CHECKING:
    from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmaskParams

FIRST = 0.0625
"""Begin of the first piece of a side whose plane passes below the receiver, in px from that."""
FARTHEST = 0.999
"""`Tap.f` of the farthest end of a piece with a perspective camera."""
LEAST_N_DOT_V = 0.05
"""Cosine between view ray and normal of the steepest plane that a piece lies in."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Piece of a surface round a tap, on one side of a slice and in one layer; arrays [rows, columns].

    Attributes:
        layer: number.
        tap: in its middle.
        where: whether there is a surface within the radius.
        least, most: sectors between which it occludes.
        faces: whether the receiver sees the side that the camera sees.
    """

    layer: int
    tap: Tap
    where: NDArray[np.bool_]
    least: NDArray[np.int64]
    most: NDArray[np.int64]
    faces: NDArray[np.bool_]


def ssdo_bitmask_reference(
    gbuffer: GBuffer,
    params: SsdoBitmaskParams,
    radiance: Doubles | None = None,
    sky: Doubles | None = None,
    *,
    sectors: int = SECTORS,
) -> Doubles:
    """Return images [1 to 10, rows, columns] as `SsdoBitmask.run` does, from the same taps.

    Args:
        radiance: [layers, rows, columns, 3] of the G-buffer's arrays, or of twice the layers, those
            of their backs behind those of their fronts.
        sky: map [size, size, 3], as `ssgi_cl.techniques.direct.sky.filtered` returns it.
        sectors: of a slice. The kernel has 32; with many, the result is the kernel's on average.
    """
    scan, full = scanned(gbuffer, params, params.thickness, params.end, within=True, facets=False)
    rows, columns = (
        scan.view.origin[i] - full.origin[i] + scan.view.step * np.arange(scan.view.depth.shape[i]) for i in (0, 1)
    )
    sent = None if radiance is None else np.asarray(radiance)[:, rows[:, None], columns]
    slopes, sides = (found(gbuffer, full)[..., rows[:, None], columns] for found in (slopes_of, sides_of))
    layers = len(scan.depths)
    thick = params.thickness > 0.0 or scan.given is not None
    shape = scan.depth.shape
    hidden, whole = np.zeros(shape), np.full(shape, 1e-30)
    skylight, bounce, bend = (np.zeros((*shape, 3)) for _ in range(3))
    number = np.arange(sectors)
    for plane in scan.slices():
        covered = np.zeros((*shape, sectors), bool)
        light = np.zeros((*shape, 3))
        for side in (1, -1):
            for piece in pieces(scan, plane, side, slopes, sides, sectors, thick=thick):
                least, most = piece.least[..., None], piece.most[..., None]
                now = piece.where[..., None] & (number >= least) & (number < most)
                fresh = (now & ~covered).mean(axis=-1)[..., None]
                covered |= now
                if sent is None:
                    continue
                front = _at_tap(sent[piece.layer], scan, piece.tap)
                back = params.back * front
                if len(sent) > layers:
                    back = _at_tap(sent[layers + piece.layer], scan, piece.tap)
                light += fresh * np.where(piece.faces[..., None], front, back)
        share = plane.weight * plane.length * whole_of(plane)
        hidden += share * covered.mean(axis=-1)
        whole += share
        bounce += share[..., None] * light
        if params.bent_normals:
            dark = covered & scan.active[..., None]
            for part, direction in cones_of(scan, plane, dark, params.cones):
                bend -= (1.5 * share * part)[..., None] * direction
        if sky is not None:
            free = ~(covered & scan.active[..., None])
            skylight += share[..., None] * looked_up(sky, scan, plane, free, params.cones)
    there = np.isfinite(scan.view.inner(scan.view.depth))
    a = np.where(scan.active, np.clip(1.0 - hidden / whole, 0.0, 1.0), 1.0) ** params.contrast
    images = [a[None]]
    if params.bent_normals:
        in_view = bend @ gbuffer.camera.view[:3, :3].T
        images.append(_irradiance(in_view / np.pi, whole, scan.active))
    if sky is not None:
        images.append(_irradiance(skylight, whole, there))
    if sent is not None:
        images.append(_irradiance(bounce, whole, scan.active))
    result: Doubles = np.concatenate(images)
    return result


def _irradiance(total: Doubles, whole: Doubles, there: NDArray[np.bool_]) -> Doubles:
    mean = np.pi * total / whole[..., None]
    result: Doubles = np.moveaxis(np.where(there[..., None], mean, 0.0), -1, 0)
    return result


def pieces(
    scan: Scan, plane: Slice, side: int, slopes: Doubles, sides: Doubles, sectors: int, *, thick: bool
) -> Iterator[Piece]:
    """Yield the pieces of the taps of a side, from near to far, of each the layers front to back.

    Args:
        slopes: [layers, 2, rows, columns] of the scan's arrays, see `slopes_of`.
        sides: [layers, rows, columns] likewise, see `sides_of`.
        thick: whether surfaces have a thickness.
    """
    taps = list(scan.taps_of_all_layers(plane, side))
    px = [layers[0].px for layers in taps]
    gain = -scan.depth if scan.perspective else np.ones_like(scan.depth)
    for index, layers in enumerate(taps):
        half = 0.5 * (px[index] + (px[index - 1] if index else 0.0))
        last = index + 1 == len(px)
        end = 2.0 * px[index] - half if last else 0.5 * (px[index] + px[index + 1])
        for layer, tap in enumerate(layers):
            along, down = (gain * _at_tap(slope[..., None], scan, tap)[..., 0] for slope in slopes[layer])
            own = tap.f - along * tap.x - down * tap.y
            start = np.where(own >= 0.0, FIRST, half) if index == 0 else half

            def at(
                distance: Doubles, along: Doubles = along, down: Doubles = down, own: Doubles = own
            ) -> tuple[Doubles, Doubles, Doubles]:
                x = side * distance * plane.cosine * scan.to_x
                y = side * distance * plane.sine * scan.to_y
                f = own + along * x + down * y
                return (np.minimum(f, FARTHEST) if scan.perspective else f), x, y

            near_out, far_out = scan.outside(*at(start)), scan.outside(*at(end))
            cut = (near_out <= 0.0) ^ (far_out <= 0.0)
            part = np.clip(near_out / np.where(cut, near_out - far_out, 1.0), 0.0, 1.0)
            border = start + part * (end - start)
            ends = [
                sector_of(scan.cotangent(plane, side, *at(distance)), plane, side, count=sectors)
                for distance in (
                    np.where(cut & (near_out > 0.0), border, start),
                    np.where(cut & (far_out > 0.0), border, end),
                )
            ]
            least, most = sorted_pair(*ends)
            if thick:
                inside = scan.outside(tap.f, tap.x, tap.y) <= 0.0
                back = sector_of(tap.back, plane, side, count=sectors)
                least = np.where(inside, np.minimum(least, back), least)
                most = np.where(inside, np.maximum(most, back), most)
            outer = own * _at_tap(sides[layer][..., None], scan, tap)[..., 0] >= 0.0
            within = tap.there & outer & ((near_out <= 0.0) | (far_out <= 0.0))
            yield Piece(layer, tap, within, least, most, own >= 0.0)


def slopes_of(gbuffer: GBuffer, view: SurfaceView) -> Doubles:
    """Return [layers, 2, rows, columns]: the gradient of 1 / depth (orthographic: of depth).

    Per slope of the view ray (orthographic: per scene unit), along columns, then along rows.
    Layers with normals have the gradient of their tangent plane, tilted no further than
    `LEAST_N_DOT_V` from the view ray. The others take the difference to the neighbour whose own
    line misses the pixel the least, or the mean of both where they differ no more than those lines
    bend; 0 without neighbours.
    """
    given = (gbuffer.normal, gbuffer.albedo, gbuffer.emission)
    shapes = [np.shape(a) for a in given if a is not None]
    count = gbuffer.layers if any(len(shape) == 4 for shape in shapes) else 1
    across = np.stack([_slopes_of_plane(gbuffer, view, layer) for layer in range(count)])
    result: Doubles = np.concatenate([across, _slopes_of_depth(gbuffer, view)[count:]])
    return result


def _slopes_of_plane(gbuffer: GBuffer, view: SurfaceView, layer: int) -> Doubles:
    depth = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *view.depth.shape)[layer]
    given = None if gbuffer.normal is None else np.asarray(gbuffer.normal)
    if given is not None and given.ndim == 4:
        given = given[layer]
    normal = view_normals(replace(view, depth=depth), given)
    there = np.isfinite(depth)
    depth = np.where(there, depth, 1.0)
    view_ray = view.position(*view.centres(), np.ones(depth.shape))
    if view.camera.is_orthographic:
        view_ray = view_ray * [0.0, 0.0, 1.0]
    n_dot_v = np.sum(normal * view_ray, axis=-1)
    least = LEAST_N_DOT_V * np.linalg.norm(view_ray, axis=-1)
    n_dot_v = np.copysign(np.maximum(np.abs(n_dot_v), least), n_dot_v)
    gain = -1.0 / n_dot_v if view.camera.is_orthographic else 1.0 / (depth * n_dot_v)
    result: Doubles = np.moveaxis(normal[..., :2], -1, 0) * np.where(there, gain, 0.0)
    return result


def _slopes_of_depth(gbuffer: GBuffer, view: SurfaceView) -> Doubles:
    depth = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *view.depth.shape)
    near = depth if view.camera.is_orthographic else 1.0 / depth
    near = np.where(np.isfinite(depth), near, np.nan)
    origin = np.zeros(1)
    units = np.subtract(view.slopes(origin + 1.0, origin + 1.0), view.slopes(origin, origin))
    found = []
    for axis, unit in ((2, units[0]), (1, units[1])):
        step = np.diff(near, axis=axis)
        gap = np.full_like(np.take(near, [0], axis), np.nan)
        down, up = (np.concatenate(pair, axis) for pair in ((gap, step), (step, gap)))
        bend = np.abs(up - down)
        before, behind = (np.roll(each, shift, axis) for each, shift in ((down, 1), (up, -1)))
        misses = (np.abs(down - before), np.abs(behind - up))
        down_miss, up_miss = (np.where(np.isnan(miss), bend, miss) for miss in misses)
        lesser = (down_miss < up_miss) | ((down_miss == up_miss) & (np.abs(down) <= np.abs(up)))
        one = np.where(np.isnan(up) | (~np.isnan(down) & lesser), down, up)
        alike = bend <= 2.0 * np.minimum(down_miss, up_miss)
        found.append(np.nan_to_num(np.where(alike, 0.5 * (down + up), one)) / unit)
    return np.stack(found, axis=1)


def _at_tap(sent: Doubles, scan: Scan, tap: Tap) -> Doubles:
    """Return the values of [rows, columns, n] at a tap, 0 outside."""
    rows, columns = sent.shape[:2]
    row = np.floor(scan.row + tap.y / scan.to_y).astype(int)
    column = np.floor(scan.column + tap.x / scan.to_x).astype(int)
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    seen = sent[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    result: Doubles = np.where(inside[..., None], seen, 0.0)
    return result


def sides_of(gbuffer: GBuffer, view: SurfaceView) -> Doubles:
    """Return [layers, rows, columns]: 1 for the layers that begin a closed object, -1 for those that end it.

    0 elsewhere, and everywhere unless there are several layers, all with attributes.
    """
    depths = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *view.depth.shape)
    result: Doubles = np.zeros(depths.shape)
    given = (gbuffer.normal, gbuffer.albedo, gbuffer.emission)
    if len(depths) == 1 or all(array is None or np.ndim(array) < 4 for array in given):
        return result
    normals = np.zeros((*depths.shape, 3))
    if gbuffer.normal is not None:
        of_layers = np.asarray(gbuffer.normal, np.float64).reshape(-1, *view.depth.shape, 3)
        normals[: len(of_layers)] = of_layers
    turned = np.stack(
        [
            np.sum(view_normals(replace(view, depth=depth), normal) * (normal @ gbuffer.camera.view[:3, :3].T), axis=-1)
            for depth, normal in zip(depths, normals, strict=True)
        ]
    )
    for row, column in np.argwhere(np.isfinite(depths[0])):
        begun: list[int] = []
        found = np.zeros(len(depths))
        for layer in np.flatnonzero(np.isfinite(depths[:, row, column])).tolist():
            side = turned[layer, row, column]
            if side > 0.0:
                begun.append(layer)
            elif side == 0.0 or not begun:
                break
            else:
                found[begun.pop()], found[layer] = 1.0, -1.0
        else:
            result[:, row, column] = found
    return result
