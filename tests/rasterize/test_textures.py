"""Textures of scenes: how many texels they may have, and their mip levels."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.scene import mip_texels
from ssgi_cl.rasterize.raster.device_scene import _mip_mapped

from .meshes import made


def test_textures_that_no_device_holds_are_refused_at_once() -> None:
    scene = made("cornell_box").scene
    large: Any = np.broadcast_to(np.zeros(4, np.uint8), (16384, 16384, 4))
    start = time.process_time()
    with pytest.raises(ValueError, match=r"have 715827882 texels .* at most 536870911"):
        dataclasses.replace(scene, textures=(large, large))
    assert time.process_time() - start < 0.5


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 3), (64, 33)])
def test_texels_of_mip_levels_are_counted_right(shape: tuple[int, int]) -> None:
    _, texels = _mip_mapped((np.zeros((*shape, 4), np.uint8),))
    assert mip_texels(*shape) == len(texels)
