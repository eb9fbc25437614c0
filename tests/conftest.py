"""Fixtures that every test may use."""

from __future__ import annotations

import gc
import math
import os
from collections.abc import Generator

# Before numpy is imported: test processes share the cores, and threads of a BLAS wait busily.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import image_limits, programs
from ssgi_cl.device.drivers import KERNEL_VARIANTS, KernelVariant
from ssgi_cl.device.runtime import Runtime


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Leave what collecting makes to no garbage collection: it stays, and there is much of it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session", autouse=True)
def nothing_is_new() -> Generator[None, None, None]:
    """Have it never said that compiling takes a while, whatever was compiled before on this machine."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(programs, "MANY", math.inf)
        yield


@pytest.fixture(scope="session")
def runtime() -> Runtime:
    """The device under test: SSGI_CL_DEVICE, or the fastest found."""
    return Runtime.open()


def _opened(variant: KernelVariant) -> Runtime:
    try:
        return Runtime.open(lanes=variant.lanes, storage=variant.storage)
    except DeviceError as error:
        pytest.skip(str(error))


def _named(variant: KernelVariant) -> str:
    return f"{variant.lanes}-{variant.storage}"


@pytest.fixture(scope="session", params=KERNEL_VARIANTS, ids=_named)
def every_variant(request: pytest.FixtureRequest) -> Runtime:
    """The device under test with each build of the kernels that it takes."""
    return _opened(request.param)


@pytest.fixture(
    scope="session",
    params=[None, *(pytest.param(variant, marks=pytest.mark.slow) for variant in KERNEL_VARIANTS)],
    ids=lambda variant: "default" if variant is None else _named(variant),
)
def variant_runtime(request: pytest.FixtureRequest) -> Runtime:
    """The device under test with its default kernel variant; the slow tests take the others too.

    What differs between variants lies in `lanes.clh` and `gbuffer.clh`. Their tests, and those that
    hold the results of all techniques to each other, cover every variant in each run.
    """
    default = Runtime.open()
    if request.param is None:
        return default
    if request.param == default.variant:
        pytest.skip("this is the default variant")
    return _opened(request.param)


@pytest.fixture(
    scope="session", params=[pytest.param(variant, marks=pytest.mark.slow) for variant in KERNEL_VARIANTS], ids=_named
)
def other_variant(request: pytest.FixtureRequest) -> Runtime:
    """The device under test with each kernel variant but its default, to be held to the default.

    In the fast tests `stress/test_same_bits.py` holds one of them to it for all techniques.
    """
    if request.param == Runtime.open().variant:
        pytest.skip("this is the default variant")
    return _opened(request.param)


@pytest.fixture(scope="session")
def plain_images(runtime: Runtime) -> Runtime:
    """The device under test with one lane on images: the form that is quickest to compile.

    Half as long without optimization, which changes no bit. Its images have 64 rows, so that planes
    lie in several columns of them.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(image_limits.VARIABLE, "64x8192")
        made = Runtime(runtime.info, KernelVariant(1, "image"))
    build = made.programs._build
    made.programs._build = (  # type: ignore[method-assign]
        lambda source, text, options: build(source, text, [*options, "-cl-opt-disable"])
    )
    return made


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20)
