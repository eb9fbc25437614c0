"""Closed surfaces of scenes, and which of their sides is the outer one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from ssgi_cl.core.closed_surfaces import closed_sides
from ssgi_cl.core.scene import Material, Scene

from ..rasterize.meshes import scene_of


def box(*, inverted: bool = False, without: int | None = None, at: float = 0.0) -> Scene:
    """Return a cube, of separate triangles; one of them may be missing."""
    mesh = trimesh.creation.box()
    faces = np.delete(mesh.faces, [] if without is None else without, axis=0)
    corners = mesh.vertices[faces[:, ::-1] if inverted else faces]
    return scene_of(corners.reshape(-1, 3) + at)


def together(*scenes: Scene) -> Scene:
    """Return the triangles of several scenes as those of one."""
    return scene_of(np.concatenate([scene.positions for scene in scenes]))


def test_outer_side_is_that_from_which_a_volume_is_enclosed() -> None:
    np.testing.assert_array_equal(closed_sides(box()), 1)
    np.testing.assert_array_equal(closed_sides(box(inverted=True)), -1)
    # Far from the scene's origin a volume is a small difference of large ones.
    np.testing.assert_array_equal(closed_sides(box(at=1000.0)), 1)


def test_a_missing_triangle_opens_its_own_surface_alone() -> None:
    sides = closed_sides(together(box(), box(without=7, at=3.0), box(inverted=True, at=6.0)))
    assert sides.tolist() == [1] * 12 + [0] * 11 + [-1] * 12


def test_a_triangle_turned_round_opens_its_surface() -> None:
    scene = box()
    turned = np.array(scene.triangles)
    turned[4] = turned[4, ::-1]
    assert not closed_sides(replace(scene, triangles=turned)).any()


def test_long_chains_of_triangles_are_one_surface() -> None:
    # Numbers go along the ring and back, so that the least of them has far to go.
    mesh = trimesh.creation.torus(3.0, 1.0, 200, 6)
    order = np.random.default_rng(3).permutation(len(mesh.faces))
    sides = closed_sides(scene_of(mesh.vertices[mesh.faces[order]].reshape(-1, 3)))
    np.testing.assert_array_equal(sides, 1)


@pytest.mark.parametrize("material", [Material(double_sided=False), Material(alpha=0.5, blends=True)])
def test_triangles_without_back_or_seen_through_count_as_open(material: Material) -> None:
    scene = box()
    other = replace(scene, materials=(Material(), material), material_ids=np.arange(12, dtype=np.int32) % 2)
    assert closed_sides(other).tolist() == [1, 0] * 6
