"""Fixtures of the tests of the rasterisers."""

from __future__ import annotations

import pytest

from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.rasterize.raster.opengl_context import context


@pytest.fixture(scope="module")
def opengl_runs() -> None:
    """Skip where OpenGL does not run."""
    try:
        with context():
            pass
    except MissingExtraError as error:
        pytest.skip(str(error))
