"""GTAO: its limits and own parameters. Tests of all that scan slices: test_slices.py."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.constants import SLICES_SIMILAR
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ao.gtao import gtao_reference
from ssgi_cl.techniques.ao.gtao import GtaoParams, gtao

from ..analytic import camera, view_of
from ..walls import wall_and_floor


def test_corner_with_an_endless_radius_hides_half_of_the_light(runtime: Runtime) -> None:
    gbuffer, distance = wall_and_floor("orthographic")
    a, _ = gtao(gbuffer, 1e6, 16, 48, blur_radius=0, bent_normals=True, runtime=runtime)
    near = (distance > 0.05) & (distance < 0.1)
    # Half of the cosine-weighted hemisphere; the wall ends with the image, 1.7 above
    # and to the sides, 20 times the distance, which opens some 1 / (20 pi) on every side.
    assert float(np.mean(a[near])) == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("choice", [{"falloff": 0.6}, {"falloff": 0.3, "thin_occluder": 1.0}])
def test_falloff_opens_what_is_far(runtime: Runtime, choice: dict[str, Any]) -> None:
    gbuffer = view_of("corner")
    sharp = gtao(gbuffer, 0.6, blur_radius=0, runtime=runtime)
    soft = gtao(gbuffer, 0.6, blur_radius=0, runtime=runtime, **choice)
    assert np.all(soft >= sharp - 1e-6)  # roundings of two ways to the same cosine
    assert float(np.mean(soft - sharp)) > 5e-3


def test_horizon_sinks_behind_what_is_narrow(runtime: Runtime) -> None:
    # A rod of 3 px before a plane, and a wall at the same height that fills a half of the image.
    made = Camera.look_at((0, 0, 5), (0, 0, 0), yfov=0.8, width=96, height=48)
    depth = np.full(made.size, 5.0, np.float32)
    depth[:, 24:27] = depth[:, 64:] = 4.7
    gbuffer = GBuffer(camera=made, depth=depth, normal=np.broadcast_to(np.float32([0, 0, 1]), (48, 96, 3)))
    plain, weak, strong = (
        gtao(gbuffer, 1.0, 8, 24, blur_radius=0, horizon_decay=decay, runtime=runtime) for decay in (0.0, 0.02, 0.05)
    )
    assert np.all(weak >= plain - 1e-6)  # roundings of two ways to the same cosine
    beside_rod, beside_wall = np.s_[20:28, 16:22], np.s_[20:28, 56:62]
    gain = [float(np.mean((strong - plain)[part] / (1.0 - plain[part]))) for part in (beside_rod, beside_wall)]
    assert gain[0] > 1.5 * gain[1] > 0.0  # 1.84: near it the wall's own far taps are lower too
    assert float(np.mean((strong - weak)[beside_rod])) > 0.01


def test_pixels_at_the_very_end_of_similar_depths_are_scanned_too(runtime: Runtime) -> None:
    made = camera(size=(12, 64))
    # Both in the same groups of 16 pixels; 1 / 5 is exactly SLICES_SIMILAR of 1 / 2, in float32 too.
    depth = np.where(np.arange(64) < 32, 2.0, 5.0) * np.ones((12, 1))
    gbuffer = GBuffer(camera=made, depth=depth.astype(np.float32))
    assert np.float32(1.0) / np.float32(5.0) == np.float32(0.5) * np.float32(SLICES_SIMILAR)
    a = gtao(gbuffer, 4.0, blur_radius=0, runtime=runtime)
    wanted = gtao_reference(gbuffer, GtaoParams(radius=4.0, blur_radius=0))
    assert wanted[:, 33:40].mean() < 0.9
    # A tap in a thousand may lie on the other side of a pixel's border.
    assert np.mean(np.abs(a - wanted) > 1e-4) < 5e-3
