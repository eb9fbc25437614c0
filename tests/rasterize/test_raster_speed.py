"""The rasteriser's time beside pyrender's, in the same run on the same machine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.bench.peers import pyrender
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import Rasterizer, Scene, load_scene
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.shadow_map import RsmRenderer, light_cameras

pytestmark = pytest.mark.slow

SPONZA = Path(__file__).parents[3] / "shared" / "scenes" / "sponza" / "sponza.glb"
FRAMES = 15


@pytest.fixture(scope="module")
def sponza(opengl_runs: None) -> Scene:
    if not SPONZA.exists():
        pytest.skip("the Sponza model is not there: ../shared/scenes/sponza/sponza.glb")
    return load_scene(SPONZA)


def steady_ms(runtime: Runtime, draw: Callable[[], object]) -> tuple[float, float]:
    """Return the median of the passes' sum and of the wall clock, in ms, once lists have grown."""
    device, wall = [], []
    for number in range(FRAMES + 3):
        with runtime.frame():
            start = time.perf_counter()
            draw()
            runtime.finish()
            spent = time.perf_counter() - start
        if number >= 3:
            device.append(sum(step.ms for step in runtime.times()))
            wall.append(1e3 * spent)
    return float(np.median(device)), float(np.median(wall))


def report(name: str, ours: tuple[float, float], theirs: float) -> None:
    print(
        f"\n{name}: {ours[0]:.1f} ms on the device, {ours[1]:.1f} ms in all; pyrender "
        f"{theirs:.1f} ms; ratio {ours[1] / theirs:.2f}"
    )


def test_a_gbuffer_takes_at_most_half_of_pyrenders_flat_pass(runtime: Runtime, sponza: Scene) -> None:
    camera = Camera.look_at((-10, 1.2, -0.3), (8, 2.6, 0.4), yfov=1.0, width=800, height=600)
    kept = DeviceScene(runtime, sponza)
    rasterizer = Rasterizer(runtime, camera.size)
    ours = steady_ms(runtime, lambda: rasterizer.render(kept, camera))
    theirs = pyrender.median_ms(sponza, camera, "flat")
    report("Sponza, 800 x 600, G-buffer", ours, theirs)
    assert max(ours) <= 0.5 * theirs


def test_a_shadow_map_takes_at_most_half_of_pyrenders_depth_pass(runtime: Runtime, sponza: Scene) -> None:
    light = SpotLight((-6.0, 8.0, 0.5), (0.7, -0.7, -0.1), 0.8, 100.0)
    (camera,) = light_cameras(light, sponza.bounds, 512)
    kept = DeviceScene(runtime, sponza)
    renderer = RsmRenderer(runtime, 512)
    depth = runtime.plane(1, (512, 512), math.inf)

    def draw() -> None:
        renderer.render(kept, light, camera, flux=False)
        renderer.write_depth(depth)

    ours = steady_ms(runtime, draw)
    theirs = pyrender.median_ms(sponza, camera, "depth")
    report("Sponza, 512 x 512, depth from a light", ours, theirs)
    assert max(ours) <= 0.5 * theirs
