"""
Soft shadows of area lights
===========================

A light has an area in two ways: a punctual light with a `radius`, or a surface that emits. Shadow maps soften
the shadow of the first by its penumbra; the second lights the scene through surfels and virtual point lights.

**What to notice.** Shadows are sharp where the block stands and soften with the distance from it. All three
send the same intensity straight down; the surface sends less to the sides, as the cosine. Its shadow is coarse
and blotched at the foot: light of surfaces is blocked by an occupancy grid, whose cells are 1/122 of the
scene's longest side. Where the shadow of an area light matters, a punctual light with a radius is the better
choice.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import ssgi_cl as gi

SIDE, INTENSITY = 0.5, 6.0  # of the light: m, W/sr


def room(emission):
    """Return a floor with a block and, above it, a quad that emits downwards."""
    quad = trimesh.creation.box((SIDE, 0.01, SIDE)).apply_translation((0, 2.0, 0))
    block = trimesh.creation.box((0.3, 1.0, 0.3)).apply_translation((-0.2, 0.5, 0))
    parts = {"floor": trimesh.creation.box((4, 0.1, 4)).apply_translation((0, -0.05, 0)), "block": block}
    parts |= {"quad": quad} if emission else {}
    for name, part in parts.items():
        part.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=name))
    scene = gi.rasterize.load_scene(trimesh.Scene(parts))
    glow = {"quad": (emission,) * 3}
    materials = (replace(m, albedo=(0.6,) * 3, emission=glow.get(m.name, (0,) * 3)) for m in scene.materials)
    return replace(scene, materials=tuple(materials))


camera = gi.Camera.look_at((1.4, 2.4, 2.6), (-0.3, 0.3, 0), yfov=0.8, width=300, height=240)
point, ball = (gi.PointLight((0, 2.0, 0), INTENSITY, radius=radius) for radius in (0.0, SIDE / 2))
cases = {
    "point light": (room(0), [point]),
    "radius 0.25 m": (room(0), [ball]),
    "surface that emits": (room(INTENSITY / SIDE**2), []),
}

figure, panels = plt.subplots(2, 3, figsize=(11, 6.2), layout="constrained")
for column, (name, (scene, lights)) in zip(panels.T, cases.items(), strict=True):
    reference = gi.truth.radiance(scene, camera, lights, paths=64).mean
    for panel, light in zip(column, (gi.render(scene, camera, lights).radiance, reference), strict=True):
        panel.imshow(gi.tonemap(np.float32(light), exposure=1.2))
        panel.axis("off")
    column[0].set_title(f"{name}, render")
    column[1].set_title("64 paths a pixel")
