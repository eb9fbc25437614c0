"""Renders frames for one tab and keeps what it prepared for the latest few kinds of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Sequence

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.renderer import Renderer
from ssgi_cl.frame.result import Frame

MOST_RENDERERS = 6
"""Kept at a time: of the still and the moving picture, of both sides of the wipe."""


class Painter:
    """Frames of a scene. Its device memory is free once it is closed, or forgotten.

    Attributes:
        made: how many renderers were prepared, in all.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self.made = 0
        self._renderers: OrderedDict[Hashable, Renderer] = OrderedDict()

    def frame(self, scene: Scene, camera: Camera, lights: Sequence[Light], params: FrameParams, *outputs: str) -> Frame:
        """Return a frame that holds `outputs`.

        Raises:
            DeviceMemoryError: there is no room; what was prepared is let go.
        """
        key = camera.size, params.shape()
        try:
            renderer = self._renderers.get(key)
            if renderer is None:
                while len(self._renderers) >= MOST_RENDERERS:
                    self._renderers.popitem(last=False)
                renderer = self.runtime.exclusively(lambda: Renderer(self.runtime, camera.size, params))
                self._renderers[key] = renderer
                self.made += 1
            self._renderers.move_to_end(key)
            renderer.params = params
            return renderer(scene, camera, lights, outputs=outputs)
        except Exception:
            self.close()
            raise

    def close(self) -> None:
        """Let go of all that was prepared."""
        self._renderers.clear()
