"""Techniques take batches and arrays of other libraries, and give back their kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime

SIZE = (24, 32)
CAMERA = gi.Camera.look_at((0.0, 2.0, 4.0), (0.0, 0.0, 0.0), width=SIZE[1], height=SIZE[0])


def depth(step: float) -> Any:
    """A wall with a step in it, at a distance of 4."""
    plane = np.full(SIZE, 4.0, np.float32)
    plane[:, 16:] -= step
    return plane


@pytest.fixture
def batch() -> gi.GBufferBatch:
    return gi.GBufferBatch(gi.GBuffer(camera=CAMERA, depth=depth(0.2 * i)) for i in range(3))


def test_a_batch_gives_the_bits_of_single_calls(runtime: Runtime, batch: gi.GBufferBatch) -> None:
    a, bent = gi.gtao(batch, bent_normals=True, runtime=runtime)  # type: ignore[call-overload]
    assert (a.shape, bent.shape) == ((3, *SIZE), (3, *SIZE, 3))
    for number, gbuffer in enumerate(batch):
        one, normal = gi.gtao(gbuffer, bent_normals=True, runtime=runtime)
        np.testing.assert_array_equal(a[number], one)
        np.testing.assert_array_equal(bent[number], normal)
    blurred = gi.bilateral_blur(a, batch, radius=2, runtime=runtime)
    np.testing.assert_array_equal(blurred[2], gi.bilateral_blur(a[2], batch[2], radius=2, runtime=runtime))
    with pytest.raises(ValueError, match="argument 1 holds 2 images: expected 3 as the G-buffers"):
        gi.bilateral_blur(a[:2], batch, radius=2, runtime=runtime)


def test_results_are_of_the_kind_of_the_depth(runtime: Runtime, batch: gi.GBufferBatch) -> None:
    view = gi.gtao(gi.GBuffer(camera=CAMERA, depth=memoryview(depth(0.4))), runtime=runtime)
    assert isinstance(view, memoryview)
    np.testing.assert_array_equal(view, gi.gtao(batch[2], runtime=runtime))


def test_tensors_of_torch_come_back(runtime: Runtime, batch: gi.GBufferBatch) -> None:
    torch = pytest.importorskip("torch")
    found = gi.gtao(gi.GBuffer(camera=CAMERA, depth=torch.from_numpy(depth(0.4))), runtime=runtime)
    assert isinstance(found, torch.Tensor)
    assert found.dtype == torch.float32
    np.testing.assert_array_equal(found.numpy(), gi.gtao(batch[2], runtime=runtime))
