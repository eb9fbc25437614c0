"""Inputs and checks that the tests of techniques with virtual point lights share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.occupancy.occupancy_grid import OccupancyGridReference, seen_surfaces
from ssgi_cl.reference.vpl.vpl_splat import receivers
from ssgi_cl.techniques.vpl.vpl_choice import choose_vpls

from ..analytic import camera, scene

NO_LIGHTS = Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


def uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    device = DeviceGBuffer(runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin)
    device.upload(gbuffer)
    return device


def cornell_box(
    runtime: Runtime, columns: int, rows: int, map_size: int, **given: Any
) -> tuple[GBuffer, ReflectiveShadowMap]:
    """Return the Cornell box as its camera and its light see it; `given`: of the G-buffer."""
    made = BUILTIN_SCENES["cornell_box"]()
    seen = rsm(made.scene, made.lights[0], size=map_size, runtime=runtime)  # type: ignore[arg-type]
    return drawn(made.scene, made.camera(columns, rows), runtime=runtime, **given), seen


def lit_scene(runtime: Runtime, name: str, columns: int, rows: int) -> tuple[GBuffer, Vpls]:
    """Return a built-in scene as its camera sees it, and 1024 lights of its punctual lights."""
    made = BUILTIN_SCENES[name]()
    punctual_lights: list[Any] = [light for light in made.lights if not isinstance(light, Environment)]
    maps = [rsm(made.scene, light, size=256, runtime=runtime) for light in punctual_lights]
    return drawn(made.scene, made.camera(columns, rows), runtime=runtime), choose_vpls(maps, 1024, runtime=runtime)


def walls_between(gbuffer: GBuffer, seen: ReflectiveShadowMap, vpls: Vpls, cells: int) -> OccupancyGridReference:
    """Return the walls that a camera and a light see, in a grid round what is lit and the lights."""
    _, point, _ = receivers(gbuffer)
    inside = in_view(gbuffer, np.concatenate([point, vpls.position]))
    return OccupancyGridReference(inside, seen_surfaces(gbuffer, [seen]), cells)


def in_view(gbuffer: GBuffer, points: NDArray[Any]) -> NDArray[np.float64]:
    """Return points of the world in the view space of a G-buffer's camera."""
    view = gbuffer.camera.view
    return np.asarray(points @ view[:3, :3].T + view[:3, 3])


def assert_no_light_where_nothing_is(rng: np.random.Generator, irradiance: Callable[[GBuffer], NDArray[Any]]) -> None:
    """Light an image of nothing, and one with a ball before it."""
    made = camera(size=(20, 30))
    nothing = GBuffer(camera=made, depth=np.full(made.size, np.inf, np.float32))
    np.testing.assert_array_equal(irradiance(nothing), 0.0)
    gbuffer = scene("ball", made, rng)
    empty = np.isinf(np.asarray(gbuffer.depth))
    e = irradiance(gbuffer)
    np.testing.assert_array_equal(e[empty], 0.0)
    assert e[~empty].any()


def assert_second_run_allocates_nothing(runtime: Runtime, run: Callable[[], Plane]) -> None:
    """Run twice: the second time nothing is allocated or built, and results are bit-identical."""
    first = run().download()
    before = runtime.allocated_bytes, runtime.builds
    second = run().download()
    assert (runtime.allocated_bytes, runtime.builds) == before
    np.testing.assert_array_equal(first, second)


def assert_what_does_not_fit_is_refused(runtime: Runtime, technique: Any, some: Vpls) -> None:
    """Give a technique for 8 x 8 pixels and 10 lights what it can't take; `some`: 11 lights."""
    rng = np.random.default_rng(1)
    fitting, other = (uploaded(runtime, scene("corner", camera(size=(n, n)), rng)) for n in (8, 9))
    few = Vpls(some.position[:5], some.normal[:5], some.flux[:5], some.area[:5])
    with pytest.raises(ValueError, match=r"size is \(9, 9\): expected \(8, 8\)"):
        technique.run(other, few)
    with pytest.raises(ValueError, match=r"vpls has 11 lights: expected at most 10"):
        technique.run(fitting, some)
    with pytest.raises(ValueError, match=r"the device G-buffer is empty"):
        technique.run(DeviceGBuffer(runtime, (8, 8)), few)
