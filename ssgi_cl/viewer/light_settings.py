"""Lights as a tab changes them: switched, moved, coloured, of another power."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight

QUANTITIES: dict[type[object], tuple[str, str]] = {
    SpotLight: ("intensity", "W/sr"),
    PointLight: ("intensity", "W/sr"),
    DirectionalLight: ("irradiance", "W/m^2"),
    Environment: ("radiance", "W m^-2 sr^-1"),
}
"""What the power of each kind of light is, and its unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LightState:
    """A light of a tab.

    Attributes:
        light: with the colour, power and place that it has when it is on.
        on: whether it shines.
    """

    light: Light
    on: bool = True


def shining(states: tuple[LightState, ...]) -> tuple[Light, ...]:
    """Return the lights that are on."""
    return tuple(state.light for state in states if state.on)


def power_of(light: Light) -> float:
    """Return the greatest channel of a light's quantity, of an environment's image that of its mean."""
    return float(_rgb(light).max())


def colour_of(light: Light) -> NDArray[np.float64]:
    """Return [3] the linear colour of a light, its greatest channel 1; white of a light without power."""
    rgb = _rgb(light)
    return rgb / rgb.max() if rgb.max() > 0.0 else np.ones(3)


def with_power(light: Light, power: float) -> Light:
    """Return a light of the same colour with another power, in the unit of its quantity."""
    name, unit = QUANTITIES[type(light)]
    power = checks.number(f"power ({name})", power, low=0.0, high=checks.MOST_LIGHT, unit=unit)
    before = power_of(light)
    value = np.asarray(getattr(light, name), np.float64)
    if before == 0.0:
        return _replaced(light, **{name: np.ones(3) * power})
    return _replaced(light, **{name: value * (power / before)})


def with_colour(light: Light, colour: NDArray[np.float64]) -> Light:
    """Return a light of another linear colour [3] and the same power; a black colour counts as white."""
    name, _ = QUANTITIES[type(light)]
    colour = np.asarray(colour, np.float64)
    colour = colour / colour.max() if colour.max() > 0.0 else np.ones(3)
    value = np.asarray(getattr(light, name), np.float64)
    if value.ndim == 3:
        grey = value / np.maximum(colour_of(light), 1e-6)
        return _replaced(light, **{name: grey * colour})
    return _replaced(light, **{name: colour * power_of(light)})


def handle_place(light: Light, centre: NDArray[np.float64], extent: float) -> NDArray[np.float64] | None:
    """Return [3] where a light's handle is, world space: that of a directional light is above the scene, where it comes
    from; None of an environment."""
    if isinstance(light, Environment):
        return None
    if isinstance(light, DirectionalLight):
        return np.asarray(centre - 0.5 * extent * np.asarray(light.direction))
    return np.asarray(light.position, np.float64)


def moved(light: Light, place: NDArray[np.float64], centre: NDArray[np.float64]) -> Light:
    """Return a light whose handle is somewhere else; a directional light then shines from there to the scene's centre.

    Raises:
        ValueError: the handle of a directional light is at the centre, or a place is beyond 1e30.
    """
    if isinstance(light, DirectionalLight):
        return replace(light, direction=centre - place)
    return light if isinstance(light, Environment) else replace(light, position=place)


def _rgb(light: Light) -> NDArray[np.float64]:
    value = np.asarray(getattr(light, QUANTITIES[type(light)][0]), np.float64)
    if value.ndim == 3:
        mean: NDArray[np.float64] = value.mean(axis=(0, 1))
        return mean
    return np.broadcast_to(value, (3,)).astype(np.float64)


def _replaced(light: Any, **changes: object) -> Light:
    changed: Light = replace(light, **changes)
    return changed
