"""Light sources, in world space and radiometric units. Their arrays are read-only."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.formats import files
from ssgi_cl.core.immutable import Immutable, frozen


@dataclass(frozen=True, eq=False)
class SpotLight(Immutable):
    """A point that shines into a cone.

    Attributes:
        position: [3], world space, scene units, within 1e30 of the origin along each axis.
        direction: [3], world space, the axis of the cone; any length but zero.
        cone_angle: half-angle of the cone in radians, in (0, 1.5].
        intensity: [3] or a number, RGB radiant intensity in W/sr inside the cone, 0 outside;
            in [0, 1e30].
        radius: of the sphere round `position` that shines, scene units, >= 0: shadows soften by it.
            Reflected light takes a point.
    """

    position: ArrayLike
    direction: ArrayLike
    cone_angle: float
    intensity: ArrayLike
    radius: float = 0.0

    def __post_init__(self) -> None:
        _set(self, "position", checks.point("position", self.position))
        _set(self, "direction", checks.direction("direction", self.direction))
        _set(self, "cone_angle", checks.number("cone_angle", self.cone_angle, low=1e-4, high=1.5, unit="radians"))
        _set(self, "intensity", checks.rgb("intensity", self.intensity, "W/sr"))
        _set(self, "radius", _radius(self.radius))


@dataclass(frozen=True, eq=False)
class PointLight(Immutable):
    """A point that shines into all directions.

    Attributes:
        position: [3], world space, scene units, within 1e30 of the origin along each axis.
        intensity: [3] or a number, RGB radiant intensity in W/sr, in [0, 1e30].
        radius: of the sphere that shines, scene units, as a spot light's.
    """

    position: ArrayLike
    intensity: ArrayLike
    radius: float = 0.0

    def __post_init__(self) -> None:
        _set(self, "position", checks.point("position", self.position))
        _set(self, "intensity", checks.rgb("intensity", self.intensity, "W/sr"))
        _set(self, "radius", _radius(self.radius))


@dataclass(frozen=True, eq=False)
class DirectionalLight(Immutable):
    """Parallel light from infinitely far away.

    Attributes:
        direction: [3], world space, the way the light travels; any length but zero.
        irradiance: [3] or a number, RGB irradiance in W/m^2 of a surface that faces the light, in
            [0, 1e30].
        angle: between the centre of its disc and the rim, radians, in [0, 0.5]; the sun's is
            0.00465. Shadows soften by it, reflected light takes a point.
    """

    direction: ArrayLike
    irradiance: ArrayLike
    angle: float = 0.0

    def __post_init__(self) -> None:
        _set(self, "direction", checks.direction("direction", self.direction))
        _set(self, "irradiance", checks.rgb("irradiance", self.irradiance, "W/m^2"))
        _set(self, "angle", checks.number("angle", self.angle, low=0.0, high=0.5, unit="radians"))


@dataclass(frozen=True, eq=False)
class Environment(Immutable):
    """Light from all around, infinitely far away.

    Whole frames shadow it by depth maps of sampled directions; else ambient occlusion dims it.

    Attributes:
        radiance: [3] or a number for the same RGB radiance everywhere, or [rows, columns, 3] as a
            latitude-longitude image (row 0 looks up +y, the middle column down -z, columns run to
            +x); W m^-2 sr^-1, in [0, 1e38].
    """

    radiance: ArrayLike

    def __post_init__(self) -> None:
        radiance = checks.as_array("radiance", self.radiance)
        if radiance.ndim == 3:
            limits: checks.Limits = {"unit": "W m^-2 sr^-1", "low": 0.0, "high": MOST_RADIANCE}
            value = checks.plane("radiance", radiance, channels=3, **limits).astype(np.float64)
            if value.size == 0:
                raise ValueError(f"radiance has shape {value.shape}: expected at least one texel")
        else:
            value = checks.rgb("radiance", radiance, "W m^-2 sr^-1", high=MOST_RADIANCE)
        _set(self, "radiance", value)

    def __repr__(self) -> str:
        radiance = np.asarray(self.radiance)
        if radiance.ndim == 1:
            return f"Environment(radiance={radiance.tolist()})"
        rows, columns = radiance.shape[:2]
        mean = ", ".join(f"{value:.4g}" for value in radiance.mean(axis=(0, 1)))
        return f"Environment of {rows} x {columns} texels, mean radiance ({mean}) W m^-2 sr^-1"

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Environment:
        """Return the environment of a latitude-longitude image file.

        Args:
            path: .exr with the channels R, G, B (or Y), or Radiance's .hdr; W m^-2 sr^-1, laid out
                as `radiance`.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: of another kind or damaged, or a texel is NaN, negative or infinite.
            OSError: the file cannot be read.
        """
        return files().read_environment(path)


MOST_RADIANCE = 1e38
"""W m^-2 sr^-1 of an environment: times pi it is a float32."""

PunctualLight = SpotLight | PointLight | DirectionalLight
"""Lights that have shadow maps."""
Light = PunctualLight | Environment


def light_tuple(lights: Iterable[Light] | Light) -> tuple[Light, ...]:
    """Return the lights, or the one that is given; TypeError if one is none."""
    result = (lights,) if isinstance(lights, Light) else tuple(lights)
    for index, light in enumerate(result):
        if not isinstance(light, Light):
            raise TypeError(f"lights[{index}] is {type(light).__name__}: expected a light")
    return result


def light_extent(light: Light) -> float:
    """Return the radius of a light, scene units, or the tangent of a directional light's angle.

    0 of an environment.
    """
    if isinstance(light, Environment):
        return 0.0
    return math.tan(light.angle) if isinstance(light, DirectionalLight) else light.radius


def environments_of(lights: Iterable[Light]) -> tuple[Environment, ...]:
    """Return the environments among the lights."""
    return tuple(light for light in lights if isinstance(light, Environment))


def shines(environment: Environment) -> bool:
    """Return whether any of an environment's radiance is not 0."""
    return bool(np.any(np.asarray(environment.radiance)))


def are_same(some: Sequence[Light], others: Sequence[Light]) -> bool:
    """Return whether both are the same objects; a light never changes."""
    return len(some) == len(others) and all(a is b for a, b in zip(some, others, strict=True))


def _set(light: object, name: str, value: float | NDArray[np.float64]) -> None:
    object.__setattr__(light, name, value if isinstance(value, float) else frozen(value))


def _radius(value: float) -> float:
    return checks.number("radius", value, low=0.0, high=1e30, unit="scene units")
