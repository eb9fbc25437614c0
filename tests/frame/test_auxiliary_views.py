"""Auxiliary cameras: half of them at lights, the others where `auxiliary_cameras` says."""

from __future__ import annotations

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.auxiliary_views import AuxiliaryViews
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import BuiltinScene, cornell_box


@pytest.fixture(scope="module")
def box() -> BuiltinScene:
    return cornell_box()


@pytest.fixture(scope="module")
def seen(runtime: Runtime, box: BuiltinScene) -> DeviceGBuffer:
    camera = box.camera(32, 24)
    with runtime.frame():
        gbuffer = Rasterizer(runtime, camera.size).render(device_scene(box.scene, runtime), camera)
        gbuffer.derive()
    return gbuffer


def punctual_lights() -> list[Light]:
    """Return new lights, each time with the same values."""
    return [
        gi.PointLight((0.1, 0.3, 0.2), 1.0),
        gi.SpotLight((0.278, 0.5, 0.28), (0, -1, 0), 1.0, 1.0),
        gi.SpotLight((0.4, 0.5, 0.1), (0, -1, 0.2), 0.7, 1.0),
    ]


def cameras(views: AuxiliaryViews, box: BuiltinScene, seen: DeviceGBuffer, lights: list[Light]) -> list[Camera]:
    found = []
    with views.runtime.frame():
        for gbuffer in views.drawn(box.scene, box.camera(32, 24), seen, lights):
            assert gbuffer.camera is not None
            found.append(gbuffer.camera)
    return found


@pytest.mark.parametrize(("count", "at_lights"), [(1, 0), (2, 1), (3, 1), (5, 2)])
def test_up_to_half_of_the_cameras_stand_at_lights_that_one_camera_sees_all_of(
    runtime: Runtime, box: BuiltinScene, seen: DeviceGBuffer, count: int, at_lights: int
) -> None:
    found = cameras(AuxiliaryViews(runtime, count), box, seen, punctual_lights())
    assert len(found) == count
    for camera, punctual_light in zip(found[:at_lights], punctual_lights()[1:], strict=False):
        np.testing.assert_allclose(camera.position, punctual_light.position, atol=1e-6)
    for camera in found[at_lights:]:
        positions = [light.position for light in punctual_lights()]
        assert min(np.abs(camera.position - position).max() for position in positions) > 1e-3


def test_cameras_stay_where_lights_and_view_have_the_same_values(
    runtime: Runtime, box: BuiltinScene, seen: DeviceGBuffer
) -> None:
    views = AuxiliaryViews(runtime, 4)
    first = cameras(views, box, seen, punctual_lights())
    again = cameras(views, box, seen, punctual_lights())
    assert all(a is b for a, b in zip(first, again, strict=True))
    moved = [*punctual_lights()[:2], gi.SpotLight((0.4, 0.5, 0.15), (0, -1, 0.2), 0.7, 1.0)]
    other = cameras(views, box, seen, moved)
    np.testing.assert_allclose(other[1].position, (0.4, 0.5, 0.15), atol=1e-6)


def test_camera_that_sees_no_triangle_is_skipped_and_the_reason_is_told(
    runtime: Runtime, box: BuiltinScene, seen: DeviceGBuffer
) -> None:
    away = gi.SpotLight((0.278, 3.0, 0.28), (0, 1, 0), 0.7, 1.0)
    views = AuxiliaryViews(runtime, 2)
    found = cameras(views, box, seen, [away])
    assert len(found) == 1
    assert np.abs(found[0].position - away.position).max() > 1e-3
    reasons = {each.name: each.skipped for each in runtime.times()}
    assert reasons["auxiliary view"] == "the camera sees no triangle"
    # The next one is drawn whole, whatever the rasteriser drew before.
    assert len(cameras(views, box, seen, punctual_lights())) == 2
