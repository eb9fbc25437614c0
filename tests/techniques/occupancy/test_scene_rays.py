"""Which scenes rays of bounces meet as triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.techniques.occupancy.scene_rays import MOST_TRIANGLES, rays_meet_triangles


@pytest.mark.parametrize(("count", "exact"), [(1, True), (MOST_TRIANGLES, True), (MOST_TRIANGLES + 1, False)])
def test_rays_meet_triangles_where_there_are_not_too_many(count: int, exact: bool) -> None:
    scene = Scene(
        origin=np.zeros(3),
        positions=np.eye(3, dtype=np.float32),
        normals=np.zeros((3, 3), np.float32),
        uvs=np.zeros((3, 2), np.float32),
        colors=np.ones((3, 3), np.float32),
        triangles=np.tile(np.arange(3, dtype=np.int32), (count, 1)),
        material_ids=np.zeros(count, np.int32),
        textures=(np.full((1, 1, 4), 255, np.uint8),),
    )
    assert rays_meet_triangles(scene) == exact
    assert not rays_meet_triangles(replace(scene, materials=(Material(texture=0, alpha_cutoff=0.5),)))
