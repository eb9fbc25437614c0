"""A tree of virtual point lights in float64."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.reference.occupancy.occupancy_grid import OccupancyGridReference
from ssgi_cl.reference.vpl.vpl_splat import LUMINANCE, PARTS

Doubles = NDArray[np.float64]
Numbers = NDArray[np.int64]

CURVED, BENT = 3.0, 0.3
"""CUT_CURVED and CUT_BENT in kernels/multires/cut.clh."""
BRIGHT, FAINT = 0.35, 0.25
"""BRIGHT and FAINT of `techniques.vpl.vpl_tree`."""
GOLDEN = 0.618034
AXES = (1.0, 0.94, 1.13)
"""Weights of the axes in kernels/multires/cluster_order.cl."""


@dataclass(frozen=True, eq=False)
class Group:
    """Bounds of some samples: positions, normals and heights of tangent planes, view space."""

    low: Doubles
    high: Doubles
    normal_low: Doubles
    normal_high: Doubles
    least: float
    most: float


def group_of(point: Doubles, normal: Doubles) -> Group:
    """Return the bounds of samples [n, 3] in view space."""
    height = np.sum(point * normal, axis=1)
    return Group(
        point.min(axis=0),
        point.max(axis=0),
        normal.min(axis=0),
        normal.max(axis=0),
        float(height.min()),
        float(height.max()),
    )


class VplTreeReference:
    """The tree over at most 2048 lights.

    Args:
        vpls: the lights.
        camera: in whose view space the tree is.

    Attributes:
        order: which light is at each place.
        first: number of the first record of lights and of runs of 4, 16 and 64.
        position, normal, flux, area: of all records; the mean normals are not of unit length.
    """

    def __init__(self, vpls: Vpls, camera: Camera) -> None:
        turn = camera.view[:3, :3]
        position = vpls.position @ turn.T + camera.view[:3, 3]
        normal = vpls.normal @ turn.T
        axis = np.argmax(np.abs(normal) * AXES, axis=1)
        positive = np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] > 0.0
        self.order = order = np.argsort(2 * axis + positive, kind="stable")
        self._parts, self._to_view = vpls.parts, camera.view
        self._orthographic = camera.is_orthographic
        self.count = count = len(vpls)
        stride = -(-count // 16) * 16
        sizes = (stride, stride // 4, stride // 16, -(-stride // 64))
        self.first = (0, *np.cumsum(sizes)[:-1].tolist())
        self.position = np.zeros((sum(sizes), 3))
        self.normal, self.flux = np.zeros((2, sum(sizes), 3))
        self.area, self.deviation, self.turn = np.zeros((3, sum(sizes)))
        self.target = np.zeros(sum(sizes), np.intp)
        self._low, self._high, self._normal_low, self._normal_high = np.zeros((4, sum(sizes), 3))
        own = (position[order], normal[order], vpls.flux[order], vpls.area[order])
        bounds = self._bounds(position[order], normal[order])
        for level, (start, size) in enumerate(zip(self.first, sizes, strict=True)):
            for run in range(size):
                lights = slice(run * 4**level, min((run + 1) * 4**level, count))
                if lights.start < lights.stop:
                    self._make(start + run, *(values[lights] for values in own))
                    for bound, values, extreme in bounds:
                        bound[start + run] = extreme(values[lights], axis=0)
                    flux = np.cumsum(self.flux[lights] @ LUMINANCE)
                    wanted = (run + 0.5) * GOLDEN % 1.0 * flux[-1]
                    found = int(np.searchsorted(flux, wanted, side="right"))
                    self.target[start + run] = lights.start + min(found, len(flux) - 1)

    def _make(self, record: int, position: Doubles, normal: Doubles, flux: Doubles, area: Doubles) -> None:
        weight = flux @ LUMINANCE + 1e-300
        weight = weight / weight.sum()
        self.position[record] = at = weight @ position
        self.normal[record] = way = weight @ normal
        self.flux[record] = flux.sum(axis=0)
        self.area[record] = weight @ area
        self.deviation[record] = math.sqrt(weight @ np.sum((position - at) ** 2, axis=1))
        self.turn[record] = math.sqrt(weight @ np.sum((normal - way) ** 2, axis=1))

    def _bounds(self, position: Doubles, normal: Doubles) -> list[tuple[Doubles, Doubles, Any]]:
        """Return the bounds of records, those of lights with their parts, and how they are joined."""
        found: list[tuple[Doubles, Doubles, Any]] = []
        own = ((position, self._low, self._high), (normal, self._normal_low, self._normal_high))
        for which, (values, lows, highs) in enumerate(own):
            low, high = values, values
            if self._parts is not None:
                shines = np.any(self._parts.flux > 0.0, axis=1).reshape(-1, PARTS, 1)[self.order]
                parts = (self._parts.position, self._parts.normal)[which] @ self._to_view[:3, :3].T
                parts = (parts if which else parts + self._to_view[:3, 3]).reshape(-1, PARTS, 3)[self.order]
                low = np.minimum(low, np.where(shines, parts, np.inf).min(axis=1))
                high = np.maximum(high, np.where(shines, parts, -np.inf).max(axis=1))
            found += [(lows, low, np.min), (highs, high, np.max)]
        return found

    def error(self, records: Numbers, group: Group) -> tuple[Doubles, NDArray[np.bool_]]:
        """Return by how much records are estimated to be off (W/m^2), and which give nothing."""
        low, high = self._low[records], self._high[records]
        to_low, to_high = low - group.high, high - group.low
        gap = np.maximum(np.maximum(to_low, -to_high), 0.0)
        squared = np.sum(gap * gap, axis=1) + 1e-12
        distance = np.sqrt(squared)
        lowest, highest = _products(low, high, group.normal_low, group.normal_high)
        received, least_received = highest - group.least, lowest - group.most
        away = -self._normal_high[records], -self._normal_low[records]
        least_emitted, emitted = _products(to_low, to_high, *away)
        dark = (received <= 0.0) | (emitted <= 0.0) | ~np.any(self.flux[records] > 0.0, axis=1)
        r, e = np.minimum(received, distance), np.minimum(emitted, distance)
        deviation = self.deviation[records]
        bent = np.where(least_received < 0.0, np.minimum(deviation, r) * e, 0.0)
        over = np.minimum(deviation + distance * self.turn[records], e) * r
        bent += np.where(least_emitted < 0.0, over, 0.0)
        error = CURVED * r * e * deviation**2 / squared + BENT * bent
        spread = squared * (math.pi * squared + self.area[records])
        return self.flux[records].max(axis=1) * error / spread, dark

    def faint(self, records: Numbers, group: Group, tolerance: float) -> NDArray[np.bool_]:
        """Return whether the runs of 64 lights that records belong to send less than `FAINT` of the
        tolerance in W/m^2, unhidden and face to face at the centre of a group.
        """
        return self._sends_less(records, group, FAINT * tolerance, 3)

    def bright(self, records: Numbers, group: Group, tolerance: float) -> NDArray[np.bool_]:
        """Return whether the runs of 16 lights that records belong to, or begin, send more than
        `BRIGHT` of the tolerance and are not faint."""
        limit = BRIGHT * tolerance if tolerance > 0.0 else math.inf
        less = self._sends_less(records, group, limit, 2)
        return ~less & ~self.faint(records, group, tolerance)

    def _sends_less(self, records: Numbers, group: Group, limit: float, wanted: int) -> NDArray[np.bool_]:
        level = np.searchsorted(self.first, records, side="right") - 1
        number = records - np.array(self.first)[level]
        # Of a run that is longer, the first of those of the wanted length.
        number = number * 4 ** np.maximum(level - wanted, 0) // 4 ** np.maximum(wanted - level, 0)
        runs = self.first[wanted] + number
        centres = self._low[runs] + self._high[runs] - group.low - group.high
        squared = np.sum((0.5 * centres) ** 2, axis=1) + self.deviation[runs] ** 2
        spread = math.pi * squared + self.area[runs]
        result: NDArray[np.bool_] = self.flux[runs].max(axis=1) <= limit * spread
        return result

    def cut(self, group: Group, tolerance: float) -> Numbers:
        """Return the records that shine on a group, in no particular order.

        Args:
            group: of samples.
            tolerance: up to which error a run stands for its lights, W/m^2.
        """
        found = []
        runs = np.arange(len(self.area) - self.first[3])
        for level in (3, 2, 1):
            records = self.first[level] + runs
            error, dark = self.error(records, group)
            fits = error <= tolerance
            found.append(records[fits & ~dark])
            open_runs = runs[~fits & ~dark]
            runs = (4 * open_runs[:, None] + np.arange(4)).ravel()
            runs = runs[runs < self.first[level] - self.first[level - 1]]
        runs = runs[runs < self.count]
        found.append(runs[~self.error(runs, group)[1]])
        return np.concatenate(found)

    def irradiance(
        self,
        records: Numbers,
        point: Doubles,
        normal: Doubles,
        occupancy: OccupancyGridReference | None = None,
        share: int = 16,
        refine: float = 0.0,
        shared: NDArray[np.bool_] | None = None,
        bright: NDArray[np.bool_] | None = None,
    ) -> Doubles:
        """Return irradiance [samples, 3] in W/m^2 by records at samples in view space.

        From a distance of sqrt(refine A) to half of that, lights with parts give way to them; runs
        of lights don't.
        What belongs to a run of `share` lights, 4, 16 or 64, shares a shadow ray to its light
        before which a fraction of its flux lies, of a golden-ratio sequence over the runs. A longer
        run has its own. Records that are `shared` have that of their run of 64, those that are
        `bright` that of their run of 4.
        """
        way = self.position[records] - point[:, None]
        squared = np.maximum(np.sum(way * way, axis=-1), 1e-300)
        received = np.maximum(np.sum(way * normal[:, None], axis=-1), 0.0)
        emitted = np.maximum(-np.sum(way * self.normal[records], axis=-1), 0.0)
        weight = received * emitted / (squared * (math.pi * squared + self.area[records]))
        visible = np.ones(weight.shape)
        if occupancy is not None:
            level = np.searchsorted(self.first, records, side="right") - 1
            line = np.maximum(level, round(math.log(share, 4)))
            line = line if shared is None else np.where(shared, 3, line)
            line = line if bright is None else np.where(bright, np.maximum(level, 1), line)
            first = np.array(self.first)
            runs = first[line] + (records - first[level]) // 4 ** (line - level)
            eye = np.tile([0.0, 0.0, 1.0], (len(point), 1))
            if not self._orthographic:
                eye = -point / np.linalg.norm(point, axis=1, keepdims=True)
            for run in np.unique(runs):
                end = self.target[run]
                hidden = occupancy.hidden(point, normal, self.position[end], self.normal[end], eye)
                visible[np.ix_(hidden, runs == run)] = 0.0
        near = np.zeros(weight.shape)
        if self._parts is not None and refine > 0.0:
            lost = 4.0 / 3.0 * (1.0 - squared / (refine * self.area[records]))
            near = np.where(records < self.count, np.clip(lost, 0.0, 1.0), 0.0) * visible
        result: Doubles = (weight * (visible - near)) @ self.flux[records]
        for column in np.flatnonzero(near.any(axis=0)):
            shining = self._of_parts(int(self.order[records[column]]), point, normal)
            result += near[:, column, None] * shining
        return result

    def _of_parts(self, light: int, point: Doubles, normal: Doubles) -> Doubles:
        """Return irradiance [samples, 3] by the parts of a light."""
        parts = self._parts
        assert parts is not None  # noqa: S101  `irradiance` saw to it
        own, turn = slice(PARTS * light, PARTS * (light + 1)), self._to_view[:3, :3]
        way = parts.position[own] @ turn.T + self._to_view[:3, 3] - point[:, None]
        squared = np.maximum(np.sum(way * way, axis=-1), 1e-300)
        received = np.maximum(np.sum(way * normal[:, None], axis=-1), 0.0)
        emitted = np.maximum(-np.sum(way * (parts.normal[own] @ turn.T), axis=-1), 0.0)
        weight = received * emitted / (squared * (math.pi * squared + parts.area[own]))
        result: Doubles = weight @ parts.flux[own]
        return result


def _products(a_low: Doubles, a_high: Doubles, b_low: Doubles, b_high: Doubles) -> tuple[Doubles, Doubles]:
    """Return the least and greatest dot product of vectors between bounds."""
    every = np.stack([a * b for a in (a_low, a_high) for b in (b_low, b_high)])
    return every.min(axis=0).sum(axis=-1), every.max(axis=0).sum(axis=-1)
