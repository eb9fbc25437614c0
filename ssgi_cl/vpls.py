"""Virtual point lights: the lit texels of reflective shadow maps, or few that stand for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import check
from ssgi_cl.device_rsm import DeviceRsm, on_device_rsm
from ssgi_cl.gbuffer import ReflectiveShadowMap
from ssgi_cl.runtime import Runtime

Doubles = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (ITU-R BT.709)."""
MOST_VPLS = 1 << 24
PARTS = 16


@dataclass(frozen=True, eq=False)
class Vpls:
    """Virtual point lights; each radiates flux / pi times the cosine to its normal (W/sr).

    Attributes:
        position: [count, 3] float64, world space.
        normal: [count, 3] float64, world space, unit length, on the side that is lit.
        flux: [count, 3] float64, RGB, W.
        area: [count] float64, of the surface that the light stands for, squared scene units, > 0.
        parts: the lights that each of these is made of, `PARTS` one after the other, or None.
    """

    position: Doubles
    normal: Doubles
    flux: Doubles
    area: Doubles
    parts: Vpls | None = None

    def __len__(self) -> int:
        return len(self.area)

    def merged(self, count: int) -> Vpls:
        """Return `count` lights that stand for these, or these if they are no more.

        The row of lights is cut into pieces of equal luminous flux. Each gives a light at the
        middle of its flux, with all of its flux and area.
        """
        if len(self) <= count:
            return self
        middle, flux, area = _cut(np.vstack([self.flux.T, self.area]), count)
        return Vpls(self.position[middle], self.normal[middle], flux, area)


def choose_vpls(
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    count: int = 1024,
    *,
    parts: bool = False,
    runtime: Runtime | None = None,
) -> Vpls:
    """Choose virtual point lights in proportion to flux, spread evenly over what is lit.

    The texels of all maps are strung along Hilbert curves and cut into `count` pieces of equal
    luminous flux. Each piece gives a light at its middle, with all of its flux and area, so that
    the sum of the flux is that of the maps. Pieces of a Hilbert curve are compact, which makes this
    a warp that stratifies in two dimensions; nothing is random, so little changes when the light
    moves a little.

    Args:
        rsms: a reflective shadow map, or one for each light.
        count: of lights, >= 1. If no more texels are lit than that, each of them is one.
        parts: give the lights' parts too, unless every texel is a light.
        runtime: the device that maps in numpy pass through; by default the fastest found.

    Returns:
        `count` lights or fewer; none if no texel is lit.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
    """
    count = check.integer("vpls", count, low=1, high=MOST_VPLS, unit="virtual point lights")
    rows = [_Texels(rsm) for rsm in on_device_rsms(rsms, runtime)]
    lit = sum(len(row.order) for row in rows)
    if lit == 0:
        return Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    amounts = np.concatenate([row.amounts() for row in rows], axis=1)
    if lit <= count:
        middle, flux, area = np.arange(lit), amounts[:3].T.astype(np.float64), amounts[3]
        return Vpls(*_places(rows, middle), flux, area.astype(np.float64))
    # With parts, where texels are fewer, some pieces are pieces of texels.
    middle, flux, area = _cut(amounts, PARTS * count if parts else count)
    chosen = Vpls(*_places(rows, middle), flux, area)
    return replace(chosen.merged(count), parts=chosen) if parts else chosen


def on_device_rsms(
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    runtime: Runtime | None,
) -> list[DeviceRsm]:
    """Return one or several maps in device memory, uploaded unless they are there already.

    Maps of one size would share the memory that `on_device_rsm` keeps, so each has its own here.
    """
    given = (rsms,) if isinstance(rsms, (ReflectiveShadowMap, DeviceRsm)) else tuple(rsms)
    maps = []
    for index, rsm in enumerate(given):
        if index == 0 or not isinstance(rsm, ReflectiveShadowMap):
            maps.append(on_device_rsm(rsm, runtime))
            continue
        runtime = runtime or Runtime.open()
        size, faces = rsm.cameras[0].size, len(rsm.cameras)
        device: DeviceRsm = runtime.prepared(
            (on_device_rsms, index, size, faces), partial(DeviceRsm, runtime, size, faces)
        )
        device.upload(rsm)
        maps.append(device)
    return maps


class _Texels:
    """The lit texels of a map along the curve.

    Attributes:
        order: their flat indices.
        values: [10, all texels] position from `origin`, normal, flux, area.
    """

    def __init__(self, rsm: DeviceRsm) -> None:
        planes = (rsm.position, rsm.normal, rsm.flux, rsm.area)
        self.values = np.concatenate([p.download().reshape(p.count, -1) for p in planes])
        self.origin = rsm.origin
        order = hilbert_order(*rsm.face_size)
        order = np.concatenate([order + face * len(order) for face in range(rsm.faces)])
        lit = np.any(self.values[6:9] > 0.0, axis=0, keepdims=True)[0]
        self.order = order[lit[order]]

    def amounts(self) -> NDArray[np.float32]:
        """Return [4, texels] flux and area."""
        found: NDArray[np.float32] = self.values[6:].take(self.order, axis=1)
        return found


def _places(rows: Sequence[_Texels], index: NDArray[np.intp]) -> tuple[Doubles, Doubles]:
    """Return the position and the normal of texels of all rows, one after the other."""
    positions, normals, first = [], [], 0
    for row in rows:
        own = index[(index >= first) & (index < first + len(row.order))] - first
        at = row.values[:6].take(row.order[own], axis=1).T.astype(np.float64)
        positions.append(at[:, :3] + row.origin)
        normals.append(at[:, 3:])
        first += len(row.order)
    return np.concatenate(positions), np.concatenate(normals)


def _cut(
    amounts: NDArray[np.floating], count: int
) -> tuple[NDArray[np.intp], Doubles, Doubles]:
    """Cut a row into pieces of equal luminous flux.

    Args:
        amounts: [4, lights] RGB flux and area of the row.
        count: of pieces.

    Returns:
        Which light is at the middle of each piece, and the pieces' flux [count, 3] and area.
    """
    sums = np.zeros((4, amounts.shape[1] + 1))
    np.cumsum(amounts, axis=1, dtype=np.float64, out=sums[:, 1:])
    # Not `@`: a BLAS's threads would wait for more work on the cores that the passes need.
    before = np.einsum("c,cn->n", LUMINANCE, sums[:3])
    edges = np.linspace(0.0, before[-1], count + 1)
    middle = np.searchsorted(before[1:-1], 0.5 * (edges[1:] + edges[:-1]))
    # An edge may fall into the middle of a light.
    pieces = np.diff([np.interp(edges, before, column) for column in sums], axis=-1)
    return middle, pieces[:3].T, pieces[3]


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
