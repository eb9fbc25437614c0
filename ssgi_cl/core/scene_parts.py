"""Parts of a scene: surfaces that are seen through, the others, and those that block light."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Material, Scene

STOPS = 0.5
"""Share of light that a surface stops, from which on it blocks all light that meets it."""

FAINTEST = 1.0 / 512.0
"""Opacity below which nothing is drawn: half a step of a texture's alpha."""


@dataclass(frozen=True, eq=False)
class SceneParts:
    """Parts of a scene, which is each of them where nothing is seen through.

    Attributes:
        solid: what nothing is seen through; a triangle without area where there is no other.
        blended: surfaces that are seen through, or None.
        casting: what blocks, reflects and emits light on its way to what is seen: surfaces that
            are seen through as a whole where they stop at least `STOPS` of it, otherwise not.
    """

    solid: Scene
    blended: Scene | None
    casting: Scene


_KEPT: WeakKeyDictionary[Scene, SceneParts] = WeakKeyDictionary()


_WHOLE: WeakKeyDictionary[Scene, Scene] = WeakKeyDictionary()


def without_holes(scene: Scene) -> Scene:
    """Return the scene without surfaces all of which is cut out, such as glass of an opacity below one half
    where nothing is seen through; the same object for the same scene."""
    there = np.array([not material.is_hole for material in scene.materials])
    if there.all():
        return scene
    if scene not in _WHOLE:
        _WHOLE[scene] = _chosen(scene, there[scene.material_ids], scene.materials)
    return _WHOLE[scene]


def scene_parts(scene: Scene) -> SceneParts:
    """Return the parts of a scene; the same objects for the same scene."""
    if not scene.is_seen_through:
        scene = without_holes(scene)
        return SceneParts(scene, None, scene)
    if scene not in _KEPT:
        _KEPT[scene] = _parts(scene)
    return _KEPT[scene]


def _parts(scene: Scene) -> SceneParts:
    through = np.array([m.is_seen_through for m in scene.materials])[scene.material_ids]
    hole = np.array([m.is_hole and not m.is_seen_through for m in scene.materials])[scene.material_ids]
    casts = np.array([not m.is_seen_through or _casts(m) for m in scene.materials])
    solid = _chosen(scene, ~through & ~hole, scene.materials)
    drawn = (replace(m, alpha_cutoff=FAINTEST if m.blends and m.texture >= 0 else 0.0) for m in scene.materials)
    pairs = zip(scene.materials, drawn, strict=True)
    blended = _chosen(scene, through, tuple(made if m.is_seen_through else m for m, made in pairs))
    casting, chosen = solid, casts[scene.material_ids] & ~hole
    if (through & chosen).any():
        casting = _chosen(scene, chosen, tuple(_cast(m) if m.is_seen_through else m for m in scene.materials))
    return SceneParts(solid, blended, casting)


def _stopped(material: Material) -> float:
    """Return the share of light that is stopped by what is there of a surface."""
    return 1.0 - float(np.mean(material.transmitted))


def _casts(material: Material) -> bool:
    """Return whether a surface stops half of the light, at the most opaque of its texture."""
    return _stopped(material) * (material.alpha if material.blends else 1.0) >= STOPS


def _cast(material: Material) -> Material:
    """Return what a surface that is seen through is taken for where light meets it."""
    if not material.blends:
        return replace(material, transmission=(0.0, 0.0, 0.0))
    if material.texture >= 0:
        cutoff = min(STOPS / _stopped(material), 1.0)
        return replace(material, blends=False, transmission=(0.0, 0.0, 0.0), alpha_cutoff=cutoff)
    red, green, blue = (np.array(material.albedo) * material.alpha).tolist()
    return replace(material, blends=False, transmission=(0.0, 0.0, 0.0), alpha_cutoff=0.0, albedo=(red, green, blue))


def _chosen(scene: Scene, chosen: NDArray[np.bool_], materials: tuple[Material, ...]) -> Scene:
    """Return the scene of some triangles, with their vertices alone."""
    if not chosen.any():
        # A scene has a triangle; one without area is never seen. It is as large as the whole.
        corners = (scene.bounds - scene.origin).astype(np.float32)
        none = np.zeros_like(corners)
        ids, triangle = np.zeros(1, np.int32), np.array([[0, 1, 1]], np.int32)
        vertices: dict[str, Any] = {"positions": corners, "normals": none, "uvs": none[:, :2], "colors": none}
        return replace(
            scene, **vertices, triangles=triangle, material_ids=ids, materials=(Material(),), textures=(), wraps=()
        )
    used, numbers = np.unique(scene.triangles[chosen], return_inverse=True)
    vertices = {name: getattr(scene, name)[used] for name in ("positions", "normals", "uvs", "colors")}
    triangles, ids = numbers.reshape(-1, 3).astype(np.int32), scene.material_ids[chosen]
    return replace(scene, **vertices, triangles=triangles, material_ids=ids, materials=materials)
