"""What the library launches otherwise on a GPU: other groups, other switches, the same bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box


@pytest.fixture(scope="module")
def as_gpu(runtime: Runtime) -> Runtime:
    """The default device, driven as if it were a GPU."""
    own = Runtime(runtime.info, KernelVariant(1, "buffer"))
    own.info = replace(own.info, kind="gpu")
    return own


def drawn(runtime: Runtime) -> list[np.ndarray]:
    made = cornell_box()
    gbuffer = gi.rasterize.gbuffer(made.scene, made.camera(100, 70), layers=2, attributes="all", runtime=runtime)
    lit = gi.rasterize.rsm(made.scene, made.lights[0], size=32, runtime=runtime)  # type: ignore[arg-type]
    return [
        np.asarray(gbuffer.depth),
        np.asarray(gbuffer.normal),
        gi.gtao(gbuffer, radius=0.1, runtime=runtime),
        gi.multires_splat(gbuffer, lit, 300, runtime=runtime),
    ]


def test_a_gpu_gives_the_bits_of_a_processor(runtime: Runtime, as_gpu: Runtime) -> None:
    for found, wanted in zip(drawn(as_gpu), drawn(runtime), strict=True):
        np.testing.assert_array_equal(found, wanted)
