"""One browser tab: its page, and the session behind it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from html import escape
from time import monotonic
from typing import Any

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io.console import is_expected, one_line
from ssgi_cl.viewer.call_code import code
from ssgi_cl.viewer.controls import STOPS, controls
from ssgi_cl.viewer.light_panel import LightPanel
from ssgi_cl.viewer.light_settings import LightState
from ssgi_cl.viewer.look import AGAINST, Look
from ssgi_cl.viewer.outlet import Outlet
from ssgi_cl.viewer.outputs import ERROR, OUTPUTS
from ssgi_cl.viewer.panel import PICTURE, Panel, listener
from ssgi_cl.viewer.pass_chart import chart
from ssgi_cl.viewer.pose import Pose
from ssgi_cl.viewer.render_loop import RenderLoop
from ssgi_cl.viewer.saved import exr_bytes, png_bytes
from ssgi_cl.viewer.session import Session, Shown
from ssgi_cl.viewer.settings import FRAME, Settings, check_share
from ssgi_cl.viewer.source import HEIGHT, WIDTH, Source

WIDTHS = ("320", "480", "640", "800", "1200", "1600", "1920")
"""Pixels of the still picture's width, to choose from."""
MOST_NOTES = 4.0
"""A second: of what is said of moving pictures."""


class Tab:
    """What a client of viser sees and does. Callbacks of its widgets change the session's look and return at once."""

    def __init__(
        self, client: Any, source: Source, runtime: Runtime, loop: RenderLoop, reload: Callable[[], None]
    ) -> None:
        self._client, self._source, self._loop, self._reload = client, source, loop, reload
        self._width = WIDTH
        self._noted = 0.0
        self._said = {"wish": "", "drawing": ""}
        self._outlet = Outlet(client)
        look = Look(
            pose=source.pose,
            size=self._size(),
            settings=Settings(source.radius),
            lights=tuple(LightState(light=light) for light in source.lights),
        )
        self.session = Session(source, look, runtime, self._show, self._say_drawing, loop.wake)
        client.camera.near, client.camera.far = 1e-3 * source.extent, 100.0 * source.extent
        self._build()
        client.camera.on_update(self._moved)
        loop.add(self.session)

    def close(self) -> None:
        """Let go of all that the tab held."""
        self._outlet.close()
        self._loop.remove(self.session)

    # ---- page

    def _build(self) -> None:
        gui, source = self._client.gui, self._source
        self._message = gui.add_html("")
        self._note = gui.add_html("")
        tabs = gui.add_tab_group()
        view, lights, frame = tabs.add_tab("View"), tabs.add_tab("Lights"), tabs.add_tab("Settings")
        reference, cost, python = tabs.add_tab("Compare"), tabs.add_tab("Cost"), tabs.add_tab("Code")
        self._panel = Panel(gui, frame, source.radius, self._settings, self._set_settings, self._say)
        with view:
            self._build_view()
        LightPanel(self._client, lights, source, lambda: self.session.look.lights, self._set_lights, self._say)
        with frame:
            defaults = gui.add_button("All defaults")

            @listener(defaults.on_click)
            async def _(_: Any) -> None:
                self._set_settings(Settings(source.radius))
                self._panel.build()

        self._panel.build()
        with reference:
            self._build_comparison()
        with cost:
            self._chart = gui.add_html("")
        with python:
            self._code = gui.add_markdown("")

    def _build_view(self) -> None:
        gui, source = self._client.gui, self._source
        names = [name for name, each in OUTPUTS.items() if source.scene is not None or each.of_gbuffer]
        if source.scene is not None:
            names.append(ERROR)
        hint = "; ".join(f"{name}: {OUTPUTS[name].doc}" for name in names if name in OUTPUTS)
        output = gui.add_dropdown("output", tuple(names), initial_value=names[0], hint=hint)
        output.on_update(self._changes(lambda: {"output": output.value}))
        for control in controls(self._settings().params, source.radius, only=PICTURE):
            widget = self._panel.add(FRAME, control)
            if control.name == "exposure":
                self._exposure = widget
        automatic = gui.add_button("Automatic exposure")

        @listener(automatic.on_click)
        async def _(_: Any) -> None:
            self._set_settings(self._settings().changed(FRAME, "exposure", None))

        if source.scene is not None:
            cameras = gui.add_dropdown("camera", tuple(source.cameras), initial_value=next(iter(source.cameras)))

            @listener(cameras.on_update)
            async def _(_: Any) -> None:
                self.look_from(source.cameras[cameras.value])

            width = gui.add_dropdown("width (px)", WIDTHS, initial_value=str(WIDTH), hint="Of the still picture.")

            @listener(width.on_update)
            async def _(_: Any) -> None:
                self._width = int(width.value)
                self.session.change(size=self._size())

        for label, name, make in (("Save as PNG", "picture.png", self._png), ("Save as EXR", "picture.exr", self._exr)):
            button = gui.add_button(label, hint="Downloaded by the browser; nothing is written where it is computed.")
            button.on_click(lambda _, name=name, make=make: self._loop.do(lambda: self._download(name, make)))
        if source.reload is not None:
            gui.add_button("Read the file again").on_click(lambda _: self._guarded(self._reload))

    def _build_comparison(self) -> None:
        gui = self._client.gui
        against = gui.add_dropdown("right of the wipe", AGAINST, initial_value=AGAINST[0])
        against.on_update(self._changes(lambda: {"against": against.value}))
        wipe = gui.add_slider("wipe", 0.0, 1.0, 0.005, 0.5, hint="Share of the picture's width.")
        wipe.on_update(self._changes(lambda: {"wipe": check_share(wipe.value)}))
        keep = gui.add_button("Keep this as B", hint="Its output, settings and lights; compared with what is set next.")

        @listener(keep.on_click)
        async def _(_: Any) -> None:
            self.session.change(other=replace(self.session.look, other=None), against="B")
            against.value = "B"

        if self._source.scene is None:
            return
        gui.add_button("Start the reference", hint="Paths or rays, of this view.").on_click(
            lambda _: self._guarded(self._start_reference)
        )
        stop = gui.add_button("Stop the reference")

        @listener(stop.on_click)
        async def _(_: Any) -> None:
            self.session.stop_reference()

        self._reference = gui.add_html("")

    # ---- what the user does

    def _changes(self, make: Callable[[], dict[str, Any]]) -> Callable[[Any], Any]:
        """Return a callback that changes the look, or says what is wrong."""

        async def changed(_: Any) -> None:
            self._guarded(lambda: self.session.change(**make()))

        return changed

    def _guarded(self, work: Callable[[], Any]) -> None:
        """Run what may fail, and say why it does."""
        try:
            work()
            self._say("")
        except Exception as error:
            if not is_expected(error):
                raise
            self._say(one_line(error))

    async def _moved(self, camera: Any) -> None:
        """Take over the camera of the page."""
        if self._source.scene is None or not np.isfinite([*camera.position, *camera.look_at, camera.fov]).all():
            return
        pose = Pose(
            eye=_vector(camera.position),
            target=_vector(camera.look_at),
            up=_vector(camera.up_direction),
            yfov=float(camera.fov),
        )
        size = self._size()
        if pose != self.session.look.pose or size != self.session.look.size:
            self.session.change(pose=pose, size=size)

    def look_from(self, pose: Pose) -> None:
        """Move the camera of the page."""
        camera = self._client.camera
        with self._client.atomic():
            camera.up_direction, camera.position, camera.look_at = pose.up, pose.eye, pose.target
            camera.fov = pose.yfov
        self.session.change(pose=pose)

    def _size(self) -> tuple[int, int]:
        """Return (width, height) of the still picture: the page's proportions."""
        gbuffer = self._source.gbuffer
        if gbuffer is not None:
            return gbuffer.camera.width, gbuffer.camera.height
        wide, tall = self._client.camera.image_width, self._client.camera.image_height
        if wide < 1 or tall < 1:
            return WIDTH, HEIGHT
        return self._width, int(np.clip(round(self._width * tall / wide), 1, 4 * self._width))

    def _settings(self) -> Settings:
        return self.session.look.settings

    def _set_settings(self, settings: Settings) -> None:
        self.session.change(settings=settings)

    def _set_lights(self, lights: tuple[LightState, ...]) -> None:
        self.session.change(lights=lights)

    def _start_reference(self) -> None:
        self.session.start_reference()
        self._reference.content = _text("the reference starts")

    def _download(self, name: str, make: Callable[[], bytes]) -> None:
        self._guarded(lambda: self._client.send_file_download(name, make(), save_immediately=True))

    def _png(self) -> bytes:
        latest = self._outlet.latest
        if latest is None:
            raise ValueError("there is no picture yet: expected one")
        return png_bytes(latest.picture)

    def _exr(self) -> bytes:
        _, drawn = self.session.still()
        if drawn is None:
            raise ValueError("there is no picture yet: expected a still one")
        return exr_bytes(drawn)

    # ---- what the session tells

    def _show(self, shown: Shown) -> None:
        self._outlet.offer(shown)
        now = monotonic()
        if shown.moving and now < self._noted + 1.0 / MOST_NOTES:
            return
        self._noted = now
        self._note.content = _text(f"{'moving: ' if shown.moving else ''}{shown.note}")
        if self.session.reference is not None:
            self._reference.content = _text(self.session.reference.text)
        if not shown.moving:
            if self._settings().params.exposure is None and shown.exposure > 0.0:
                self._panel.follow(self._exposure, float(np.clip(round(np.log2(shown.exposure), 3), -STOPS, STOPS)))
            if shown.frame is not None:
                self._chart.content = chart(shown.frame.graph, shown.frame.wall_ms)
            self._code.content = f"```python\n{code(self._source, self.session.look)}\n```"

    def _say(self, text: str) -> None:
        """Show what is wrong with what the user asked for; "" once that is no longer so."""
        self._tell(wish=text)

    def _say_drawing(self, text: str) -> None:
        """Show why there is no picture; "" once there is."""
        self._tell(drawing=text)

    def _tell(self, **said: str) -> None:
        if all(self._said[name] == text for name, text in said.items()):
            return
        self._said |= said
        text = "\n".join(each for each in self._said.values() if each)
        style = "padding:6px 10px;margin:4px;background:#fee2e2;color:#991b1b;font-size:12px;white-space:pre-wrap"
        self._message.content = f'<div role="alert" style="{style}">{escape(text)}</div>' if text else ""


def _vector(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _text(text: str) -> str:
    return f'<div style="padding:2px 10px;font-size:12px">{escape(text)}</div>'
