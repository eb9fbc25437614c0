"""A store of truths apart from the user's."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def own_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of an empty cache, which is not there yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("SSGI_CL_CACHE", str(folder))
    return folder
