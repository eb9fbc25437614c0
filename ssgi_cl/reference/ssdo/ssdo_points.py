"""Numpy reference of directions of SSDO in float64, see `ssgi_cl.techniques.ssdo.ssdo_points`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.ssdo.ssdo_directions import directions

if TYPE_CHECKING:
    from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams

Masks = NDArray[np.bool_]

NEAREST = 1e-3
"""Least depth of points that are looked up, in parts of the receiver's depth or of the radius."""
DEPTH_ROUNDING = 2e-6
"""Error of the height above the tangent plane by rounding of a depth, in parts of the depth."""
AGREE = 0.05
"""Largest distance of two intersections that count as one, in parts of the distance along the ray."""
FADE = 0.8
"""Distance from which occlusion fades out, in radii (published)."""


@dataclass(frozen=True, eq=False)
class Gathered:
    """Results of pixels, each [rows, columns, ...] without margin.

    Attributes:
        visibility: A in [0, 1], 1 where nothing is.
        sky: [rows, columns, 3] irradiance of the sky's image, W/m^2.
        bounce: [rows, columns, 3] irradiance that other surfaces send, W/m^2.
        met: [directions, rows, columns] whether a direction met something.
    """

    visibility: Doubles
    sky: Doubles
    bounce: Doubles
    met: Masks


@dataclass(frozen=True, eq=False)
class Receivers:
    """Origins of directions, in the view space of the camera whose layers are read."""

    there: Masks
    active: Masks
    position: Doubles
    normal: Doubles
    radius: Doubles
    floor: Doubles  # height above the tangent plane up to which nothing counts


@dataclass(frozen=True, eq=False)
class Ray:
    """One direction of each receiver.

    Attributes:
        way: [rows, columns, 3] unit length, view space.
        cosine: to the receiver's normal.
        length: in (0, 1): the position of the taps.
        solid_angle: steradians.
        sky: [rows, columns, 3] irradiance by the sky's image, W/m^2, or None.
    """

    way: Doubles
    cosine: Doubles
    length: Doubles
    solid_angle: Doubles
    sky: Doubles | None


@dataclass(frozen=True, eq=False)
class Hit:
    """Occlusion of directions [rows, columns] in [0, 1], and irradiance, W/m^2."""

    hides: Doubles
    arriving: Doubles


@dataclass(frozen=True, eq=False)
class Camera:
    """Contents of a camera's G-buffer.

    Attributes:
        layers: its depth layers.
        thickness: of the front one, or None.
        radiance: [layers, rows, columns, 3] of those that send, or None.
        auxiliary: whether it isn't the first one.
    """

    layers: list[SurfaceView]
    thickness: NDArray[np.float32] | None
    radiance: Doubles | None
    auxiliary: bool


def ssdo_points_reference(
    gbuffer: GBuffer,
    params: PointsParams,
    *,
    step: int = 1,
    radiance: ArrayLike | None = None,
    sky: ArrayLike | None = None,
) -> Gathered:
    """Return the results of each step-th pixel.

    Args:
        gbuffer: depth of any number of layers, normals of as many or of the front one.
        params: see `PointsParams`.
        step: 1, 2 or 4.
        radiance: [layers, rows, columns, 3] with margin, of the layers that send light, or None.
        sky: [rows, columns, 3], a latitude-longitude image, or None.
    """
    camera = _camera(gbuffer, radiance)
    at = receivers(camera.layers[0], params.radius, params.max_radius_px, step, params.bias)
    shape = at.there.shape
    light = np.zeros((*shape, 3))
    for ray in _rays(gbuffer, at, params, sky):
        light += 0.0 if ray.sky is None else ray.sky
    before = Gathered(np.ones(shape), light, np.zeros((*shape, 3)), np.zeros((params.samples, *shape), bool))
    nearest = NEAREST * -at.position[..., 2]
    return _gathered(gbuffer, at, before, camera, at, np.eye(3), nearest, params, sky)


def ssdo_point_views_reference(
    gbuffer: GBuffer,
    before: Gathered,
    other: GBuffer,
    radiance: ArrayLike | None,
    params: PointsParams,
    *,
    step: int = 1,
    sky: ArrayLike | None = None,
) -> Gathered:
    """Return the results of each step-th pixel after an auxiliary camera.

    Args:
        gbuffer: what the first camera sees.
        before: the result of `ssdo_points_reference`, or of this for another camera.
        other: what the auxiliary camera sees.
        radiance: [layers, rows, columns, 3] of it with margin, or None.
        params: see `PointsParams`.
        step: 1, 2 or 4.
        sky: [rows, columns, 3], the image that `before` was made with, or None.
    """
    own = receivers(layers_of(gbuffer)[0], params.radius, params.max_radius_px, step, params.bias)
    turn, shift = transform(gbuffer, other)
    seen = replace(own, position=own.position @ turn.T + shift, normal=own.normal @ turn.T)
    camera = _camera(other, radiance, auxiliary=True)
    return _gathered(gbuffer, own, before, camera, seen, turn, NEAREST * params.radius, params, sky)


def transform(gbuffer: GBuffer, other: GBuffer) -> tuple[Doubles, Doubles]:
    """Return rotation [3, 3] and translation [3] from one camera's view space to another's."""
    turn = other.camera.view[:3, :3] @ gbuffer.camera.view[:3, :3].T
    return turn, other.camera.view[:3, 3] - turn @ gbuffer.camera.view[:3, 3]


def _gathered(
    gbuffer: GBuffer,
    at: Receivers,
    before: Gathered,
    camera: Camera,
    seen: Receivers,
    turn: Doubles,
    nearest: Doubles | float,
    params: PointsParams,
    sky: ArrayLike | None,
) -> Gathered:
    """Return the results after the unoccluded directions are traced in a camera's G-buffer.

    Args:
        gbuffer: of the first camera.
        at: its receivers.
        before: their results with the cameras so far.
        camera: the camera to trace in.
        seen: the receivers in its view space.
        turn: [3, 3] from the first camera's view space to its.
        nearest: least depth of points that are looked up.
        params, sky: see `ssdo_points_reference`.
    """
    hidden, total = np.zeros(at.there.shape), np.zeros(at.there.shape)
    light, bounce = before.sky.copy(), np.zeros(before.bounce.shape)
    met = before.met.copy()
    search = _tap if params.method == "published" else _traced
    for number, ray in enumerate(_rays(gbuffer, at, params, sky)):
        open_ = at.active & ~before.met[number]
        hit = search(camera, seen, replace(ray, way=ray.way @ turn.T), open_, nearest, params)
        weight = ray.solid_angle * ray.cosine
        hidden += weight * hit.hides
        total += weight
        bounce += hit.arriving
        met[number] |= hit.hides > 0.0
        if ray.sky is not None:
            light -= ray.sky * hit.hides[..., None]
    total = np.maximum(total, 1e-30)
    if params.method != "published":
        bounce = bounce * (np.pi / total)[..., None]
    visibility = np.clip(before.visibility - hidden / total, 0.0, 1.0)
    there = at.there[..., None]
    return Gathered(
        np.where(at.there, visibility, 1.0),
        np.where(there, np.maximum(light, 0.0), 0.0),
        before.bounce + np.where(there, bounce, 0.0),
        met,
    )


def _camera(gbuffer: GBuffer, radiance: ArrayLike | None, *, auxiliary: bool = False) -> Camera:
    sent = None if radiance is None else np.asarray(radiance, np.float64)
    return Camera(layers_of(gbuffer), gbuffer.first("thickness"), sent, auxiliary)


def layers_of(gbuffer: GBuffer) -> list[SurfaceView]:
    """Return each depth layer as an image of its own; those without normals face the camera."""
    depth: NDArray[np.float32] = gbuffer.depth  # type: ignore[assignment]
    normal: NDArray[np.float32] | None = gbuffer.normal  # type: ignore[assignment]
    deep = depth if depth.ndim == 3 else depth[None]
    views = []
    for number, layer in enumerate(deep):
        own = normal if normal is None or normal.ndim == 3 else normal[number]
        if number > 0 and (normal is None or normal.ndim == 3):
            # View +z in world space.
            own = np.broadcast_to(gbuffer.camera.view[2, :3].astype(np.float32), (*layer.shape, 3))
        views.append(SurfaceView.of(GBuffer(camera=gbuffer.camera, depth=layer, normal=own)))
    return views


def receivers(view: SurfaceView, reach: float, most_px: float, step: int = 1, bias: float = 0.0) -> Receivers:
    """Return every step-th pixel, with the radius `reach` of at most `most_px`; `bias` is in radii."""
    row, column = (view.inner(centre)[::step, ::step] for centre in view.centres())
    depth = view.inner(view.depth)[::step, ::step]
    there = np.isfinite(depth)
    depth = np.where(there, depth, 1.0)
    wanted_px = reach * view.pixels_per_unit(depth)
    shrink = np.minimum(most_px / wanted_px, 1.0)
    radius = reach * shrink
    return Receivers(
        there=there,
        active=there & (wanted_px * shrink >= step),
        position=view.position(row, column, depth),
        normal=view.inner(view.normal)[::step, ::step],
        radius=radius,
        floor=bias * radius + DEPTH_ROUNDING * depth,
    )


def _rays(gbuffer: GBuffer, at: Receivers, params: PointsParams, sky: ArrayLike | None) -> Iterator[Ray]:
    """Yield the directions of all receivers, one for each after the other."""
    image = None if sky is None else np.asarray(sky, np.float64)
    chosen = directions(params.samples, image, equal=params.method == "published")
    y, x = np.indices(at.there.shape)
    for number in range(params.samples):
        place = y % 16, x % 4, number
        way = chosen.direction[place] @ gbuffer.camera.view[:3, :3].T
        cosine = np.sum(way * at.normal, axis=-1)
        away = (cosine < 0.0)[..., None]
        light = None
        if chosen.light is not None:
            both = chosen.light[place] * np.abs(cosine)[..., None, None]
            light = np.where(away, both[..., 1, :], both[..., 0, :])
        way = np.where(away, -way, way)
        yield Ray(way, np.abs(cosine), chosen.length[place], chosen.solid_angle[place], light)


def pixel_of(
    view: SurfaceView, point: Doubles, nearest: Doubles | float, *, beside: bool = False
) -> tuple[Masks, NDArray[np.int_], NDArray[np.int_]]:
    """Return whether points are in the image, and their rows and columns.

    With `beside`, rows and columns of the nearest pixel that shares a corner with the point's own.
    """
    visible = -point[..., 2] > nearest
    row, column = view.pixel(np.where(visible[..., None], point, [0.0, 0.0, -1.0]))
    rows, columns = view.depth.shape
    inside = visible & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    y, x = np.floor(row), np.floor(column)
    if beside:
        y = y + np.where(row - y < 0.5, -1.0, 1.0)
        x = x + np.where(column - x < 0.5, -1.0, 1.0)
    y, x = np.clip(y, 0, rows - 1).astype(int), np.clip(x, 0, columns - 1).astype(int)
    return inside, y, x


def _surface(view: SurfaceView, row: NDArray[np.int_], column: NDArray[np.int_]) -> Doubles:
    """Return the surface points at pixel centres; undefined where nothing is."""
    depth = view.depth[row, column]
    y, x = row.astype(np.float64) + 0.5, column.astype(np.float64) + 0.5
    return view.position(y, x, np.where(np.isfinite(depth), depth, 1.0))


def _cut(
    view: SurfaceView, at: Receivers, ray: Ray, t: Doubles, nearest: Doubles | float, *, beside: bool = False
) -> tuple[Masks, Masks, Doubles, Doubles, Doubles, NDArray[np.int_], NDArray[np.int_]]:
    """Intersect rays with the tangent planes of the pixels that show their points at t.

    Returns:
        Whether there is a surface at the pixel; whether the intersection lies within the radius and
        above the floor; its distance; the receiver's height above the plane; the distance of the
        point behind the plane along the view ray; row and column.
    """
    point = at.position + t[..., None] * ray.way
    inside, row, column = pixel_of(view, point, nearest, beside=beside)
    there = inside & np.isfinite(view.depth[row, column])
    surface, normal = _surface(view, row, column), view.normal[row, column]
    height = np.sum((at.position - surface) * normal, axis=-1)
    along = np.sum(ray.way * normal, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        where = -height / along
        ok = there & (where > 0.0) & (where <= at.radius) & (where * ray.cosine > at.floor)
    view_ray = point / np.maximum(-point[..., 2:], 1e-30)
    if view.camera.is_orthographic:
        view_ray = np.broadcast_to([0.0, 0.0, -1.0], point.shape)
    down = np.sum(view_ray * normal, axis=-1)
    gap = np.sum((point - surface) * normal, axis=-1) / np.where(down == 0.0, 1.0, down)
    return there, ok, where, height, gap, row, column


def _traced(
    camera: Camera, at: Receivers, ray: Ray, open_: Masks, nearest: Doubles | float, params: PointsParams
) -> Hit:
    """Return the nearest intersection of each ray that a second tangent plane confirms."""
    best = np.full(ray.cosine.shape, np.inf)
    arriving = np.zeros((*ray.cosine.shape, 3))
    for tap in range(params.taps):
        t = at.radius * ((ray.length + tap) / params.taps) ** 1.5
        looks = open_ & (t < best)
        for number, view in enumerate(camera.layers):
            there, ok, next_, height, gap, row, column = _cut(view, at, ray, t, nearest)
            next_ = np.where(ok, next_, at.radius)
            _, again, second, next_height, _, next_row, next_column = _cut(view, at, ray, next_, nearest)
            with np.errstate(invalid="ignore"):
                found = looks & ok & again & (np.abs(second - next_) <= AGREE * second)
            if camera.auxiliary:
                _, also, side, *_ = _cut(view, at, ray, next_, nearest, beside=True)
                with np.errstate(invalid="ignore"):
                    found &= also & (np.abs(side - next_) <= AGREE * side)
            thick = params.thickness * at.radius
            if camera.thickness is not None and number == 0:
                given = camera.thickness[row, column].astype(np.float64)
                thick = np.where(given < 0.0, thick, given)
            behind = looks & there & (gap > 0.0) & (gap < thick) & (t * ray.cosine > at.floor)
            where = np.where(found, second, np.where(behind, t, np.inf))
            height = np.where(found, next_height, height)
            row, column = np.where(found, next_row, row), np.where(found, next_column, column)
            nearer = where < best
            best = np.where(nearer, where, best)
            light = np.zeros((*ray.cosine.shape, 3))
            if camera.radiance is not None and number < len(camera.radiance):
                amount = np.where(height > 0.0, ray.solid_angle * ray.cosine, 0.0)
                light = amount[..., None] * camera.radiance[number][row, column]
            arriving = np.where(nearer[..., None], light, arriving)
    return Hit(np.isfinite(best).astype(np.float64), arriving)


def _tap(camera: Camera, at: Receivers, ray: Ray, open_: Masks, nearest: Doubles | float, params: PointsParams) -> Hit:
    """Return the hit of one tap of each direction: Ritschel, Grosch and Seidel 2009, section 4."""
    front = camera.layers[0]
    tap = at.position + (ray.length * at.radius)[..., None] * ray.way
    inside, row, column = pixel_of(front, tap, nearest)
    depth = -tap[..., 2]
    hides, arriving = np.zeros(ray.cosine.shape), np.zeros((*ray.cosine.shape, 3))
    for number in range(0, len(camera.layers), 2):
        view = camera.layers[number]
        within = open_ & inside & (depth > view.depth[row, column])
        if number + 1 < len(camera.layers):
            within &= depth < camera.layers[number + 1].depth[row, column]
        apart = _surface(view, row, column) - at.position
        distance = np.maximum(np.linalg.norm(apart, axis=-1), 1e-15)
        height = np.sum(apart * at.normal, axis=-1)
        sender_height = -np.sum(apart * view.normal[row, column], axis=-1)
        u = np.clip((at.radius - distance) / ((1.0 - FADE) * at.radius), 0.0, 1.0)
        fade = u * u * (3.0 - 2.0 * u)
        hit = within & (height > at.floor)
        hides = np.where(hit, fade, hides)
        light = np.zeros((*ray.cosine.shape, 3))
        if camera.radiance is not None and number < len(camera.radiance):
            area = params.strength * np.pi * at.radius**2 / params.samples
            form_factor = area * (height / distance) * (np.maximum(sender_height, 0.0) / distance)
            form_factor = fade * form_factor / np.maximum(distance, params.nearest_distance) ** 2
            light = form_factor[..., None] * camera.radiance[number][row, column]
        arriving = np.where(hit[..., None], light, arriving)
    return Hit(hides, arriving)
