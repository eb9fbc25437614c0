"""SSDO from taps in float64, tap by tap as defined in `ssgi_cl.techniques.ssdo_points`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.ssao import NEAREST_SAMPLE, ONSET
from ssgi_cl.techniques.ssao import DEPTH_BIAS
from ssgi_cl.techniques.ssdo_points import PointsParams
from ssgi_cl.techniques.ssdo_taps import TapSets, tap_sets

TILE = 16.0
"""Pixels that take different taps and are blurred together."""


@dataclass(frozen=True, eq=False)
class Gathered:
    """What a pixel gathers, each [rows, columns, ...] without margin.

    Attributes:
        openness: A in [0, 1], 1 where nothing is.
        sky: [rows, columns, 3] irradiance of the sky's image, W/m^2.
        bounce: [rows, columns, 3] irradiance that other surfaces send, W/m^2.
        known: [taps, rows, columns] whether a tap lies in the image; None if not looked at.
        hides: likewise, whether it hides.
    """

    openness: Doubles
    sky: Doubles
    bounce: Doubles
    known: NDArray[np.bool_] | None = None
    hides: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Receivers:
    """What taps are taken round, in the view space of the camera whose layers are read."""

    there: NDArray[np.bool_]
    active: NDArray[np.bool_]
    position: Doubles
    normal: Doubles
    radius: Doubles
    floor: Doubles  # height above the tangent plane up to which nothing counts


def ssdo_points_reference(
    gbuffer: GBuffer,
    params: PointsParams | None = None,
    *,
    step: int = 1,
    radiance: ArrayLike | None = None,
    sky: ArrayLike | None = None,
    sets: TapSets | None = None,
) -> Gathered:
    """Return what each step-th pixel gathers; the model of the kernel.

    Args:
        gbuffer: depth of any number of layers, normals of as many or of the front one.
        params: see `PointsParams`.
        step: 1, 2 or 4.
        radiance: [layers, rows, columns, 3] with margin, of the layers that send light, or None.
        sky: [rows, columns, 3], a latitude-longitude image, or None.
        sets: other taps than the kernel's: more of them, the same or not for all pixels.
    """
    params = params or PointsParams()
    views = layers_of(gbuffer)
    sets = sets or tap_sets(params.samples, None if sky is None else np.asarray(sky, np.float64))
    sent = None if radiance is None else np.asarray(radiance, np.float64)
    at = receivers(views[0], params, step)
    given = gbuffer.first("thickness")
    y, x = np.indices(at.there.shape)
    shape = at.there.shape
    hidden, known = np.zeros(shape), np.zeros(shape)
    light, unknown = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    bounce = np.zeros((*shape, 3))
    in_image, hiding = [], []
    turn = gbuffer.camera.view[:3, :3]
    for number in range(sets.length.shape[2]):
        way = sets.direction[y % 4, x % 4, number] @ turn.T
        solid_angle = sets.solid_angle[y % 4, x % 4, number]
        cosine = np.sum(way * at.normal, axis=-1)
        turned = cosine < 0.0
        way = np.where(turned[..., None], -way, way)
        cosine = np.abs(cosine)
        length = sets.length[y % 4, x % 4, number] * at.radius
        counts, hides, arriving = look_up(
            views, given, sent, at, at.position + length[..., None] * way,
            NEAREST_SAMPLE * -at.position[..., 2], solid_angle, params,
        )
        in_image.append(counts)
        hiding.append(hides > 0.0)
        hidden += np.where(counts, hides, 0.0) * solid_angle * cosine
        known += np.where(counts, solid_angle * cosine, 0.0)
        bounce += np.where(counts[..., None], arriving, 0.0)
        if sets.light is not None:
            sides = sets.light[y % 4, x % 4, number]
            there = np.where(turned[..., None], sides[..., 1, :], sides[..., 0, :])
            there = there * cosine[..., None]
            light += np.where(counts[..., None], there * (1.0 - hides)[..., None], 0.0)
            unknown += np.where(counts[..., None], 0.0, there)
    openness = np.clip(1.0 - hidden / np.maximum(known, 1e-30), 0.0, 1.0)
    openness = np.where(at.there, openness, 1.0)
    there = at.there[..., None]
    return Gathered(
        openness, np.where(there, light + unknown * openness[..., None], 0.0),
        np.where(there, bounce, 0.0), np.stack(in_image), np.stack(hiding),
    )


def layers_of(gbuffer: GBuffer) -> list[SurfaceView]:
    """Return each depth layer as an image of its own."""
    depth: NDArray[np.float32] = gbuffer.depth  # type: ignore[assignment]
    normal: NDArray[np.float32] | None = gbuffer.normal  # type: ignore[assignment]
    deep = depth if depth.ndim == 3 else depth[None]
    views = []
    for number, layer in enumerate(deep):
        own = normal if normal is None or normal.ndim == 3 else normal[number]
        views.append(SurfaceView.of(GBuffer(camera=gbuffer.camera, depth=layer, normal=own)))
    return views


def receivers(view: SurfaceView, params: PointsParams, step: int) -> Receivers:
    """Return every step-th pixel."""
    row, column = (view.inner(centre)[::step, ::step] for centre in view.centres())
    depth = view.inner(view.depth)[::step, ::step]
    there = np.isfinite(depth)
    depth = np.where(there, depth, 1.0)
    wanted_px = params.radius * view.pixels_per_unit(depth)
    shrink = np.minimum(params.max_radius_px / wanted_px, 1.0)
    radius = params.radius * shrink
    return Receivers(
        there=there,
        active=there & (wanted_px * shrink >= step),
        position=view.position(row, column, depth),
        normal=view.inner(view.normal)[::step, ::step],
        radius=radius,
        floor=params.bias * radius + DEPTH_BIAS * depth,
    )


def look_up(
    views: list[SurfaceView],
    given: NDArray[np.float32] | None,
    sent: Doubles | None,
    at: Receivers,
    tap: Doubles,
    nearest: Doubles | float,
    solid_angle: Doubles,
    params: PointsParams,
) -> tuple[NDArray[np.bool_], Doubles, Doubles]:
    """Return whether each pixel's tap counts, how much it hides, and the light that comes.

    Args:
        views: a camera's layers.
        given: thickness of the front one, or None.
        sent: [layers, rows, columns, 3] radiance, or None.
        at: receivers in the camera's view space, as the taps' places are.
        tap: [rows, columns, 3] places of the taps.
        nearest: depth of a tap up to which it doesn't count.
        solid_angle: of the taps' directions, steradians.
        params: see `PointsParams`.
    """
    front = views[0]
    depth = -tap[..., 2]
    visible = at.active & (depth > nearest)
    row, column = front.pixel(np.where(visible[..., None], tap, [0.0, 0.0, -1.0]))
    rows, columns = front.depth.shape
    counts = visible & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    row = np.clip(np.floor(row), 0, rows - 1).astype(int)
    column = np.clip(np.floor(column), 0, columns - 1).astype(int)
    hides, arriving = np.zeros(depth.shape), np.zeros((*depth.shape, 3))
    for number, view in enumerate(views):
        seen = view.depth[row, column]
        deeper = views[number + 1].depth[row, column] if number + 1 < len(views) else np.inf
        thick = params.thickness * at.radius
        if given is not None and number == 0:
            thick = given[row, column].astype(np.float64)
        back = np.minimum(seen + thick, deeper)
        within = counts & (depth > seen) & (depth < back)
        seen = np.where(within, seen, np.maximum(-at.position[..., 2], nearest))
        surface = view.position(row + 0.5, column + 0.5, seen)
        way = surface - at.position
        height = np.sum(way * at.normal, axis=-1)
        hit = within & (height > at.floor)
        share = np.minimum(depth - seen, height - at.floor) / (ONSET * at.radius)
        hides = np.maximum(hides, np.where(hit, np.minimum(share, 1.0), 0.0))
        if sent is not None and number < len(sent):
            facing = view.normal[row, column]
            along = view.position(row + 0.5, column + 0.5, np.ones(seen.shape))
            if view.camera.is_orthographic:
                along = np.broadcast_to([0.0, 0.0, -1.0], way.shape)
            form = _form(way, at, facing, along, back - seen, solid_angle, params)
            sends = np.where(hit, form, 0.0)[..., None]
            arriving = arriving + sends * sent[number][row, column]
    return counts, hides, arriving


def _form(
    way: Doubles,
    at: Receivers,
    facing: Doubles,
    along: Doubles,
    thickness: Doubles,
    solid_angle: Doubles,
    params: PointsParams,
) -> Doubles:
    """Return irradiance over radiance of senders; see kernels/ssdo_points/sender.clh."""
    square = np.maximum(np.sum(way * way, axis=-1), 1e-300)
    radius = at.radius
    cosines = np.sum(way * at.normal, axis=-1) * -np.sum(way * facing, axis=-1) / square
    sends = (np.sum(way * facing, axis=-1) < 0.0) & (square <= radius * radius)
    if params.area == "paper":
        area = params.strength * np.pi * radius**2 / params.samples
        form = cosines * area / np.maximum(square, (params.nearest * radius) ** 2)
        return np.where(sends, form, 0.0)
    length = np.linalg.norm(along, axis=-1)
    sight = along / length[..., None]
    start = np.sum(way * sight, axis=-1)
    h = np.sqrt(np.maximum(square - start * start, 1e-6 * square))
    down = np.maximum(-np.sum(sight * at.normal, axis=-1), 1e-6)
    end = np.minimum(
        np.sqrt(np.maximum(radius * radius - h * h, 0.0)), start + thickness * length
    )
    end = np.minimum(end, start + np.sum(way * at.normal, axis=-1) / down)
    end = np.maximum(end, start)
    # Perspective lines part: along them the density of taps counts times the squared depth.
    depth = -(at.position + way)[..., 2]
    is_perspective = np.any(sight != [0.0, 0.0, -1.0])
    gain = 1.0 / (length * depth) if is_perspective else np.zeros(depth.shape)
    first = 1.0 - start * gain
    angle = np.arctan2(h * (end - start), h * h + start * end)
    integral = (
        (first * first - (gain * h) ** 2) * angle / h
        + first * gain * np.log((h * h + end * end) / (h * h + start * start))
        + gain * gain * (end - start)
    )
    across = np.abs(np.sum(facing * sight, axis=-1))
    bound = np.pi * square * integral * across / (solid_angle * radius)
    return np.where(sends, np.pi * cosines / (bound + 1.0 / TILE), 0.0)
