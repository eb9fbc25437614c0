"""Glass of an opacity below one half is no surface where nothing is seen through: drawn, or met by rays."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.scene import Material
from ssgi_cl.core.scene_parts import without_holes
from ssgi_cl.device.runtime import Runtime

from ..closed_forms import quads

CAMERA = gi.Camera.look_at((0, 0, 4), (0, 0, 0), width=16, height=12)
WALL, PANE = ((-4, -4, 0), (8, 0, 0), (0, 8, 0)), ((-4, -4, 1), (8, 0, 0), (0, 8, 0))


def panes(alpha: float) -> gi.Scene:
    """A wall at a distance of 4, and a pane before it at 3."""
    made = quads(WALL, PANE)
    ids = np.repeat(np.array([0, 1], np.int32), len(made.triangles) // 2)
    glass = Material(alpha=alpha, alpha_cutoff=0.5, blends=True)
    return replace(made, materials=(Material(), glass), material_ids=ids)


@pytest.mark.parametrize(("alpha", "distance"), [(0.235, 4.0), (0.5, 3.0)])
def test_the_wall_or_the_pane_is_seen(runtime: Runtime, alpha: float, distance: float) -> None:
    scene = panes(alpha)
    gbuffer = gi.rasterize.gbuffer(scene, CAMERA, runtime=runtime)
    np.testing.assert_allclose(gbuffer.depth, distance, rtol=1e-6)
    light = gi.DirectionalLight((0, 0, -1), 1.0)
    seen = gi.rasterize.rsm(scene, light, size=16, runtime=runtime)
    position: Any = seen.position
    np.testing.assert_allclose(position[np.isfinite(seen.depth)][:, 2], 4.0 - distance, atol=1e-5)


def test_rays_meet_what_is_drawn() -> None:
    pytest.importorskip("embreex")
    scene, camera = panes(0.235), gi.Camera.look_at((0, 0, 0.5), (0, 0, 0), width=8, height=6)
    a = gi.ray_ao(scene, camera, radius=2.0, rays=16)
    np.testing.assert_array_equal(a, 1.0)  # the pane behind the eye hides nothing


def test_a_scene_without_holes_is_itself() -> None:
    scene = panes(0.5)
    assert without_holes(scene) is scene
    holed = panes(0.235)
    assert len(without_holes(holed).triangles) == 2
    assert without_holes(holed) is without_holes(holed)
    only = replace(holed, material_ids=np.ones_like(holed.material_ids))
    assert not np.isfinite(gi.rasterize.gbuffer(only, CAMERA).depth).any()
