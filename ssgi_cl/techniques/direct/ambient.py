"""Ambient light: irradiance of an unoccluded surface by environments.

E(n) = Int L(w) max(0, n.w) dw is stored at the vertices of an octahedron with subdivided faces, and
interpolated linearly on each triangle: kernels/direct/ambient.clh. All weights are >= 0, so E never
falls below 0 and doesn't ring. The error is linear in L: relative to the mean of E over all
normals, no environment has a greater RMS error than the worst single direction of light has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, Light, are_same, environments_of
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.light_data import BRIGHTEST

Doubles = NDArray[np.float64]

AMBIENT_SIZE = 64
"""Cells along a side of the map, even. A single direction of light is .0026 of the RMS of E off in
RMS (32: .008, 16: .024), and .019 of its greatest E at most (.038, .075)."""

_PARTS = 64
"""Least rows of parts of an image, with twice as many columns. A part across the receiver's horizon
counts as one direction, which costs a uniform sky 3e-4."""

_ROUNDING = 1e-14
"""Relative to the greatest E: an upper bound of the rounding error of parts that cancel."""

_maps: WeakKeyDictionary[Environment, Doubles] = WeakKeyDictionary()


class Ambient:
    """The environments' irradiance, in device memory.

    Attributes:
        irradiance: float32, what kernels/direct/ambient.clh looks up, W/m^2.
        macros: AMBIENT_SIZE, 0 where E is the same for all normals.
        shines: whether there is any such light.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.irradiance = runtime.array(np.zeros((AMBIENT_SIZE + 1) ** 2 * 4, np.float32))
        self.macros = {"AMBIENT_SIZE": 0}
        self.shines = False
        self._environments: tuple[Environment, ...] = ()

    def set(self, lights: Sequence[Light]) -> bool:
        """Take the environments among the lights; return whether they changed since last time."""
        environments = environments_of(lights)
        if are_same(environments, self._environments):
            return False
        total = sum((irradiance_map(e) for e in environments), np.zeros(3))
        self.macros = {"AMBIENT_SIZE": AMBIENT_SIZE if total.ndim == 3 else 0}
        self.shines = bool(total.any())
        quads = np.zeros((*total.shape[:-1], 4), np.float32)
        quads[..., :3] = np.minimum(total, BRIGHTEST)
        self.irradiance.upload(quads)
        self._environments = environments
        return True


def irradiance_map(environment: Environment) -> Doubles:
    """Return E in W/m^2 at the map's vertices [size + 1, size + 1, 3], or [3] of a constant one.

    Computed once for an environment.
    """
    radiance = np.asarray(environment.radiance, np.float64)
    if radiance.ndim == 1:
        constant: Doubles = math.pi * radiance
        return constant
    found = _maps.get(environment)
    if found is None:
        found = _maps[environment] = _convolved(part_vectors(radiance))
    return found


def vertices() -> Doubles:
    """Return the normals [size + 1, size + 1, 3] of the map's vertices; rows grow with z."""
    z, x = _way()
    y = AMBIENT_SIZE // 2 - np.abs(x) - np.abs(z)
    lower_x, lower_z = _folded(x, z)
    way = np.stack([np.where(y < 0, lower_x, x), y, np.where(y < 0, lower_z, z)], axis=-1)
    unit: Doubles = way / np.linalg.norm(way, axis=-1, keepdims=True)
    return unit


def part_vectors(image: Doubles) -> Doubles:
    """Return V [parts, 3 colours, 3 axes] = Int L w dw, W/m^2, of a latitude-longitude image.

    A surface with normal n gets n.V of a part above its horizon, exactly.
    """
    for axis, least in ((0, _PARTS), (1, 2 * _PARTS)):
        image = np.repeat(image, math.ceil(least / image.shape[axis]), axis)
    rows, columns = image.shape[:2]
    polar = np.linspace(0.0, math.pi, rows + 1)
    azimuth = np.linspace(-math.pi, math.pi, columns + 1)
    # w = (sin p sin a, cos p, -sin p cos a), dw = sin p dp da: each integral is a product.
    squared = np.diff(0.5 * polar - 0.25 * np.sin(2.0 * polar))
    upward = np.diff(0.5 * np.sin(polar) ** 2)
    around = np.stack([np.diff(-np.cos(azimuth)), np.diff(azimuth), np.diff(-np.sin(azimuth))])
    starts = [np.arange(0, size, round(size / least)) for size, least in ((rows, _PARTS), (columns, 2 * _PARTS))]
    axes = []
    for down, across in zip((squared, upward, squared), around, strict=True):
        weighted = np.add.reduceat(image * down[:, None, None], starts[0], 0)
        axes.append(np.add.reduceat(weighted * across[:, None], starts[1], 1))
    vectors = np.stack(axes, axis=-1).reshape(-1, 3, 3)
    lit: Doubles = vectors[vectors.any(axis=(1, 2))]
    return lit


def _convolved(vectors: Doubles) -> Doubles:
    """Return E [size + 1, size + 1, 3] at the vertices: the sum of max(0, n.V) over the parts.

    That is half of n.(sum of V) + sum of |n.V|, and the latter is the same for -n.
    """
    z, x = _way()
    half = AMBIENT_SIZE // 2
    normal = vertices()
    upper = np.abs(x) + np.abs(z) <= half
    towards = normal[upper]
    sums = np.empty_like(towards)
    ones = np.ones(len(vectors))
    # A few normals at a time, so that the products stay in the cache.
    kept = np.empty((16, len(vectors)))
    for colour in range(3):
        parts = np.ascontiguousarray(vectors[:, colour].T)
        for first in range(0, len(towards), 16):
            some = towards[first : first + 16]
            products = np.matmul(some, parts, out=kept[: len(some)])
            np.abs(products, out=products)
            sums[first : first + 16, colour] = products @ ones
    total = np.empty_like(normal)
    total[upper] = sums
    x, z = _folded(x, z)
    lower = ~upper
    total[lower] = total[half - z[lower], half - x[lower]]
    light: Doubles = 0.5 * (normal @ vectors.sum(axis=0).T + total)
    # Unlit normals are black, not a rounding of the brightest.
    light[light < _ROUNDING * light.max(axis=(0, 1))] = 0.0
    return light


def _way() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the row and column of each vertex, from the middle of the map."""
    half = AMBIENT_SIZE // 2
    z, x = np.mgrid[: AMBIENT_SIZE + 1, : AMBIENT_SIZE + 1] - half
    return z, x


def _folded(x: NDArray[np.int64], z: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
    """Return x and z of vertices beyond the diamond |x| + |z| = 1, where the lower half lies."""
    half = AMBIENT_SIZE // 2
    return (np.copysign(half - np.abs(z), x).astype(np.int64), np.copysign(half - np.abs(x), z).astype(np.int64))
