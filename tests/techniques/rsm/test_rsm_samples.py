"""Launches of the passes over samples of reflective shadow maps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.rsm.rsm_samples import FluxSamples, TexelRecords


def test_kernels_are_compiled_for_two_widths_of_work_groups_at_most(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Drivers that specialise kernels on the local size compile a variant for each.
    cl = opencl()
    enqueue = cl.enqueue_nd_range_kernel
    variants: dict[str, set[Any]] = {}

    def counted(queue: Any, kernel: Any, work: Any, local: Any, *rest: Any) -> Any:
        variants.setdefault(kernel.function_name, set()).add(local)
        return enqueue(queue, kernel, work, local, *rest)

    monkeypatch.setattr(cl, "enqueue_nd_range_kernel", counted)
    for size in ((1, 1), (5, 3), (37, 53), (64, 96), (128, 128)):
        device = DeviceRsm(runtime, size)
        device.flux.upload(np.ones((3, *size), np.float32))
        texels = TexelRecords(runtime, size)
        for count in (1, 3, 20, 400):
            samples = FluxSamples(runtime, texels, count)
            texels.update(device)
            samples.update()
    assert set(variants) >= {"rsm_gather_sums", "rsm_gather_pick", "rsm_gather_texels"}
    assert all(len(widths) <= 2 for widths in variants.values()), variants
