"""Sky map: radiance by direction, filtered to the width of a cone, for lookups in kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.environment_samples import BRIGHTEST, summed
from ssgi_cl.core.lights import Environment, are_same
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime

Doubles = NDArray[np.float64]

SKY_SIZE = 32
"""Rows and columns of the map."""

SHARPNESS = 26.0
"""Of the filter, exp(SHARPNESS (cos - 1)) of the angle from a direction: 11 degrees of standard
deviation, half the width of one of eight cones of a slice."""

_MOST_SOURCES = 64 * 128  # texels of an image that are filtered one by one


class Sky:
    """The sum of environments, in device memory.

    Attributes:
        constant: [3] float64, of those that are the same all round, W m^-2 sr^-1.
        image: [rows, columns, 3] float64, the sum of the others as `Environment.radiance` has it,
            or None without any; the same object as long as the environments are the same.
        map: the map of `image` that kernels/ssdo/sky.clh reads, or None.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self.constant: Doubles = np.zeros(3)
        self.image: Doubles | None = None
        self.map: DeviceArray | None = None
        self._kept = runtime.array(np.zeros(SKY_SIZE * SKY_SIZE * 3, np.float32))
        self._environments: tuple[Environment, ...] = ()

    def set(self, environments: Sequence[Environment]) -> None:
        """Take other environments; nothing is done if they are those of last time."""
        now = tuple(environments)
        if are_same(now, self._environments):
            return
        radiance = [np.asarray(environment.radiance, np.float64) for environment in now]
        constants = [value for value in radiance if value.ndim == 1]
        images = [value for value in radiance if value.ndim == 3 and value.any()]
        self.constant = np.minimum(sum(constants, np.zeros(3)), BRIGHTEST)
        self.image = None if not images else np.minimum(_sum(images), BRIGHTEST)
        self.map = None
        if self.image is not None:
            self._kept.upload(filtered(self.image).astype(np.float32))
            self.map = self._kept
        self._environments = now


def _sum(images: Sequence[Doubles]) -> Doubles:
    """Return the sum of latitude-longitude images, at the least common multiple of their sizes.

    Sizes beyond 4096 texels are those of the largest image: texels are then picked.
    """
    rows, columns = (math.lcm(*sizes) for sizes in zip(*(image.shape[:2] for image in images), strict=True))
    return summed(images, (rows if rows <= 4096 else 1, columns if columns <= 4096 else 1))


def directions() -> tuple[Doubles, Doubles]:
    """Return the map's texels: direction [size, size, 3], and solid angle [size, size] in sr."""
    centre = (np.arange(SKY_SIZE) + 0.5) / SKY_SIZE * 2.0 - 1.0
    z, x = np.meshgrid(centre, centre, indexing="ij")
    y = 1.0 - np.abs(x) - np.abs(z)
    folded = y < 0.0
    x, z = (np.where(folded, np.copysign(1.0 - np.abs(z), x), x), np.where(folded, np.copysign(1.0 - np.abs(x), z), z))
    point = np.stack([x, y, z], axis=-1)
    length = np.linalg.norm(point, axis=-1)
    # A texel's area on the octahedron, seen from its middle: the faces are 1 / sqrt(3) away.
    solid_angle = length**-3.0
    return point / length[..., None], solid_angle * 4.0 * math.pi / solid_angle.sum()


def filtered(image: Doubles) -> Doubles:
    """Return the map [size, size, 3] of a latitude-longitude image [rows, columns, 3].

    Every texel's flux is spread over the map and none is lost, however bright it is.
    """
    way, flux = _sources(image)
    towards, solid_angle = directions()
    to, omega = towards.reshape(-1, 3), solid_angle.ravel()
    total = np.zeros((len(omega), 3))
    for first in range(0, len(way), 1024):
        piece = slice(first, first + 1024)
        weight = np.exp(SHARPNESS * (way[piece] @ to.T - 1.0))
        total += (weight / (weight @ omega)[:, None]).T @ flux[piece]
    return total.reshape(SKY_SIZE, SKY_SIZE, 3)


def _sources(image: Doubles) -> tuple[Doubles, Doubles]:
    """Return direction [n, 3] and flux per area [n, 3] of blocks of an image's texels."""
    # A texel is a direction: it must be narrower than the filter.
    for axis, least in ((0, 32), (1, 64)):
        image = np.repeat(image, math.ceil(least / image.shape[axis]), axis)
    rows, columns = image.shape[:2]
    edges = np.linspace(0.0, math.pi, rows + 1)
    height = np.cos(edges[:-1]) - np.cos(edges[1:])
    flux = image * (height * 2.0 * math.pi / columns)[:, None, None]
    polar = 0.5 * (edges[1:] + edges[:-1])[:, None]
    azimuth = ((np.arange(columns) + 0.5) / columns - 0.5) * 2.0 * math.pi
    way = np.stack(
        [
            np.sin(polar) * np.sin(azimuth),
            np.broadcast_to(np.cos(polar), (rows, columns)),
            -np.sin(polar) * np.cos(azimuth),
        ],
        axis=-1,
    )
    step = math.ceil(math.sqrt(rows * columns / _MOST_SOURCES))
    # A block is where its flux is: a sun does not move.
    power = flux.sum(axis=-1)
    power = power / power.max() + 1e-12
    starts = [np.arange(0, size, step) for size in (rows, columns)]

    def blocks(values: Doubles) -> Doubles:
        summed = np.add.reduceat(np.add.reduceat(values, starts[0], 0), starts[1], 1)
        result: Doubles = summed.reshape(-1, values.shape[-1])
        return result

    centre = blocks(way * power[..., None])
    lit = blocks(flux)
    some = lit.any(axis=-1)
    centre, lit = centre[some], lit[some]
    return centre / np.linalg.norm(centre, axis=-1, keepdims=True), lit
