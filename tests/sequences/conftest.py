"""Frames of a sequence."""

from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.io import exr


@pytest.fixture
def frames(tmp_path: Path) -> list[Path]:
    """Files of four frames: frame n has a depth of n."""
    paths = [tmp_path / f"in.{number:04d}.exr" for number in range(1, 5)]
    for number, path in enumerate(paths, 1):
        exr.write(path, {"depth": np.full((6, 8), number, np.float32)})
    return paths
