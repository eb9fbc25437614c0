"""Ceilings that are measured once, and a store of truths apart from the user's."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from ssgi_cl.tuning.calibration import Calibration

_of = functools.cache(Calibration.of)


@pytest.fixture(autouse=True)
def _calibrated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the device's ceilings measured by the first test that needs them."""
    monkeypatch.setattr(Calibration, "of", lambda runtime: _of(runtime))


@pytest.fixture
def own_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of an empty cache, which is not there yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("SSGI_CL_CACHE", str(folder))
    return folder
