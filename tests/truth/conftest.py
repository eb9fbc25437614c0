"""An empty store for each test of truths."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.truth import store
from ssgi_cl.truth.store import Truth


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The store's folder, which is not there yet."""
    monkeypatch.setattr(store, "cache_folder", lambda: tmp_path)
    return tmp_path / "truth"


def same(a: Truth, b: Truth) -> bool:
    """Return whether two truths have the same bits."""
    return (
        np.array_equal(a.mean, b.mean) and np.array_equal(a.error, b.error) and (a.passes, a.key) == (b.passes, b.key)
    )
