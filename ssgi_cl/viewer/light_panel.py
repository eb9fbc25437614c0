"""Widgets and handles of lights: on, colour, power, and a handle in the scene that is dragged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ssgi_cl.core.errors import SsgiError
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.core.srgb import srgb_to_linear
from ssgi_cl.io.console import one_line
from ssgi_cl.viewer.light_settings import (
    QUANTITIES,
    LightState,
    colour_of,
    handle_place,
    moved,
    power_of,
    with_colour,
    with_power,
)
from ssgi_cl.viewer.panel import listener
from ssgi_cl.viewer.source import Source

MOST_HANDLES = 16
"""Lights with a handle in the scene; of more the page has a list alone."""
_HANDLE_SHARE = 0.04
"""Size of a handle, share of the scene's extent."""
_OWN = "of the scene"
_NAMES = {"SpotLight": "Spot", "PointLight": "Point", "DirectionalLight": "Sun", "Environment": "Sky"}

Lights = tuple[LightState, ...]


class LightPanel:
    """The lights of one tab.

    Args:
        client: of viser.
        container: what the widgets are put into.
        source: whose lights they are at first.
        read, write: the present lights, and others.
        say: takes what is wrong.
    """

    def __init__(
        self,
        client: Any,
        container: Any,
        source: Source,
        read: Callable[[], Lights],
        write: Callable[[Lights], None],
        say: Callable[[str], None],
    ) -> None:
        self._client, self._container, self._source = client, container, source
        self._read, self._write, self._say = read, write, say
        bounds = source.scene.bounds if source.scene is not None else np.zeros((2, 3))
        self._centre = bounds.mean(axis=0)
        self._handles: dict[int, Any] = {}
        self._places: dict[int, Any] = {}
        with container:
            if source.environments:
                self._add_environments()
            if source.scene is not None and any(not isinstance(state.light, Environment) for state in read()):
                switch = client.gui.add_checkbox("handles", False, hint="Show the lights' handles in the scene.")

                @listener(switch.on_update)
                async def _(_: Any) -> None:
                    self.show_handles(switch.value)

            for index, state in enumerate(read()):
                self._add(index, state.light)

    def show_handles(self, shown: bool) -> None:
        """Show or hide the handles in the scene."""
        if shown and not self._handles:
            for index, state in enumerate(self._read()):
                if len(self._handles) < MOST_HANDLES:
                    self._add_handle(index, state.light)
        for handle in self._handles.values():
            handle.visible = shown

    def _add(self, index: int, light: Light) -> None:
        """Add the widgets of a light."""
        gui, (quantity, unit) = self._client.gui, QUANTITIES[type(light)]
        with gui.add_folder(f"{_NAMES[type(light).__name__]} {index + 1}"):
            on = gui.add_checkbox("on", True)
            colour = gui.add_rgb("colour", _encoded(colour_of(light)), hint="Of its greatest channel as a share.")
            hint = f"Greatest channel of its {quantity}, {unit}"
            power = gui.add_number(f"{quantity} ({unit})", power_of(light), min=0.0, step=_step(light), hint=hint)
            place = None
            if not isinstance(light, Environment):
                name = "direction" if isinstance(light, DirectionalLight) else "position"
                label = "direction" if name == "direction" else "position (scene units)"
                place = gui.add_vector3(label, _three(getattr(light, name)), step=0.01)
                self._places[index] = place

        @listener(on.on_update)
        async def _(_: Any) -> None:
            self._set(index, lambda state: replace(state, on=on.value))

        @listener(colour.on_update)
        async def _(_: Any) -> None:
            self._change(index, lambda light: with_colour(light, _decoded(colour.value)))

        @listener(power.on_update)
        async def _(_: Any) -> None:
            self._change(index, lambda light: with_power(light, power.value))

        if place is not None:

            @listener(place.on_update)
            async def _(_: Any) -> None:
                if not np.allclose(place.value, getattr(self._read()[index].light, name)):  # else it followed a handle
                    self._change(index, lambda light: replace(light, **{name: place.value}))

    def _add_handle(self, index: int, light: Light) -> None:
        place = handle_place(light, self._centre, 0.5 * self._source.extent)
        if place is None:
            return
        handle = self._client.scene.add_transform_controls(
            f"/lights/{index + 1}",
            scale=_HANDLE_SHARE * self._source.extent,
            disable_rotations=True,
            depth_test=False,
            position=_three(place),
        )
        self._handles[index] = handle

        @listener(handle.on_update)
        async def _(_: Any) -> None:
            self.drag(index, np.asarray(handle.position))

    def drag(self, index: int, place: np.ndarray) -> None:
        """Take over the place that a light's handle was dragged to, world space."""
        self._change(index, lambda light: moved(light, place, self._centre))
        light = self._read()[index].light
        if index in self._places:
            name = "direction" if isinstance(light, DirectionalLight) else "position"
            self._places[index].value = _three(getattr(light, name))

    def _change(self, index: int, change: Callable[[Light], Light]) -> None:
        self._set(index, lambda state: replace(state, light=change(state.light)))

    def _set(self, index: int, change: Callable[[LightState], LightState]) -> None:
        lights = list(self._read())
        try:
            lights[index] = change(lights[index])
        except (TypeError, ValueError, OverflowError) as error:
            self._say(str(error))
            return
        self._say("")
        self._write(tuple(lights))

    def _add_environments(self) -> None:
        names: dict[str, Path | None] = {_OWN: None, **{path.name: path for path in self._source.environments}}
        chosen = self._client.gui.add_dropdown(
            "environment", tuple(names), initial_value=_OWN, hint="Files given at the start."
        )

        @listener(chosen.on_update)
        def _(_: Any) -> None:  # reads a file: not on the thread of the connections
            path = names[chosen.value]
            try:
                sky = None if path is None else Environment.load(path)
            except (SsgiError, ValueError, OSError) as error:
                self._say(one_line(error))
                return
            self._say("")
            self._write(with_environment(self._read(), self._source.lights, sky))


def with_environment(lights: Lights, own: tuple[Light, ...], sky: Environment | None) -> Lights:
    """Return lights with another environment in place of the first, and others off; None: the scene's own.

    Each light keeps its place in the list. Where the scene has no environment, that of a file is the last.
    """
    found: list[LightState] = []
    placed = False
    for state, first in zip(lights, own, strict=False):  # what is beyond is of a file
        if not isinstance(first, Environment):
            found.append(state)
            continue
        found.append(LightState(light=first if sky is None or placed else sky, on=sky is None or not placed))
        placed = True
    if sky is not None and not placed:
        found.append(LightState(light=sky))
    return tuple(found)


def _three(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.asarray(values, np.float64))
    return x, y, z


def _step(light: Light) -> float:
    power = power_of(light)
    return float(10.0 ** np.floor(np.log10(power) - 1.0)) if power > 0.0 else 0.1


def _encoded(colour: np.ndarray) -> tuple[int, int, int]:
    """Return a linear colour in [0, 1] as bytes of sRGB."""
    value = np.clip(colour, 0.0, 1.0)
    srgb = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    red, green, blue = (round(255 * float(each)) for each in srgb)
    return red, green, blue


def _decoded(colour: tuple[int, int, int]) -> np.ndarray:
    return srgb_to_linear(np.clip(np.asarray(colour, np.float64) / 255.0, 0.0, 1.0))
