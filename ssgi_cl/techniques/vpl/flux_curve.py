"""Cumulative flux of reflective shadow maps along Hilbert curves, and its cuts into equal pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.constants import VPL_BLOCK_RUNS, VPL_RUN, VPL_SUMS
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct, floats, ints

Doubles = NDArray[np.float64]

CURVE = Struct(
    "VplCurveParams",
    (
        *ints("face_runs", "faces", "face_rows", "map_runs", "first_run"),
        *ints("runs", "blocks", "lights", "split", "count", "stride"),
        *floats("x", "y", "z"),
    ),
)

RUN, BLOCK_RUNS, SUMS = VPL_RUN, VPL_BLOCK_RUNS, VPL_SUMS

Key = tuple[tuple[Size, int], ...]
"""(rows, columns) of a face and number of faces, of each map."""


def curve_key(rsms: Sequence[DeviceRsm]) -> Key:
    """Return the key of the `FluxCurve` that takes these maps."""
    return tuple((rsm.face_size, rsm.faces) for rsm in rsms)


class FluxCurve:
    """The sums of flux and area along the texels of maps, prepared for maps of some sizes.

    Args:
        runtime: the device.
        key: of the maps, at least one; see `curve_key`.
        glossy: sum up what lobes take away, of maps that have them; luminous flux then counts by
            the lobe's sharpness too, see kernels/vpl/curve.clh.

    Attributes:
        quarters, runs, blocks: see kernels/vpl/curve.clh.
        texels: of all maps.
        maps: the maps of the latest `update`.
        version: grows with every change of the contents.
    """

    def __init__(self, runtime: Runtime, key: Key, *, glossy: bool = False) -> None:
        self.runtime = runtime
        self.key = key
        self.glossy = glossy
        self.texels = sum(rows * columns * faces for (rows, columns), faces in key)
        self.maps: tuple[DeviceRsm, ...] = ()
        self.version = 0
        self._versions: tuple[int, ...] = ()
        self._importance: DeviceArray | None = None
        sizes = {size for size, _ in key}
        self._orders = {size: _order(runtime, size) for size in sizes}
        self._tables: list[dict[str, int]] = []
        first = 0
        for size, faces in key:
            face_runs = self._orders[size].count // RUN
            map_runs = -(-face_runs * faces // BLOCK_RUNS) * BLOCK_RUNS
            self._tables.append(
                {"face_runs": face_runs, "faces": faces, "face_rows": size[0], "map_runs": map_runs, "first_run": first}
            )
            first += map_runs
        blocks = first // BLOCK_RUNS
        self._counts = {"runs": first, "blocks": blocks}
        self.quarters = runtime.empty(SUMS * 4 * first, np.float32)
        self.runs = runtime.empty(2 * SUMS * first, np.float32)
        self.blocks = runtime.empty(2 * SUMS * (blocks + 1), np.float32)

    @property
    def origin(self) -> Doubles:
        """World-space point [3] that positions of `cut` count from: the first map's origin."""
        return self.maps[0].origin

    def update(self, rsms: Sequence[DeviceRsm], importance: DeviceArray | None = None) -> None:
        """Queue the passes that make the sums, unless they are those of these maps already.

        Args:
            rsms: the maps.
            importance: of their runs, by which luminous flux then counts more; see
                kernels/vpl/curve.clh. It is taken for new.
        """
        maps, versions = tuple(rsms), tuple(rsm.version for rsm in rsms)
        if importance is None is self._importance and (maps, versions) == (self.maps, self._versions):
            return
        self._versions = ()  # should anything fail, the sums are nobody's
        self.maps, self._importance = maps, importance
        self.version += 1
        runtime, lanes = self.runtime, self.runtime.variant.lanes
        kernel = runtime.kernel("vpl/vpl_partial_sums.cl", self._macros(), (CURVE,))
        for rsm, table in zip(maps, self._tables, strict=True):
            _, flux, gloss = self._lobes(rsm)
            kernel.run(
                rsm.size,
                grid=(1, table["map_runs"] // lanes),
                flux=flux,
                area=rsm.area,
                gloss=gloss,
                order=self._orders[rsm.face_size],
                importance=self._importance,
                quarters=self.quarters,
                runs=self.runs,
                params=self._packed(table),
            )
        blocks = self._counts["blocks"]
        runtime.kernel("vpl/vpl_blocks.cl", structs=(CURVE,)).run(
            (SUMS, blocks), runs=self.runs, blocks=self.blocks, params=self._packed(self._tables[0])
        )
        runtime.kernel("vpl/vpl_totals.cl").run(
            (blocks, SUMS), grid=(1, -(-SUMS // lanes)), local=runtime.small_groups(1), blocks=self.blocks
        )
        self._versions = versions

    def cut(self, found: FoundPlaces, lights: int, split: int, edges: FoundPlaces | None = None) -> None:
        """Queue the passes that find places of `lights` times `split` pieces; see `FoundPlaces`.

        Args:
            found: where they are written.
            lights, split: how many pieces.
            edges: of these pieces, or of as many parts of each; of middles alone.
        """
        runtime, lanes = self.runtime, self.runtime.variant.lanes
        macros = {"VPL_MIDDLE": int(found.middle), **self._macros()}
        kernel = runtime.kernel("vpl/vpl_cut.cl", macros, (CURVE,))
        for rsm, table in zip(self.maps, self._tables, strict=True):
            packed = self._packed(
                table,
                lights=lights,
                split=split,
                count=found.count,
                stride=found.stride,
                **dict(zip("xyz", rsm.origin - self.origin, strict=True)),
            )
            axis, flux, gloss = self._lobes(rsm)
            kernel.run(
                rsm.size,
                grid=(1, -(-found.count // lanes)),
                position=rsm.position,
                normal=rsm.normal,
                axis=axis,
                flux=flux,
                area=rsm.area,
                gloss=gloss,
                order=self._orders[rsm.face_size],
                quarters=self.quarters,
                runs=self.runs,
                blocks=self.blocks,
                importance=self._importance,
                edges=edges.array if edges else None,
                found=found.array,
                params=packed,
                edge_stride=edges.stride if edges else 0,
                edge_step=(edges.count - 1) // (lights * split) if edges else 0,
            )

    def pieces(self) -> Iterator[tuple[DeviceRsm, DeviceArray, Any, int]]:
        """Yield each map of the latest `update`, its order, its struct `CURVE` and its runs."""
        for rsm, table in zip(self.maps, self._tables, strict=True):
            yield rsm, self._orders[rsm.face_size], self._packed(table), table["map_runs"]

    @property
    def run_count(self) -> int:
        """Runs of all maps."""
        return self._counts["runs"]

    def _macros(self) -> dict[str, int]:
        weighted = int(self._importance is not None)
        return {"VPL_GLOSSY": int(self.glossy), "VPL_WEIGHTED": weighted}

    def _lobes(self, rsm: DeviceRsm) -> tuple[Plane | None, Plane, Plane | None]:
        """Return axis, flux and exponent; diffuse light has flux alone."""
        if not self.glossy:
            return None, rsm.flux, None
        lobes = rsm.lobes
        if lobes is None:
            raise ValueError("a reflective shadow map has no specular flux: expected it in all")
        return lobes.axis, lobes.flux, lobes.gloss

    def lit(self) -> int:
        """Return the number of texels that reflect anything. Waits for the device."""
        return int(self.blocks.download().reshape(2, SUMS, -1)[0, 0, -1])

    def _packed(self, table: dict[str, int], **values: float) -> np.ndarray[tuple[int, ...], np.dtype[np.void]]:
        rest = dict.fromkeys(("lights", "split", "count", "stride", "x", "y", "z"), 0.0)
        return CURVE.pack({**rest, **self._counts, **table, **values})


class FoundPlaces:
    """Memory for places in the row of texels: edges between pieces, or their middles.

    Attributes:
        array: [8, 6 or 10, stride] floats; see kernels/vpl/vpl_cut.cl.
        count: places.
        middle: which of the two.
    """

    def __init__(self, runtime: Runtime, count: int, *, middle: bool, glossy: bool = False) -> None:
        self.count = count
        self.middle = middle
        self.stride = -(-count // 16) * 16
        rows = (10 if glossy else 6) if middle else 8
        self.array = runtime.empty(rows * self.stride, np.float32)

    def download(self) -> Doubles:
        """Return [6, count] positions and normals, or [4, count] flux and area before each.

        Of lobes, [10, count] with axes and exponents too.
        """
        values = self.array.download().reshape(-1, self.stride)[:, : self.count].astype(np.float64)
        return values if self.middle else values[:4] + values[4:]


@lru_cache(maxsize=8)
def hilbert_order(rows: int, columns: int) -> NDArray[np.intp]:
    """Return the flat indices of an image's pixels in the order of a Hilbert curve.

    Of the curve on the least square of 2^k pixels a side that holds the image.
    """
    side = 1 << max(rows - 1, columns - 1, 1).bit_length()
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    x, y, place = column.copy(), row.copy(), np.zeros(rows * columns, np.int64)
    step = side // 2
    while step:
        right, low = (x & step) > 0, (y & step) > 0
        place += step * step * ((3 * right) ^ low)
        # Turn the quarter so that the curve in it starts where that of the one before ends.
        turned = ~low
        mirrored = turned & right
        x = np.where(mirrored, step - 1 - (x & (step - 1)), x & (step - 1))
        y = np.where(mirrored, step - 1 - (y & (step - 1)), y & (step - 1))
        x, y = np.where(turned, y, x), np.where(turned, x, y)
        step //= 2
    order: NDArray[np.intp] = np.argsort(place, kind="stable")
    order.flags.writeable = False
    return order


def _order(runtime: Runtime, size: Size) -> DeviceArray:
    """Return `_packed_order` in device memory, the same for all curves."""
    kept: DeviceArray = runtime.prepared((FluxCurve, size), lambda: runtime.array(_packed_order(size)))
    return kept


def _packed_order(size: Size) -> NDArray[np.int32]:
    """Return row << 16 | column along the curve, -1 up to the end of the last run."""
    row, column = np.divmod(hilbert_order(*size), size[1])
    packed = np.full(-(-len(row) // RUN) * RUN, -1, np.int32)
    packed[: len(row)] = (row << 16) | column
    return packed
