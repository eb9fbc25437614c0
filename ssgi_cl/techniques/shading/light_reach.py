"""Which lights are proven to light nothing of what is seen, from boxes round what tiles hold.

Few lights are held against all tiles. Many are held against boxes round runs of tiles first; one
that these don't keep out is held against the tiles of the run that it lights best, and only one
that those do keep out against the tiles of all runs that it may light.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, SpotLight
from ssgi_cl.device.constants import TILES_FLAT

if TYPE_CHECKING:
    from ssgi_cl.techniques.shading.light_data import PunctualLight

RUN = 64
"""Tiles of a run."""

FEW = 1 << 9
"""Pairs of a light and a tile that take no longer than it takes to look at runs first."""

AWAY = 1e-5
"""Cosine by which normals must be turned away from a light: more than roundings of float32."""

FLAT = 2.0 * TILES_FLAT
"""Distance of a flat tile's points from its plane, relative to that of the eye; twice what the
kernel allows, for roundings."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes round points and round their normals, view space; arrays may have further axes first.

    Attributes:
        least, greatest: [n, 3] corners round points, scene units.
        normal_least, normal_greatest: [n, 3] corners round normals.
        offset: [n] least n . p of the tangent planes, scene units; -inf where that is not known.
    """

    least: Floats
    greatest: Floats
    normal_least: Floats
    normal_greatest: Floats
    offset: Floats

    def at(self, places: NDArray[np.int64]) -> Boxes:
        """Return the boxes at these places, of any shape."""
        return Boxes(
            self.least[places],
            self.greatest[places],
            self.normal_least[places],
            self.normal_greatest[places],
            self.offset[places],
        )

    def runs(self) -> Boxes:
        """Return boxes round each run of boxes."""
        first = np.arange(0, len(self.offset), RUN)
        return Boxes(
            np.minimum.reduceat(self.least, first),
            np.maximum.reduceat(self.greatest, first),
            np.minimum.reduceat(self.normal_least, first),
            np.maximum.reduceat(self.normal_greatest, first),
            np.minimum.reduceat(self.offset, first),
        )


class _PunctualLights:
    """Lights in a camera's view space, one a row."""

    def __init__(self, punctual_lights: Sequence[PunctualLight], camera: Camera) -> None:
        turn, shift = camera.view[:3, :3], camera.view[:3, 3]
        far = np.array([isinstance(punctual_light, DirectionalLight) for punctual_light in punctual_lights])
        self.placed = 1.0 - far[:, None]
        # Of a directional light, the way to it in place of its position.
        places = np.array(
            [
                -np.asarray(punctual_light.direction)
                if isinstance(punctual_light, DirectionalLight)
                else np.asarray(punctual_light.position)
                for punctual_light in punctual_lights
            ]
        )
        self.position = places @ turn.T + shift * self.placed
        self.any_placed = not far.all()
        spots = [
            punctual_light if isinstance(punctual_light, SpotLight) else None for punctual_light in punctual_lights
        ]
        self.axis = np.array([np.zeros(3) if spot is None else np.asarray(spot.direction) for spot in spots]) @ turn.T
        self.angle = np.array([[math.pi if s is None else s.cone_angle] for s in spots])
        self.any_spot = any(spot is not None for spot in spots)
        self.radius = np.array(
            [
                [0.0 if isinstance(punctual_light, DirectionalLight) else punctual_light.radius]
                for punctual_light in punctual_lights
            ]
        )

    def margins(self, boxes: Boxes, rows: NDArray[np.int64]) -> Floats:
        """Return for some of the lights and each box (or their own: boxes [lights, n]) a number
        that is above 0 unless the light is proven to bring nothing to what is in the box."""
        placed, radius, angle = self.placed[rows], self.radius[rows], self.angle[rows]
        position, axis = self.position[rows, None], self.axis[rows, None]
        apart, room = placed[..., None], radius[..., None]
        low = position - boxes.greatest * apart - room
        high = position - boxes.least * apart + room
        length = _norm(np.maximum(np.abs(low), np.abs(high)))
        ends = [n * way for n in (boxes.normal_least, boxes.normal_greatest) for way in (low, high)]
        height = np.maximum.reduce(ends).sum(axis=-1)
        if self.any_placed:
            above = self._above_planes(boxes, position) + radius
            height = np.where(placed > 0.0, np.minimum(height, above), height)
        margin: Floats = height / np.maximum(length, 1e-300) + AWAY
        if not self.any_spot:
            return margin
        # A cone that begins in a ball may meet boxes whose balls it meets.
        offset = 0.5 * (boxes.least + boxes.greatest) - position
        distance = np.maximum(_norm(offset), 1e-300)
        off_axis = np.arccos(np.clip((offset * axis).sum(axis=-1) / distance, -1.0, 1.0))
        extent = 0.5 * _norm(boxes.greatest - boxes.least) + radius
        widened = np.arcsin(np.clip(extent / distance, 0.0, 1.0))
        met = (off_axis <= angle + widened + 1e-3) | (distance <= extent)
        return np.where(met, margin, -1.0)

    def _above_planes(self, boxes: Boxes, position: Floats) -> Floats:
        """Return how high points may lie above any tangent plane of each box; inf if unknown.

        A box round a slanted plane is much larger than the plane.
        """
        most = np.maximum(boxes.normal_least * position, boxes.normal_greatest * position)
        farthest = _norm(np.maximum(np.abs(boxes.least), np.abs(boxes.greatest)))
        spread = _norm(boxes.normal_greatest - boxes.normal_least)
        above: Floats = most.sum(axis=-1) - boxes.offset + (spread + FLAT) * farthest
        return above


def reaching(punctual_lights: Sequence[PunctualLight], boxes: Boxes, camera: Camera) -> NDArray[np.bool_]:
    """Return for each light False if it is proven to light nothing in any of the boxes."""
    count = len(boxes.offset)
    reach = np.zeros(len(punctual_lights), np.bool_)
    if not punctual_lights or not count:
        return reach
    held = _PunctualLights(punctual_lights, camera)
    if len(punctual_lights) * count <= FEW:
        reach[:] = (held.margins(boxes, np.arange(len(punctual_lights))) > 0.0).any(axis=1)
        return reach
    margins = held.margins(boxes.runs(), np.arange(len(punctual_lights)))
    open_ = np.flatnonzero((margins > 0.0).any(axis=1))
    best = margins[open_].argmax(axis=1)
    # The last run may be shorter: its last tile stands in for those that it lacks.
    members = np.minimum(best[:, None] * RUN + np.arange(RUN), count - 1)
    reach[open_] = (held.margins(boxes.at(members), open_) > 0.0).any(axis=1)
    for punctual_light in open_[~reach[open_]]:
        tiles = np.flatnonzero(np.repeat(margins[punctual_light] > 0.0, RUN)[:count])
        reach[punctual_light] = (held.margins(boxes.at(tiles), np.array([punctual_light])) > 0.0).any()
    return reach


def _norm(vectors: Floats) -> Floats:
    """Return the lengths along the last axis, three numbers each."""
    length: Floats = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return length
