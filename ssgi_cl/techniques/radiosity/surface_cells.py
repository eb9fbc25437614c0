"""Cells that the surfaces of a scene lie in: what makes a light volume of the light that surfaces send."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, LightVolume, cells_at
from ssgi_cl.techniques.radiosity.surfels import Surfels, facing_axis

Doubles = NDArray[np.float64]

FAINT = 1e-3
"""Area that surfaces from another cell are given in one that has none, in sides of a cell squared."""
BRIGHTEST = 1e30
"""W m^-2 sr^-1: more counts as this."""
NEAR = 5.0
"""Cells within which surfaces that no light reaches give way to lit ones, as cells are thicker than some walls."""
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
_AROUND = np.concatenate(_RINGS)
"""All of them, the nearest first."""

Box = tuple[slice, slice, slice]
"""Cells of a volume by z, y and x."""
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

    Where a cell has no surface that faces a side, the nearest that has counts, as seen from the side that its own face,
    as if it were `FAINT` of the cell's side.

    Args:
        lit: pieces that stand for all surfaces that light reaches.
        low, extent: of the cube, see `LightVolume`.
        unlit: of surfaces that no light reaches: black where no other within `NEAR` faces the same way.
        shown: [lit pieces] what each counts for its cell, 0 to 1: the part of its hemisphere that is open to beyond the
            cell. Rays from afar come to a piece in that proportion, seldom into a gap.
        seen: [lit pieces] whether a surface sees them, as rays come from surfaces. Those that none sees, such as the
            outside of a building, count least, and not at all where another within `NEAR` faces the same way.
        planes: finds what divides cells into two spaces that do not see each other, such as walls; each side of it
            then has a mean of its own.
    """

    def __init__(
        self,
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
        self._shown = np.where(seen, np.maximum(1.0 if shown is None else shown, LEAST_SHOWN), LEAST_SHOWN)
        dark = Pieces.none() if unlit is None else unlit
        own, others = self._cell(lit.position), self._cell(dark.position)
        there = np.zeros(CELLS**3, np.bool_)
        there[own] = there[others] = True
        there[0] |= not there.any()
        divided, cut = own[:0], np.zeros((0, 4))
        if planes is not None and len(own):
            divided, cut = self._divide(lit, own, there, planes)
        self._grid = grid = _RecordGrid(there, divided, cut)
        self.cells = grid.cells()
        count = len(grid.place)
        record = self._records(own, lit)
        towards: Doubles = np.zeros((count, 3))
        for axis, part in enumerate(lit.normal.T):
            towards[:, axis] = np.bincount(record, lit.area * part, count)
        grid.look_towards(towards)
        self._slots = _Slots.of(record, lit.normal)
        self._shown_area = self._slots.sums(lit.area * self._shown, count)
        black = _Slots.of(self._records(others, dark), dark.normal).sums(dark.area, count)
        area = self._slots.sums(lit.area, count)
        facing = self._slots.sums(np.where(seen, lit.area, 0.0), count)
        # Slots are numbered record by record.
        self._near = np.arange(count * FACES).reshape(-1, FACES)

        def lend(face: int) -> None:
            """Find for records without surfaces that face a side those that stand for them."""
            least = 1e-6 * area[:, face].max(initial=0.0)
            known = facing[:, face] > least
            if known.all():
                return
            area[:, face] = np.where(area[:, face] > least, area[:, face], black[:, face])
            if known.any():
                given, lender = grid.lenders(known, area[:, face] > 0.0)
                self._near[given, face] = lender * FACES + face
                area[given, face] = 0.0

        with ThreadPoolExecutor(FACES) as pool:
            list(pool.map(lend, range(FACES)))
        self.area = np.maximum(area / self.side**2, FAINT)

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
        count = len(self.area)
        radiance = self._slots.mean(flux * self._shown[:, None], self._shown_area)
        if also is not None:
            pieces, sent = also
            slots = _Slots.of(self._records(self._cell(pieces.position), pieces), pieces.normal)
            # Pieces are few: those of some surfaces may have missed a cell that others lie in.
            radiance += slots.mean(sent, np.maximum(self._shown_area, slots.sums(pieces.area, count)))
        records = np.empty((count, FACES, 4), np.float32)
        records[..., :3] = np.minimum(radiance, BRIGHTEST).astype(np.float32).take(self._near, axis=0)
        records[..., 3] = self.area
        planes = self._grid.planes.astype(np.float32)
        return LightVolume(self.cells, records, self.low, self.extent, planes)

    def _records(self, cell: NDArray[np.intp], pieces: Pieces) -> NDArray[np.intp]:
        """Return the numbers of the records of pieces that lie in cells."""
        place = (pieces.position - self.low) / self.side + BEFORE * pieces.normal
        return self._grid.resolved(self.cells.ravel()[cell], place)

    def _divide(
        self, pieces: Pieces, cell: NDArray[np.intp], there: NDArray[np.bool_], planes: Planes
    ) -> tuple[NDArray[np.intp], Doubles]:
        """Return numbers of cells of which parts hide from each other, and planes between these, in cells.

        Pieces of a cell that face the same way look at that of them which is shown most, and at those of the cells
        beside. A plane divides its cell, that which was looked at, and others round it that it cuts.
        """
        weight = pieces.area * self._shown
        group = cell * FACES + facing_axis(pieces.normal)
        names, member = np.unique(group, return_inverse=True)
        by_group = np.argsort(member, kind="stable")
        begins = np.searchsorted(member[by_group], np.arange(len(names)))

        def heaviest(values: Doubles) -> NDArray[np.intp]:
            """Return for each group the first of its pieces with the greatest value."""
            own = values[by_group]
            greatest = own == np.maximum.reduceat(own, begins)[member[by_group]]
            place = np.where(greatest, np.arange(len(own)), len(own))
            return by_group[np.minimum.reduceat(place, begins)]

        most = heaviest(weight)
        total = np.bincount(member, weight, len(names))
        at = pieces.position + BEFORE * self.side * pieces.normal
        cells: list[NDArray[np.intp]] = []
        found: list[Doubles] = []
        merit: list[Doubles] = []
        for step in (0, 1, -1, CELLS, -CELLS, CELLS * CELLS, -CELLS * CELLS):
            beside = np.minimum(np.searchsorted(names, names + step * FACES), len(names) - 1)
            exists = names[beside] == names + step * FACES
            partner = np.where(exists[member], most[beside[member]], np.arange(len(member)))
            seen = planes(partner, LOOK * self.side)
            hidden = seen.any(axis=1) & exists[member]
            apart = np.bincount(member, np.where(hidden, weight, 0.0), len(names))
            # The plane that hides the heaviest of each group.
            chosen = seen[heaviest(np.where(hidden, weight, 0.0))]
            own = chosen[member]
            behind = np.einsum("nc,nc->n", own[:, :3], at) < own[:, 3]
            astray = np.bincount(member, weight * (behind != hidden), len(names))
            good = exists & (apart > LEAST_DIVIDED * total) & (astray < MOST_ASTRAY * np.minimum(total, 5.0 * apart))
            good = np.flatnonzero(good & chosen.any(axis=1))
            for side in (0, step) if step else (0,):
                cells.append(names[good] // FACES + side)
                found.append(chosen[good])
                merit.append(apart[good].astype(np.float64))
        cell, plane, share = np.concatenate(cells), np.concatenate(found), np.concatenate(merit)
        plane[:, 3] = (plane[:, 3] - plane[:, :3] @ self.low) / self.side
        return _spread(cell, plane, share, there)

    def _cell(self, position: Doubles) -> NDArray[np.intp]:
        return cells_at((position - self.low) / self.side)


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
        self._there, self._box = there, _box(there)
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
        found: NDArray[np.int32] = self._numbers_of(_nearest(self._there, self._box)).reshape(_SHAPE)
        return found

    def resolved(self, number: NDArray[np.int32], place: Doubles) -> NDArray[np.intp]:
        """Return records for what cells have, at places in cells."""
        found = number.astype(np.intp)
        two = np.flatnonzero(number < 0)
        plane = -1 - found[two]
        behind = np.einsum("nc,nc->n", self.planes[plane, :3], place[two]) < self.planes[plane, 3]
        found[two] = 2 * plane + behind
        return found

    def lenders(self, known: NDArray[np.bool_], has: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return records that others stand for, and for each the nearest that is known, on its side of planes if one
        is.

        Args:
            known: [records] which have something to lend, one or more.
            has: [records] those that are not known and have something of their own, or a cell beside them has, borrow
                within `NEAR` alone.
        """
        there = np.zeros(CELLS**3, np.bool_)
        there[self.place[known]] = True
        nearest = _nearest(there, self._box)
        far = ((self._middle[:, ::-1].T - 0.5 - nearest[:, self.place]) ** 2).sum(axis=0) > NEAR**2
        given = np.flatnonzero(~known & ~(far & self._near_those(has, far & ~known)))
        cell = self._numbers_of(nearest[:, cells_at(self._aside[given])])
        found = self.resolved(cell, self._aside[given])
        # Of a plane's sides one may have none.
        empty = np.flatnonzero(~known[found])
        before = 2 * (-1 - cell[empty])
        found[empty] = np.where(known[before], before, before + 1)
        for step in _AROUND:
            from_there = self._aside[given[empty]]
            to = cells_at(from_there + step)
            at = np.flatnonzero(self._there[to])
            other = self.resolved(self._number[to[at]], from_there[at])
            at, other = at[known[other]], other[known[other]]
            found[empty[at]] = other
            empty = np.delete(empty, at)
        return given, found

    def _near_those(self, has: NDArray[np.bool_], asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return [records] which of those that are asked for have something in their cell or one beside it."""
        there = np.zeros(CELLS**3, np.bool_)
        there[self.place[has]] = True
        found = has.copy()
        left = np.flatnonzero(asked & ~has) if has.any() else np.zeros(0, np.intp)
        for step in _AROUND:
            beside = there[cells_at(self._middle[left] + step)]
            found[left[beside]] = True
            left = left[~beside]
        return found

    def _numbers_of(self, place: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return what the cells at [3, n] z, y and x have."""
        found: NDArray[np.int32] = self._number[np.ravel_multi_index(tuple(place), _SHAPE)]
        return found


def _box(there: NDArray[np.bool_]) -> Box:
    """Return the z, y and x of the box of the cells that are there."""
    grid = there.reshape(_SHAPE)
    own = [np.flatnonzero(grid.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    z, y, x = (slice(int(along[0]), int(along[-1]) + 1) for along in own)
    return z, y, x


def _nearest(there: NDArray[np.bool_], box: Box) -> NDArray[np.int32]:
    """Return [3, cells] the z, y and x of the nearest of the cells that are there, all within a box, for each.

    Cells outside of the box have what the nearest in it has, up to 1.5 times as far as the nearest.
    """
    from scipy import ndimage  # takes a fifth of a second, which other commands do without

    grid = ~there.reshape(_SHAPE)[box]
    found: NDArray[np.int32] = ndimage.distance_transform_edt(grid, return_distances=False, return_indices=True)
    found += np.array([side.start for side in box], np.int32)[:, None, None, None]
    around = [(side.start, CELLS - side.stop) for side in box]
    return np.pad(found, [(0, 0), *around], mode="edge").reshape(3, -1)


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
