"""Virtual point lights, and fewer of them that stand for all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (ITU-R BT.709)."""
MOST_VPLS = 1 << 24
SHARPEST = 1000.0
"""Exponent of a lobe at most; kernels have it as VPL_SHARPEST."""
PARTS = 16


@dataclass(frozen=True, eq=False)
class Vpls:
    """Virtual point lights; each radiates flux / pi times the cosine to its normal (W/sr).

    Those with lobes radiate flux (n + 1) / (2 pi F) times the n-th power of the cosine to their
    axis, on the side of their normal alone; F is the share of the lobe on that side.

    Attributes:
        position: [count, 3] float64, world space.
        normal: [count, 3] float64, world space, unit length, on the side that is lit.
        flux: [count, 3] float64, RGB, W.
        area: [count] float64, of the surface that the light stands for, squared scene units, > 0.
        parts: the lights that each of these is made of, `PARTS` one after the other, or None.
        axis: [count, 3] float64, world space, unit length: of lobes, or None for diffuse light.
        gloss: [count] float64, exponent n of each lobe, which counts as one in [1, SHARPEST].
    """

    position: Doubles
    normal: Doubles
    flux: Doubles
    area: Doubles
    parts: Vpls | None = None
    axis: Doubles | None = None
    gloss: Doubles | None = None

    def __len__(self) -> int:
        return len(self.area)

    def with_more(self, more: Vpls) -> Vpls:
        """Return these diffuse lights, then others; with their parts if both have some."""
        parts = self.parts.with_more(more.parts) if self.parts is not None and more.parts is not None else None
        return Vpls(
            np.concatenate([self.position, more.position]),
            np.concatenate([self.normal, more.normal]),
            np.concatenate([self.flux, more.flux]),
            np.concatenate([self.area, more.area]),
            parts,
        )

    def merged(self, count: int) -> Vpls:
        """Return `count` lights that stand for these, or these if they are no more.

        The row of lights is cut into pieces of equal luminous flux. Each gives a light at the
        middle of its flux, with all of its flux and area.
        """
        if len(self) <= count:
            return self
        middle, flux, area = cut_evenly(np.vstack([self.flux.T, self.area]), count)
        lobe = () if self.axis is None or self.gloss is None else (None, self.axis[middle], self.gloss[middle])
        return Vpls(self.position[middle], self.normal[middle], flux, area, *lobe)


def cut_evenly(
    amounts: NDArray[np.floating], count: int, importance: Doubles | None = None
) -> tuple[NDArray[np.intp], Doubles, Doubles]:
    """Cut a row into pieces of equal luminous flux.

    Args:
        amounts: [4, lights] RGB flux and area of the row.
        count: of pieces.
        importance: [lights] by which luminous flux counts more; by default 1.

    Returns:
        Which light is at the middle of each piece, and the pieces' flux [count, 3] and area.
    """
    sums = np.zeros((4, amounts.shape[1] + 1))
    np.cumsum(amounts, axis=1, dtype=np.float64, out=sums[:, 1:])
    # Not `@`: a BLAS's threads would wait for more work on the cores that the passes need.
    before = np.einsum("c,cn->n", LUMINANCE, sums[:3])
    if importance is not None:
        before[1:] = np.cumsum(np.diff(before) * importance)
    edges = np.linspace(0.0, before[-1], count + 1)
    middle = np.searchsorted(before[1:-1], 0.5 * (edges[1:] + edges[:-1]))
    # An edge may fall into the middle of a light.
    pieces = np.diff([np.interp(edges, before, column) for column in sums], axis=-1)
    return middle, pieces[:3].T, pieces[3]
