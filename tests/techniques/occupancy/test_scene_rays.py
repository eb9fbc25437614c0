"""Which scenes rays of bounces meet as triangles, and what carries the first bounce."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.techniques.occupancy.scene_rays import MOST_TRIANGLES, rays_carry_first_bounce, rays_meet_triangles


@pytest.mark.parametrize(("count", "many"), [(1, False), (MOST_TRIANGLES, False), (MOST_TRIANGLES + 1, True)])
def test_rays_meet_triangles_without_holes_and_of_many_find_the_first_bounce(count: int, many: bool) -> None:
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
    assert rays_meet_triangles(scene)
    assert rays_carry_first_bounce(scene) == many
    holes = replace(scene, materials=(Material(texture=0, alpha_cutoff=0.5),))
    assert not rays_meet_triangles(holes)
    assert not rays_carry_first_bounce(holes)
