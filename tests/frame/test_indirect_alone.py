"""Light that surfaces reflect and emit, without direct light, against paths: percentiles and not only the mean."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

PATHS, BLOCK = 1024, 4
"""Of the reference, per pixel, and the side of the blocks of pixels that are compared: their noise is 1 to 2 %."""
NOISE = 0.03
"""Of percentiles over some 100 blocks, beside today's values."""


class Today(NamedTuple):
    """Bounds of indirect light over the reference's, less 1: that of the whole, and percentiles of blocks.

    They are what frames reach today and may be tightened, never loosened.
    """

    mean: float
    fifth: float
    median: float
    ninetyfifth: float


ROOMS = {
    "rods-300": Today(-0.03, -0.12, -0.025, 0.07),
    "panel-300": Today(-0.02, -0.08, -0.01, 0.08),
    "window-300": Today(0.0, -0.075, 0.0, 0.08),
    "spot-300": Today(-0.01, -0.065, -0.01, 0.07),
    "point-300": Today(-0.02, -0.045, -0.02, 0.02),
}
"""Rooms on which nothing is tuned -> their bounds. In the first two light from the gap above an emissive panel was lost
before: all of their blocks were 6 to 9 % darker, the brightest, too."""


def blocks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sums of blocks of pixels [rows, columns], of whole ones alone."""
    rows, columns = (side // BLOCK * BLOCK for side in values.shape)
    cut = values[:rows, :columns].reshape(rows // BLOCK, BLOCK, columns // BLOCK, BLOCK)
    sums: NDArray[np.float64] = cut.sum(axis=(1, 3))
    return sums


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "rods-300" else [pytest.mark.slow]) for name in ROOMS]
)
def test_light_of_surfaces_is_as_near_to_paths_as_it_was(runtime: Runtime, name: str) -> None:
    room, today = make_scene(name), ROOMS[name]
    camera, lights = room.camera(64, 48), room.own_lights
    frame = gi.render(room.scene, camera, lights, outputs=("radiance", "indirect", "gbuffer"), runtime=runtime)
    seen = frame.gbuffer
    assert seen is not None
    if lights:
        assert frame.indirect is not None
        reflected = np.asarray(seen.albedo, np.float64) / np.pi * frame.indirect
    else:  # all light is that of surfaces, whichever pass adds it
        reflected = frame.radiance.astype(np.float64)
    every = gi.truth.radiance(room.scene, camera, lights, PATHS).mean.astype(np.float64)
    straight = gi.truth.radiance(room.scene, camera, lights, PATHS, 0).mean if lights else 0.0
    # Of matt surfaces that do not emit: lobes are a pass of their own.
    counted = np.isfinite(np.asarray(seen.depth))
    for other in (seen.specular, seen.emission):
        if other is not None:
            counted &= ~np.asarray(other).any(axis=-1)
    ours, paths = (blocks(np.where(counted, light.sum(axis=-1), 0.0)) for light in (reflected, every - straight))
    full = blocks(counted.astype(np.float64)) >= 0.5 * BLOCK**2
    assert full.sum() > 100
    ratio = ours[full] / paths[full] - 1.0
    fifth, median, ninetyfifth = np.percentile(ratio, (5, 50, 95))
    found = Today(float(ours[full].sum() / paths[full].sum() - 1.0), float(fifth), float(median), float(ninetyfifth))
    assert today.mean - NOISE < found.mean < NOISE, found
    assert found.fifth > today.fifth - NOISE, found
    assert today.median - NOISE < found.median < NOISE, found
    assert found.ninetyfifth < today.ninetyfifth + NOISE, found
