"""Samples of reflective shadow maps: patterns, texels drawn by flux, launches of their passes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.device.constants import RSM_RECORD
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.rsm.rsm_samples import FluxSamples, TexelRecords, cap_pattern, disk_pattern, square_points


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


def test_weights_of_a_pattern_add_up_to_what_it_covers() -> None:
    for weights in ("unbiased", "paper"):
        assert disk_pattern(400, weights)[:, 3].sum() == pytest.approx(math.pi)
        assert cap_pattern(400, weights, math.pi)[:, 3].sum() == pytest.approx(4.0 * math.pi)
        assert cap_pattern(400, weights, 0.5)[:, 3].sum() == pytest.approx(2.0 * math.pi * (1.0 - math.cos(0.5)))
    np.testing.assert_allclose(np.linalg.norm(cap_pattern(50, "paper", 1.0)[:, :3], axis=1), 1.0)


def test_unbiased_weights_integrate_and_the_papers_do_not() -> None:
    # The mean square distance from the centre of a disk is 1 / 2; with weights xi^2 it is 3 / 5.
    for weights, expected in (("unbiased", 0.5), ("paper", 0.6)):
        pattern = disk_pattern(4000, weights)
        square = np.sum(pattern[:, :2] ** 2, axis=1)
        assert pattern[:, 3] @ square / math.pi == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("size", [(64, 64), (37, 53), (1, 200), (384, 64)])
def test_samples_are_drawn_in_proportion_to_flux(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    texels = TexelRecords(variant_runtime, size)
    device = DeviceRsm(variant_runtime, size)
    flux = (rng.random((3, *size)) ** 8).astype(np.float32)
    flux[:, :, size[1] // 2 :] *= 1e-3
    flux[:, rng.random(size) < 0.3] = 0.0
    device.flux.upload(flux)
    device.area.upload(np.ones((1, *size), np.float32))
    place = np.indices(size).astype(np.float32)
    device.position.upload(np.stack([place[1], place[0], np.zeros(size, np.float32)]))
    texels.update(device)
    samples = FluxSamples(variant_runtime, texels, 4096)
    samples.update()
    records = samples.records.download().reshape(-1, RSM_RECORD)
    x, y = records[:, 0].astype(int), records[:, 1].astype(int)
    power = flux.sum(axis=0)
    assert (power[y, x] > 0.0).all()
    # Each stands for the same share of all power; the rest of the error is of sums in float32.
    np.testing.assert_allclose(records[:, 8:11].sum(axis=1), power.sum() / 4096, rtol=1e-5)
    share = np.histogram(x, 4, (0, size[1]))[0] / 4096
    column_power = power.sum(axis=0, dtype=np.float64)
    expected = np.histogram(np.arange(size[1]), 4, (0, size[1]), weights=column_power)[0]
    # Points of the square that are well spread: some of 4096 on either side of a bound.
    np.testing.assert_allclose(share, expected / expected.sum(), atol=0.01)


def test_points_of_the_square_are_well_spread() -> None:
    points = square_points(1024)
    assert points.min() > 0.0
    assert points.max() < 1.0
    counts = np.histogram2d(*points.T, bins=32, range=((0, 1), (0, 1)))[0]
    np.testing.assert_array_equal(counts, 1)
