"""Arrays of other libraries come in without a copy, and results go back as theirs."""

from __future__ import annotations

import pickle
import sys
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from ssgi_cl.core.array_kinds import ArrayKind, array_kind, channels_last, host_array, kind_among, of_kind
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_batch import GBufferBatch, image_by_image, images_in

CAMERA = Camera.from_intrinsics(4.0, 4.0, 2.0, 2.0, width=4, height=4)


class Foreign:
    """An array of another library, which gives its memory by DLPack alone."""

    __module__ = "foreign.arrays"
    device = "cpu"

    def __init__(self, values: Any) -> None:
        self.values = np.asarray(values)

    def __dlpack__(self, **given: Any) -> Any:
        return self.values.__dlpack__(**given)

    def __dlpack_device__(self) -> Any:
        return self.values.__dlpack_device__()


class Distant(Foreign):
    """Likewise, on a device that the host cannot read."""

    def __dlpack__(self, **given: Any) -> Any:
        raise BufferError("on a device")

    def cpu(self) -> Any:
        return self.values


@pytest.fixture(autouse=True)
def library(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    module = ModuleType("foreign")
    module.from_dlpack = Foreign  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "foreign", module)
    return module


def test_the_host_reads_the_same_memory() -> None:
    values = np.arange(16.0, dtype=np.float32).reshape(4, 4)
    for given in (values, Foreign(values), memoryview(values)):
        assert np.shares_memory(host_array(given), values)
    np.testing.assert_array_equal(host_array(Distant(values)), values)  # copied
    del Distant.cpu
    with pytest.raises(TypeError, match="Distant of no dtype cannot be read by the host"):
        host_array(Distant(values))


def test_a_result_is_of_the_kind_that_came_in() -> None:
    result = np.ones((2, 2), np.float32)
    assert array_kind(result) is None
    assert of_kind(result, None) is result
    foreign = of_kind(result, array_kind(Foreign(result)))
    assert isinstance(foreign, Foreign)
    assert np.shares_memory(foreign.values, result)
    view = of_kind(result, array_kind(memoryview(result)))
    assert (view.shape, view.format) == ((2, 2), "f")

    class Pair(NamedTuple):
        first: Any
        second: Any

    pair = of_kind(Pair(result, "no array"), ArrayKind("foreign"))
    assert isinstance(pair, Pair)
    assert isinstance(pair.first, Foreign)
    assert pair.second == "no array"


def test_a_gbuffer_keeps_the_kind_of_its_depth() -> None:
    gbuffer = GBuffer(camera=CAMERA, depth=Foreign(np.ones((4, 4), np.float32)))  # type: ignore[arg-type]
    assert kind_among([1.0, gbuffer]) == ArrayKind("foreign", "cpu")
    assert pickle.loads(pickle.dumps(gbuffer)).array_kind == gbuffer.array_kind
    assert kind_among([GBuffer(camera=CAMERA, depth=np.ones((4, 4)))]) is None


def test_channels_first_becomes_channels_last_without_a_copy() -> None:
    values = np.zeros((5, 3, 4, 2))
    last = channels_last("normal", values, "CHW", 3)
    assert last.shape == (5, 4, 2, 3)
    assert np.shares_memory(last, values)
    assert channels_last("depth", values[:, :1], "CHW", 1).shape == (5, 4, 2)


def batch(count: int) -> GBufferBatch:
    return GBufferBatch(GBuffer(camera=CAMERA, depth=np.full((4, 4), 1.0 + i)) for i in range(count))


def test_a_function_works_image_by_image() -> None:
    def both(gbuffer: GBuffer, values: Any, factor: float = 1.0) -> Any:
        return gbuffer.depth * factor, values.sum()

    gbuffers = batch(3)
    assert images_in((1, gbuffers), {}) == images_in((), {"gbuffer": gbuffers}) == 3
    assert images_in((gbuffers[0],), {}) is None
    depth, sums = image_by_image(both, 3, (gbuffers,), {"values": np.eye(3), "factor": 2.0})
    np.testing.assert_array_equal(depth[:, 0, 0], [2.0, 4.0, 6.0])
    assert sums == [1.0, 1.0, 1.0]
    with pytest.raises(ValueError, match="values holds 2 images: expected 3 as the G-buffers"):
        image_by_image(both, 3, (gbuffers,), {"values": np.eye(2)})


def test_a_batch_is_of_one_size() -> None:
    assert len(batch(3)[1:]) == 2
    other = GBuffer(camera=Camera.from_intrinsics(4.0, 4.0, 2.0, 2.0, width=5, height=4), depth=np.ones((4, 5)))
    with pytest.raises(ValueError, match=r"gbuffers\[1\] has size \(4, 5\).*expected \(4, 4\)"):
        GBufferBatch([batch(1)[0], other])
    with pytest.raises(ValueError, match="gbuffers is empty"):
        GBufferBatch([])
