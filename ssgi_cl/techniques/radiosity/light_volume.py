"""Light volume: radiance of a scene's surfaces by place and direction, for rays that leave the image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

CELLS = 32
"""Cells along a side of the volume."""
FAINT = 1e-3
"""Area that surfaces from another cell are given in an empty one, in sides of a cell squared."""
BRIGHTEST = 1e30
"""W m^-2 sr^-1: more counts as this."""
NEAR = 2.5
"""Cells within which surfaces that no light reaches give way to lit ones."""
FACES = 6
"""Directions that surfaces of a cell face: +x, -x, +y, -y, +z, -z."""


@dataclass(frozen=True, eq=False)
class SentLight:
    """Light that pieces of surfaces send, on the side of their normals.

    Attributes:
        position: [count, 3] float64, scene units.
        normal: [count, 3], unit length.
        area: [count], scene units squared.
        flux: [count, 3], W.
    """

    position: Doubles
    normal: Doubles
    area: Doubles
    flux: Doubles

    @classmethod
    def none(cls) -> SentLight:
        """Return no piece."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class LightVolume:
    """Mean radiance of the surfaces in cells of a cube, by the six sides that they face.

    A ray takes the mean of the three sides that it sees, weighted by how large the surfaces that
    face them appear to it. Where a cell has no surface that faces a side, the nearest that has
    counts, as if it were `FAINT` of the cell's side.

    Attributes:
        light: what surfaces send; its pieces stand for all of them.
        low: [3] float64, the corner of least coordinates of the cube, scene units.
        extent: of its side, scene units.
        also: what some of the same surfaces send besides.
        unlit: pieces of surfaces that no light reaches: black where no other within `NEAR` faces the same way, as
            cells are thicker than some walls.
    """

    light: SentLight
    low: Doubles
    extent: float
    also: SentLight | None = None
    unlit: SentLight | None = None

    @property
    def side(self) -> float:
        """Side of a cell, scene units."""
        return self.extent / CELLS

    @property
    def radiance(self) -> Doubles:
        """[CELLS by z, CELLS by y, CELLS by x, FACES, 3] float64, W m^-2 sr^-1."""
        return self._sides[0]

    @property
    def area(self) -> Doubles:
        """[CELLS, CELLS, CELLS, FACES] float64, in sides of cells squared."""
        return self._sides[1]

    @property
    def packed(self) -> NDArray[np.float32]:
        """[CELLS, CELLS, CELLS, FACES, 4] float32: radiance and area, as kernels/radiosity/volume.clh reads them."""
        return np.concatenate([np.minimum(self.radiance, BRIGHTEST), self.area[..., None]], axis=-1, dtype=np.float32)

    @cached_property
    def _sides(self) -> tuple[Doubles, Doubles]:
        """Radiance and area, computed when they are first asked for."""
        from scipy import ndimage  # takes a fifth of a second, which other commands do without

        sums = [_sums(each, self.low, self.side) for each in (self.light, self.also) if each is not None]
        black = None if self.unlit is None else _sums(self.unlit, self.low, self.side)[..., 3]
        shape = (CELLS, CELLS, CELLS)
        radiance, faces = np.zeros((*shape, FACES, 3)), np.full((*shape, FACES), FAINT)
        for face in range(FACES):
            area = sums[0][face, :, 3]
            known = (area > 1e-6 * area.max(initial=0.0)).reshape(shape)
            if black is not None and black[face].any():
                away = ndimage.distance_transform_edt(~known) if known.any() else np.full(shape, np.inf)
                alone = (away > NEAR) & (black[face] > 0.0).reshape(shape)
                area = np.where(alone.ravel(), black[face], area)
                known |= alone
            if not known.any():
                continue
            mean = np.zeros((CELLS**3, 3))
            for each in sums:
                # Pieces are few: those of some surfaces may have missed a cell that others lie in.
                over = np.maximum(area, each[face, :, 3])
                mean += each[face, :, :3] / (np.pi * np.maximum(over, 1e-300))[:, None]
            nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
            radiance[..., face, :] = mean.reshape(*shape, 3)[tuple(nearest)]
            faces[known, face] = area.reshape(shape)[known] / self.side**2
        return radiance, np.maximum(faces, FAINT)


def _sums(light: SentLight, low: Doubles, side: float) -> Doubles:
    """Return flux and area [FACES, CELLS^3, 4] of pieces by cell and the sides that they face."""
    cell = np.clip(((light.position - low) / side).astype(np.intp), 0, CELLS - 1)
    index = (cell[:, 2] * CELLS + cell[:, 1]) * CELLS + cell[:, 0]
    faced = np.stack([light.normal, -light.normal], axis=-1).reshape(-1, FACES)
    weight = np.maximum(faced, 0.0) ** 2
    values = np.concatenate([light.flux, light.area[:, None]], axis=1)
    sums = np.empty((FACES, CELLS**3, 4))
    for face, own in enumerate(weight.T):
        for channel, value in enumerate(values.T):
            sums[face, :, channel] = np.bincount(index, own * value, CELLS**3)
    return sums
