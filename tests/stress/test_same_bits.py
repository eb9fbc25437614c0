"""The same bits in every run, whatever the number of threads and the size of work-groups."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.bench.every import TECHNIQUES, Inputs, inputs, results
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime

SIZE = (30, 40)
TEXELS = 16
GROUPS = ((1, 1), (8, 8))
"""(rows, columns) of work-items, the second as on GPUs."""

QUICK = {
    "drawing": 5,
    "view normals": 2,
    "blended layers": 2,
    "upsampling": 1,
    "ssao": 2,
    "gtao": 1,
    "radiosity": 1,
    "reflections": 1,
    "sampled lights": 1,
    "sky rays": 2,
}
"""Technique -> how many of its results; of all other kernels nearly all functions are among theirs."""

WRITE = """
import sys
import numpy as np
from ssgi_cl.bench.every import inputs, results
from ssgi_cl.device.runtime import Runtime
runtime = Runtime.open(lanes=1)
np.savez(sys.argv[1], **results(inputs(runtime, (30, 40), 16), runtime))
"""


@pytest.fixture(scope="module")
def scalar(plain_images: Runtime) -> Iterator[Runtime]:
    """One lane on images; what memory held before is spoilt wherever passes share it."""
    plain_images.transient._spoiling = True
    yield plain_images
    plain_images.transient._spoiling = False


@pytest.fixture(scope="module")
def given_once(scalar: Runtime) -> Inputs:
    return inputs(scalar, SIZE, TEXELS)


def assert_short_header(runtime: Runtime) -> None:
    """Check that no kernel needs the full header of built-in functions, which takes longer; PoCL alone has it."""
    if runtime.device.platform.name == "Portable Computing Language":
        assert runtime.programs.short_header, "common/builtins.clh lacks a function that a kernel calls"


@pytest.mark.parametrize(("name", "count"), QUICK.items())
def test_one_lane_on_images_gives_the_bits_of_the_default_variant(
    runtime: Runtime, scalar: Runtime, given_once: Inputs, name: str, count: int
) -> None:
    # Both read the same inputs and round alike, so not one bit may differ.
    both = zip(*(TECHNIQUES[name](given_once, used) for used in (runtime, scalar)), strict=True)
    for wanted, found in islice(both, count):
        np.testing.assert_array_equal(found, wanted)
    for used in (runtime, scalar):
        assert_short_header(used)


@pytest.mark.slow
@pytest.mark.parametrize("name", TECHNIQUES)
def test_every_form_and_run_gives_bit_identical_results(
    every_variant: Runtime, scalar: Runtime, given_once: Inputs, name: str
) -> None:
    wanted = results(given_once, scalar, [name])
    for _ in range(2):
        for key, found in results(given_once, every_variant, [name]).items():
            np.testing.assert_array_equal(found, wanted[key], err_msg=key)
    assert_short_header(every_variant)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS, ids=str)
def test_work_groups_of_any_size_give_bit_identical_results(
    scalar: Runtime, given_once: Inputs, group: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = results(given_once, scalar)
    high, wide = group

    def chosen(_: Kernel, rows: int, columns: int) -> tuple[int, int]:
        # Kernels that go along a list are launched on one row and look at columns alone.
        return group if rows >= high else (1, high * wide)

    monkeypatch.setattr(Kernel, "_group", chosen)
    for key, found in results(given_once, scalar).items():
        np.testing.assert_array_equal(found, wanted[key], err_msg=key)


@pytest.mark.slow
@pytest.mark.parametrize("threads", ["1", "2", "5"])
def test_any_number_of_threads_gives_bit_identical_results(
    scalar: Runtime, given_once: Inputs, threads: str, tmp_path: Path
) -> None:
    path = tmp_path / "results.npz"
    limits = {"POCL_MAX_PTHREAD_COUNT": threads, "POCL_CPU_MAX_CU_COUNT": threads}
    device = {"SSGI_CL_DEVICE": scalar.info.label}
    subprocess.run([sys.executable, "-c", WRITE, str(path)], env={**os.environ, **limits, **device}, check=True)
    wanted = results(given_once, scalar)
    with np.load(path) as found:
        for key, values in wanted.items():
            np.testing.assert_array_equal(found[key], values, err_msg=key)
