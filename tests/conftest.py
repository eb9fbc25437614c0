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


@pytest.fixture(scope="session", params=FORMS, ids=lambda form: f"{form.lanes}-{form.storage}")
def form_runtime(request: pytest.FixtureRequest) -> Runtime:
    """The device under test with each build of the kernels that it takes."""
    form: Form = request.param
    try:
        return Runtime.open(lanes=form.lanes, storage=form.storage)
    except DeviceError as error:
        pytest.skip(str(error))


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20)
