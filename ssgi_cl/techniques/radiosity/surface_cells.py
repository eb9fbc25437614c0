"""Cells that the surfaces of a scene lie in: what makes a light volume of the light that surfaces send."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, LightVolume, cells_at, device_cells
from ssgi_cl.techniques.radiosity.surfels import Surfels, facing_axis
from ssgi_cl.techniques.radiosity.triangle_rays import row_length

Doubles = NDArray[np.float64]

FAINT = 1e-3
"""Area that surfaces from another cell are given in one that has none, in sides of a cell squared."""
BRIGHTEST = 1e30
"""W m^-2 sr^-1: more counts as this."""
NEAR = 3.0
"""Within so many cells surfaces stand for others, or so many widths of a piece, if these are more."""
FARTHEST = 24.0
"""Cells within which surfaces stand for others, at most."""
LEAST_SEEN = 1e-6
"""Of the largest area that faces a side in any cell: less is none."""
LEAST_SHOWN = 0.01
"""What a piece counts at least, so that a cell has a mean where all of its pieces are in a gap."""
BEFORE = 0.01
"""Cells before a surface that it is looked up, as VOLUME_BEFORE of kernels/radiosity/volume.clh."""
LEAST_DIVIDED = 0.02
"""Part of the surfaces of a cell that face alike that a plane must hide from the others to divide it."""
MOST_ASTRAY = 0.1
"""Part of them that may lie on the wrong side of it."""
BEYOND = 0.1
"""Cells beyond which a plane divides no cell: one along the sides of cells decides where they look for surfaces."""
LOOK = 0.25
"""Cells above their surfaces at which pieces look at each other."""

_SHAPE = (CELLS, CELLS, CELLS)
_RINGS = [
    np.array([step for step in itertools.product((-1, 0, 1), repeat=3) if np.abs(step).sum() == far])
    for far in range(4)
]
"""Steps to a cell itself, and to those that share a side, an edge or a corner with it."""
Planes = Callable[[NDArray[np.intp], float], Doubles]
"""Takes for each piece the number of another in its cell, and a height above both, scene units.

Returns [n, 4] the plane of what hides one from the other: its normal, towards the other, and where it is along that; 0
where nothing does."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of surfaces, each on the side of its normal.

    Attributes:
        position: [count, 3] float64, scene units.
        normal: [count, 3], unit length.
        area: [count], scene units squared.
    """

    position: Doubles
    normal: Doubles
    area: Doubles

    @classmethod
    def of(cls, surfels: Surfels) -> Pieces:
        """Return the parts of surfels."""
        return cls(surfels.part_position + surfels.origin, surfels.part_normal, surfels.part_area)

    @classmethod
    def none(cls) -> Pieces:
        """Return no piece."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


class SurfaceCells:
    """The cells of a cube that surfaces lie in, and which sides they face there.

    Where a cell has no surface that faces a side, the nearest within `NEAR` that has counts, as seen from the side that
    its own face and not behind these, as if it were `FAINT` of the cell's side. Where none has, that side is black.

    Args:
        runtime: the device, which finds those.
        lit: pieces that stand for all surfaces that light reaches.
        low, extent: of the cube, see `LightVolume`.
        unlit: of surfaces that no light reaches: where a lit one within `NEAR` faces the same way that counts, as cells
            are thicker than some walls.
        shown: [lit pieces] what each counts for its cell, 0 to 1: the part of its hemisphere that is open to beyond the
            cell. Rays from afar come to a piece in that proportion, seldom into a gap.
        seen: [lit pieces] whether a surface sees them, as rays come from surfaces. Those that none sees, such as the
            outside of a building, count least, and not at all where another within `NEAR` faces the same way.
        planes: finds what divides cells into two spaces that do not see each other, such as walls; each side of it
            then has a mean of its own.
    """

    def __init__(
        self,
        runtime: Runtime,
        lit: Pieces,
        low: Doubles,
        extent: float,
        unlit: Pieces | None = None,
        shown: Doubles | None = None,
        planes: Planes | None = None,
        seen: NDArray[np.bool_] | None = None,
    ) -> None:
        self.low, self.extent = low, extent
        seen = np.ones(len(lit.area), np.bool_) if seen is None else seen
        shown = np.where(seen, np.maximum(1.0 if shown is None else shown, LEAST_SHOWN), LEAST_SHOWN)
        dark = Pieces.none() if unlit is None else unlit
        own, others = self._cell(lit.position), self._cell(dark.position)
        there = np.zeros(CELLS**3, np.bool_)
        there[own] = there[others] = True
        there[0] |= not there.any()
        divided, cut = own[:0], np.zeros((0, 4))
        if planes is not None and len(own):
            divided, cut = self._divide(lit, lit.area * shown, own, there, planes)
        self._grid = grid = _RecordGrid(there, divided, cut)
        self.cells = grid.cells()
        count = len(grid.place)
        record = self._records(own, lit)
        towards: Doubles = np.zeros((count, 3))
        for axis, part in enumerate(lit.normal.T):
            towards[:, axis] = np.bincount(record, lit.area * part, count)
        grid.look_towards(towards)
        slots = _Slots.of(record, lit.normal)
        self._shown_area = slots.sums(lit.area * shown, count)
        black = _Slots.of(self._records(others, dark), dark.normal).sums(dark.area, count)
        area = slots.sums(lit.area, count)
        facing = slots.sums(np.where(seen, lit.area, 0.0), count)
        least = LEAST_SEEN * area.max(axis=0, initial=0.0)
        known, area = facing > least, np.where(area > least, area, black)
        # Slots are numbered record by record.
        self._near = np.arange(count * FACES).reshape(-1, FACES)
        width = math.sqrt(float(lit.area.max(initial=0.0))) / self.side
        lender = grid.lenders(runtime, known, min(NEAR * max(width, 1.0), FARTHEST))
        lent = lender >= 0
        self._near[lent] = (lender * FACES + np.arange(FACES))[lent]
        self.area = np.maximum(np.where(lent, 0.0, area) / self.side**2, FAINT)
        # Slots that pieces face, numbered without gaps; after the last comes one for all others.
        over = np.pi * self._shown_area.ravel()
        self._sends = np.where(over > 0.0, np.cumsum(over > 0.0) - 1, np.count_nonzero(over))
        weight = slots.weight * shown[slots.piece] / np.where(over > 0.0, over, np.inf)[slots.slot]
        self._slots = _Slots(self._sends[slots.slot], slots.piece, weight)
        self._lent = self._sends[self._near]

    @property
    def side(self) -> float:
        """Side of a cell, scene units."""
        return self.extent / CELLS

    def light(self, flux: Doubles, also: tuple[Pieces, Doubles] | None = None) -> LightVolume:
        """Return the light that surfaces send.

        Args:
            flux: [lit pieces, 3] W, that they send on their sides.
            also: pieces of some of the same surfaces, and what these send besides, [n, 3] W.
        """
        slots = self._slots
        radiance = np.zeros((np.count_nonzero(self._shown_area) + 1, 3), np.float32)
        for channel, own in zip(radiance[:-1].T, flux.T, strict=True):
            sums = np.bincount(slots.slot, slots.weight * own[slots.piece], len(radiance))
            channel[:] = np.minimum(sums[:-1], BRIGHTEST)
        records = np.empty((len(self.area), FACES, 4), np.float32)
        if also is None:
            records[..., :3] = radiance.take(self._lent, axis=0)
        else:
            pieces, sent = also
            few = _Slots.of(self._records(self._cell(pieces.position), pieces), pieces.normal)
            # Pieces are few: those of some surfaces may have missed a cell that others lie in.
            area = np.maximum(self._shown_area, few.sums(pieces.area, len(self.area)))
            both = radiance.take(self._sends, axis=0) + few.mean(sent, area)
            records[..., :3] = np.minimum(both, BRIGHTEST).astype(np.float32).take(self._near, axis=0)
        records[..., 3] = self.area
        planes = self._grid.planes.astype(np.float32)
        return LightVolume(self.cells, records, self.low, self.extent, planes)

    def _records(self, cell: NDArray[np.intp], pieces: Pieces) -> NDArray[np.intp]:
        """Return the numbers of the records of pieces that lie in cells."""
        place = (pieces.position - self.low) / self.side + BEFORE * pieces.normal
        return self._grid.resolved(self.cells.ravel()[cell], place)

    def _divide(
        self, pieces: Pieces, weight: Doubles, cell: NDArray[np.intp], there: NDArray[np.bool_], planes: Planes
    ) -> tuple[NDArray[np.intp], Doubles]:
        """Return numbers of cells of which parts hide from each other, and planes between these, in cells.

        Pieces of a cell that face the same way look at that of them which has the greatest weight [pieces], and at
        those of the cells beside. A plane divides its cell, that which was looked at, and others round it that it cuts.
        """
        group = cell * FACES + facing_axis(pieces.normal)
        by_group = np.argsort(group, kind="stable")
        begins = np.flatnonzero(np.diff(group[by_group], prepend=-1))
        names, ends = group[by_group[begins]], np.append(begins[1:], len(group))
        member = np.empty_like(group)
        member[by_group] = np.repeat(np.arange(len(names)), ends - begins)
        most = by_group[begins + _heaviest(weight[by_group], begins, ends)]
        total = np.add.reduceat(weight[by_group], begins)
        at = pieces.position + BEFORE * self.side * pieces.normal
        cells: list[NDArray[np.intp]] = []
        found: list[Doubles] = []
        merit: list[Doubles] = []
        for step in (0, 1, -1, CELLS, -CELLS, CELLS * CELLS, -CELLS * CELLS):
            beside = np.minimum(np.searchsorted(names, names + step * FACES), len(names) - 1)
            exists = names[beside] == names + step * FACES
            partner = np.where(exists[member], most[beside][member], np.arange(len(member)))
            seen = planes(partner, LOOK * self.side)
            # Of the groups of which something is hidden, all pieces.
            some = np.zeros(len(names), np.bool_)
            some[member[seen.any(axis=1)]] = True
            some &= exists
            own = by_group[np.repeat(some, ends - begins)]
            length = (ends - begins)[some]
            first = np.cumsum(length) - length
            if not len(own):
                continue
            hidden, heavy = seen[own].any(axis=1), weight[own]
            apart = np.add.reduceat(np.where(hidden, heavy, 0.0), first)
            # The plane that hides the heaviest of each group.
            chosen = seen[own[first + _heaviest(np.where(hidden, heavy, 0.0), first, first + length)]]
            by = np.repeat(chosen, length, axis=0)
            behind = np.einsum("nc,nc->n", by[:, :3], at[own]) < by[:, 3]
            astray = np.add.reduceat(heavy * (behind != hidden), first)
            least = np.minimum(total[some], 5.0 * apart)
            good = np.flatnonzero((apart > LEAST_DIVIDED * total[some]) & (astray < MOST_ASTRAY * least))
            for side in (0, step) if step else (0,):
                cells.append(names[some][good] // FACES + side)
                found.append(chosen[good])
                merit.append(apart[good])
        if not cells:
            return np.zeros(0, np.intp), np.zeros((0, 4))
        cell, plane, share = np.concatenate(cells), np.concatenate(found), np.concatenate(merit)
        plane[:, 3] = (plane[:, 3] - plane[:, :3] @ self.low) / self.side
        return _spread(cell, plane, share, there)

    def _cell(self, position: Doubles) -> NDArray[np.intp]:
        return cells_at((position - self.low) / self.side)


def _heaviest(values: Doubles, begins: NDArray[np.intp], ends: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return for each range of values where in it the first of the greatest is."""
    greatest = values == np.repeat(np.maximum.reduceat(values, begins), ends - begins)
    place = np.where(greatest, np.arange(len(values)), len(values))
    found: NDArray[np.intp] = np.minimum.reduceat(place, begins) - begins
    return found


class _RecordGrid:
    """Records of the cells that surfaces lie in: two of a cell that a plane divides, one of each other.

    Args:
        there: [cells] which cells those are, one or more.
        divided: which of them planes divide.
        planes: [divided, 4] see `LightVolume`.

    Attributes:
        planes: as given.
        place: [records] the cell of each.
    """

    def __init__(self, there: NDArray[np.bool_], divided: NDArray[np.intp], planes: Doubles) -> None:
        self.planes = planes
        whole = there.copy()
        whole[divided] = False
        self.place = np.concatenate([np.repeat(divided, 2), np.flatnonzero(whole)])
        self._number = (2 * len(divided) - 1 + np.cumsum(whole)).astype(np.int32)
        self._number[divided] = -1 - np.arange(len(divided))
        self._there = there
        self._middle: Doubles = np.stack(np.unravel_index(self.place, _SHAPE))[::-1].T + np.float64(0.5)
        # What is on one side of a plane looks for surfaces from there.
        self._aside: Doubles = self._middle.copy()
        for side, way in enumerate((1.0, -1.0)):
            self._aside[side : 2 * len(divided) : 2] += way * planes[:, :3]

    def look_towards(self, ways: Doubles) -> None:
        """Have records of whole cells look for surfaces from where their own face, [records, 3] of any length: what is
        behind a wall is as near as what is before it."""
        length = np.linalg.norm(ways, axis=1, keepdims=True)
        whole = slice(2 * len(self.planes), None)
        self._aside[whole] += np.where(length > 0.0, ways / np.maximum(length, 1e-300), 0.0)[whole]

    def cells(self) -> NDArray[np.int32]:
        """Return what `LightVolume.cells` has: that of the nearest cell that is there."""
        nearest = tuple(_nearest(self._there))
        found: NDArray[np.int32] = self._number[np.ravel_multi_index(nearest, _SHAPE)].reshape(_SHAPE)
        return found

    def resolved(self, number: NDArray[np.int32], place: Doubles) -> NDArray[np.intp]:
        """Return records for what cells have, at places in cells."""
        found = number.astype(np.intp)
        two = np.flatnonzero(number < 0)
        plane = -1 - found[two]
        behind = np.einsum("nc,nc->n", self.planes[plane, :3], place[two]) < self.planes[plane, 3]
        found[two] = 2 * plane + behind
        return found

    def lenders(self, runtime: Runtime, known: NDArray[np.bool_], within: float) -> NDArray[np.int32]:
        """Return [records, FACES] the nearest record on the same side of planes, and not behind its own surfaces, that
        stands for one without surfaces that face a side; -1 for those that have some, or if there is none. Waits for
        the device.

        Args:
            runtime: the device.
            known: [records, FACES] which have surfaces to lend.
            within: cells.
        """
        count = len(known)
        stride = row_length(count)
        places, ways = np.zeros((3, stride), np.float32), np.zeros((3, stride), np.float32)
        places[:, :count], ways[:, :count] = self._aside.T, (self._aside - self._middle).T
        sides = 1 << np.arange(FACES, dtype=np.int32)
        wanted = np.zeros(stride, np.int32)
        wanted[:count] = (~known) @ sides
        # A cell that no surface lies in has the number of a record more, which knows nothing.
        cells = np.where(self._there, self._number, count).astype(np.int32)
        steps, lender = _steps(within), runtime.empty(FACES * stride, np.int32)
        runtime.kernel("radiosity/radiosity_lend.cl").run(
            (1, stride),
            places=runtime.array(places),
            ways=runtime.array(ways),
            wanted=runtime.array(wanted),
            cells=device_cells(runtime, cells, self.planes.astype(np.float32)),
            known=runtime.array(np.append(known @ sides, np.int32(0)).astype(np.int32)),
            steps=runtime.array(steps),
            lender=lender,
            count=len(steps),
        )
        found: NDArray[np.int32] = lender.download().reshape(FACES, stride)[:, :count].T
        return found


def _nearest(there: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return [3, cells] the z, y and x of the nearest of the cells that are there, for each, by the sum of steps along
    the axes."""
    from scipy import ndimage  # takes a fifth of a second, which other commands do without

    found: NDArray[np.int32] = ndimage.distance_transform_cdt(
        ~there.reshape(_SHAPE), "taxicab", return_distances=False, return_indices=True
    )
    return found.reshape(3, -1)


@lru_cache(maxsize=4)
def _steps(within: float) -> NDArray[np.int32]:
    """Return steps [n, 3] by x, y and z from a cell to all within a distance, the nearest first."""
    most = int(within)
    along = np.arange(-most, most + 1, dtype=np.int32)
    steps = np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3)
    squared = (steps * steps).sum(axis=1)
    order = np.argsort(squared, kind="stable")
    found: NDArray[np.int32] = steps[order[: np.count_nonzero(squared <= within * within)]]
    return found


def _spread(
    cell: NDArray[np.intp], planes: Doubles, merit: Doubles, there: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], Doubles]:
    """Return cells that planes cut and that surfaces lie in, one plane for each.

    A cell's own counts before those of cells round it, as pieces are few and may have missed one side.

    Args:
        cell: [n] in which each plane was found.
        planes: [n, 4] in cells.
        merit: [n] the greater counts.
        there: [cells] whether surfaces lie in it.
    """
    place = np.stack(np.unravel_index(cell, _SHAPE))
    off = np.einsum("nc,cn->n", planes[:, :3], place[::-1] + 0.5) - planes[:, 3]
    most = BEYOND + 0.5 * np.abs(planes[:, :3]).sum(axis=1)
    undivided = there.copy()
    divided: list[NDArray[np.intp]] = []
    by: list[NDArray[np.intp]] = []
    for ring in _RINGS:
        targets, numbers = [], []
        for step in ring:
            moved = place + step[:, None]
            within = ((moved >= 0) & (moved < CELLS)).all(axis=0)
            to = cells_at(moved[::-1].T)
            cut = np.abs(off + planes[:, :3] @ step[::-1].astype(np.float64)) < most
            number = np.flatnonzero(within & cut & undivided[to])
            targets.append(to[number])
            numbers.append(number)
        target, number = np.concatenate(targets), np.concatenate(numbers)
        order = np.lexsort((number, -merit[number], target))
        target, first = np.unique(target[order], return_index=True)
        undivided[target] = False
        divided.append(target)
        by.append(number[order[first]])
    found = np.concatenate(divided)
    order = np.argsort(found)
    return found[order], planes[np.concatenate(by)[order]]


@dataclass(frozen=True, eq=False)
class _Slots:
    """Sides of records that pieces face: [n] numbers of slots, pieces, and squares of cosines."""

    slot: NDArray[np.intp]
    piece: NDArray[np.intp]
    weight: Doubles

    @classmethod
    def of(cls, record: NDArray[np.intp], normal: Doubles) -> _Slots:
        faced = np.maximum(np.stack([normal, -normal], axis=-1).reshape(-1, FACES), 0.0) ** 2
        piece, face = np.nonzero(faced)
        return cls(record[piece] * FACES + face, piece, faced[piece, face])

    def mean(self, flux: Doubles, area: Doubles) -> Doubles:
        """Return [records FACES, 3] the radiance of the pieces' flux [pieces, 3] over areas [records, FACES]."""
        over = np.pi * np.where(area > 0.0, area, np.inf)
        return np.stack([(self.sums(channel, len(area)) / over).ravel() for channel in flux.T], axis=1)

    def sums(self, values: Doubles, records: int) -> Doubles:
        """Return [records, FACES] sums of a value of the pieces."""
        found: Doubles = np.bincount(self.slot, self.weight * values[self.piece], records * FACES).astype(np.float64)
        return found.reshape(records, FACES)
