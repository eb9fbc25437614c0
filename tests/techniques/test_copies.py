"""Copies of arrays on their way to the device and back: none that is not needed."""

import tracemalloc

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime

SIZE = 512


@pytest.fixture(scope="module")
def depth() -> np.ndarray:
    values = np.random.default_rng(3).uniform(2.0, 2.4, (SIZE // 16, SIZE // 16))
    return np.ascontiguousarray(np.kron(values, np.ones((16, 16))), np.float32)


@pytest.mark.parametrize("normals", [False, True])
def test_ambient_occlusion_of_an_array_makes_its_result_alone(
    runtime: Runtime, depth: np.ndarray, normals: bool
) -> None:
    normal = np.zeros((SIZE, SIZE, 3), np.float32)
    normal[..., 2] = 1.0
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=SIZE, height=SIZE)

    # Checks of lengths take three planes of their own, once for a G-buffer.
    kept = GBuffer(camera=camera, depth=depth, normal=normal) if normals else None

    def call() -> np.ndarray:
        return gi.gtao(kept or GBuffer(camera=camera, depth=depth), radius=0.2, runtime=runtime)

    call()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    result = call()
    after, peak = (value - before for value in tracemalloc.get_traced_memory())
    tracemalloc.stop()
    # numpy tells tracemalloc of each array. The checks' answers of a byte a pixel come and go before the result.
    assert after < 1.1 * result.nbytes
    assert peak < 1.3 * result.nbytes
    assert np.shares_memory(np.asarray(GBuffer(camera=camera, depth=depth).depth), depth)


def test_an_albedo_that_is_not_given_is_written_once(runtime: Runtime, depth: np.ndarray) -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=SIZE, height=SIZE)
    device = DeviceGBuffer(runtime, camera.size)
    red = np.broadcast_to(np.array([1.0, 0.0, 0.0], np.float32), (SIZE, SIZE, 3))
    for albedo, shown in ((None, [0.8] * 3), (None, [0.8] * 3), (red, [1.0, 0.0, 0.0]), (None, [0.8] * 3)):
        device.upload(GBuffer(camera=camera, depth=depth, albedo=albedo))
        found = device.albedo.download()
        np.testing.assert_array_equal(found, np.broadcast_to(np.float32(shown)[:, None, None], found.shape))
    # What is drawn into it counts as well.
    device.set_camera(camera)
    device.albedo.upload(np.zeros((3, SIZE, SIZE), np.float32))
    device.upload(GBuffer(camera=camera, depth=depth))
    np.testing.assert_array_equal(device.albedo.download(), np.full((3, SIZE, SIZE), np.float32(0.8)))
