"""Files for commands, and a terminal that breaks no line of theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.io import exr

# Two walls that meet: something for ambient occlusion to darken.
CORNER_OBJ = """
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
v 1 2 -1
v -1 2 -1
f 4 3 2 1
f 1 2 5 6
"""


@pytest.fixture(autouse=True)
def wide_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")


@pytest.fixture
def corner(tmp_path: Path) -> Path:
    path = tmp_path / "corner.obj"
    path.write_text(CORNER_OBJ)
    return path


@pytest.fixture
def depth_file(tmp_path: Path, rng: np.random.Generator) -> Path:
    """A G-buffer with depth alone: steps of random height, and a corner where nothing is."""
    depth = np.kron(rng.uniform(2.0, 2.4, (6, 8)), np.ones((8, 8))).astype(np.float32)
    depth[:5, :5] = np.inf
    path = tmp_path / "in.exr"
    exr.write(path, {"depth": depth})
    return path
