"""Widgets of parameters in the page, made from `controls`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ssgi_cl.viewer.controls import Control, controls
from ssgi_cl.viewer.settings import AO, BOUNCE, FRAME, PRESET, Settings

CHOOSES = {(FRAME, name) for name in ("bounces", "preset", "ao", "indirect", "method")}
"""Parameters that decide which others there are."""
PICTURE = frozenset(("exposure", "curve"))
"""Parameters of the frame that stand beside the output, not among the others."""


Callback = TypeVar("Callback", bound=Callable[..., Any])


def listener(register: Any) -> Callable[[Callback], Callback]:
    """Return a method of a widget of viser that registers a callback, as a decorator with types."""
    decorator: Callable[[Callback], Callback] = register
    return decorator


class Panel:
    """The widgets of all parameters; made anew when a choice changes which there are.

    Args:
        gui: of a client of viser.
        container: what they are put into, a tab.
        lengths: a length that suits the scene, scene units.
        read: returns the present settings.
        write: takes other settings.
        say: takes what is wrong with a value.
    """

    def __init__(
        self,
        gui: Any,
        container: Any,
        lengths: float,
        read: Callable[[], Settings],
        write: Callable[[Settings], None],
        say: Callable[[str], None],
    ) -> None:
        self._gui, self._container, self._lengths = gui, container, lengths
        self._read, self._write, self._say = read, write, say
        self._folders: list[Any] = []
        self._echoes: dict[int, Any] = {}  # by id: handles have no hash

    def follow(self, widget: Any, shown: Any) -> None:
        """Have a widget show something, without taking that for a wish of the user."""
        if widget.value != shown:
            self._echoes[id(widget)] = shown
            widget.value = shown

    def build(self, groups: tuple[str, ...] = (FRAME, PRESET, AO, BOUNCE)) -> None:
        """Make the widgets, in place of those that there are."""
        for folder in self._folders:
            folder.remove()
        self._folders = []
        settings = self._read()
        with self._container:
            for group in groups:
                params = settings.current(group)
                if params is None:
                    continue
                folder = self._gui.add_folder(settings.title(group), expand_by_default=group in (FRAME, AO))
                self._folders.append(folder)
                with folder:
                    for control in controls(params, self._lengths):
                        if control.name not in PICTURE:
                            self.add(group, control)

    def add(self, group: str, control: Control) -> Any:
        """Add the widget of a control to the present container; return it."""
        widget = _widget(self._gui, control)

        @listener(widget.on_update)
        async def _(_: Any) -> None:
            if self._echoes.pop(id(widget), None) != widget.value:
                self.change(group, control, widget.value)

        return widget

    def change(self, group: str, control: Control, shown: Any) -> None:
        """Take over what a widget shows, or say what is wrong with it."""
        try:
            settings = self._read().changed(group, control.name, control.value(shown))
        except (TypeError, ValueError, OverflowError) as error:
            self._say(str(error))
            return
        self._say("")
        self._write(settings)
        if (group, control.name) in CHOOSES:
            self.build()


def _widget(gui: Any, control: Control) -> Any:
    if control.kind == "switch":
        return gui.add_checkbox(control.label, control.shown, hint=control.hint)
    if control.kind == "choice":
        return gui.add_dropdown(control.label, tuple(control.words), initial_value=control.shown, hint=control.hint)
    if control.kind == "number":
        return gui.add_number(control.label, control.shown, hint=control.hint)
    whole = control.whole and not control.power
    low, high, step, shown = (
        (int if whole else float)(value) for value in (control.low, control.high, control.step, control.shown)
    )
    return gui.add_slider(control.label, low, high, step, shown, hint=control.hint)
