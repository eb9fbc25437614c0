"""Reflected light alone, behind rods thinner than the cells of any grid: compared with paths, in percentiles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.parts import assemble
from ssgi_cl.rasterize.scenes.shapes import box, of_material, pole

Doubles = NDArray[np.float64]
BLOCK = 8


def room(rods: int) -> Scene:
    """A room of 4 x 2.6 x 4 with walls of .1, and rods of .02 to .06 from floor to ceiling."""
    rng = np.random.default_rng(5)
    slabs = [
        ((-0.1, -0.1, -0.1), (4.1, 0.0, 4.1)), ((-0.1, 2.6, -0.1), (4.1, 2.7, 4.1)),
        ((-0.1, 0.0, -0.1), (0.0, 2.6, 4.1)), ((4.0, 0.0, -0.1), (4.1, 2.6, 4.1)),
        ((0.0, 0.0, -0.1), (4.0, 2.6, 0.0)), ((0.0, 0.0, 4.0), (4.0, 2.6, 4.1)),
    ]  # fmt: skip
    parts = [of_material(box(*slab), 0) for slab in slabs]
    for _ in range(rods):
        x, z = rng.uniform((0.6, 0.5), (3.4, 2.4))
        parts.append(of_material(pole((x, 0.0, z), (x, 2.6, z), rng.uniform(0.02, 0.06), 10), 1))
    return assemble(parts, (Material(albedo=(0.7, 0.65, 0.6)), Material(albedo=(0.5, 0.5, 0.5))))


def blocks(image: Doubles) -> Doubles:
    rows, columns = image.shape[0] // BLOCK, image.shape[1] // BLOCK
    return np.asarray(image.reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3, 4)))


@pytest.mark.slow
@pytest.mark.parametrize("rods", [0, 12])
def test_light_of_surfaces_is_that_of_paths_behind_rods_too(runtime: Runtime, rods: int) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    scene = room(rods)
    camera = gi.Camera.look_at((2.0, 1.4, 3.85), (2.0, 1.1, 0.0), yfov=1.0, width=96, height=72)
    lights = [gi.SpotLight((2.2, 2.4, 2.4), (-0.2, -1.0, -0.5), 0.6, 40.0)]
    found = gi.render(
        scene, camera, lights, outputs=("indirect", "gbuffer", "radiance"), ao=False, runtime=runtime
    )  # fmt: skip
    assert found.indirect is not None
    assert found.gbuffer is not None
    albedo = np.asarray(found.gbuffer.albedo, np.float64).reshape(72, 96, 3)
    light = blocks(albedo / math.pi * found.indirect)
    every, straight = (gi.truth.radiance(scene, camera, lights, 256, bounces).mean for bounces in ("all", 0))
    expected = blocks(every.astype(np.float64) - straight)
    # 256 paths of 64 pixels: noise of 1 %. An occupancy grid in place of the triangles leaves -9.9 % and, at the 10th
    # percentile, .83; triangles -1.0 % and .95, and .95 to 1.06 with and without rods.
    assert light.mean() == pytest.approx(expected.mean(), rel=0.04)
    low, middle, high = np.percentile(light / expected, (10, 50, 90))
    assert middle == pytest.approx(1.0, abs=0.05)
    assert low > 0.87
    assert high < 1.13
