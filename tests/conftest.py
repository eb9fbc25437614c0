"""Fixtures that every test may use."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.drivers import FORMS, Form
from ssgi_cl.errors import DeviceError
from ssgi_cl.runtime import Runtime


@pytest.fixture(scope="session")
def runtime() -> Runtime:
    """The device under test: SSGI_CL_DEVICE, or the fastest found."""
    return Runtime.open()


def _opened(form: Form) -> Runtime:
    try:
        return Runtime.open(lanes=form.lanes, storage=form.storage)
    except DeviceError as error:
        pytest.skip(str(error))


def _named(form: Form) -> str:
    return f"{form.lanes}-{form.storage}"


@pytest.fixture(scope="session", params=FORMS, ids=_named)
def every_form(request: pytest.FixtureRequest) -> Runtime:
    """The device under test with each build of the kernels that it takes."""
    return _opened(request.param)


@pytest.fixture(
    scope="session",
    params=[
        FORMS[0], pytest.param(Form(8, "buffer"), marks=pytest.mark.slow), FORMS[-1]
    ],
    ids=_named,
)
def form_runtime(request: pytest.FixtureRequest) -> Runtime:
    """As `every_form`, but 8 lanes are for the slow tests, and 1 lane reads images alone.

    What is a form's own lies in `lanes.clh` and `gbuffer.clh`; their tests, and those that hold the
    results of all techniques and forms to each other, use `every_form`.
    """
    return _opened(request.param)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20)
