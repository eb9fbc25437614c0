"""Parts of scenes by what is seen through."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.scene_parts import FAINTEST, scene_parts

from ..rasterize.meshes import scene_of

SOLID = Material(name="solid")
GLASS = Material(name="glass", albedo=(0.05,) * 3, transmission=(0.9, 0.8, 0.7))
DARK = Material(name="dark", albedo=(0.05,) * 3, transmission=(0.1, 0.2, 0.3))
SMOKE = Material(name="smoke", albedo=(0.5, 0.4, 0.2), alpha=0.75, blends=True, alpha_cutoff=0.5)
FAINT = replace(SMOKE, name="faint", alpha=0.25)
LEAF = Material(name="leaf", texture=0, blends=True, alpha_cutoff=0.5)


def scene_with(*materials: Material) -> Scene:
    """Return a triangle of each material, and a vertex that none has."""
    count = len(materials)
    points = np.arange(9 * count + 3, dtype=np.float32).reshape(-1, 3) ** 1.5
    return scene_of(
        points,
        np.arange(3 * count).reshape(-1, 3),
        uvs=points[:, :2] / 100,
        colors=points / points.max(),
        material_ids=np.arange(count),
        materials=materials,
        textures=(np.full((2, 2, 4), 200, np.uint8),),
    )


def names(scene: Scene | None) -> list[str]:
    assert scene is not None
    return [material.name for material in scene.used_materials]


def test_a_scene_that_nothing_is_seen_through_is_all_its_parts() -> None:
    scene = scene_with(SOLID, SOLID)
    parts = scene_parts(scene)
    assert parts.solid is scene
    assert parts.casting is scene
    assert parts.blended is None


def test_each_triangle_is_solid_or_blended_and_keeps_all_that_it_has() -> None:
    scene = scene_with(SOLID, GLASS, SMOKE, SOLID, LEAF)
    parts = scene_parts(scene)
    assert parts.blended is not None
    assert names(parts.solid) == ["solid", "solid"]
    assert names(parts.blended) == ["glass", "smoke", "leaf"]
    # Texels that show nothing are left out of layers.
    assert [m.alpha_cutoff for m in parts.blended.used_materials] == [0.0, 0.0, FAINTEST]
    for part, chosen in ((parts.solid, [0, 3]), (parts.blended, [1, 2, 4])):
        for field in ("positions", "normals", "uvs", "colors"):
            found = getattr(part, field)[part.triangles]
            expected = getattr(scene, field)[scene.triangles[chosen]]
            np.testing.assert_array_equal(found, expected)
        assert len(part.positions) == 3 * len(chosen), "no vertex that none of them has"


def test_what_stops_half_of_the_light_casts_shadows() -> None:
    scene = scene_with(SOLID, GLASS, DARK, SMOKE, FAINT, LEAF)
    casting = scene_parts(scene).casting
    assert names(casting) == ["solid", "dark", "smoke", "leaf"]
    assert not casting.is_seen_through
    smoke, leaf = casting.used_materials[2:]
    np.testing.assert_allclose(smoke.albedo, np.array(SMOKE.albedo) * 0.75, rtol=1e-12)
    assert (leaf.alpha_cutoff, leaf.has_holes) == (0.5, True)
    parts = scene_parts(scene_with(SOLID, GLASS, FAINT))  # of which none casts
    assert parts.casting is parts.solid


def test_without_anything_solid_a_triangle_without_area_is_left() -> None:
    scene = scene_with(GLASS)
    parts = scene_parts(scene)
    assert len(parts.solid.triangles) == 1
    assert len(set(parts.solid.triangles[0].tolist())) == 2
    np.testing.assert_allclose(parts.solid.bounds, scene.bounds)
    assert parts.casting is parts.solid


def test_parts_are_made_once_and_go_with_the_scene() -> None:
    scene = scene_with(SOLID, GLASS)
    parts = scene_parts(scene)
    assert scene_parts(scene) is parts
    assert scene_parts(replace(scene)) is not parts
    gone = weakref.ref(parts)
    del scene, parts
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"blends": 1}, "blends is 1: expected True or False"),
        ({"transmission": (0.0, 1.5, 0.0)}, "transmission"),
        ({"transmission": (0.0, float("nan"), 0.0)}, "transmission"),
    ],
)
def test_bad_values_are_named(given: dict[str, object], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        Material(**given)  # type: ignore[arg-type]
