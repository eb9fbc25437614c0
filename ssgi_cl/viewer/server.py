"""The server behind the pages: one source, one device, any number of tabs."""

from __future__ import annotations

import contextlib
import io
import threading
import time
from collections.abc import Callable
from html import escape
from typing import Any

from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.viewer.painter import Painter
from ssgi_cl.viewer.quality import quick_params
from ssgi_cl.viewer.render_loop import RenderLoop
from ssgi_cl.viewer.source import HEIGHT, WIDTH, Source
from ssgi_cl.viewer.tab import Tab

NOTEBOOK_HEIGHT = 600
"""Pixels of the frame in notebooks."""


def viser() -> Any:
    """Return the package.

    Raises:
        MissingExtraError: it is not installed; it comes with the extra `viewer`.
    """
    try:
        import viser as package
    except ImportError as error:
        raise MissingExtraError(
            "the window in the browser needs viser, which is not installed: pip install 'ssgi-cl[viewer]'"
        ) from error
    return package


class Viewer:
    """A window on a source: a server whose page any number of browser tabs open, each with a camera of its own.

    Args:
        source: what is shown.
        runtime: the device.
        host: address that it listens to; others than "localhost" let other machines in.
        port: the first one that is tried; the next free one is taken.
    """

    def __init__(self, source: Source, runtime: Runtime, *, host: str = "localhost", port: int = 8080) -> None:
        package = viser()
        self.source = source
        self._runtime = runtime
        self._tabs: dict[int, Tab] = {}
        self._lock = threading.Lock()
        self._loop = RenderLoop()

        with contextlib.redirect_stdout(io.StringIO()):  # it prints a box with its address
            self._server = package.ViserServer(host=host, port=port, label=f"ssgi view {source.name}", verbose=False)
        # A page may ask for a tunnel to the world outside: that is for the caller to decide, by `host`.
        self._server.request_share_url = lambda verbose=True: None
        self.url = f"http://{self._server.get_host()}:{self._server.get_port()}"
        self._server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        self._place_camera(source)
        self._loop.do(self._warm)
        self._server.on_client_connect(self._connected)
        self._server.on_client_disconnect(self._disconnected)

    def __repr__(self) -> str:
        return f"<Viewer of {self.source.name} at {self.url}, {len(self._tabs)} tabs>"

    def _repr_html_(self) -> str:
        """Return a frame with the page, for notebooks."""
        return f'<iframe src="{escape(self.url, quote=True)}" width="100%" height="{NOTEBOOK_HEIGHT}"></iframe>'

    @property
    def tabs(self) -> tuple[Tab, ...]:
        """The tabs that are open."""
        with self._lock:
            return tuple(self._tabs.values())

    def wait(self) -> None:
        """Return when the server is stopped by an interrupt."""
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                time.sleep(3600.0)

    def close(self) -> None:
        """Stop the server; let go of all that tabs held."""
        for tab in self.tabs:
            tab.close()
        self._loop.end()
        self._server.stop()

    def _place_camera(self, source: Source) -> None:
        start, pose = self._server.initial_camera, source.pose
        self._server.scene.set_up_direction(pose.up)
        start.up, start.position, start.look_at, start.fov = pose.up, pose.eye, pose.target, pose.yfov

    def _warm(self) -> None:
        """Bring the scene and the kernels of the first picture to the device while a browser starts."""
        scene, pose = self.source.scene, self.source.pose
        if scene is None:
            return
        size = WIDTH // 2, HEIGHT // 2
        params = quick_params(FrameParams())
        Painter(self._runtime).frame(scene, pose.camera(*size), self.source.lights, params, "image")

    def _connected(self, client: Any) -> None:
        tab = Tab(client, self.source, self._runtime, self._loop, self._reload)
        with self._lock:
            self._tabs[client.client_id] = tab

    def _disconnected(self, client: Any) -> None:
        with self._lock:
            tab = self._tabs.pop(client.client_id, None)
        if tab is not None:
            tab.close()

    def _reload(self) -> None:
        """Read the source's file again, for all tabs."""
        again: Callable[[], Source] | None = self.source.reload
        if again is None:
            return
        self.source = again()
        for tab in self.tabs:
            tab.session.renew(self.source)
