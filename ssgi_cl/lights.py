"""Light sources, in world space and radiometric units."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl import check


@dataclass(frozen=True, eq=False)
class SpotLight:
    """A point that shines into a cone.

    Attributes:
        position: [3], world space, scene units.
        direction: [3], world space, the axis of the cone; any length but zero.
        cone_angle: half-angle of the cone in radians, in (0, 1.5].
        intensity: [3] or a number, RGB radiant intensity in W/sr inside the cone, 0 outside.
        radius: of the sphere round `position` that shines, scene units, >= 0; screen-space
            shadows soften by it, shadow maps and reflected light take a point.
    """

    position: ArrayLike
    direction: ArrayLike
    cone_angle: float
    intensity: ArrayLike
    radius: float = 0.0

    def __post_init__(self) -> None:
        _set(self, "position", check.vector("position", self.position, 3, "scene units"))
        _set(self, "direction", check.direction("direction", self.direction))
        angle = check.number("cone_angle", self.cone_angle, low=1e-4, high=1.5, unit="radians")
        object.__setattr__(self, "cone_angle", angle)
        _set(self, "intensity", check.rgb("intensity", self.intensity, "W/sr"))
        radius = check.number("radius", self.radius, low=0.0, high=1e30, unit="scene units")
        object.__setattr__(self, "radius", radius)


@dataclass(frozen=True, eq=False)
class PointLight:
    """A point that shines into all directions.

    Attributes:
        position: [3], world space, scene units.
        intensity: [3] or a number, RGB radiant intensity in W/sr.
        radius: of the sphere that shines, scene units, as a spot light's.
    """

    position: ArrayLike
    intensity: ArrayLike
    radius: float = 0.0

    def __post_init__(self) -> None:
        _set(self, "position", check.vector("position", self.position, 3, "scene units"))
        _set(self, "intensity", check.rgb("intensity", self.intensity, "W/sr"))
        radius = check.number("radius", self.radius, low=0.0, high=1e30, unit="scene units")
        object.__setattr__(self, "radius", radius)


@dataclass(frozen=True, eq=False)
class DirectionalLight:
    """Parallel light from infinitely far away.

    Attributes:
        direction: [3], world space, the way the light travels; any length but zero.
        irradiance: [3] or a number, RGB irradiance in W/m^2 of a surface that faces the light.
        angle: between the centre of its disc and the rim, radians, in [0, 0.5]; the sun's is
            0.00465. Screen-space shadows soften by it, shadow maps take a point.
    """

    direction: ArrayLike
    irradiance: ArrayLike
    angle: float = 0.0

    def __post_init__(self) -> None:
        _set(self, "direction", check.direction("direction", self.direction))
        _set(self, "irradiance", check.rgb("irradiance", self.irradiance, "W/m^2"))
        angle = check.number("angle", self.angle, low=0.0, high=0.5, unit="radians")
        object.__setattr__(self, "angle", angle)


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all around, infinitely far away; no shadow map, ambient occlusion dims it.

    Attributes:
        radiance: [3] or a number for the same RGB radiance everywhere, or [rows, columns, 3] as a
            latitude-longitude image (row 0 looks up +y, the middle column down -z, columns run to
            +x); W m^-2 sr^-1, >= 0.
    """

    radiance: ArrayLike

    def __post_init__(self) -> None:
        radiance = np.asarray(self.radiance)
        if radiance.ndim == 3:
            image = check.plane(
                "radiance", radiance, channels=3, unit="W m^-2 sr^-1", low=0.0
            ).astype(np.float64)
            if image.size == 0:
                raise ValueError(f"radiance has shape {image.shape}: expected at least one texel")
            _set(self, "radiance", image)
        else:
            _set(self, "radiance", check.rgb("radiance", radiance, "W m^-2 sr^-1"))

    def irradiance_coefficients(self) -> NDArray[np.float64]:
        """Return [9, 3] float64: irradiance E(n) = sum_i c_i b_i(n) in W/m^2.

        The basis is 1, x, y, z, xy, yz, zx, 3z^2 - 1, x^2 - y^2 of the world-space normal: the
        spherical harmonics up to degree 2 (Ramamoorthi and Hanrahan 2001, eq. 7 to 12), with their
        constants folded into the coefficients. A constant environment L gives pi L exactly.
        """
        radiance = np.asarray(self.radiance, dtype=np.float64)
        result = np.zeros((9, 3))
        if radiance.ndim == 1:
            result[0] = math.pi * radiance
            return result
        rows, columns = radiance.shape[:2]
        polar_edges = np.linspace(0.0, math.pi, rows + 1)
        polar = 0.5 * (polar_edges[1:] + polar_edges[:-1])[:, None]
        azimuth = ((np.arange(columns) + 0.5) / columns - 0.5) * 2.0 * math.pi
        x = np.sin(polar) * np.sin(azimuth)
        y = np.cos(polar) * np.ones_like(azimuth)
        z = -np.sin(polar) * np.cos(azimuth)
        solid_angle = (np.cos(polar_edges[:-1]) - np.cos(polar_edges[1:])) * 2.0 * math.pi / columns
        basis = np.stack(
            [np.ones_like(x), x, y, z, x * y, y * z, z * x, 3.0 * z * z - 1.0, x * x - y * y]
        )
        # Squares of the normalisation of each basis function, times the cosine lobe's A_l.
        band = np.array([1.0 / 4.0, *[3.0 / 4.0] * 3, *[15.0 / 4.0] * 3, 5.0 / 16.0, 15.0 / 16.0])
        lobe = np.array([1.0, *[2.0 / 3.0] * 3, *[1.0 / 4.0] * 5])
        moments = np.einsum("brc,r,rcd->bd", basis, solid_angle, radiance)
        coefficients: NDArray[np.float64] = (band * lobe)[:, None] * moments
        return coefficients


Light = SpotLight | PointLight | DirectionalLight | Environment


def _set(light: object, name: str, value: NDArray[np.float64]) -> None:
    own = value.copy()  # the caller's array stays writable
    own.flags.writeable = False
    object.__setattr__(light, name, own)
