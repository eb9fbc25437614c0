"""This library's edge-aware blur as a denoiser of whole frames by other programs.

What surfaces send is divided by their reflectance, so that textures stay sharp, blurred along the
surfaces of a G-buffer that is drawn for each frame, and multiplied again. Emission and what shows no
surface are left as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams

Floats = NDArray[np.float32]

RADII = {1: 12, 2: 8, 8: 4}
"""Pixels for as many paths a pixel and more: of 4, 8, 12 and 16 px, normals' sigmas .3 and .7 and one or two
passes those of the least mean FLIP on the built-in scenes at 400 x 300, with .3 and one pass."""
NORMAL_SIGMA = 0.3
DARKEST = 1e-3
"""Reflectance by which light is divided at least."""


def radius_of(samples: int) -> int:
    """Return the radius of the blur in pixels for frames of so many paths per pixel."""
    return RADII[max(least for least in RADII if least <= samples)]


class FrameBlur:
    """The blur, for one scene at one size.

    Args:
        runtime: the device.
        size: (rows, columns).
        scene: what frames show.
        samples: paths per pixel of the frames.
    """

    def __init__(self, runtime: Runtime, size: Size, scene: Scene, samples: int) -> None:
        self._runtime, self._scene = runtime, scene
        # `matt`: what lobes reflect counts as reflectance too.
        self._rasterizer = Rasterizer(runtime, size, matt=True)
        params = BilateralParams(radius=radius_of(samples), normal_sigma=NORMAL_SIGMA)
        self._blur = Bilateral(runtime, size, params, 3)
        self._light = runtime.plane(3, size)

    def run(self, color: Floats, camera: Camera) -> Floats:
        """Return the blurred radiance [rows, columns, 3]."""
        with self._runtime.frame():
            seen = self._rasterizer.render(device_scene(self._scene, self._runtime), camera)
            seen.derive()
            planes = np.moveaxis(color, -1, 0)
            there = np.isfinite(seen.depth.download()[0])
            reflectance = np.maximum(seen.albedo.download(), np.float32(DARKEST))
            emission = seen.emission.download() if seen.emits else np.float32(0.0)
            self._light.upload(np.where(there, np.maximum(planes - emission, 0.0) / reflectance, 0.0))
            light = self._blur.run(seen, self._light).download()
        found = np.where(there, light * reflectance + emission, planes)
        return np.ascontiguousarray(np.moveaxis(found, 0, -1), np.float32)
