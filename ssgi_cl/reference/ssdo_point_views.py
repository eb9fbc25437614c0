"""Further cameras of SSDO from taps in float64, as `ssgi_cl.techniques.ssdo_point_views` says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.camera import Camera
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles
from ssgi_cl.reference.ssdo_points import Gathered, layers_of, look_up, receivers
from ssgi_cl.techniques.ssdo_points import PointsParams
from ssgi_cl.techniques.ssdo_taps import tap_sets


def ssdo_point_views_reference(
    gbuffer: GBuffer,
    before: Gathered,
    other: GBuffer,
    radiance: ArrayLike | None,
    params: PointsParams | None = None,
    *,
    step: int = 1,
    sky: ArrayLike | None = None,
) -> Gathered:
    """Return what each step-th pixel gathers after a further camera; the model of the kernel.

    Args:
        gbuffer: what the first camera sees.
        before: what `ssdo_points_reference`, or this for another camera, returned.
        other: what the further camera sees.
        radiance: [layers, rows, columns, 3] of it with margin, dark where `seen_before`, or None.
        params: see `PointsParams`.
        step: 1, 2 or 4.
        sky: [rows, columns, 3], the image that `before` was made with, or None.
    """
    params = params or PointsParams()
    assert before.known is not None  # noqa: S101  of what this module is given
    assert before.hides is not None  # noqa: S101  likewise
    own = receivers(layers_of(gbuffer)[0], params, step)
    turn, shift = _between(gbuffer.camera, other.camera)
    at = replace(own, position=own.position @ turn.T + shift, normal=own.normal @ turn.T)
    views, given = layers_of(other), other.first("thickness")
    sent = None if radiance is None else np.asarray(radiance, np.float64)
    sets = tap_sets(params.samples, None if sky is None else np.asarray(sky, np.float64))
    y, x = np.indices(own.there.shape)
    shape = own.there.shape
    hidden, known_before, known = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    colours = (*shape, 3)
    more, unknown_before, unknown = np.zeros(colours), np.zeros(colours), np.zeros(colours)
    bounce = before.bounce.copy()
    in_image, hiding = before.known.copy(), before.hides.copy()
    for number in range(params.samples):
        way = sets.direction[y % 4, x % 4, number] @ gbuffer.camera.view[:3, :3].T
        solid_angle = sets.solid_angle[y % 4, x % 4, number]
        cosine = np.sum(way * own.normal, axis=-1)
        turned = cosine < 0.0
        way = np.where(turned[..., None], -way, way)
        cosine = np.abs(cosine)
        length = sets.length[y % 4, x % 4, number] * own.radius
        tap = (own.position + length[..., None] * way) @ turn.T + shift
        counts, hides, arriving = look_up(
            views, given, sent, at, tap, 1e-3 * params.radius, solid_angle, params
        )
        bounce += np.where(counts[..., None], arriving, 0.0)
        was_known, was_hiding = before.known[number], before.hides[number]
        share = np.where(counts & ~was_hiding, hides, 0.0)
        hidden += share * solid_angle * cosine
        known_before += np.where(was_known, solid_angle * cosine, 0.0)
        known += np.where(was_known | counts, solid_angle * cosine, 0.0)
        if sets.light is not None:
            sides = sets.light[y % 4, x % 4, number]
            there = np.where(turned[..., None], sides[..., 1, :], sides[..., 0, :])
            there = there * cosine[..., None]
            adds = counts & ~was_known
            more += (np.where(adds, 1.0, 0.0) - share)[..., None] * there
            unknown_before += np.where(was_known[..., None], 0.0, there)
            unknown += np.where((was_known | counts)[..., None], 0.0, there)
        in_image[number] |= counts
        hiding[number] |= share > 0.0
    all_hidden = (1.0 - before.openness) * known_before + hidden
    openness = np.clip(1.0 - all_hidden / np.maximum(known, 1e-30), 0.0, 1.0)
    openness = np.where(own.active, openness, before.openness)
    light = before.sky - unknown_before * before.openness[..., None] + more
    light = np.maximum(light + unknown * openness[..., None], 0.0)
    light = np.where(own.active[..., None], light, before.sky)
    return Gathered(openness, light, bounce, in_image, hiding)


def seen_before(
    other: GBuffer, earlier: GBuffer, radius: float, layers: int
) -> NDArray[np.bool_]:
    """Return [layers, rows, columns], with margin: what of a camera's layers another shows.

    Args:
        other: what the further camera sees, with normals of each layer.
        earlier: what the one before it sees.
        radius: of the half ball, scene units.
        layers: of the earlier one that send light.
    """
    turn, shift = _between(other.camera, earlier.camera)
    to_x, to_y, _, _ = earlier.camera.pixel_to_view
    senders = layers_of(earlier)[:layers]
    rows, columns = senders[0].depth.shape
    result = []
    for view in layers_of(other):
        there = np.isfinite(view.depth)
        place = view.position(*view.centres(), np.where(there, view.depth, 1.0)) @ turn.T + shift
        normal = view.normal @ turn.T
        inside = there & (-place[..., 2] > 1e-3 * radius)
        row, column = senders[0].pixel(np.where(inside[..., None], place, [0.0, 0.0, -1.0]))
        inside &= (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        row = np.clip(np.floor(row), 0, rows - 1).astype(int)
        column = np.clip(np.floor(column), 0, columns - 1).astype(int)
        sight = senders[0].position(row + 0.5, column + 0.5, np.ones(row.shape))
        ahead: Doubles | float = np.maximum(-place[..., 2], 1e-3 * radius)
        if earlier.camera.is_orthographic:
            sight, ahead = np.broadcast_to([0.0, 0.0, -1.0], sight.shape), 1.0
        pixel = max(abs(to_x), abs(to_y)) * ahead
        found = np.zeros(inside.shape, bool)
        for sender in senders:
            depth = sender.depth[row, column]
            shows = np.isfinite(depth)
            surface = sender.position(row + 0.5, column + 0.5, np.where(shows, depth, 1.0))
            found |= shows & (np.abs(np.sum((surface - place) * normal, axis=-1)) <= pixel)
        result.append(inside & found & (np.sum(sight * normal, axis=-1) < 0.0))
    return np.stack(result)


def _between(camera: Camera, further: Camera) -> tuple[Doubles, Doubles]:
    """Return turn and shift from a camera's view space to another's."""
    turn = further.view[:3, :3] @ camera.view[:3, :3].T
    return turn, further.view[:3, 3] - turn @ camera.view[:3, 3]
